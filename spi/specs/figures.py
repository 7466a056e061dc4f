"""What a person can choose of a figure: the keys of ``figure``, the options of `spi plot`, the words of ``plot``.

This is their only declaration.  A value is a text as on a command line, or what YAML or Python have for it.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple


class FigureKey(NamedTuple):
    """One thing that can be chosen."""

    text: str  #: what it is
    read: Callable[[Any], Any]  #: a value as drawing takes it; ValueError "is ...; must be ..." if it is none
    can_be_off: bool = False  #: whether false leaves it out, and there is an option `--no-...`


def _wrong(value: Any, right: str) -> ValueError:
    words = {"None": "empty", "True": "true", "False": "false"}
    shown = f"'{value}'" if isinstance(value, str) else words.get(str(value), str(value))
    return ValueError(f"is {shown}; must be {right}")


def _one_of(*words: str) -> Callable[[Any], str]:
    def read(value: Any) -> str:
        if value not in words:
            raise _wrong(value, f"{', '.join(words[:-1])} or {words[-1]}")
        return str(value)

    return read


def _entries(value: Any, right: str) -> list[str]:
    """Words of a list, or of a text that commas divide."""
    given = value.split(",") if isinstance(value, str) else value
    if not isinstance(given, Sequence) or not given or not all(isinstance(one, str) and one.strip() for one in given):
        raise _wrong(value, right)
    return [one.strip() for one in given]


def _word(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise _wrong(value, "a word")
    return value.strip()


def _panels(value: Any) -> tuple[str, ...]:
    words = _entries(value, "words divided by commas, such as mean,variance")
    if twice := next((word for word in words if words.count(word) > 1), None):
        raise ValueError(f"has '{twice}' twice; remove one")
    return tuple(words)


def _named(value: Any, right: str) -> dict[str, str]:
    """Texts by name, of a mapping or of a text such as "a=b,c=d"."""
    named = value
    if isinstance(value, str):
        pairs = [one.partition("=") for one in _entries(value, right)]
        named = {name.strip(): text.strip() for name, _, text in pairs}
    if not isinstance(named, Mapping) or not named or not all(isinstance(one, str) and one for one in named.values()):
        raise _wrong(value, right)
    return {str(name): text for name, text in named.items()}


def _crossing(value: Any) -> str | dict[str, str]:
    """A quantity, or that with the lines of which it is."""
    right = "a quantity, or of: a quantity and between: cases or a swept word"
    if isinstance(value, str) and "=" not in value:
        return _word(value)
    named = _named(value, right)
    if named.keys() != {"of", "between"}:
        raise _wrong(value, right)
    return named


def _labels(value: Any) -> dict[str, str]:
    return _named(value, "labels by name, such as binder=Binder cumulant")


def _colors(value: Any) -> tuple[str, ...] | dict[str, str]:
    """Colours in order, or by name."""
    from ..drawing import page

    right = "colours such as red,#0072B2, or by name, such as splitting=red"
    named = isinstance(value, Mapping) or (isinstance(value, str) and "=" in value)
    chosen = _named(value, right) if named else _entries(value, right)
    for colour in chosen.values() if isinstance(chosen, dict) else chosen:
        if not page.is_colour(colour):
            raise ValueError(f"has '{colour}'; must be {right}")
    return chosen if isinstance(chosen, dict) else tuple(chosen)


def _number(value: Any) -> float:
    from ..expressions.arithmetic import parse

    number = parse(value) if isinstance(value, str) else value
    if isinstance(number, bool | complex):
        raise ValueError("no number")
    return float(number)


def _limits(value: Any) -> tuple[float, float]:
    """Both ends of an axis."""
    ends = value.split("..") if isinstance(value, str) else value
    right = "two ends, the smaller one first, such as 0..2 or 2^-8..1"
    try:
        low, high = map(_number, ends)
    except (ValueError, TypeError):
        raise _wrong(value, right) from None
    if not -1e300 < low < high < 1e300:
        raise _wrong(value, right)
    return low, high


def _title(value: Any) -> str | bool:
    if value is False:
        return False
    if not isinstance(value, str) or not value.strip():
        raise _wrong(value, "text, or false for none")
    return value


def _size(value: Any) -> tuple[float, float]:
    """Width and height in inches."""
    from ..drawing import page

    given = value
    if isinstance(value, str):
        found = re.fullmatch(r"([0-9.]+) *(in|cm|mm)? *x *([0-9.]+) *(in|cm|mm)", value.strip())
        given = (f"{found[1]}{found[2] or found[4]}", f"{found[3]}{found[4]}") if found else ()
    try:
        width, height = given
    except (ValueError, TypeError):
        raise _wrong(value, "a width and a height, such as 8.6x6cm") from None
    try:
        return page.inches(width), page.inches_high(height)
    except ValueError:
        ends = f"{page.NARROWEST:g} to {page.WIDEST:g} inches wide and {page.LOWEST:g} to {page.HIGHEST:g} inches high"
        raise _wrong(value, f"{ends}, such as 8.6x6cm") from None


def _width(value: Any) -> float:
    from ..drawing import page

    return page.inches(value)


def _height(value: Any) -> float:
    from ..drawing import page

    return page.inches_high(value)


def _font(value: Any) -> str:
    from ..drawing import page

    return page.family(_word(value))


def _font_size(value: Any) -> float:
    from ..drawing import page

    return page.letters(value)


FIGURE_KEYS: Mapping[str, FigureKey] = {
    "panels": FigureKey("Panels, such as mean,variance; of a sweep its quantities.", _panels),
    "overlay": FigureKey("Lines in one panel: of all cases (cases), or of each value of a swept word.", _word),
    "crossing": FigureKey(
        "Quantity over a swept word, whose lines' crossing is marked; of=..,between=.. names the lines.", _crossing
    ),
    "title": FigureKey("Another title; without one the parameters are left out, too.", _title, can_be_off=True),
    "labels": FigureKey("Labels, such as binder=Binder cumulant,T=temperature.", _labels),
    "log": FigureKey("Axes that become logarithmic: x, y, xy, or none of them.", _one_of("x", "y", "xy", "none")),
    "xlim": FigureKey("Ends of the horizontal axes, such as 0..2.", _limits),
    "ylim": FigureKey("Ends of the vertical axes.", _limits),
    "legend": FigureKey("Place of the legend: below, inside or none.", _one_of("below", "inside", "none")),
    "colors": FigureKey("Colours of the lines in order, or by name, such as splitting=red.", _colors),
    "style": FigureKey(
        "screen, or paper: without a title, for a column; <out>/<name>_paper.pdf.", _one_of("screen", "paper")
    ),
    "size": FigureKey("Width and height, such as 8.6x6cm.", _size),
    "width": FigureKey("Width: one or two (columns of a paper), or e.g. 5.125in, 130mm.", _width),
    "height": FigureKey("Height, e.g. 4.5in, 110mm.", _height),
    "font": FigureKey("Font: serif, sans or an installed TrueType family.", _font),
    "font_size": FigureKey("Points of text (default: 9, in a paper 8); other letters in proportion.", _font_size),
}


def read_figure(given: Mapping[str, Any]) -> dict[str, Any]:
    """What was chosen, as drawing takes it; ValueError "name: is ...; must be ..." about the first mistake."""
    read = {}
    for name, value in given.items():
        if name not in FIGURE_KEYS:
            raise ValueError(f"{name}: is not a known word; known: {', '.join(FIGURE_KEYS)}")
        try:
            read[name] = FIGURE_KEYS[name].read(value)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None
    if isinstance(crossing := read.get("crossing"), dict):
        read["crossing"], between = crossing["of"], crossing["between"]
        if read.setdefault("overlay", between) != between:
            raise ValueError(f"overlay: is {read['overlay']}, but crossing is between {between}; leave out one of them")
    if size := read.pop("size", None):
        if beside := next((name for name in ("width", "height") if name in read), None):
            raise ValueError(f"size: is given beside {beside}; leave out one of them")
        read |= dict(zip(("width", "height"), size, strict=True))
    return read
