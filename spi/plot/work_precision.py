"""The figure of work and precision: errors, and errors of the Casimirs, against processor time."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

from . import style
from .errors import HUGE, INTERVAL, LINE, PANEL, legend_under, limits, rules, with_order
from .steps import Line, step_labels

ERROR = {
    "strong": r"strong error  $\sup_n\,(\mathrm{E}|y_h(t_n)-y_{\mathrm{ref}}(t_n)|^2)^{1/2}$",
    "weak": r"weak error  $|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$",
}
CASIMIR = r"$\max\,|C(y_h(t_n))-C(y_0)|$"
TIME = "processor time of a path"

TARGET, UNRESOLVED = "#8c8c8c", "#999999"
_LOWER = 2.0  # inches of a panel of Casimirs
_FAR = 100.0  # an error so many times larger than the middle one of the schemes' largest is that of a blow-up
_SPOILT = 1e6  # and so is an error of a Casimir
_ROOM = 1.7  # at the sides of a panel, as a factor of time

_LOOK = {"markerfacecolor": "none", "elinewidth": 0.7, "capsize": 0, "markeredgewidth": 1.2}
_SMALL = {"markerfacecolor": "none", "markeredgewidth": 1.0, "markersize": 4.5}


def _facts_of_all(groups):
    """The groups of a case, the estimator of their weak errors left out if it differs from scheme to scheme."""
    if len({group.attributes.get("estimator") for group in groups}) == 1:
        return groups
    return [group._replace(attributes={**group.attributes, "estimator": None}) for group in groups]


def draw(results):
    """The figure of a study of kind work_precision: a column per case, under the errors those of the Casimirs."""
    cases = style.cases(results)
    styles = style.styles(results)
    shared, own = style.split_facts([_facts_of_all(groups) for groups in cases])
    measured = [_has_casimirs(groups) for groups in cases]
    fig = Figure()
    grid = _grid(fig, results.attributes.get("title", ""), shared, cases, any(measured))
    for i, (groups, facts) in enumerate(zip(cases, own, strict=True)):
        axes = grid[i]
        if len(cases) > 1:
            title = style.plain(groups[0].attributes.get("case_title") or groups[0].case)
            axes[0].set_title("\n".join([title, *style.wrapped(facts, ",  ", 9, PANEL[0] - 0.5)]))
        _errors(axes[0], groups, styles)
        if measured[i]:
            _casimirs(axes[1], groups, styles)
        if all(measured):
            axes[0].tick_params(labelbottom=False)
            axes[0].set_xlabel("")
        _legend(axes, groups, styles, measured[i])
        _name_axes(axes, groups, cases[i - 1] if i % _columns(cases) else None)
    fig.get_layout_engine().execute(fig)  # where labels may lie depends on where the panels do
    for axes, groups in zip(grid, cases, strict=True):
        step_labels(axes[0], _ends(groups, styles, axes[0].get_ylim()[1]), _targets(axes[0], groups))
    return fig


def _columns(cases):
    return 2 if len(cases) == 4 else min(len(cases), 3)


def _grid(fig, title, shared, cases, lower):
    """The axes of each case, from top to bottom."""
    columns = _columns(cases)
    blocks = math.ceil(len(cases) / columns)
    ratios = [PANEL[1], _LOWER] if lower else [PANEL[1]]
    entries = max(map(len, cases)) + 3  # of the legend, with remarks
    style.dress(fig, columns * PANEL[0], blocks * (sum(ratios) + LINE * entries), title, shared)
    grid = fig.subplots(len(ratios) * blocks, columns, squeeze=False, height_ratios=ratios * blocks)
    columns_of_axes = [grid[b * len(ratios) : (b + 1) * len(ratios), c] for b in range(blocks) for c in range(columns)]
    for axes in columns_of_axes[len(cases) :]:
        for ax in axes:
            ax.remove()
    return columns_of_axes[: len(cases)]


def _name_axes(axes, groups, left):
    """Label the vertical axes, unless those of the case to the left say it."""
    measure = groups[0].attributes.get("measure")
    if left is None or left[0].attributes.get("measure") != measure:
        axes[0].set_ylabel(ERROR.get(measure, "error"))
    if _has_casimirs(groups) and (left is None or not _has_casimirs(left)):
        axes[1].set_ylabel(f"Casimir error\n{CASIMIR}")


def _has_casimirs(groups):
    return any("casimir_drift" in group.variables and group.variables["casimir_drift"][1].size for group in groups)


def _seconds(groups):
    seconds = np.concatenate([group.variables["seconds_per_path"][1] for group in groups])
    return seconds[(seconds > 0) & np.isfinite(seconds)]


def _time_axes(ax, groups):
    """Logarithmic axes, the horizontal one for the times of all schemes."""
    ax.set(xscale="log", yscale="log", xlabel=TIME)
    seconds = _seconds(groups)
    if seconds.size:
        ax.set_xlim(seconds.min() / _ROOM, seconds.max() * _ROOM)
        if seconds.max() < 20 * seconds.min():
            ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter(EngFormatter(unit="s"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    rules(ax)


def _errors(ax, groups, styles):
    """Errors against time, the requested ones as lines across."""
    _time_axes(ax, groups)
    frame = _frame(groups)
    if frame is not None:
        ax.set_ylim(frame)
    for target in _targets(ax, groups):
        ax.axhline(target, color=TARGET, linewidth=0.7, linestyle=(0, (6, 4)), zorder=1)
    for group in groups:
        _scheme(ax, group, *styles[group.scheme])


def _targets(ax, groups):
    """The requested errors that can be seen."""
    low, high = ax.get_ylim()
    return sorted({t for group in groups for t in group.attributes.get("targets", ()) if low < t < high})


def _frame(groups):
    """The limits of the errors' axis; None if no error can be drawn."""
    good, poor = (np.concatenate([_found(group, resolved)[:, 2] for group in groups]) for resolved in (True, False))
    if not len(good):
        return limits(poor) if len(poor) else None
    largest = [found[:, 2].max() for found in (_found(group, True) for group in groups) if len(found)]
    good = good[good <= _FAR * np.median(largest)]
    return limits(np.concatenate([good, poor[(poor > good.min() / 10) & (poor < good.max())]]))


