"""Panels of weak errors against step sizes."""

import math
from typing import NamedTuple

import numpy as np
from matplotlib.colors import to_hex, to_rgb
from matplotlib.markers import CARETDOWN, CARETUP

from ..estimators import is_resolved
from . import style
from .errors import HUGE, INTERVAL, error_axes, legend_under, limits, slopes, with_order

ERROR = r"weak error  $|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$"

#: Marker and colour for each number of paths, from few to many.
STAGES = (("o", "#56B4E9"), ("s", "#E69F00"), ("D", "#009E73"), ("^", "#D55E00"), ("v", "#0072B2"), ("P", "#CC79A7"))

VISIBLE = 0.01  # a band of relative half width less than that is as thin as the line
_FAR = 1e3  # an error that is not resolved and so many times larger than those which are is that of a blow-up


class Series(NamedTuple):
    """The errors of one scheme by one estimator, for one test function."""

    h: np.ndarray
    error: np.ndarray  #: without its sign
    half: np.ndarray  #: half the 95 % interval, or the bound of its numerical error
    resolved: np.ndarray
    exact: bool  #: whether nothing was sampled
    expected: float | None  #: order
    label: str
    look: dict
    joined: bool  #: whether points are joined by a line


def series_of(group, f, look, several_schemes, several_estimators, joined, beside, size=6):
    """The series of test function number ``f`` of a group, drawn beside another of its scheme or not.

    Its label names what there are several of.
    """
    v, a = group.arrays, group.attributes
    exact = "error_bound" in v
    half = v["error_bound"][f] if exact else INTERVAL * v["error_stderr"][f]
    name = style.ESTIMATORS.get(group.estimator, group.estimator)
    if group.estimator == "plain" and "samples" in a:
        name += f" ({style.count(a['samples'])})"
    label = ", ".join([style.label(group)] * (several_schemes or not several_estimators) + [name] * several_estimators)
    order = [float(v[name][f]) if name in v else math.nan for name in ("order", "order_low", "order_high")]
    marker, colour = look
    appearance = {"marker": marker, "color": _pale(colour) if beside else colour, "markersize": 4 if beside else size}
    return Series(
        group.coordinates["h"] * (1.08 if beside else 1.0),
        *(np.abs(v["error"][f]), half, v["resolved"][f].astype(bool), exact, a.get("expected_order")),
        *(with_order(label, *order), appearance, joined),
    )


def frame(series):
    """The limits of the errors' axis, None if there is none: all that is resolved, and the sampling floor."""
    resolved = np.concatenate([one.error[_finite(one.error) & one.resolved] for one in series] or [[]])
    floors = []
    for one in series:
        poor = _finite(one.half) & np.isfinite(one.error) & ~one.resolved
        floors.append(np.maximum(one.error, 0.25 * one.half)[poor])
    floors = np.concatenate(floors or [[]])
    floors = floors[_finite(floors)]
    if len(resolved):
        floors = np.minimum(floors, _FAR * resolved.max())
    values = np.concatenate([resolved, floors])
    return limits(values) if len(values) else None


def _finite(x):
    return (x > 0) & (x < HUGE)


def errors_panel(ax, series, title, notes=()):
    """Errors against step sizes, with reference slopes; ``notes`` are further entries of the legend."""
    _begin(ax, series, title)
    ax.set_ylabel(ERROR)
    orders = sorted({one.expected for one in series if one.expected}) or [1, 2]
    drawn = np.concatenate([_points(one, one.resolved) for one in series])
    if not len(drawn):
        drawn = np.concatenate([_points(one, ~one.resolved) for one in series])
    for one in series:
        draw(ax, one)
    if len(drawn):
        last = len(orders) - 1
        slopes(ax, drawn, [(p, ":" if i == last else "--", i < last) for i, p in enumerate(orders)])
    remarks(ax, series)
    for note in notes:
        ax.plot([], [], linestyle="none", label=note)
    legend_under(ax)


