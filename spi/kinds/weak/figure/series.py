"""Panels of weak errors against step sizes."""

from collections.abc import Iterable, Sequence
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.lines import Line2D

from spi.drawing import style
from spi.drawing.axes import (
    ERRORS,
    HUGE,
    INTERVAL,
    error_axes,
    legend_under,
    limits,
    note_diverged,
    slopes,
    with_order,
)
from spi.drawing.layout import edge_marks, unresolved

from ..results import WeakErrors

#: Marker and colour for each number of paths, from few to many.
STAGES = (("o", "#56B4E9"), ("s", "#E69F00"), ("D", "#009E73"), ("^", "#D55E00"), ("v", "#0072B2"), ("P", "#CC79A7"))

VISIBLE = 0.01  # a band of relative half width less than that is as thin as the line
_DASHES = ("--", ":", "-.", (0, (6, 1.5, 1, 1.5, 1, 1.5)))  # of slopes, where there are more
_FEW = 2  # so many reference slopes have room above and below all points
_FAR = 1e3  # an error that is not resolved and so many times larger than those which are is that of a blow-up


class Series(NamedTuple):
    """The errors of one scheme by one estimator, for one test function, at N places along the horizontal axis."""

    h: np.ndarray  #: (N,) step sizes, or in a panel against eps the values of eps
    error: np.ndarray  #: (N,) without its sign
    half: np.ndarray  #: (N,) half the 95 % interval, or the bound of its numerical error
    resolved: np.ndarray  #: (N,) bool
    label: str
    look: dict
    exact: bool = False  #: whether nothing was sampled
    expected: float | None = None  #: order
    joined: bool = False  #: whether points are joined by a line


def series_of(reading: WeakErrors, f: int, look: dict[str, Any], label: str, joined: bool, beside: bool) -> Series:
    """The series of test function number `f` of a reading, drawn `beside` another of its scheme or not."""
    return Series(
        h=reading.h * (1.08 if beside else 1.0),
        error=np.abs(reading.error[f]),
        half=reading.half[f],
        resolved=reading.resolved[f],
        exact=reading.unsampled is not None,
        expected=reading.expected_order,
        label=with_order(label, *reading.orders[f][:3]),
        look=look | {"color": _pale(look["color"]), "markersize": 4} if beside else look,
        joined=joined,
    )


def frame(series: Sequence[Series]) -> tuple[float, float] | None:
    """The limits of the errors' axis, None if there is none: all that is resolved, and the sampling floor."""
    resolved = np.concatenate([one.error[_finite(one.error) & one.resolved] for one in series] or [[]])
    poor = [np.isfinite(one.error) & ~one.resolved for one in series]
    each = [np.fmax(one.error, 0.25 * one.half)[which] for one, which in zip(series, poor, strict=True)]
    floors = np.concatenate(each or [[]])
    floors = floors[_finite(floors)]
    if len(resolved):
        floors = np.minimum(floors, _FAR * resolved.max())
    values = np.concatenate([resolved, floors])
    return limits(values) if len(values) else None


def _finite(x: np.ndarray) -> np.ndarray:
    return (x > 0) & (x < HUGE)


def errors_panel(ax: Axes, series: Sequence[Series], title: str, notes: Iterable[str] = ()) -> None:
    """Errors against step sizes, with reference slopes; `notes` are further entries of the legend."""
    _begin(ax, series, title)
    ax.set_ylabel(ERRORS["weak"])
    orders = sorted({one.expected for one in series if one.expected}) or [1, 2]
    drawn = np.concatenate([_points(one, one.resolved) for one in series])
    if not len(drawn):
        drawn = np.concatenate([_points(one, ~one.resolved) for one in series])
    for one in series:
        draw(ax, one)
    if len(orders) > _FEW:
        for order, dashes in zip(orders, cycle(_DASHES), strict=False):  # above the points of which it is expected
            points = np.concatenate([_points(one, one.resolved) for one in series if one.expected == order])
            if len(points):
                slopes(ax, points, [(order, dashes, True)], (points[:, 0].min(), points[:, 0].max()))
    elif len(drawn):
        last = len(orders) - 1
        slopes(ax, drawn, [(p, ":" if i == last else "--", i < last) for i, p in enumerate(orders)])
    remarks(ax, series)
    for note in notes:
        ax.plot([], [], linestyle="none", label=note)
    legend_under(ax)


def prefixes_panel(ax: Axes, reading: WeakErrors, f: int, exact: Series | None, title: str) -> None:
    """Errors of plain Monte Carlo against step sizes for several numbers of paths, over the exact ones."""
    stages = _stages(reading, f)
    shown = stages if exact is None else [*stages, exact]
    _begin(ax, shown, title)
    ax.set_ylabel(ERRORS["weak"])
    for one in stages:
        ax.plot(one.h, np.where(_finite(one.half), one.half, np.nan), "--", color=one.look["color"], linewidth=0.8)
        draw(ax, one, bars=False)
    if exact is not None:
        draw(ax, exact._replace(look={"color": "#000000"}))
    ax.plot([], [], "--", color="#777777", linewidth=0.8, label="half the 95 % interval")
    remarks(ax, stages)
    legend_under(ax)


