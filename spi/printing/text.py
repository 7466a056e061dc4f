"""Console, the look of tables, and numbers as text."""

import math
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from decimal import ROUND_CEILING, Decimal
from fractions import Fraction
from numbers import Integral, Real
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:  # rich takes a while
    from rich.console import Console
    from rich.table import Table

#: Angles, in rad, above which a table says what they cost in accuracy.
LARGE_ANGLE = 1e6

LABEL = 32  #: characters of a column of schemes

_WIDTH = 100  # of a table that goes into a file or a pipe


def new_console(file: IO[str] | None) -> "Console":
    """A console that writes to ``file``, or to standard output if that is None."""
    from rich.console import Console

    console = Console(file=file, highlight=False)
    return console if console.is_terminal else Console(file=file, highlight=False, width=_WIDTH)


def printable(text: object) -> str:
    """A text without what a terminal would take for a command; line breaks stay."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in str(text))


def new_table(title: str, headings: Iterable[str], left: int = 0, labels: int | None = None) -> "Table":
    """A table without rows, its first ``left`` columns left-justified; labels of schemes wrap in column ``labels``."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    style: dict[str, Any] = {"padding": (0, 1, 0, 0), "pad_edge": False, "show_edge": False}
    table = Table(title=Text(title) if title else None, title_justify="left", box=box.SIMPLE_HEAD, **style)
    for i, heading in enumerate(headings):
        table.add_column(Text(heading), justify="left" if i < left else "right", no_wrap=True)
    if labels is not None:
        table.columns[labels].no_wrap, table.columns[labels].max_width = False, LABEL
    return table


def print_whole(console: "Console", table: "Table") -> None:
    """Print a table at the width its numbers need: one cut short would be another number."""
    from rich.console import ConsoleDimensions

    size, needed = console.size, narrowed(console, table)
    # The height as well: rich takes a terminal that says it is dumb for 80 columns unless it is told both.
    console.size = ConsoleDimensions(max(size.width, needed), size.height)
    console.print(table)
    console.size = size


def print_lines(console: "Console", lines: Iterable[str], style: str | None = None) -> None:
    """Print lines: on a terminal broken between words, elsewhere as they are, however long."""
    for line in lines:
        text = wrapped(line, console.width) if console.is_terminal else line
        console.print(text, style=style, markup=False, soft_wrap=True)


def wrapped(text: str, width: int) -> str:
    """Lines of a text, broken between words; a command in backticks stays whole where a line has room for it."""
    whole = re.sub("`[^`]*`", lambda match: match[0].replace(" ", "\xa0"), text)
    fitted = (_filled(line, width) for line in whole.split("\n"))
    return "\n".join(fitted).replace("\xa0", " ")


def _filled(line: str, width: int) -> str:
    """A line in as many as it needs, the further ones indented."""
    indent = " " * (len(line) - len(line.lstrip(" ")) + 2)
    return textwrap.fill(
        line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False, expand_tabs=False
    )


def room(console: "Console") -> float:
    """Width of a terminal; a file or a pipe has room for everything."""
    return console.width if console.is_terminal else math.inf


def narrowed(console: "Console", table: "Table") -> int:
    """Break the columns that may wrap between words, the widest first, until a terminal has room for the table.

    None becomes narrower than its longest word.  Returns the width that the table needs then.
    """
    from rich.measure import Measurement, measure_renderables

    options = console.options.update(max_width=10_000)
    columns = [column for column in table.columns if not column.no_wrap]
    for column in columns:
        column.width = None  # it may have been narrowed before
    needed = Measurement.get(console, options, table).maximum
    words = [measure_renderables(console, options, [column.header, *column.cells]) for column in columns]
    widths = [min(most, column.max_width or most) for column, (_, most) in zip(columns, words, strict=True)]
    while needed > room(console) and (wide := [i for i, (least, _) in enumerate(words) if widths[i] > least]):
        widths[max(wide, key=widths.__getitem__)] -= 1
        needed -= 1
    for column, width in zip(columns, widths, strict=True):
        column.width = width
    return needed


#: Why a large kurtosis is a warning.
HEAVY = "heavy tails: few samples carry the variance, so that intervals may be too narrow"

_ROUNDED = 2.0**-51  # relative: an end of an interval is known to a unit in the last place of the value
_FIXED = 1e-3, 1e5  # numbers between these are written without a power of ten


def with_interval(value: float, half: float) -> str:
    """``0.4003 ± 0.0008``: the half width with one digit, or two after a leading 1, the value to the same place.

    The half width is rounded up, so that no interval is printed narrower than it is.  Numbers below 1e-3 or from 1e5 on
    have a power of ten, ``3.42e-7 ± 0.07e-7``.  Of a value with more than seven good digits seven, ``0.06612345 ±
    2e-13``.
    """
    if not math.isfinite(value):
        return str(value)
    if not (math.isfinite(half) and half > 1e-300):  # below, powers of ten are no longer exact or are 0
        return short(value, ".3e") if value else "0"
    scale = math.floor(math.log10(max(abs(value), half)))
    place = math.floor(math.log10(float(half)))
    leading = half < 1.95 * 10.0**place  # with a 1
    place -= int(leading)
    up = _rounded_up(half, place)
    if scale - place > 6:
        return f"{short(value, '.6e')} ± {short(float(up), '.1e' if leading else '.0e')}"
    if not _FIXED[0] <= 10.0**scale < _FIXED[1]:
        digits = max(scale - place, 0)
        shown = f"{value / 10.0**scale:z.{digits}f}e{scale}"
        return f"{shown if float(shown) else '0'} ± {up.scaleb(-scale):.{digits}f}e{scale}"
    digits = max(-place, 0)
    return f"{round(value, -place):z.{digits}f} ± {up:.{digits}f}"


