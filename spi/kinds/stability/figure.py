"""The figure of stability: maps of regimes, and single quantities over the swept parameter."""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from spi.drawing import layout, style
from spi.drawing.axes import HUGE, INTERVAL, cell_places, edges, error_axes, limits, swept_axis, ticks
from spi.drawing.layout import Entry, Line

from .results import CASIMIR_LOST, FAILING, GROWTH, Stability

# ---------------------------------------------------------------------------------------------------------------------
# Maps of the regimes of a scheme over step size and a parameter.
# ---------------------------------------------------------------------------------------------------------------------

MAP_SIZE = (2.3, 2.45)  # inches of a map
LEAST = 1.6  # inches of its width in a paper

#: Colour and hatch of each regime, from good to bad: blue while the geometry is kept, then warm, then black.
LOOKS = (
    ("#0072B2", None),
    ("#A9D6F2", None),
    ("#F7E489", "....."),
    ("#E69F00", None),
    ("#D55E00", None),
    ("#CC79A7", "//////"),
    ("#3a3a3a", "xxxx"),
)
HATCHES = "#999999", "#ffffff"  # on a pale colour, and on others
_TICKS = 9


def map_lines(cases: Sequence[Sequence[Stability]], titles: list[str]) -> list[Line]:
    """A line of maps per case, a map per scheme, with the legend of the colours under the last line."""
    variants = list(dict.fromkeys(reading.about.variant for readings in cases for reading in readings))
    lines = []
    for readings, title in zip(cases, titles, strict=True):
        of = {reading.about.variant: reading for reading in readings}
        panels = [partial(_map, reading=of.get(variant)) for variant in variants]
        lines.append(Line(panels, MAP_SIZE, title, least=LEAST, shared=True))
    return [*lines[:-1], lines[-1]._replace(legend=[_map_legend([reading for case in cases for reading in case])])]


def _map_legend(readings: Iterable[Stability]) -> list[Entry]:
    """Entries of the regimes that occur, from good to bad."""
    present = sorted({number for reading in readings for number in np.unique(reading.regimes).tolist()})
    allowed = ", ".join(dict.fromkeys(style.number(reading.accurate) for reading in readings))
    texts = (
        rf"accurate: rms error $\leq {allowed}\,|y_0|$",
        "bounded, not accurate",
        "bounded, not positive",
        rf"Casimir lost: relative error $>{style.power(CASIMIR_LOST)}$",
        rf"not bounded: $|y|$ {style.number(GROWTH)} times too large",
        f"solver fails in more than {style.number(100 * FAILING)} % of steps",
        "paths diverged: NaN or infinity",
    )
    return [(Patch(linewidth=0, **_look(number)), texts[number]) for number in present]


def _look(number: int) -> dict[str, Any]:
    colour, hatch = LOOKS[number]
    return {"facecolor": colour, "hatch": hatch, "edgecolor": HATCHES[number > 2]}


def _map(ax: Axes, reading: Stability | None) -> None:
    """Cells over step size and value, each in the colour of its regime."""
    if reading is None:
        ax.set_axis_off()
        return
    h, values = reading.h, reading.values
    label = style.label(reading.about)
    ax.set_title("\n".join(style.wrapped(label.split(), " ", "axes.titlesize", MAP_SIZE[0] - 0.1)))
    places, is_log = cell_places(values)
    x, y = edges(h, True), edges(places, is_log)
    _cells(ax, x, y, reading.regimes)
    ax.set_xscale("log", base=2)
    if is_log:
        ax.set_yscale("log")
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()), xlabel="step size $h$")
    ticks(ax.xaxis, h, h, steps=True, room=5)
    ticks(ax.yaxis, places, values, steps=False, room=_TICKS)
    ax.tick_params(length=2.5)
    ax.set_ylabel(style.word(reading.word))