def _found(group, resolved):
    """The points (h, seconds, error, half of the 95 % interval) that are resolved, or those that are not."""
    v = group.arrays
    stderr = np.where(np.isfinite(v["error_stderr"]), v["error_stderr"], 0.0)
    half = stderr * (1.0 if group.attributes.get("exact") else INTERVAL)
    chosen = (v["error"] > 0) & (v["error"] < HUGE) & np.isfinite(v["seconds_per_path"])
    chosen &= v["resolved"].astype(bool) == resolved
    return np.column_stack([group.coordinates["h"], v["seconds_per_path"], v["error"], half])[chosen]


def _scheme(ax, group, marker, colour):
    """Draw the errors of one scheme; what lies beyond the top of the panel becomes a mark at its edge."""
    top = ax.get_ylim()[1]
    look = {"marker": marker, "color": colour, **_LOOK}
    for resolved, further in ((True, {"zorder": 3}), (False, {"alpha": 0.4, "linestyle": "none", "zorder": 2})):
        _, seconds, error, half = _found(group, resolved).T
        inside = error <= top
        if inside.any():
            ax.errorbar(seconds[inside], error[inside], half[inside], **look, **further)
    _edge(ax, group.variables["seconds_per_path"][1][_lost(group, top)], 1, colour)


def _lost(group, top):
    return ~(group.variables["error"][1] <= top)


def _edge(ax, seconds, end, colour):
    """Marks at the lower (0) or upper (1) edge of a panel."""
    place = {"transform": ax.get_xaxis_transform(), "clip_on": False, "linestyle": "none", "zorder": 4}
    if len(seconds):
        ax.plot(seconds, np.full(len(seconds), end), marker=(CARETDOWN, CARETUP)[end], color=colour, **place)


def _casimirs(ax, groups, styles):
    """The largest error of the Casimirs against time; none at all, and a lost path, are marks at the edges."""
    _time_axes(ax, groups)
    drifts = {group.scheme: _drift(group) for group in groups}
    everything = np.concatenate(list(drifts.values()))
    drawn = everything[(everything > 0) & (everything < _SPOILT)]
    low, high = limits(drawn) if len(drawn) else (1e-17, 1e-15)
    ax.set_ylim(low / 10 if (everything == 0).any() else low, high)
    ax.yaxis.set_major_locator(LogLocator(numticks=6))
    for group in groups:
        marker, colour = styles[group.scheme]
        drift, seconds = drifts[group.scheme], group.variables["seconds_per_path"][1][: len(drifts[group.scheme])]
        inside = (drift > 0) & (drift < _SPOILT)
        ax.plot(seconds[inside], drift[inside], marker, linestyle="-", color=colour, **_SMALL)
        _edge(ax, seconds[drift == 0], 0, colour)
        _edge(ax, seconds[~(drift < _SPOILT)], 1, colour)


def _drift(group):
    """The largest error over Casimirs at each step size, empty where none were measured."""
    if "casimir_drift" not in group.variables or not group.variables["casimir_drift"][1].size:
        return np.empty(0)
    return group.variables["casimir_drift"][1].max(axis=1)


def _legend(axes, groups, styles, measured):
    """One legend for both panels of a case, under the lower one or in its place."""
    ax = axes[-1]
    for group in groups:
        marker, colour = styles[group.scheme]
        a = group.attributes
        label = with_order(style.label(group), a.get("order", math.nan), *a.get("order_ci", (math.nan, math.nan)))
        ax.plot([], [], marker=marker, color=colour, markerfacecolor="none", markeredgewidth=1.2, label=label)
    _remarks(ax, axes[0], groups)
    legend_under(ax)
    if len(axes) > 1:
        ax.get_legend().set_bbox_to_anchor((0.5, -0.14 * PANEL[1] / _LOWER if measured else 1.0), ax.transAxes)
    if len(axes) > 1 and not measured:
        ax.set_axis_off()


def _remarks(ax, errors, groups):
    """Legend entries for what is no scheme."""
    top = errors.get_ylim()[1]
    drifts = np.concatenate([_drift(group) for group in groups])
    black = {"color": "black", "linestyle": "none"}
    if _targets(errors, groups):
        ax.plot([], [], color=TARGET, linewidth=0.7, linestyle=(0, (6, 4)), label="requested errors")
    if any((_found(group, False)[:, 2] <= top).any() for group in groups):
        look = {"color": UNRESOLVED, "markerfacecolor": "none", "linestyle": "none"}
        ax.plot([], [], marker="o", alpha=0.6, label="pale: not resolved, left out of the fit", **look)
    if any(_lost(group, top).any() for group in groups) or not (drifts < _SPOILT).all():
        ax.plot([], [], marker=CARETUP, label="paths left the finite numbers or nearly so", **black)
    if (drifts == 0).any():
        ax.plot([], [], marker=CARETDOWN, label="the Casimirs have not changed at all", **black)


def _ends(groups, styles, top):
    """The lines of errors whose ends are labelled with their step sizes."""
    for group in groups:
        h, seconds, error, _ = _found(group, True)[_found(group, True)[:, 2] <= top].T
        if len(h):
            yield Line(h, seconds, error, styles[group.scheme][1])
