"""Panels that compare the law of long paths with the exact stationary law."""

import numpy as np
from matplotlib.lines import Line2D

from . import layout, style
from .errors import INTERVAL, error_axes, limits, rules

MOST = 4  # variables shown
ZERO = 2.0  # standard errors: up to these a distance is statistically zero
NARROWEST, WIDEST = 0.03, 0.6  # deviations of a density from 1 that the axis reaches at least, and at most
APART = 0.006  # between the markers of two schemes in one bin
FAR = 6.0  # standard errors: a mean further from the exact value is only marked


def chosen(groups):
    """The variables shown: all, or of many the first, the second and the last two."""
    names = list(dict.fromkeys(name for group in groups for name in group.coordinates["variable"].tolist()))
    return names if len(names) <= MOST else [*names[:2], *names[-2:]]


def law_step(group):
    """Number of the largest step size at which all paths are finite; None if there is none."""
    finite = np.flatnonzero(group.variables["nonfinite"][1] == 0)
    return int(finite[np.argmax(group.coordinates["h"][finite])]) if len(finite) else None


def scheme_row(groups, styles, word):
    """The entries of the legend of a line of panels: the schemes, of the law with the step size, and one more."""
    row = []
    for group in groups:
        marker, colour = styles[group.scheme]
        at, text = law_step(group), style.label(group)
        if word == "law":
            text += ": paths lost at all $h$" if at is None else f", {_step(group, at)}"
        row.append((Line2D([], [], marker=marker, color=colour, markersize=5, linewidth=0.9), text))
    if word == "law":
        return [*row, (Line2D([], [], color="black", linewidth=0.9), "exact")]
    return [*row, layout.mark("o", "hollow: zero within 2 standard errors", markerfacecolor="none", alpha=0.6)]


def _step(group, i):
    return f"$h={style.number(float(group.coordinates['h'][i]), steps=True)}$"


def _at(group, name):
    return group.coordinates["variable"].tolist().index(name)


def _densities(groups, name):
    """(group, frequency over exact probability, half the 95 % interval) of each scheme, at its :func:`law_step`."""
    for group in groups:
        i = law_step(group)
        if i is not None and name in group.coordinates["variable"]:
            values, stderr = (group.variables[what][1][i, _at(group, name)] for what in ("fraction", "fraction_stderr"))
            yield group, len(values) * values, INTERVAL * len(values) * stderr


def law_limits(groups, names):
    """Limits of the axis of densities, about 1: all of the best scheme, and of the others what is not far away."""
    reach = {}
    for name in names:
        for group, values, half in _densities(groups, name):
            reach[group.scheme] = max(reach.get(group.scheme, 0.0), float(np.nanmax(np.abs(values - 1) + half)))
    if not reach:
        return 0.0, 2.0
    best = min(reach.values())
    room = 1.08 * max(NARROWEST, best, min(max(reach.values()), max(WIDEST, 3 * best)))
    return 1 - room, 1 + room


def law_panel(ax, groups, name, first, limits, styles):
    """Frequency over exact probability in bins of equal probability, at the largest step size that keeps all paths."""
    _begin(ax, name, first, "frequency / exact")
    ax.set(xlabel="exact distribution function", xlim=(0, 1), ylim=limits)
    ax.set_xticks([0, 0.5, 1], ["0", "1/2", "1"])
    rules(ax)
    ax.axhline(1, color="black", linewidth=0.9, zorder=1)
    found = list(_densities(groups, name))
    for k, (group, values, half) in enumerate(found):
        marker, colour = styles[group.scheme]
        x = (np.arange(len(values)) + 0.5) / len(values) + APART * (k - (len(found) - 1) / 2)
        look = {"marker": marker, "color": colour, "markersize": 3.5, "linewidth": 0.7, "elinewidth": 0.7}
        inside = (values >= limits[0]) & (values <= limits[1])
        ax.errorbar(x, np.where(inside, values, np.nan), half, zorder=3, **look)
        layout.edge_marks(ax, x[~inside], values[~inside], colour)


