"""Page that a figure is drawn for: a screen, or one or two columns of a paper."""

import contextlib
import difflib
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextvars import ContextVar
from types import MappingProxyType
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import matplotlib
import matplotlib.style
from matplotlib.cbook import is_math_text
from matplotlib.colors import is_color_like
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager
from matplotlib.textpath import text_to_path

from . import measures
from .measures import COLUMNS, Layout

NARROWEST, WIDEST = 2.5, 20.0  # inches of a figure
LOWEST, HIGHEST = 1.0, 40.0  # inches
SMALLEST, LARGEST = 4.0, 24.0  # points of letters
_UNITS = {"in": 1.0, "cm": 1 / 2.54, "mm": 1 / 25.4}

#: Short names of families that come with matplotlib, so that they look the same everywhere.
FAMILIES = {"serif": "STIXGeneral", "sans": "DejaVu Sans"}
_MATHS = {"STIXGeneral": "stix", "DejaVu Sans": "dejavusans", "DejaVu Serif": "dejavuserif", "cmr10": "cm"}

_SCREEN: dict[str, Any] = {
    "font.family": FAMILIES["sans"],
    "lines.linewidth": 1.1,
    "lines.markersize": 6,
    "agg.path.chunksize": 10_000,  # long paths are drawn in parts
    "pdf.fonttype": 42,  # TrueType: many journals refuse the other kind
    "svg.hashsalt": "spi",  # the same figure gives the same bytes
    "savefig.dpi": 200,
}

_PAPER: dict[str, Any] = {
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.9,
    "lines.markersize": 4.5,
    "savefig.dpi": 300,
    **{f"{axis}tick.major.width": 0.6 for axis in "xy"},
    **{f"{axis}tick.minor.width": 0.5 for axis in "xy"},
}


class Page(NamedTuple):
    """Page that a figure is drawn for."""

    layout: Layout = measures.SCREEN
    is_paper: bool = False  #: whether title and parameters are left to a caption
    family: str | None = None  #: of letters; None: that of a screen
    chosen: Mapping[str, Any] = MappingProxyType({})  #: what a person chose of panels, by name
    looked_up: set[str] | None = None  #: the names for which labels were looked up so far

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of matplotlib that make its look."""
        look = _SCREEN | _letters(self.layout) | (_PAPER if self.is_paper else {})
        if self.family is None:
            return look
        math_fonts = {"mathtext.fontset": _MATHS.get(self.family, "custom"), "mathtext.fallback": "stix"}
        styles = {"rm": "", "it": ":italic", "bf": ":bold"}
        math_fonts |= {f"mathtext.{style}": f"{self.family}{word}" for style, word in styles.items()}
        # Letters that the family lacks are taken from one that has them.
        return look | math_fonts | {"font.family": [self.family, FAMILIES["sans"]]}

    def label(self, name: str) -> str | None:
        """Label that a person chose for what has this name; None if there is none."""
        if self.looked_up is not None:
            self.looked_up.add(name)
        label: str | None = self.chosen.get("labels", {}).get(name)
        return label

    def check_labels(self, names: Iterable[str]) -> None:
        """Raise ValueError about the first of some names that nothing in the figure has, which is drawn by now."""
        if self.looked_up and (other := next((name for name in names if name not in self.looked_up), None)):
            raise ValueError(f"labels: has '{other}'; {meant(other, sorted(self.looked_up))}")

    def overlays_cases(self) -> bool:
        """Whether the lines of all cases stand in one panel."""
        over = self.chosen.get("overlay")
        if over not in (None, "cases"):
            raise ValueError(f"overlay: is '{over}', which is not the second of two swept words; must be cases")
        return over is not None

    def columns(self) -> int:
        """Number of panels side by side at most: of those that a figure of a given width has room for."""
        wanted, width = self.layout.columns, self.layout.width
        return wanted if width is None else min(wanted, max(1, int(width / self.layout.least)))


def _letters(layout: Layout) -> dict[str, Any]:
    """Sizes of letters by matplotlib's names."""
    return {
        "font.size": layout.text,
        "figure.titlesize": layout.title,
        "axes.titlesize": layout.panel_title,
        "axes.labelsize": layout.label,
        "legend.fontsize": layout.legend,
        "xtick.labelsize": layout.ticks,
        "ytick.labelsize": layout.ticks,
    }


SCREEN = Page()

_CURRENT: ContextVar[Page] = ContextVar("page", default=SCREEN)
_OF: WeakKeyDictionary[Figure, Page] = WeakKeyDictionary()


def current() -> Page:
    """Page of the figure that is being made."""
    return _CURRENT.get()