def _cells(ax: Axes, x: np.ndarray, y: np.ndarray, regimes: np.ndarray) -> None:
    """The cell of each step size, between `x` (S, 2), and value, between `y` (V, 2)."""
    for number in np.unique(regimes).tolist():
        cells = [_cell(x[j], y[i]) for i, j in np.argwhere(regimes == number)]
        ax.add_collection(PolyCollection(cells, linewidth=0, label=str(number), **_look(number)))
    borders = [_cell(x[j], y[i]) for i, j in np.ndindex(regimes.shape)]
    ax.add_collection(LineCollection(borders, color="white", linewidth=0.5, zorder=2))


def _cell(x: np.ndarray, y: np.ndarray) -> list[tuple[float, float]]:
    return [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])]


Looks = dict[str, dict[str, Any]]  #: options of lines, by variant

SIZE = (3.3, 2.75)  # inches of a panel
ALONE = (4.4, 3.3)  # the same where a case has only one
COLUMNS = 4  # panels side by side
STEPS = 4  # step sizes shown at most
MARKERS = 6.5, 4.5  # from the first scheme's size towards the last one's, so that both are seen where they agree
CAP = 1e4  # relative errors and growths beyond that are only marked
ZERO = 2.0  # standard errors: up to these a value is statistically zero


class _Quantity(NamedTuple):
    """The quantity of a panel."""

    label: str
    field: str  #: of a reading, perhaps of a part that it need not have
    is_log: bool = True
    lacking: str = "not stored"  #: the text of an empty panel
    dotted: str = ""  #: the field of a second, dotted line
    nan_is_lost: bool = True  #: whether NaN means that paths diverged rather than that nothing is known


class _Values(NamedTuple):
    """A quantity of one reading; arrays (V, S)."""

    reading: Stability
    values: np.ndarray
    half: np.ndarray  #: half the 95 % interval, NaN where it has none
    dotted: np.ndarray | None


_IMPLICIT = "no implicit scheme"

QUANTITIES = {
    "finite": _Quantity("fraction of paths finite to $T$", "finite", is_log=False),
    "casimir": _Quantity(
        "largest relative Casimir error",
        "casimirs.largest_worst",
        lacking="no Casimir",
        dotted="casimirs.largest_median",
    ),
    "norm": _Quantity(r"largest $|y|\,/\,|y_0|$", "largest_norm"),
    "error": _Quantity(r"rms error at $T$,  relative to $|y_0|$", "error"),
    "law": _Quantity(
        r"$\max_\varphi\,|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$",
        "law.distance",
        lacking="the law is not known",
        nan_is_lost=False,
    ),
    "positive": _Quantity("fraction of positive paths", "positive", is_log=False),
    "failures": _Quantity("solver failures per step", "solver.failing_fraction", lacking=_IMPLICIT),
    "iterations": _Quantity(
        "iterations per step",
        "solver.iterations_per_solve",
        is_log=False,
        lacking=_IMPLICIT,
        nan_is_lost=False,
    ),
    "angle": _Quantity("largest angle of a flow (rad)", "largest_angle"),
}

#: The words of the attribute ``panels``.
WORDS = ("regimes", *QUANTITIES)


def draw(title: str, cases: Sequence[Sequence[Stability]]) -> Figure:
    """The figure of a study of kind stability.

    The word ``regimes`` gives a line of maps per case, a map per scheme; all other words give a panel each, in lines of
    their own for each case, below the maps.
    """
    for readings in cases:
        layout.check_panels(readings[0].panels, WORDS)
    names = "reference_step", "reference_scheme", "samples", "functions"
    shared, own = style.split_facts([style.facts(readings[0], *names) for readings in cases])
    swept = [_single_value(readings[0]) for readings in cases]
    if len(set(map(tuple, swept))) == 1:
        shared = [*swept[0], *shared]
    else:
        own = [[*value, *facts] for value, facts in zip(swept, own, strict=True)]
    looks = _looks(cases)
    mapped = [i for i, readings in enumerate(cases) if "regimes" in readings[0].panels]
    variants = {reading.about.variant for i in mapped for reading in cases[i]}
    several = len(cases) > 1
    lines = []
    if mapped:
        titles = [_title(cases[i], own[i], several, MAP_SIZE[0] * len(variants)) for i in mapped]
        lines += map_lines([cases[i] for i in mapped], titles)
    for readings, facts in zip(cases, own, strict=True):
        chosen = [word for word in readings[0].panels if word != "regimes"]
        lines += _lines(readings, chosen, looks, partial(_title, readings, facts, several)) if chosen else []
    return layout.arranged(title, _without_repetition(lines), shared)


