"""The figure of strong errors: error against step size, with 95 % intervals and reference slopes."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP

from . import style
from .errors import INTERVAL, LINE, PANEL, error_axes, legend_under, limits, slopes, with_order

UNRESOLVED = "#999999"

#: The reference slopes: (order, line style, whether the line lies above the data or below).
SLOPES = ((1 / 2, "--", True), (1, ":", False))


def draw(results):
    """The figure of a study of kind strong: a panel per case."""
    panels = style.cases(results)
    shared, own = style.split_facts(panels)
    styles = style.styles(results)

    columns = 2 if len(panels) == 4 else min(len(panels), 3)
    rows = math.ceil(len(panels) / columns)
    fig = Figure()
    height = rows * (PANEL[1] + LINE * (max(map(len, panels)) + len(SLOPES)))
    style.dress(fig, columns * PANEL[0], height, results.attributes.get("title", ""), shared)
    axes = list(fig.subplots(rows, columns, squeeze=False).flat)
    for i, (ax, groups, facts) in enumerate(zip(axes, panels, own, strict=False)):
        if len(panels) > 1:
            title = style.plain(groups[0].attributes.get("case_title") or groups[0].case)
            ax.set_title("\n".join([title, *style.wrapped(facts, ",  ", 9, PANEL[0] - 0.5)]))
        _panel(ax, groups, styles)
        if i % columns == 0:
            ax.set_ylabel(r"strong error  $\sup_n\,(\mathrm{E}|y_h(t_n)-y_{\mathrm{ref}}(t_n)|^2)^{1/2}$")
    for ax in axes[len(panels) :]:
        ax.remove()
    return fig


def _panel(ax, groups, styles):
    error_axes(ax, np.concatenate([group.coordinates["h"] for group in groups]))
    resolved = np.concatenate([_points(group, resolved=True) for group in groups])
    drawn = resolved if len(resolved) else np.concatenate([_points(group, resolved=False) for group in groups])
    if len(drawn):
        slopes(ax, drawn, SLOPES)
        ax.set_ylim(limits(drawn[:, 1]))
    for group in groups:
        _scheme(ax, group, *styles[group.scheme])
    _remarks(ax, groups)
    legend_under(ax)


def _points(group, resolved):
    """The finite points (h, error) of a scheme that are resolved, or those that are not."""
    error = group.variables["error"][1]
    chosen = np.isfinite(error) & (error > 0) & (group.variables["resolved"][1].astype(bool) == resolved)
    return np.column_stack([group.coordinates["h"], error])[chosen]


def _scheme(ax, group, marker, colour):
    """Draw one scheme; what lies beyond the top of the panel becomes a mark at its edge."""
    h = group.coordinates["h"]
    error, stderr = group.variables["error"][1], group.variables["error_stderr"][1]
    resolved = group.variables["resolved"][1].astype(bool)
    beyond = ~(error <= ax.get_ylim()[1])
    bars = INTERVAL * np.where(np.isfinite(stderr), stderr, 0.0)
    look = {"marker": marker, "markerfacecolor": "none", "elinewidth": 0.7, "capsize": 0, "markeredgewidth": 1.2}
    good, poor = resolved & (error > 0), ~resolved & ~beyond & (error > 0)
    ax.errorbar(h[good], error[good], bars[good], color=colour, label=_label(group), zorder=3, **look)
    if poor.any():
        ax.errorbar(h[poor], error[poor], bars[poor], color=colour, alpha=0.4, linestyle="none", zorder=2, **look)
    if beyond.any():
        top = {"transform": ax.get_xaxis_transform(), "clip_on": False}
        ax.plot(h[beyond], np.ones(beyond.sum()), marker=CARETUP, color=colour, linestyle="none", zorder=4, **top)


def _label(group):
    a = group.attributes
    return with_order(style.label(group), a.get("order", math.nan), *a.get("order_ci", (math.nan, math.nan)))


def _remarks(ax, groups):
    """Legend entries for what is not an ordinary point."""
    top = ax.get_ylim()[1]
    errors = np.concatenate([group.variables["error"][1] for group in groups])
    resolved = np.concatenate([group.variables["resolved"][1].astype(bool) for group in groups])
    if ((errors <= top) & ~resolved).any():
        look = {"color": UNRESOLVED, "markerfacecolor": "none"}
        ax.plot([], [], "o", alpha=0.6, label="pale: not resolved, left out of the fit", **look)
    if not (errors <= top).all():
        label = "paths left the finite numbers or nearly so"
        ax.plot([], [], marker=CARETUP, linestyle="none", color="black", label=label)
