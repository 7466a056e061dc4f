"""One panel of a figure: lines with their 95 % intervals, references, limits, marks at the edges, and its legend."""

import math
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from matplotlib import ticker
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.path import Path
from matplotlib.text import Text

from spi.numerics.types import Array

from . import measures, page, style

LegendEntry = tuple[Artist, str]  #: of a legend: a handle and a text
Draw = Callable[[Axes], list[LegendEntry]]  #: draws on an axes and returns entries of the legend

HUGE = 1e100  #: a value beyond that would make axes that cannot be drawn
GREY, PALE = "#777777", 0.55  #: colour of what is no scheme, and opacity of points that are not resolved
THEORY: dict[str, Any] = {"color": "black", "linewidth": 1.1, "linestyle": (0, (4, 3)), "zorder": 4}

SLOPE = "slope "  #: with which the names of reference lines begin

_MARKS = 12  # along a dense line
_DENSE = 24  # points from which on a line is dense
_FAR = 1e3  # an interval that is so many times wider than all resolved values does not widen the axis
_NEAR = 30.0  # an interval that ends so many times above them is shown whole
_OUT = 100.0  # heights of a panel by which lines may leave it
_SHORT = 30.0  # ratio of the ends of a logarithmic axis on which powers of ten are too few ticks
_TINY = 1e-3  # values below are written as powers of ten, which are longer
_LINEAR = 20.0  # ratio of the values of a parameter up to which their axis is linear
_SLOPES = ((0, (5, 2)), (0, (1, 1.5)), "-.", (0, (6, 1.5, 1, 1.5, 1, 1.5)))
_ARROW = Path([(0, 0), (0, -1), (-0.14, -0.72), (0, -1), (0.14, -0.72)], [1, 2, 1, 2, 2])
_BELOW = Path([(-0.5, 0.4), (0, -0.4), (0.5, 0.4)])  # as a caret, in the middle of a line of text
_ARROW_SIZE = 26.0  # points, twice the length of the arrow


class Series(NamedTuple):
    """A line of a panel: N values of one scheme along the horizontal axis, with their 95 % intervals."""

    x: Array
    y: Array
    look: dict[str, Any]  #: of matplotlib's Line2D: marker, color, linestyle (none for points alone), ...
    label: str = ""  #: in the legend, the same in all panels of a figure
    low: Array | None = None  #: ends of the intervals
    high: Array | None = None
    poor: Array | None = None  #: bool, whether a value is not resolved by sampling
    band: bool = False  #: whether the intervals are a band instead of bars
    note: str = ""  #: a number that belongs to the line in this panel, such as a fitted order

    def within(self, low: float, high: float) -> "Series":
        """Series from the last place below `low` to the first one above `high`, all of it if there is nothing."""
        inside = np.flatnonzero((self.x >= low) & (self.x <= high))
        if not inside.size:
            return self
        part = slice(max(inside[0] - 1, 0), inside[-1] + 2)
        arrays = {name: getattr(self, name) for name in ("x", "y", "low", "high", "poor")}
        return self._replace(**{name: array[part] for name, array in arrays.items() if array is not None})


def series(x: Any, y: Any, look: dict[str, Any], label: str = "", half: Any = None, **more: Any) -> Series:
    """A series with intervals of half the width `half`, in the order of x."""
    ends = {} if half is None else {"low": y - half, "high": y + half}
    order = np.argsort(x, kind="stable")
    arrays = {"x": x, "y": y, "low": None, "high": None, "poor": None} | ends | more
    arrays |= {
        name: np.asarray(arrays[name])[order] for name in ("x", "y", "low", "high", "poor") if arrays[name] is not None
    }
    return Series(look=look, label=label, **arrays)


class End(NamedTuple):
    """Right end of a line, where its name or a number may stand."""

    height: float  #: in data coordinates
    label: str
    note: str
    colour: str


