"""The figure of strong errors: error against step size, with 95 % intervals and reference slopes."""

import math
from fractions import Fraction

import numpy as np
from matplotlib.figure import Figure
from matplotlib.markers import CARETUP
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from . import style

UNRESOLVED, SLOPE = "#999999", "#777777"

#: The reference slopes: (order, line style, whether the line lies above the data or below).
SLOPES = ((1 / 2, "--", True), (1, ":", False))

PANEL = (5.0, 4.0)  # inches, without the legend under it and the title above
INTERVAL = 1.96  # half the width of a 95 % interval in standard errors


def draw(results):
    """The figure of a study of kind strong: a panel per case."""
    panels = style.cases(results)
    shared, own = style.split_facts(panels)
    styles = style.styles(results)

    columns = 2 if len(panels) == 4 else min(len(panels), 3)
    rows = math.ceil(len(panels) / columns)
    fig = Figure()
    height = rows * (PANEL[1] + 0.17 * (max(map(len, panels)) + len(SLOPES)))
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
    ax.set_xscale("log", base=2)
    ax.set_yscale("log", nonpositive="clip")
    h = np.concatenate([group.coordinates["h"] for group in groups])
    if h.size:
        ax.set_xlim(h.min() / 1.5, h.max() * 1.5)
        _power_ticks(ax, h)
    ax.set_xlabel("step size $h$")
    resolved = np.concatenate([_points(group, resolved=True) for group in groups])
    drawn = resolved if len(resolved) else np.concatenate([_points(group, resolved=False) for group in groups])
    if len(drawn):
        _slopes(ax, drawn)
        _limits(ax, drawn)
    for group in groups:
        _scheme(ax, group, *styles[group.scheme])
    ax.grid(True, which="major", color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    _remarks(ax, groups)
    # Under the panel, where it never covers data; the schemes first, their markers without bars.
    entries = sorted(zip(*ax.get_legend_handles_labels(), strict=True), key=lambda e: not isinstance(e[0], tuple))
    handles = [handle[0] if isinstance(handle, tuple) else handle for handle, _ in entries]
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14), "handlelength": 2.4}
    ax.legend(handles, [label for _, label in entries], frameon=False, **place)


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


def _slopes(ax, points):
    """Reference lines that touch the cloud of points from above or below, at a distance, so that they cover none."""
    ends = np.array(ax.get_xlim())
    for order, line, above in SLOPES:
        ratio = points[:, 1] / points[:, 0] ** order
        factor = ratio.max() * 1.7 if above else ratio.min() / 1.7
        label = f"slope {Fraction(order)}"
        ax.plot(ends, factor * ends**order, line, color=SLOPE, linewidth=1, zorder=1, label=label)


def _limits(ax, points):
    """The data with some room, and at least two whole decades' labels."""
    low, high = np.log10(points[:, 1].min() / 3), np.log10(points[:, 1].max() * 3)
    while math.floor(high) - math.ceil(low) < 1:
        low, high = low - 0.05, high + 0.05
    ax.set_ylim(10**low, 10**high)


def _power_ticks(ax, h):
    exponents = np.arange(round(math.log2(h.min())), round(math.log2(h.max())) + 1)
    step = 1 if len(exponents) <= 5 else 2 if len(exponents) <= 13 else 4
    ax.xaxis.set_major_locator(FixedLocator(2.0 ** exponents[::-1][::step]))
    ax.xaxis.set_minor_locator(FixedLocator(2.0**exponents) if step > 1 else NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"${style.number(x, steps=True)}$"))
    ax.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))


def _label(group):
    a = group.attributes
    label = style.plain(a.get("scheme_label", group.scheme))
    if not math.isfinite(a.get("order", math.nan)):
        return f"{label}: order not resolved"
    return f"{label}: order {a['order']:.2f} [{a['order_ci'][0]:.2f}, {a['order_ci'][1]:.2f}]"


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
