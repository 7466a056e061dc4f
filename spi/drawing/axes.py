"""Common parts of figures of errors against step sizes: their axes, reference slopes and legends."""

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.markers import CARETUP
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import ScaledTranslation

from spi.storage.records import INTERVAL as INTERVAL  # which tables and figures import from here
from spi.storage.stored import Stored

from ..statistics.cells import heights, mollweide
from ..storage.stored import Description
from . import page, style

# ---------------------------------------------------------------------------------------------------------------------
# Axes for the values of a parameter: the places of values, of cells around them, and of ticks.
# ---------------------------------------------------------------------------------------------------------------------

_WIDE = 20.0  # ratio of values above which their axis is logarithmic
_UNEVEN = 3.0  # largest gap over smallest, in logarithms


def swept_axis(ax: Axes, word: str, values: np.ndarray) -> np.ndarray:
    """Scale, ticks and label of a horizontal axis for the values of a parameter; returns the places of the values."""
    rules(ax)
    ax.set_xlabel(style.word(word))
    positive = values[values > 0]
    if len(values) > 2 and len(positive) == len(values) and (np.frexp(values)[0] == 0.5).all():
        ax.set_xscale("log", base=2)
        ax.set_xlim(values.min() / 1.25, values.max() * 1.25)
        power_ticks(ax, values)
        return values
    sizes = np.abs(values[values != 0])
    if sizes.size and sizes.max() <= _WIDE * sizes.min():
        return values
    places, is_log = value_places(values)
    if is_log:
        ax.set_xscale("log")
    else:
        ax.set_xticks(places, [f"${style.number(float(value))}$" for value in values])
    return places


def value_places(values: np.ndarray) -> tuple[np.ndarray, bool]:
    """The places of values on an axis, and whether it is logarithmic; ranks for values that are not all positive."""
    if (values > 0).all():
        return values, True
    return np.argsort(np.argsort(values)).astype(float), False


def cell_places(values: np.ndarray) -> tuple[np.ndarray, bool]:
    """The places of the cells of values on an axis, and whether it is logarithmic.

    The axis is linear in the rank of a value if they are not all positive, or if gaps differ so much that some cells
    could not be seen.
    """
    places, is_log = value_places(values)
    gaps = np.diff(np.sort(np.log(values))) if is_log else np.ones(1)
    if len(gaps) > 1 and gaps.max() > _UNEVEN * gaps.min():
        return np.argsort(np.argsort(values)).astype(float), False
    return places, is_log


def edges(places: np.ndarray, is_log: bool) -> np.ndarray:
    """(low, high) of the cell around each place, half way to its neighbours; shape (places, 2)."""
    x = np.log2(places) if is_log else np.asarray(places, float)
    order = np.argsort(x)
    x = x[order]
    middle = (x[1:] + x[:-1]) / 2
    outer = (x[1:] - x[:-1]) / 2 if len(x) > 1 else np.array([0.5])
    bounds = np.concatenate([[x[0] - outer[0]], middle, [x[-1] + outer[-1]]])
    cells = np.empty((len(x), 2))
    cells[order] = np.column_stack([bounds[:-1], bounds[1:]])
    return 2.0**cells if is_log else cells


def ticks(axis: Axis, places: np.ndarray, values: np.ndarray, steps: bool, room: int) -> None:
    """Ticks at the places, labelled by the values, at most `room` of them."""
    order = np.argsort(places)[:: -1 if steps else 1][:: int(np.ceil(len(places) / room))]
    shown = [float(value) for value in values[order]]
    powers = all(value > 0 and math.isclose(math.log10(value) % 1, 0) for value in shown)
    names = [f"${style.power(value) if powers and not steps else style.number(value, steps)}$" for value in shown]
    axis.set_major_locator(FixedLocator(places[order].tolist()))
    axis.set_minor_locator(NullLocator())
    axis.set_ticklabels(names)


SLOPE = "#777777"
KNOWN: dict[str, Any] = {"color": "black", "linewidth": 1.0, "linestyle": (0, (4, 3)), "zorder": 4}

#: The labels of the axes of errors, by the error measured.
ERRORS = {
    "strong": r"strong error  $\sup_n\,(\mathrm{E}|y_h(t_n)-y_{\mathrm{ref}}(t_n)|^2)^{1/2}$",
    "weak": r"weak error  $|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$",
}
UNRESOLVED = "#999999"

PANEL = (5.0, 4.0)  # inches, without the legend under it and the title above
HUGE = 1e100  # a value beyond that would make axes that cannot be drawn


LEAST = 2.2  # least width in inches of a panel in a paper, where as many stand side by side as fit


def legend_line() -> float:
    """Inches of a line of a legend."""
    return 0.17 * page.points("legend.fontsize") / 8


def under_label() -> float:
    """Inches from the lower edge of a panel to the place under its ticks and its label."""
    return (11 + 1.2 * (page.points("xtick.labelsize") + page.points("axes.labelsize"))) / 72