class Plot(NamedTuple):
    """One panel: its lines and axes; `own` draws more, or all, and returns entries of the legend."""

    series: Sequence[Series] = ()
    title: str = ""
    x: str = ""
    y: str = ""
    xscale: str = "linear"  #: "steps" for powers of two, or a scale of matplotlib
    log: bool = False  #: whether the vertical axis is logarithmic
    xlim: tuple[float, float] | None = None
    ylim: tuple[float, float] | None = None  #: those of the values if None
    across: Sequence[tuple[float, str]] = ()  #: values of theory as horizontal lines, and their names
    slopes: Sequence[float] = ()  #: orders of reference lines
    zero: bool = False  #: whether a line marks 0
    top: float = HUGE  #: values beyond do not widen the axis
    own: Draw | None = None
    entries: Sequence[LegendEntry] = ()  #: further ones of the legend
    aspect: float = measures.SCREEN.shape  #: height over width, with labels
    projection: str | None = None
    shared: bool = False  #: whether its vertical axis is that of the panel to the left

    def as_chosen(self) -> "Plot":
        """Panel with the axes that a person chose, if it has lines; a reference slope is none on linear axes."""
        chosen, plot = page.current().chosen, self
        if not self.series:
            return self
        if log := chosen.get("log", ""):
            plot = self._scaled(log)
        for name, is_log in (("xlim", plot.xscale != "linear"), ("ylim", plot.log)):
            if is_log and chosen.get(name, (1.0,))[0] <= 0:
                low = f"begins at {chosen[name][0]:g} on a logarithmic axis"
                raise ValueError(f"{name}: {low}; must begin above 0, or choose log: none")
        if "xlim" in chosen:
            low, high = chosen["xlim"]
            plot = plot._replace(xlim=(low, high), series=tuple(line.within(low, high) for line in plot.series))
        return plot._replace(ylim=chosen["ylim"]) if "ylim" in chosen else plot

    def _scaled(self, log: str) -> "Plot":
        """Panel with logarithmic axes ``x``, ``y``, both or none, where they have positive numbers."""
        if log == "none":
            return self._replace(log=False, xscale="linear", slopes=(), ylim=None if self.log else self.ylim)
        plot = self
        x, y = (np.concatenate([getattr(line, axis) for line in self.series]) for axis in "xy")
        if "x" in log and self.xscale == "linear" and (x > 0).any():
            plot = plot._replace(xscale="log", xlim=None)
        if "y" in log and not self.log and (y[np.isfinite(y)] > 0).any():
            plot = plot._replace(log=True, ylim=None, zero=False)
        return plot

    def draw(self, ax: Axes) -> tuple[list[LegendEntry], list[End]]:
        """Draw on an axes; returns the entries of its legend and the ends of its lines."""
        entries: list[LegendEntry] = []
        if self.series or self.across:
            self._scale(ax)
            for line in self.series:
                entries += _draw(ax, line, self.log)
            entries += self._references(ax) + self._marks(ax)
        x = _scaled(ax.xaxis, ax.get_xlim(), self.x, most=7) if self.series and self.xscale == "linear" else self.x
        y = self.y if self.log or not self.series else _scaled(ax.yaxis, ax.get_ylim(), self.y)
        ax.set(**{name: text for name, text in (("xlabel", x), ("ylabel", y)) if text})
        entries += self.entries
        if self.own:
            entries += self.own(ax)
        return entries, [end for line in self.series for end in _ends(ax, line)]

    def _scale(self, ax: Axes) -> None:
        grid(ax)
        x = np.concatenate([line.x for line in self.series] or [np.zeros(0)])
        if self.xscale == "steps":
            step_axis(ax, x)
        elif self.xscale != "linear":
            ax.set_xscale(self.xscale)
            _plain_ticks(ax, x, self.xlim)
        if self.log:
            ax.set_yscale("log", nonpositive="clip")
        if self.xlim:
            ax.set_xlim(self.xlim)
        elif self.xscale == "log" and (x > 0).any():
            ax.set_xlim(x[x > 0].min() / 1.5, x.max() * 1.5)
        bounds = self.ylim or (log_limits(self.series, self.top) if self.log else self._linear())
        if bounds:
            ax.set_ylim(bounds)

    def _linear(self) -> tuple[float, float] | None:
        """Limits of all values with their intervals, and of the references."""
        values = [np.array([value for value, _ in self.across]), np.zeros(int(self.zero))]
        for line in self.series:
            good = np.isfinite(line.y) & (np.abs(line.y) < self.top)
            ends = [end for end in (line.low, line.high) if end is not None]
            values += [line.y[good], *(end[good] for end in ends)]
        shown = np.concatenate(values)
        return room_around(shown[np.isfinite(shown) & (np.abs(shown) < HUGE)])

    def _references(self, ax: Axes) -> list[LegendEntry]:
        if self.zero:
            ax.axhline(0, color="#aaaaaa", linewidth=0.8, zorder=1)
        for value, _ in self.across:
            ax.axhline(value, **THEORY)
        entries: list[LegendEntry] = [(Line2D([], [], **THEORY), name) for _, name in self.across if name]
        points = [(line.x, line.y, _good(line)) for line in self.series if line.label]
        shown = [np.column_stack([x, y])[(y > 0) & (y < ax.get_ylim()[1]) & good] for x, y, good in points]
        cloud = np.concatenate(shown or [np.zeros((0, 2))])
        for i, order in enumerate(self.slopes if len(cloud) else ()):
            above = i < len(self.slopes) - 1
            ratio, ends = cloud[:, 1] / cloud[:, 0] ** order, np.array(ax.get_xlim())
            factor = ratio.max() * 1.7 if above else ratio.min() / 1.7
            look: dict[str, Any] = {"linestyle": _SLOPES[i % len(_SLOPES)], "color": GREY, "linewidth": 1.0}
            text = f"{SLOPE}{Fraction(order).limit_denominator(100)}"
            entries += [(line, text) for line in ax.plot(ends, factor * ends**order, zorder=1, label=text, **look)]
        return entries

    def _marks(self, ax: Axes) -> list[LegendEntry]:
        """Entries for points that are no ordinary ones."""
        bottom, top = ax.get_ylim()
        entries = []
        if any((~_good(line) & (line.y <= top) & (line.y > 0 if self.log else True)).any() for line in self.series):
            entries.append(mark("o", "pale: not resolved", alpha=PALE, markerfacecolor="none"))
        if any(np.isinf(line.y).any() for line in self.series):
            entries.append(mark("^", "paths diverged, or beyond the axis"))
        elif any((line.y > top).any() for line in self.series):
            entries.append(mark("^", "beyond the axis"))
        if any((line.y < bottom).any() for line in self.series):
            entries.append(
                mark(_BELOW, "0, or below the axis" if self.log else "below the axis", markerfacecolor="none")
            )
        return entries