def of(fig: Figure) -> Page:
    """Page that a finished figure was drawn for."""
    return _OF.get(fig, SCREEN)


def remember(fig: Figure) -> None:
    """Remember the page of a figure, as it has to be saved with the same settings."""
    _OF[fig] = current()


def points(setting: str) -> float:
    """Size of letters by the name of a setting of matplotlib, such as "axes.titlesize"."""
    settings: Any = matplotlib.rcParams
    return float(FontProperties(size=settings[setting]).get_size_in_points())


def inches_of(text: str, font: FontProperties) -> float:
    """Width of a line of text in a font, in inches; its outline would take ten times as long to make."""
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


@contextlib.contextmanager
def without(name: str) -> Iterator[None]:
    """Draw without something that was chosen, which has been taken care of."""
    now = current()
    token = _CURRENT.set(now._replace(chosen={one: value for one, value in now.chosen.items() if one != name}))
    try:
        yield
    finally:
        _CURRENT.reset(token)


def named(
    style: str = "screen",
    width: str | float | None = None,
    height: str | float | None = None,
    font: str | None = None,
    font_size: str | float | None = None,
    **chosen: Any,
) -> Page:
    """Page of a style, "screen" or "paper", with its width and height, the font and size of its letters, and panels.

    ``width`` and ``height`` are inches or a text such as "130mm", ``width`` also "one" or "two" columns; ``font`` is
    "serif", "sans" or the name of an installed TrueType family, ``font_size`` points of its text, to which the letters
    of titles, labels, numbers and legends are in proportion.  What else is chosen is for panels, see
    :data:`spi.specs.figures.FIGURE_KEYS`.  Raises ValueError, with the reason, if they are none of these.
    """
    is_paper = style == "paper"
    layout = measures.PAPER if is_paper else measures.SCREEN
    if width is not None:
        layout = layout._replace(width=inches(width))
    if height is not None:
        layout = layout._replace(height=inches_high(height))
    if font_size is not None:
        layout = layout.with_letters(letters(font_size))
    font = font or ("serif" if is_paper else None)
    return Page(layout, is_paper, family(font) if font else None, chosen, set())


def meant(name: str, known: Collection[str]) -> str:
    """Advice about a name that is none of those known."""
    near = difflib.get_close_matches(name, known, 1)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"


def letters(size: str | float) -> float:
    """Points of text; ValueError if it is no number of points, or too small or too large."""
    try:
        points = float(size)
    except (ValueError, TypeError):
        points = math.nan
    if not SMALLEST <= points <= LARGEST:
        raise ValueError(f"is {size}; must be {SMALLEST:g} to {LARGEST:g} points")
    return points


def is_colour(text: str) -> bool:
    """Whether a text is a colour."""
    return is_color_like(text)


def inches(width: str | float) -> float:
    """A width in inches; ValueError if it is no length, or too small or too large."""
    value = COLUMNS[str(width)] if width in COLUMNS else _length(width)
    if not NARROWEST <= value <= WIDEST:
        raise ValueError(
            f"is {width!r}; must be one or two (columns), or a length of {NARROWEST:g} to {WIDEST:g} inches, "
            "as in 5.125in or 130mm"
        )
    return value


def inches_high(height: str | float) -> float:
    """A height in inches; ValueError if it is no length, or too small or too large."""
    value = _length(height)
    if not LOWEST <= value <= HIGHEST:
        raise ValueError(f"is {height!r}; must be a length of {LOWEST:g} to {HIGHEST:g} inches, as in 4.5in or 110mm")
    return value


def _length(given: str | float) -> float:
    """Inches of a number or of a text with its unit; NaN if it is no length."""
    if match := re.fullmatch(r"([0-9]*\.?[0-9]+) *(in|cm|mm)", str(given).strip()):
        return float(match[1]) * _UNITS[match[2]]
    return float(given) if isinstance(given, int | float) else math.nan


def family(name: str) -> str:
    """Installed TrueType family of a name; ValueError names those that are spelt alike."""
    installed = {font.name for font in fontManager.ttflist if font.fname.lower().endswith(".ttf")}
    by_small = {spelling.lower(): spelling for spelling in installed} | FAMILIES
    if name.lower() in by_small:
        return by_small[name.lower()]
    near = [by_small[spelling] for spelling in difflib.get_close_matches(name.lower(), by_small, n=3, cutoff=0.5)]
    meant = f"did you mean {' or '.join(map(repr, dict.fromkeys(near)))}? " if near else ""
    raise ValueError(f"{name!r} is not an installed TrueType family; {meant}serif and sans are always available")