def panel_grid(count: int) -> tuple[int, int, tuple[float, float]]:
    """(columns, lines, inches of one panel) of a grid of `count` panels of errors."""
    columns, size = page.current().panels(2 if count == 4 else min(count, 3), PANEL, LEAST)
    return columns, math.ceil(count / columns), size


def case_panels(
    title: str,
    cases: Sequence[Sequence[Stored]],
    facts: list[dict[str, str]],
    entries: int,
    heights: Sequence[float] = (1.0,),
) -> tuple[Figure, list[list[Axes]]]:
    """A figure, and the axes of each case from top to bottom, with `heights` in units of the height of a panel.

    `facts` are those of each case, and `entries` is the number of lines of a legend under the axes of a case.
    """
    shared, own = style.split_facts(facts)
    columns, lines, size = panel_grid(len(cases))
    ratios, fig = [size[1] * height for height in heights], Figure()
    style.dress(fig, columns * size[0], lines * (sum(ratios) + legend_line() * entries), title, shared)
    grid = fig.subplots(len(ratios) * lines, columns, squeeze=False, height_ratios=ratios * lines)
    each = range(0, len(ratios) * lines, len(ratios))
    axes = [list(grid[first : first + len(ratios), column]) for first in each for column in range(columns)]
    for ax in (ax for unused in axes[len(cases) :] for ax in unused):
        ax.remove()
    for (ax, *_), readings, of_case in zip(axes, cases, own, strict=False):
        if len(cases) > 1:
            ax.set_title(panel_title(readings[0].about, of_case))
    return fig, axes[: len(cases)]


def error_axes(ax: Axes, h: np.ndarray) -> None:
    """Logarithmic axes, the horizontal one for the step sizes ``h``."""
    ax.set_xscale("log", base=2)
    ax.set_yscale("log", nonpositive="clip")
    if h.size:
        ax.set_xlim(h.min() / 1.5, h.max() * 1.5)
        power_ticks(ax, h)
    ax.set_xlabel("step size $h$")
    rules(ax)


def panel_title(about: Description, facts: list[str]) -> str:
    """The title of the panel of a case: the case, and the facts that are its own."""
    return "\n".join([style.plain(about.case_title), *style.wrapped(facts, ",  ", "axes.titlesize", PANEL[0] - 0.5)])


def rules(ax: Axes) -> None:
    """A grid behind the data."""
    ax.grid(True, which="major", color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)


def dress_function(ax: Axes, record: Any, f: int, x: str | None, y: str) -> None:
    """Title and labels of the panel of function `f` of a record with names and texts; its name for None as x."""
    name, text = record.functions[f], record.texts[f]
    ax.set(xlabel=style.plain(name) if x is None else x, ylabel=y)
    ax.set_title(style.plain(name if name == text or len(text) > 30 else f"{name}: {text}"))
    rules(ax)


def histogram(
    ax: Axes, cells: tuple[float, float], density: np.ndarray, stderr: np.ndarray, colour: str, exact: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Draw densities in `cells`, (begin of the first, width), with 95 % intervals, from the first to the last not 0.

    Returns the exact densities shown, and the edges.
    """
    used = np.flatnonzero((density > 0) | (exact > 0))
    low, high = (used[0], used[-1] + 1) if len(used) else (0, len(density))
    edges = cells[0] + cells[1] * np.arange(low, high + 1)
    ax.stairs(density[low:high], edges, color=colour, linewidth=1.0)
    half = INTERVAL * np.nan_to_num(stderr[low:high])
    middle = (edges[1:] + edges[:-1]) / 2
    ax.errorbar(middle, density[low:high], half, color=colour, linestyle="none", elinewidth=0.6)
    return exact[low:high], edges


def power_ticks(ax: Axes, h: np.ndarray) -> None:
    """Ticks of a horizontal axis at powers of two."""
    exponents = np.arange(round(math.log2(h.min())), round(math.log2(h.max())) + 1)
    step = 1 if len(exponents) <= 5 else 2 if len(exponents) <= 13 else 4
    powers = (2.0**exponents).tolist()
    ax.xaxis.set_major_locator(FixedLocator(powers[::-1][::step]))
    ax.xaxis.set_minor_locator(FixedLocator(powers) if step > 1 else NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"${style.number(x, steps=True)}$"))
    ax.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))


def slopes(
    ax: Axes, points: np.ndarray, orders: Iterable[tuple[float, Any, bool]], ends: tuple[float, float] | None = None
) -> None:
    """Reference lines that touch the cloud of points from above or below, at a distance, so that they cover none.

    ``orders``: (order, line style, whether the line lies above the points or below) of each; ``ends``: the step sizes
    between which lines are drawn, by default from one side of the panel to the other.
    """
    between = np.array(ends or ax.get_xlim())
    for order, dashes, above in orders:
        ratio = points[:, 1] / points[:, 0] ** order
        factor = ratio.max() * 1.7 if above else ratio.min() / 1.7
        label = f"slope {Fraction(order).limit_denominator(100)}"
        ax.plot(between, factor * between**order, linestyle=dashes, color=SLOPE, linewidth=1, zorder=1, label=label)


def limits(values: np.ndarray) -> tuple[float, float]:
    """The limits of a logarithmic axis: the values with some room, and at least two whole decades' labels."""
    low, high = np.log10(values.min() / 3), np.log10(values.max() * 3)
    while math.floor(high) - math.ceil(low) < 1:
        low, high = low - 0.05, high + 0.05
    return 10**low, 10**high


def note_pale(ax: Axes) -> None:
    """An entry of the legend for points that are drawn pale."""
    look: dict[str, Any] = {"color": UNRESOLVED, "markerfacecolor": "none", "linestyle": "none"}
    ax.plot([], [], marker="o", alpha=0.6, label="pale: not resolved, left out of the fit", **look)


def note_diverged(ax: Axes, nearly: bool = True) -> None:
    """An entry of the legend for marks at the upper edge, of paths that diverged, or perhaps only nearly so."""
    label = "paths diverged (NaN or infinity)" + " or nearly so" * nearly
    ax.plot([], [], marker=CARETUP, label=label, color="black", linestyle="none")


def legend_under(ax: Axes) -> Legend:
    """A legend under the panel, where it never covers data; the schemes first, their markers without bars."""
    entries = sorted(zip(*ax.get_legend_handles_labels(), strict=True), key=lambda e: not isinstance(e[0], tuple))
    handles = [handle[0] if isinstance(handle, tuple) else handle for handle, _ in entries]
    under = ax.transAxes + ScaledTranslation(0, -under_label(), ax.figure.dpi_scale_trans)
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0), "bbox_transform": under}
    look: dict[str, Any] = {"frameon": False, "handlelength": 2.4, "borderaxespad": 0}
    return ax.legend(handles, [label for _, label in entries], **place, **look)