def _good(line: Series) -> Array:
    return np.ones(len(line.y), bool) if line.poor is None else ~line.poor


def _look_of(line: Series) -> dict[str, Any]:
    """What a line looks like: its markers are open, and few on one of many points."""
    look: dict[str, Any] = {"linewidth": 1.0, "zorder": 3} | line.look
    if look.get("marker"):
        if len(line.x) > _DENSE and look.get("linestyle") != "none":
            look |= {"markevery": max(1, len(line.x) // _MARKS), "markersize": 4.0}
        look |= {"markerfacecolor": "none", "markeredgewidth": 1.1}
    return look


def _draw(ax: Axes, line: Series, log: bool) -> list[LegendEntry]:
    """Draw a series within the limits of a panel; returns its entry of the legend."""
    bottom, top = ax.get_ylim()
    look = _look_of(line)
    colour, marker = str(look["color"]), look.get("marker") or ""
    good, inside, entries = _good(line), (line.y >= bottom) & (line.y <= top), []
    ax.plot(line.x, np.where(good, _drawable(line.y, bottom, top, log), np.nan), label=line.label or None, **look)
    if not log and (last := _lost(line, inside)) is not None:
        ax.plot(line.x[last], line.y[last], marker="X", color=colour, zorder=4)
        entries = [mark("X", "diverged, or not defined from there on")]
    if (pale := inside & ~good).any():
        ax.plot(line.x[pale], line.y[pale], **look | {"marker": marker or ".", "alpha": PALE, "linestyle": "none"})
    if line.low is not None and line.high is not None:
        (_band if line.band else _bars)(ax, line, log, colour)
    if not line.band or not np.isfinite(line.y).all():
        edge_marks(ax, line.x, line.y, colour)
    handle = Line2D([], [], **{name: value for name, value in look.items() if name not in ("markevery", "zorder")})
    return [*([(handle, line.label)] if line.label else []), *entries]


def _drawable(y: Array, bottom: float, top: float, log: bool) -> Array:
    """Values that a line can go through, also those out of the panel, at a distance that can be drawn."""
    if log:
        far = (top / bottom) ** 3
        return np.where(np.isfinite(y) & (y > 0), np.clip(y, bottom / far, top * far), np.nan)
    far, half = _OUT * (top - bottom), (top - bottom) / 2
    near = (y >= bottom - half) & (y <= top + half)
    beside = np.convolve(near, [1, 0, 1])[1:-1] > 0  # on its way out of the panel, or in
    return np.where(np.isfinite(y) & (near | beside), np.clip(y, bottom - far, top + far), np.nan)


def _lost(line: Series, inside: Array) -> int | None:
    """Place from which on a dense line is not finite; None if it ends, or leaves the panel before."""
    finite = np.flatnonzero(np.isfinite(line.y))
    last = int(finite[-1]) if len(finite) else len(line.y) - 1
    return last if len(line.x) > _DENSE and last < len(line.y) - 1 and inside[last] else None


def _band(ax: Axes, line: Series, log: bool, colour: str) -> None:
    low, high = np.asarray(line.low), np.asarray(line.high)
    there = np.isfinite(low) & np.isfinite(high) & (np.abs(high) < HUGE)
    low = np.maximum(low, ax.get_ylim()[0]) if log else low
    ax.fill_between(line.x, low, high, where=there.tolist(), color=colour, alpha=0.22, linewidth=0, zorder=1.5)


def _bars(ax: Axes, line: Series, log: bool, colour: str) -> None:
    """Bars; on a logarithmic axis an arrow of fixed length where an interval reaches 0 or leaves the panel below."""
    bottom, top = ax.get_ylim()
    low, high, good = np.asarray(line.low), np.asarray(line.high), _good(line)
    bar = np.isfinite(low) & np.isfinite(high) & (high > low) & (high > bottom) & (line.y <= top)
    open_end = bar & (low < bottom) & log
    below = line.y < bottom  # then only the upper end of the interval is seen
    begin = np.where(open_end, np.where(below, high, line.y), np.maximum(low, bottom))
    for chosen, alpha in ((bar & good, 1.0), (bar & ~good, PALE)):
        ax.vlines(line.x[chosen], begin[chosen], np.minimum(high, top)[chosen], colour, linewidth=0.8, alpha=alpha)
    if open_end.any():
        arrow: dict[str, Any] = {"marker": _ARROW, "markersize": _ARROW_SIZE, "markerfacecolor": "none"}
        ax.plot(line.x[open_end], begin[open_end], color=colour, linestyle="none", zorder=2.5, **arrow)


def _ends(ax: Axes, line: Series) -> Iterator[End]:
    bottom, top = ax.get_ylim()
    within = (line.y >= bottom) & (line.y <= top)
    inside = np.flatnonzero(within & _good(line) if (within & _good(line)).any() else within)
    if line.label and inside.size:
        yield End(float(line.y[inside[-1]]), line.label, line.note, str(line.look["color"]))


def edge_marks(ax: Axes, x: Array, y: Array, colour: str) -> None:
    """Mark values above the panel, or infinite, at its upper edge, and values below it, hollow, at its lower edge."""
    bottom, top = ax.get_ylim()
    look: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 4}
    look |= {"color": colour, "linestyle": "none"}
    left, right = ax.get_xlim()
    within = (x >= left) & (x <= right)
    above, below = within & (y > top), within & (y < bottom)
    if len(y) > _DENSE:  # only where a line leaves the panel first
        above, below = (np.arange(len(y)) == np.argmax(side) if side.any() else side for side in (above, below))
    if above.any():
        ax.plot(x[above], np.ones(above.sum()), marker=CARETUP, **look)
    if below.any():
        ax.plot(x[below], np.zeros(below.sum()), marker=CARETDOWN, markerfacecolor="none", **look)


def mark(marker: Any, text: str, **look: Any) -> LegendEntry:
    """An entry of a legend: a black mark and its meaning."""
    return Line2D([], [], **{"marker": marker, "linestyle": "none", "color": "black"} | look), text


# ---------------------------------------------------------------------------------------------------------------------
# Limits, scales and ticks.
# ---------------------------------------------------------------------------------------------------------------------


def log_limits(lines: Sequence[Series], top: float = HUGE) -> tuple[float, float] | None:
    """Limits of a logarithmic axis: all values that are resolved, and the others with their intervals.

    Of an interval that is far longer than these values it is a part.
    """
    resolved, floors, ends = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
    for line in lines:
        good, drawable = _good(line), (line.y > 0) & (line.y < top)
        resolved.append(line.y[good & drawable])
        half = line.y if line.high is None else 0.25 * (line.high - line.y)
        floor, end = (np.fmax(line.y, other)[~good] for other in (half, line.y if line.high is None else line.high))
        floors.append(floor[(floor > 0) & (floor < top)])
        ends.append(end[(end > 0) & (end < top)])
    values, *others = map(np.concatenate, (resolved, floors, ends))
    bounds = (_FAR, _NEAR) if len(values) else (math.inf, math.inf)
    most = values.max(initial=1e-300)
    shown = np.concatenate([values, *(some[some <= far * most] for some, far in zip(others, bounds, strict=True))])
    return limits(shown) if len(shown) else None


def limits(values: Array) -> tuple[float, float]:
    """Limits of a logarithmic axis: positive values with some room, and at least two whole decades' labels."""
    low, high = np.log10(values.min() / 2), np.log10(values.max() * 2)
    while math.floor(high) - math.ceil(low) < 1:
        low, high = low - 0.05, high + 0.05
    return 10**low, 10**high


def room_around(values: Array) -> tuple[float, float] | None:
    """Limits of a linear axis: finite values with some room; None without any."""
    if not values.size:
        return None
    room = 0.06 * np.ptp(values) or 0.05 * abs(values[0]) or 1.0
    return float(values.min() - room), float(values.max() + room)


def grid(ax: Axes) -> None:
    """A pale grid behind the data."""
    ax.grid(True, which="major", color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)


def step_axis(ax: Axes, h: Array) -> None:
    """A logarithmic horizontal axis for step sizes, with ticks at powers of two."""
    ax.set_xscale("log", base=2)
    if not h.size:
        return
    ax.set_xlim(h.min() / 1.5, h.max() * 1.5)
    exponents = np.arange(round(math.log2(h.min())), round(math.log2(h.max())) + 1)
    every = 1 if len(exponents) <= 5 else 2 if len(exponents) <= 13 else 4
    powers = (2.0**exponents).tolist()
    ax.xaxis.set_major_locator(ticker.FixedLocator(powers[::-1][::every]))
    ax.xaxis.set_minor_locator(ticker.FixedLocator(powers) if every > 1 else ticker.NullLocator())
    ax.xaxis.set_major_formatter(ticker.FuncFormatter(lambda x, _: f"${style.number(x, steps=True)}$"))
    ax.xaxis.set_minor_formatter(ticker.NullFormatter())


def _plain_ticks(ax: Axes, x: Array, xlim: tuple[float, float] | None) -> None:
    """Ticks of a logarithmic axis at 1, 2 and 5, or 1 and 3, where it is short, else labels at powers of ten alone."""
    low, high = xlim or (min(x[x > 0], default=0.0), max(x, default=0.0))
    if low < high < _SHORT * low:
        ax.xaxis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5) if low > _TINY else (1, 3)))
        ax.xaxis.set_major_formatter(ticker.FuncFormatter(lambda x, _: f"${style.number(x)}$"))
    ax.xaxis.set_minor_formatter(ticker.NullFormatter())