def prefixes_panel(ax, group, f, exact, title):
    """Errors of plain Monte Carlo against step sizes for several numbers of paths, over the exact ones."""
    stages = _stages(group, f)
    shown = stages if exact is None else [*stages, exact]
    _begin(ax, shown, title)
    ax.set_ylabel(ERROR)
    for one in stages:
        ax.plot(one.h, np.where(_finite(one.half), one.half, np.nan), "--", color=one.look["color"], linewidth=0.8)
        draw(ax, one, bars=False)
    if exact is not None:
        draw(ax, exact._replace(look={"color": "#000000"}))
    ax.plot([], [], "--", color="#777777", linewidth=0.8, label="half the 95 % interval")
    remarks(ax, stages)
    legend_under(ax)


def _stages(group, f):
    """A series for each number of first paths, and for all of them."""
    v, h, a = group.arrays, group.coordinates["h"], group.attributes
    several = zip(group.coordinates["samples"].tolist(), v["prefix_error"], v["prefix_error_stderr"], strict=True)
    found = [(n, error[f], stderr[f]) for n, error, stderr in several]
    if a.get("samples", 0) > found[-1][0]:
        found.append((a["samples"], v["error"][f], v["error_stderr"][f]))
    stages = []
    for i, (n, error, stderr) in enumerate(found):
        marker, colour = STAGES[i % len(STAGES)]
        look = {"marker": marker, "color": colour, "markersize": 5}
        resolved = is_resolved(np.abs(error), stderr)
        stages.append(
            Series(h, np.abs(error), INTERVAL * stderr, resolved, False, None, f"{style.count(n)} paths", look, True)
        )
    return stages


def _begin(ax, series, title):
    error_axes(ax, np.concatenate([one.h for one in series]))
    ax.set_title(title)
    found = frame(series)
    if found:
        ax.set_ylim(found)


def _points(one, which):
    chosen = _finite(one.error) & which
    return np.column_stack([one.h, one.error])[chosen]


def draw(ax, one, bars=True):
    """Draw one series: a curve with its band, or points with bars, hollow where they are not resolved."""
    if one.exact:
        _curve(ax, one)
        return
    bottom, top = ax.get_ylim()
    look = {**one.look, "markeredgewidth": 1.0, "linestyle": "none", "zorder": 3}
    hollow = look | {"markerfacecolor": "none"}
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
    edge = {"transform": ax.get_xaxis_transform(), "clip_on": False, "color": look["color"], "linestyle": "none"}
    above, below = ~(one.error <= top), one.error < bottom
    if above.any():
        ax.plot(one.h[above], np.ones(above.sum()), marker=CARETUP, zorder=4, **edge)
    if below.any():
        ax.plot(one.h[below], np.zeros(below.sum()), marker=CARETDOWN, markerfacecolor="none", zorder=4, **edge)
        ax.vlines(one.h[below], bottom, (one.error + up)[below], color=look["color"], linewidth=0.8, zorder=3)


def _curve(ax, one):
    order = np.argsort(one.h)
    h, error, half = one.h[order], one.error[order], one.half[order]
    known = _finite(error)
    look = {"color": one.look["color"], "linewidth": one.look.get("linewidth", 1.2)}
    ax.plot(h[known], error[known], label=one.label, zorder=1.5, **look)
    known &= np.isfinite(half)
    if (half[known] > VISIBLE * error[known]).any():
        bottom = ax.get_ylim()[0]
        low, high = np.maximum(error - half, bottom)[known], (error + half)[known]
        ax.fill_between(h[known], low, high, color=one.look["color"], alpha=0.25, linewidth=0, zorder=1.2)


def remarks(ax, series, consequence=", left out of the fit"):
    """Entries of the legend for what is not an ordinary point."""
    top = ax.get_ylim()[1]
    sampled = [one for one in series if not one.exact]
    if any(((one.error <= top) & ~one.resolved).any() for one in sampled):
        look = {"color": "#777777", "markerfacecolor": "none", "linestyle": "none"}
        ax.plot([], [], "o", label=f"hollow: not resolved{consequence}", **look)
    beyond = np.concatenate([one.error[~(one.error <= top)] for one in sampled] or [[]])
    if len(beyond):
        label = "paths left the finite numbers" + " or nearly so" * bool(np.isfinite(beyond).any())
        ax.plot([], [], marker=CARETUP, linestyle="none", color="black", label=label)


def _pale(colour):
    return to_hex(0.55 * np.array(to_rgb(colour)) + 0.45)