def _single_value(reading: Stability) -> list[str]:
    """The swept value as a fact if it is only one."""
    values = reading.values
    return [f"{style.word(reading.word)}$\\,={style.number(float(values[0]))}$"] if len(values) == 1 else []


def _looks(cases: Sequence[Sequence[Stability]]) -> Looks:
    """The look of each scheme; markers differ in size, the last lies on top."""
    looks = style.looks(cases)
    variants = dict.fromkeys(reading.about.variant for readings in cases for reading in readings)
    return {
        variant: {"marker": looks[variant][0], "color": looks[variant][1], "markersize": float(size)}
        for variant, size in zip(variants, np.linspace(*MARKERS, len(looks)), strict=False)
    }


def _title(readings: Sequence[Stability], facts: list[str], several: bool, width: float) -> str:
    return layout.case_title(readings[0].about, facts, width) if several else ""


def _lines(
    readings: Sequence[Stability], words: list[str], looks: Looks, title: Callable[[float], str]
) -> list[layout.Line]:
    """The line panels of a case in lines of about the same length."""
    size = SIZE if len(words) > 1 else ALONE
    columns = layout.even(len(words), COLUMNS)
    panels = [partial(_panel, readings=readings, word=word, looks=looks) for word in words]
    lines = layout.in_lines(panels, columns, size)
    lines[0] = lines[0]._replace(title=title(size[0] * columns))
    return [*lines[:-1], lines[-1]._replace(legend=_legend(readings, words, looks))]


def _without_repetition(lines: list[layout.Line]) -> list[layout.Line]:
    """The lines without a legend that is repeated further down."""
    texts = [[text for row in line.legend for _, text in row] for line in lines]
    return [line._replace(legend=()) if texts[i] in texts[i + 1 :] else line for i, line in enumerate(lines)]


def _shown(reading: Stability) -> list[int] | list[None]:
    """Numbers of the step sizes that are lines; None, alone, where the step size is the horizontal axis."""
    return layout.spread(len(reading.h), STEPS) if len(reading.values) > 1 else [None]


def _legend(readings: Sequence[Stability], words: list[str], looks: Looks) -> list[list[layout.Entry]]:
    """The rows of the legend of all panels of a case: markers, shades and edge marks."""
    abouts = [reading.about for reading in readings]
    rows: list[list[layout.Entry]] = [
        [(Line2D([], [], **looks[about.variant]), style.label(about)) for about in abouts]
    ]
    shown, h = _shown(readings[0]), readings[0].h
    if len(shown) > 1:
        handles = [Line2D([], [], color=layout.shade("#000000", i, len(shown)), linewidth=2) for i in range(len(shown))]
        names = [f"$h={style.number(float(h[j]), steps=True)}$" for j in shown]
        rows.append(list(zip(handles, names, strict=True)))
    marks: list[layout.Entry] = []
    if "casimir" in words and _values_of(readings, "casimir"):
        marks.append((Line2D([], [], color="black", linestyle="-"), "worst path"))
        marks.append((Line2D([], [], color="black", linestyle=":"), "median path"))
    marks += _marks(readings, words)
    return [*rows, marks] if marks else rows


def _marks(readings: Sequence[Stability], words: list[str]) -> list[layout.Entry]:
    """Entries of the legend for marks that are no ordinary points in some panel."""
    entries = []
    logs = [curve for word in words if QUANTITIES[word].is_log for curve in _values_of(readings, word)]
    if any((curve.values == 0).any() for curve in logs):
        text = r"0, or an angle $\leq\pi/4$" if "angle" in words else "0"
        entries.append(layout.mark("v", text, markerfacecolor="none"))
    if any((~(curve.values <= CAP)).any() for curve in logs):
        entries.append(layout.mark("^", f"not finite, or above ${style.power(CAP)}$"))
    if "law" in words and any(_is_zero(curve).any() for curve in _values_of(readings, "law")):
        entries.append(layout.zero_mark())
    return entries