def _scaled(axis: Axis, ends: tuple[float, float], label: str, most: int = 4) -> str:
    """Label of a linear axis; of tiny values, and of those from 10^most on, it names the power of ten of the ticks."""
    formatter = ticker.ScalarFormatter(useOffset=False)
    formatter.set_scientific(False)
    axis.set_major_formatter(formatter)
    largest = max(map(abs, ends))
    exponent = math.floor(math.log10(largest)) if largest else 0
    if -3 < exponent < most:
        return label
    axis.set_major_formatter(lambda y, _: f"{y / 10.0**exponent:.4g}".replace("-", "\N{MINUS SIGN}"))
    return rf"{label} in $10^{{{exponent}}}$"


class Places(NamedTuple):
    """Places of the values of a parameter on an axis, (V,)."""

    values: Array
    at: Array
    scale: str  #: "linear", "log" or "steps"

    def of(self, values: Array) -> Array:
        """Places of some of the values."""
        return self.at[np.searchsorted(self.values, values)]

    def dress(self, ax: Axes) -> list[LegendEntry]:
        """Ticks of a horizontal axis at the values where their places are not the values themselves."""
        if not np.array_equal(self.values, self.at):
            ticks(ax.xaxis, self.at, self.values)
        return []


def places(values: Array) -> Places:
    """Where the values of a parameter stand: as they are, by their logarithms, or in order where neither fits."""
    values = np.unique(values)
    if len(values) > 2 and (values > 0).all() and (np.frexp(values)[0] == 0.5).all():
        return Places(values, values, "steps")
    sizes = np.abs(values[values != 0])
    if sizes.size and sizes.max() <= _LINEAR * sizes.min():
        return Places(values, values, "linear")
    if (values > 0).all():
        return Places(values, values, "log")
    return Places(values, np.arange(len(values), dtype=float), "linear")