def _begin(ax, name, first, label):
    ax.set_title(f"${style.formula(name)}$")
    if first:
        ax.set_ylabel(label)
    else:
        ax.tick_params(labelleft=False)


def _distances(groups, name):
    """(group, distance, standard error), arrays (h,), of each scheme."""
    for group in groups:
        if name in group.coordinates["variable"]:
            at = _at(group, name)
            yield group, *(group.variables[what][1][:, at] for what in ("law_distance", "law_distance_stderr"))


def distance_limits(groups, names):
    """Limits of the axis of distances: all of them, and the sampling errors."""
    known = []
    for name in names:
        for _, value, stderr in _distances(groups, name):
            known += [value, np.maximum(value - INTERVAL * stderr, stderr)]
    known = np.concatenate(known)
    known = known[np.isfinite(known) & (known > 0)]
    return limits(known if known.size else np.array([1.0]))


def distance_panel(ax, groups, name, first, limits, styles):
    """Largest difference of the distribution functions against the step size, hollow where it is statistically zero."""
    found = list(_distances(groups, name))
    error_axes(ax, np.concatenate([group.coordinates["h"] for group, _, _ in found]))
    _begin(ax, name, first, r"$\max\,|F_h-F|$")
    ax.set_ylim(limits)
    for group, value, stderr in found:
        marker, colour = styles[group.scheme]
        _points(ax, group.coordinates["h"], value, stderr, {"marker": marker, "color": colour, "markersize": 5})


def _points(ax, h, value, stderr, look):
    bottom, top = ax.get_ylim()
    inside = (value >= bottom) & (value <= top)
    ax.plot(h, np.where(inside, value, np.nan), color=look["color"], linewidth=0.9, alpha=0.6, zorder=2)
    zero = ~(value > ZERO * stderr)
    for which, fill in ((inside & ~zero, {}), (inside & zero, {"markerfacecolor": "none", "alpha": 0.6})):
        if which.any():
            up = INTERVAL * np.where(np.isfinite(stderr), stderr, 0.0)[which]
            bars = np.array([np.minimum(up, value[which] - bottom), up])
            ax.errorbar(h[which], value[which], bars, linestyle="none", elinewidth=0.8, zorder=3, **look | fill)
    layout.edge_marks(ax, h, value, look["color"])


def moments_panel(ax, groups, styles):
    """Means less exact values in standard errors, of each scheme at the largest step size that keeps all paths."""
    names = list(dict.fromkeys(name for group in groups for name in group.coordinates["moment"].tolist()))
    ax.set(xlim=(-0.6, len(names) - 0.4), ylim=(-FAR, FAR), ylabel="(mean $-$ exact) / standard error")
    ax.set_xticks(range(len(names)), [f"${style.formula(name)}$" for name in names])
    rules(ax)
    ax.axhspan(-INTERVAL, INTERVAL, color="#eeeeee", linewidth=0, zorder=0.2, label="95 % if the law is exact")
    ax.axhline(0, color="black", linewidth=0.9, zorder=1)
    far = False
    for k, group in enumerate(groups):
        i = law_step(group)
        if i is None:
            continue
        marker, colour = styles[group.scheme]
        v = {what: group.variables[what][1] for what in ("mean", "mean_stderr", "mean_exact")}
        with np.errstate(divide="ignore", invalid="ignore"):
            z = (v["mean"][i] - v["mean_exact"]) / v["mean_stderr"][i]
        x = np.array([names.index(name) for name in group.coordinates["moment"].tolist()])
        x = x + 0.12 * (k - (len(groups) - 1) / 2)
        look = {"marker": marker, "color": colour, "markersize": 5, "linestyle": "none"}
        inside = np.abs(z) <= FAR
        ax.plot(x, np.where(inside, z, np.nan), label=f"{style.label(group)}, {_step(group, i)}", zorder=3, **look)
        layout.edge_marks(ax, x[~inside], z[~inside], colour)
        far |= not inside.all()
    if far:
        ax.plot([], [], "^", color="black", label=f"further away than {FAR:g}, or not finite")
    layout.legend_below(ax)
