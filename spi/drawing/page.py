"""The page that a figure is drawn for: a screen, or one or two columns of a paper."""

import contextlib
import difflib
import math
import re
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import matplotlib
import matplotlib.style
from matplotlib.cbook import is_math_text
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager
from matplotlib.textpath import text_to_path

#: Inches of a column, and of the two columns of a page, as in most journals (84 to 90 mm, 174 to 190 mm).
COLUMNS = {"one": 3.35, "two": 7.0}
NARROWEST, WIDEST = 2.5, 20.0  # inches
_UNITS = {"in": 1.0, "cm": 1 / 2.54, "mm": 1 / 25.4}

#: Short names of families that come with matplotlib, so that they look the same everywhere.
FAMILIES = {"serif": "STIXGeneral", "sans": "DejaVu Sans"}
_MATHS = {"STIXGeneral": "stix", "DejaVu Sans": "dejavusans", "DejaVu Serif": "dejavuserif", "cmr10": "cm"}

_SCREEN: dict[str, Any] = {
    "font.family": FAMILIES["sans"],
    "font.size": 9,
    "figure.titlesize": 11,
    "axes.titlesize": 9,
    "axes.labelsize": 10,
    "legend.fontsize": 8,
    "lines.linewidth": 1.1,
    "lines.markersize": 6,
    "agg.path.chunksize": 10_000,  # long paths are drawn in parts
    "pdf.fonttype": 42,  # TrueType: many journals refuse the other kind
    "svg.hashsalt": "spi",  # the same figure gives the same bytes
    "savefig.dpi": 200,
}

_PAPER: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.9,
    "lines.markersize": 4.5,
    "savefig.dpi": 300,
    **{f"{axis}tick.major.width": 0.6 for axis in "xy"},
    **{f"{axis}tick.minor.width": 0.5 for axis in "xy"},
}


class Page(NamedTuple):
    """The page that a figure is drawn for."""

    width: float | None = None  #: inches of every figure; None: as wide as its panels want to be
    family: str = FAMILIES["sans"]

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of matplotlib that make its look."""
        if self.width is None:
            return _SCREEN
        math_fonts = {"mathtext.fontset": _MATHS.get(self.family, "custom"), "mathtext.fallback": "stix"}
        styles = {"rm": "", "it": ":italic", "bf": ":bold"}
        math_fonts |= {f"mathtext.{style}": f"{self.family}{word}" for style, word in styles.items()}
        # Letters that the family lacks are taken from one that has them.
        return _SCREEN | _PAPER | math_fonts | {"font.family": [self.family, FAMILIES["sans"]]}

    def columns(self, wanted: int, least: float) -> int:
        """The number of panels side by side: `wanted`, or as many as are `least` inches wide in a column."""
        return wanted if self.width is None else min(wanted, max(1, int(self.width / least)))


SCREEN = Page()

_CURRENT: ContextVar[Page] = ContextVar("page", default=SCREEN)
_OF: WeakKeyDictionary[Figure, Page] = WeakKeyDictionary()


def current() -> Page:
    """The page of the figure that is being made."""
    return _CURRENT.get()


def of(fig: Figure) -> Page:
    """The page that a finished figure was drawn for."""
    return _OF.get(fig, SCREEN)


def remember(fig: Figure) -> None:
    """Remember the page of a figure, as it has to be saved with the same settings."""
    _OF[fig] = current()


def points(setting: str) -> float:
    """The size of letters by the name of a setting of matplotlib, such as "axes.titlesize"."""
    settings: Any = matplotlib.rcParams
    return float(FontProperties(size=settings[setting]).get_size_in_points())


def inches_of(text: str, font: FontProperties) -> float:
    """The width of a line of text in a font, in inches; its outline would take ten times as long to make."""
    width: float = text_to_path.get_text_width_height_descent(text, font, is_math_text(text))[0]
    return width / 72


@contextlib.contextmanager
def applied(page: Page = SCREEN) -> Iterator[None]:
    """Draw for `page`: its settings on matplotlib's own, whatever the user's are."""
    token = _CURRENT.set(page)
    try:
        with matplotlib.style.context(["default", page.settings]):
            yield
    finally:
        _CURRENT.reset(token)


def named(style: str = "screen", width: str | float | None = None, font: str | None = None) -> Page:
    """The page of a style, "screen" or "paper", of a paper with its width and font.

    ``width`` is "one" or "two" columns, inches, or a text such as "130mm"; ``font`` is "serif", "sans" or the name of
    an installed TrueType family.  Raises ValueError, with the reason, if they are none of these.
    """
    if style == "paper":
        return Page(inches("one" if width is None else width), family(font or "serif"))
    if style != "screen":
        raise ValueError(f"style: is {style!r}; must be screen or paper")
    if width is not None or font is not None:
        given = "font" if width is None else "width"
        raise ValueError(f"{given}: is for figures in the style paper only; ask for that style as well")
    return SCREEN


def inches(width: str | float) -> float:
    """A width in inches; ValueError if it is no length, or too small or too large."""
    match = re.fullmatch(r"([0-9]*\.?[0-9]+) *(in|cm|mm)", str(width).strip())
    if width in COLUMNS:
        value = COLUMNS[str(width)]
    elif match:
        value = float(match[1]) * _UNITS[match[2]]
    else:
        value = math.nan if isinstance(width, str) else float(width)
    if not NARROWEST <= value <= WIDEST:
        raise ValueError(
            f"width: is {width!r}; must be one or two (columns), or a length of {NARROWEST:g} to {WIDEST:g} inches, "
            "as in 5.125in or 130mm"
        )
    return value


def family(name: str) -> str:
    """The installed TrueType family of a name; ValueError names those that are spelt alike."""
    installed = {font.name for font in fontManager.ttflist if font.fname.lower().endswith(".ttf")}
    by_small = {spelling.lower(): spelling for spelling in installed} | FAMILIES
    if name.lower() in by_small:
        return by_small[name.lower()]
    near = [by_small[spelling] for spelling in difflib.get_close_matches(name.lower(), by_small, n=3, cutoff=0.5)]
    meant = f"did you mean {' or '.join(map(repr, dict.fromkeys(near)))}? " if near else ""
    raise ValueError(f"font: {name!r} is not an installed TrueType family; {meant}serif and sans are always available")