def with_order(label: str, order: float, low: float, high: float) -> str:
    """An entry of a legend: a label and the fitted order with its interval."""
    if not math.isfinite(order):
        return f"{label}: order not resolved"
    return f"{label}: order " + f"{order:.2f} [{low:.2f}, {high:.2f}]".replace("-", "\N{MINUS SIGN}")


# ---------------------------------------------------------------------------------------------------------------------
# Maps of densities in cells, of two quantities or of the sphere in Mollweide's projection.
# ---------------------------------------------------------------------------------------------------------------------

_LINES = "#777777"


def cell_edges(maps: Any, i: int, finer: int = 1) -> list[np.ndarray]:
    """The edges of the cells of map `i` along both of its sides, each cell divided into `finer` parts."""
    ends = zip(maps.low[i], maps.width[i], maps.density.shape[1:], strict=True)
    return [low + width * np.linspace(0, number, finer * number + 1) for low, width, number in ends]


def dress_map(ax: Axes, about: Description, maps: Any, i: int, mesh: QuadMesh) -> None:
    """Give map `i` of `maps`, at one of its times `t`, its title, the names of its sides, and a colour bar."""
    name = f"{style.label(about)}, $t={style.number(float(maps.t[i]))}$"
    if maps.is_sphere:
        net(ax, style.component_names(about, 3))
        ax.set_title(name, pad=14)
        bar = ax.figure.colorbar(mesh, ax=ax, label="density per steradian", shrink=0.8, pad=0.02)
    else:
        ax.set(xlabel=style.plain(maps.sides[0]), ylabel=style.plain(maps.sides[1]))
        ax.set_title(name)
        bar = ax.figure.colorbar(mesh, ax=ax, label="density", pad=0.02)
    bar.outline.set_linewidth(0.4)


def net(ax: Axes, names: Sequence[str]) -> None:
    """Draw meridians, parallels, the outline and the points where the axes with these `names` leave the sphere."""
    thin: dict[str, Any] = {"color": _LINES, "linewidth": 0.4, "alpha": 0.6}
    whole = np.linspace(-1, 1, 201)
    up = heights(-1, 1, 201)
    for meridian in np.pi * np.array([-0.5, 0, 0.5]):
        ax.plot(*mollweide(up, np.full_like(up, meridian)), **thin)
    for height in (-0.5, 0, 0.5):
        ax.plot(*mollweide(np.full_like(whole, height), np.pi * whole), **thin)
    for side in (-np.pi, np.pi):
        ax.plot(*mollweide(up, np.full_like(up, side)), color="black", linewidth=0.7)
    ends = {
        (0, 0): names[0],
        (0, 0.5): names[1],
        (0, -0.5): _minus(names[1]),
        (1, 0): names[2],
        (-1, 0): _minus(names[2]),
    }
    for (height, turn), name in ends.items():
        x, y = mollweide(np.array(height, float), np.pi * np.array(turn))
        ax.plot(x, y, marker="+", color="black", markersize=4, markeredgewidth=0.7)
        above, shift = height >= 0, (0, 3 if height >= 0 else -3)
        ax.annotate(name, (x, y), shift, textcoords="offset points", ha="center", va="bottom" if above else "top")
    ax.set_aspect("equal")
    ax.set_axis_off()


def _minus(name: str) -> str:
    return f"$-${name}"