def _stages(reading: WeakErrors, f: int) -> list[Series]:
    """A series for each number of first paths, and for all of them; none if there are no results of first paths."""
    first, all_paths = reading.prefixes, reading.sampled
    if first is None or all_paths is None:
        return []
    several = zip(first.samples.tolist(), first.error, first.error_stderr, first.resolved, strict=True)
    found = [(n, error[f], stderr[f], resolved[f]) for n, error, stderr, resolved in several]
    if all_paths.samples > found[-1][0]:
        found.append((all_paths.samples, reading.error[f], all_paths.error_stderr[f], reading.resolved[f]))
    stages = []
    for i, (n, error, stderr, resolved) in enumerate(found):
        marker, colour = STAGES[i % len(STAGES)]
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 5}
        told: dict[str, Any] = {"resolved": resolved, "label": f"{style.count(n)} paths", "look": look, "joined": True}
        stages.append(Series(h=reading.h, error=np.abs(error), half=INTERVAL * stderr, **told))
    return stages


def _begin(ax: Axes, series: Sequence[Series], title: str) -> None:
    error_axes(ax, np.concatenate([one.h for one in series]))
    ax.set_title(title)
    found = frame(series)
    if found:
        ax.set_ylim(found)


def _points(one: Series, which: np.ndarray) -> np.ndarray:
    chosen = _finite(one.error) & which
    return np.column_stack([one.h, one.error])[chosen]


def draw(ax: Axes, one: Series, bars: bool = True) -> None:
    """Draw one series: a curve with its band, or points with bars, hollow where they are not resolved."""
    if one.exact:
        _curve(ax, one)
        return
    bottom, top = ax.get_ylim()
    look = {**one.look, "markeredgewidth": 1.0, "linestyle": "none", "zorder": 3}
    hollow = look | unresolved(str(look["marker"]))
    inside = (one.error >= bottom) & (one.error <= top)
    good, poor = one.resolved & inside, ~one.resolved & inside
    if one.joined:
        joined = np.where(_finite(one.error) & (one.resolved | (not bars)), one.error, np.nan)
        ax.plot(one.h, joined, color=look["color"], linewidth=0.9, alpha=0.6, zorder=2)
    up = np.where(np.isfinite(one.half), one.half, 0.0) if bars else np.zeros_like(one.error)
    down = np.minimum(up, one.error - bottom)
    told = (one.label, None) if good.any() or not poor.any() else (None, one.label)
    for chosen, how, label in ((good, look, told[0]), (poor, hollow, told[1])):
        if chosen.any() or label:
            half = np.array([down[chosen], up[chosen]])
            ax.errorbar(one.h[chosen], one.error[chosen], half, label=label, elinewidth=0.8, capsize=0, **how)
    edge_marks(ax, one.h, one.error, look["color"])
    below = one.error < bottom
    if below.any():
        ends = np.maximum(one.error + up, bottom)[below]
        ax.vlines(one.h[below], bottom, ends, color=look["color"], linewidth=0.8, zorder=3)


def _curve(ax: Axes, one: Series) -> None:
    order = np.argsort(one.h)
    h, error, half = one.h[order], one.error[order], one.half[order]
    known = _finite(error)
    look: dict[str, Any] = {"color": one.look["color"], "linewidth": one.look.get("linewidth", 1.2)}
    look |= {"marker": one.look.get("marker"), "markersize": 3}  # which tells curves apart without colours
    ax.plot(h[known], error[known], label=one.label, zorder=1.5, **look)
    known &= np.isfinite(half)
    if (half[known] > VISIBLE * error[known]).any():
        bottom = ax.get_ylim()[0]
        low, high = np.maximum(error - half, bottom)[known], (error + half)[known]
        ax.fill_between(h[known], low, high, color=one.look["color"], alpha=0.25, linewidth=0, zorder=1.2)


def remarks(ax: Axes, series: Sequence[Series], consequence: str = ", left out of the fit") -> None:
    """Entries of the legend for what is not an ordinary point."""
    top = ax.get_ylim()[1]
    sampled = [one for one in series if not one.exact]
    if any(((one.error <= top) & ~one.resolved).any() for one in sampled):
        look: dict[str, Any] = {"color": "#777777", "markerfacecolor": "none", "linestyle": "none"}
        crosses = ", or pale crosses" * any(one.look["marker"] not in Line2D.filled_markers for one in sampled)
        ax.plot([], [], "o", label=f"hollow{crosses}: not resolved{consequence}", **look)
    beyond = np.concatenate([one.error[~(one.error <= top)] for one in sampled] or [np.empty(0)])
    if len(beyond):
        note_diverged(ax, nearly=bool(np.isfinite(beyond).any()))


def _pale(colour: str) -> str:
    red, green, blue = (0.55 * np.array(to_rgb(colour)) + 0.45).tolist()
    return to_hex((red, green, blue))