def ticks(axis: Axis, at: Array, values: Array, steps: bool = False, room: int = measures.SCREEN.ticks_most) -> None:
    """Ticks at some places, labelled by the values there, at most `room` of them."""
    order = np.argsort(at)[:: -1 if steps else 1][:: math.ceil(len(at) / room)]
    shown = values[order].tolist()
    powers = not steps and all(value > 0 and math.isclose(math.log10(value) % 1, 0) for value in shown)
    names = [style.power(value) if powers else style.number(value, steps) for value in shown]
    axis.set_major_locator(ticker.FixedLocator(at[order].tolist()))
    axis.set_minor_locator(ticker.NullLocator())
    axis.set_ticklabels([f"${name}$" for name in names])


def write_slopes(ax: Axes) -> None:
    """Write the names of reference lines beside them, away from the points."""
    lines = [line for line in ax.lines if str(line.get_label()).startswith(SLOPE)]
    size = page.current().layout.note * page.points("legend.fontsize")
    for i, line in enumerate(lines):
        x, y = (np.geomspace(float(ends[0]), float(ends[1]), 41) for ends in np.asarray(line.get_data(), float))
        seen = np.flatnonzero((y > ax.get_ylim()[0]) & (y < ax.get_ylim()[1]))
        if seen.size:
            above, at = i < len(lines) - 1, seen[len(seen) // 2]
            place: dict[str, Any] = {"ha": "right", "va": "bottom"} if above else {"ha": "left", "va": "top"}
            shift = (-3, 1) if above else (3, -1)
            look: dict[str, Any] = {"textcoords": "offset points", "color": GREY, "fontsize": size}
            ax.annotate(str(line.get_label()), (x[at], y[at]), shift, **place, **look)


def write_ends(ax: Axes, ends: Sequence[End], named: set[tuple[str, str]], noted: bool) -> None:
    """Write the names of the lines (with their colours) in `named` and the notes of lines at the right of a panel.

    None stands on another, and what lines of one colour have in common stands there once.
    """
    texts = []
    for end in ends:
        name = end.label if (end.label, end.colour) in named else ""
        texts.append((end, ": ".join(filter(None, (name, _short(end.note) if noted else "")))))
    texts = list({(text, end.colour): (end, text) for end, text in texts}.values())
    texts = sorted((pair for pair in texts if pair[1]), key=lambda pair: pair[0].height)
    layout = page.current().layout
    size = layout.note * page.points("legend.fontsize")
    place: dict[str, Any] = {"transform": ax.transAxes, "va": "center", "fontsize": size}
    _ENDS[ax] = [(ax.text(layout.names_place, 0.5, text, color=end.colour, **place), end.height) for end, text in texts]
    part_ends(ax)


#: The texts at the ends of lines, and the values there.
_ENDS: WeakKeyDictionary[Axes, list[tuple[Text, float]]] = WeakKeyDictionary()


def part_ends(ax: Axes) -> None:
    """Give the texts at the ends of lines places beside these, none on another, at the present size of the panel."""
    texts = _ENDS.get(ax, [])
    to_axes, x = ax.transData + ax.transAxes.inverted(), ax.get_xlim()[1]
    heights = [float(to_axes.transform((x, height))[1]) for _, height in texts]
    inches = ax.get_position().height * ax.figure.bbox.height / ax.figure.dpi
    if texts:
        gap = page.current().layout.names_spacing * float(texts[0][0].get_fontsize()) / 72 / max(inches, 0.5)
        for (text, _), height in zip(texts, _apart(heights, gap), strict=True):
            text.set_y(height)


def _short(note: str) -> str:
    """A number without its interval: `0.51` of `order 0.51 [0.49, 0.53]`."""
    return note.removeprefix("order ").split(" [")[0]


def _apart(heights: list[float], gap: float) -> list[float]:
    """Ascending heights moved as little as needed so that neighbours are at least `gap` apart."""
    shifted = np.array(heights) - gap * np.arange(len(heights))
    groups: list[list[float]] = []
    for value in shifted.tolist():
        groups.append([value])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            groups[-2:] = [groups[-2] + groups[-1]]
    moved = np.array([np.mean(group) for group in groups for _ in group])
    return (moved + gap * np.arange(len(heights))).tolist()


def spread(count: int, most: int = 4) -> list[int]:
    """At most `most` of the numbers 0, ..., count - 1, among them the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()