def _panel(ax: Axes, readings: Sequence[Stability], word: str, looks: Looks) -> None:
    """One quantity over the swept value, a line per scheme and step size; over the step size if it is the only one."""
    quantity, curves = QUANTITIES[word], _values_of(readings, word)
    if not curves:
        layout.empty(ax, quantity.lacking)
        return
    x = _x_axis(ax, curves[0].reading)
    ax.set_ylabel(quantity.label)
    ax.set_yscale("log" if quantity.is_log else "linear")
    _y_limits(ax, word, np.concatenate([curve.values.ravel() for curve in curves]))
    for curve in curves:
        look, shown = looks[curve.reading.about.variant], _shown(curve.reading)
        for i, j in reversed(list(enumerate(shown))):
            at = (0, slice(None)) if j is None else (slice(None), j)
            colour = layout.shade(look["color"], i, len(shown))
            poor = _is_zero(curve) if word == "law" else np.zeros(curve.values.shape, bool)
            _line(ax, x, curve.values[at], curve.half[at], poor[at], look | {"color": colour})
            if curve.dotted is not None:
                _joined(ax, x, curve.dotted[at], {"color": colour, "linestyle": ":"})


def _x_axis(ax: Axes, reading: Stability) -> np.ndarray:
    """Scale, ticks and label of the horizontal axis; returns the places of its points."""
    values = reading.values
    if len(values) == 1:
        error_axes(ax, reading.h)
        return reading.h
    return swept_axis(ax, reading.word, values)


def _y_limits(ax: Axes, word: str, values: np.ndarray) -> None:
    shown = values[np.isfinite(values)]
    if not QUANTITIES[word].is_log:
        top = 1.0 if word in ("finite", "positive") else shown.max(initial=1.0)
        ax.set_ylim(-0.05 * top, 1.05 * top)
        return
    shown = shown[(shown > 0) & (shown <= (HUGE if word == "angle" else CAP))]
    ax.set_ylim(limits(shown if shown.size else np.array([1.0])))


def _line(
    ax: Axes, x: np.ndarray, values: np.ndarray, half: np.ndarray, poor: np.ndarray, look: dict[str, Any]
) -> None:
    """A line with its bars, hollow where it is poor; marks at the edges for values outside, nothing for NaN."""
    is_number = ~np.isnan(values)
    _joined(ax, x, values, {"color": look["color"]})
    layout.points(ax, x, values, half, poor, look)
    layout.edge_marks(ax, x[is_number], values[is_number], look["color"])


def _joined(ax: Axes, x: np.ndarray, values: np.ndarray, look: dict[str, Any]) -> None:
    bottom, top = ax.get_ylim()
    order = np.argsort(x)
    shown = np.where((values >= bottom) & (values <= top), values, np.nan)
    ax.plot(x[order], shown[order], linewidth=1.0, zorder=2.5, **look)


def _values_of(readings: Iterable[Stability], word: str) -> list[_Values]:
    """The quantity of each reading that has values of it other than NaN."""
    quantity, curves = QUANTITIES[word], []
    for reading in readings:
        values = reading.known(quantity.field)
        if values is None:
            continue
        values = np.where(np.isnan(values), np.inf, values) if quantity.nan_is_lost else np.asarray(values, float)
        if np.isnan(values).all():
            continue
        stderr = reading.known(f"{quantity.field}_stderr")
        half = np.full(values.shape, np.nan) if stderr is None else INTERVAL * stderr
        curves.append(_Values(reading, values, half, reading.known(quantity.dotted) if quantity.dotted else None))
    return curves


def _is_zero(curve: _Values) -> np.ndarray:
    """Where a value is zero within ZERO standard errors."""
    with np.errstate(invalid="ignore"):
        return curve.values <= ZERO / INTERVAL * curve.half