def _rounded_up(x: float, place: int) -> Decimal:
    """Smallest multiple of 10^place that is no less than x, but for the rounding of x in its ninth digit."""
    return Decimal(f"{x:.8e}").quantize(Decimal(1).scaleb(place), ROUND_CEILING)


def power_of_two(h: float) -> str:
    """``2^-5`` for 0.03125, and other numbers as they are."""
    mantissa, exponent = math.frexp(h)
    return f"2^{exponent - 1}" if mantissa == 0.5 else f"{h:g}"


def duration(seconds: float) -> str:
    """``12.3 µs``: a time with three digits in the unit that suits it."""
    if not (math.isfinite(seconds) and seconds > 0):
        return f"{seconds:g}"
    if seconds >= 1e9:
        return f"{seconds:.3g} s"
    power = math.floor(math.log10(float(f"{seconds:.2e}")) / 3 + 1e-9)
    power = min(max(power, -4), 0)
    scaled = seconds / 1000.0**power
    digits = 2 if scaled < 9.995 else 1 if scaled < 99.95 else 0
    return f"{scaled:.{digits}f} {('s', 'ms', 'µs', 'ns', 'ps')[-power]}"


def human_time(seconds: float) -> str:
    """``45 s``, ``12 min``, ``3.5 h``: a time that somebody waits, with two digits."""
    for unit, length, most in (("s", 1, 100), ("min", 60, 100), ("h", 3600, 48)):
        if seconds < most * length:
            return f"{float(f'{seconds / length:.2g}'):g} {unit}"
    return f"{seconds / 86400:.2g} days"


def readable(text: str, variables: tuple[str, ...] = ()) -> str:
    """Text of an expression in which 6.283185307179586 is 2*pi again, and components have the system's names."""
    text = re.sub(r"[0-9.]+", _multiple_of_pi, text)
    names = {f"y{k}": name for k, name in enumerate(variables, 1)}
    return re.sub(r"\by\d+\b", lambda match: names.get(match.group(), match.group()), text)


def _multiple_of_pi(match: re.Match[str]) -> str:
    text = match.group()
    times = float(text) / math.pi if re.fullmatch(r"\d+\.\d+", text) else 0.0
    return text if not times or times % 1 else "pi" if times == 1 else f"{times:g}*pi"


def fraction(x: float) -> str:
    """``1/2`` for 0.5, and numbers that are no simple fraction as they are; "not known" for NaN."""
    if math.isnan(x):
        return "not known"
    nearest = Fraction(x).limit_denominator(12)
    return str(nearest) if abs(nearest - x) < 1e-12 else f"{x:g}"


def decimal(x: float) -> str:
    """``12.3``; from a million on ``1.2e6``, since a ratio to an error that is nearly 0 may have hundreds of digits."""
    return f"{x:.1f}" if abs(x) < 1e6 else short(x)


def short(x: float | None, form: str = ".1e") -> str:
    """A number with as many digits as `form` has, from 1e-3 to 1e5 without a power of ten; nothing for None."""
    if x is None:
        return ""
    text = f"{x:{form}}"
    digits, e, exponent = text.partition("e")
    if not (e and exponent):
        return text
    if x == 0.0:
        return "0"
    if _FIXED[0] <= abs(float(text)) < _FIXED[1]:
        return f"{float(text):.{max(len(digits.lstrip('-').replace('.', '')) - 1 - int(exponent), 0)}f}"
    return f"{digits}e{int(exponent)}"


def interval_text(
    value: Any,
    ends: tuple[Any, Any] | None = None,
    form: str | Callable[[Any], str] = ".1e",
    by_ends: bool = False,
) -> str:
    """A number with the ends of its 95 % interval, ``0.050 ± 0.003``; as ``0.504 [0.489, 0.520]`` if not symmetric.

    `form` is that of numbers without interval, and of ends; "-" is no number, and ± ? an interval that is not known.
    """
    if not isinstance(value, Real) or isinstance(value, Integral):
        return str(value)
    if math.isnan(value):
        return "-"
    if ends is None:
        return form(value) if callable(form) else short(float(value), form)
    low, high = (float(end) for end in ends)
    down, up = float(value) - low, high - float(value)
    if not math.isfinite(down + up):
        return short(float(value), ".3e") + (" ± ?" if math.isfinite(value) else "")
    uneven = abs(up - down) > max(1e-6 * (up + down), _ROUNDED * abs(float(value)))  # by more than rounding
    if by_ends or uneven:
        return (
            f"{interval_text(value, None, form)} [{interval_text(low, None, form)}, {interval_text(high, None, form)}]"
        )
    return with_interval(float(value), (up + down) / 2)


def order_text(order: float, low: float, high: float, expected: float | None = None) -> str:
    """A fitted order with its interval, and the one by theory."""
    fitted = f"order {interval_text(order, (low, high), '.3f', True) if math.isfinite(order) else 'not resolved'}"
    if expected is None or math.isnan(expected):
        return f"{fitted} (measured; theory states none)"
    # where a term of higher order is still the larger one
    later = ", perhaps at smaller steps" if low > expected else ""
    return f"{fitted} (expected {fraction(expected)}{later})"


def angle_note(largest: float) -> str:
    """A remark on rotations by large angles, or an empty text.

    The product that gives an angle is rounded, so that an angle of 10^6 rad is known to about 10^-10 rad.
    """
    if not largest > LARGE_ANGLE:
        return ""
    return f"angles up to {largest:.1e} rad, which double precision knows to about {largest * 2.0**-52:.0e} rad"


def joined(parts: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))
