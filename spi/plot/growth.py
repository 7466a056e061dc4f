"""Panels of the growth of Casimir errors with the number of steps."""

import math

import numpy as np
from matplotlib.lines import Line2D

from . import layout, style
from .errors import SLOPE, limits, rules

FLOOR = 1e-11  #: errors of what keeps a Casimir but for rounding are held to stay below that
TOP = 1e2  # larger errors are only marked
MARKERS = 9  # along a curve
KEPT = 1e-6  # only a scheme whose errors end below that has reference slopes
STEPS = 3  # step sizes shown at most
SLOPE_LOOKS = (
    {"color": SLOPE, "linestyle": "--", "linewidth": 1.0},
    {"color": SLOPE, "linestyle": ":", "linewidth": 0.8},
)
FLOOR_LOOK = {"color": "#000000", "linestyle": "-.", "linewidth": 0.8}


def growth_panel(ax, groups, c, styles):
    """Root mean square of the relative error of Casimir `c` against the number of steps, and of path 0, thin.

    A line per scheme and step size, with the fitted exponent in the legend.  Slope 1/2 lies just above the errors of
    the scheme that keeps the Casimir best; slope 1 starts with it, and shows what a bias of that size would grow to.
    """
    found = [group for group in groups if c < len(group.coordinates["casimir"])]
    if not found:
        layout.empty(ax, "no Casimir")
        return
    several = max(len(group.coordinates["casimir"]) for group in found) > 1
    symbol = f"C_{c + 1}" if several else "C"
    ax.set(xscale="log", yscale="log", xlabel="number of steps $n$")
    ax.set_ylabel(f"rms of ${symbol}(y_n)\\,/\\,{symbol}(y_0)-1$")
    rules(ax)
    n = np.concatenate([group.coordinates["n"] for group in found])
    ax.set_xlim(n.min() / 1.5, n.max() * 1.5)
    known = np.concatenate([_of(group, "casimir_rms", c).ravel() for group in found])
    known = known[(known > 0) & (known <= TOP)]
    ax.set_ylim(limits(np.append(known, FLOOR)))
    for group in found:
        shown = steps_shown(group)
        for k, i in enumerate(shown):
            colour = layout.shade(styles[group.scheme][1], k, len(shown))
            _curves(ax, group, i, c, styles[group.scheme][0], colour, 3 - 0.1 * k)
    _slopes(ax, found, c)
    ax.axhline(FLOOR, zorder=1, **FLOOR_LOOK)
    layout.legend_below(ax)


def steps_shown(group):
    """Numbers of the step sizes that have lines."""
    return layout.spread(len(group.coordinates["h"]), STEPS)


def marks(groups):
    """Entries of a legend for what is no curve of a scheme."""
    found = [(Line2D([], [], **look), f"slope {text}") for text, look in zip(("1/2", "1"), SLOPE_LOOKS, strict=True)]
    found.append((Line2D([], [], **FLOOR_LOOK), f"${style.power(FLOOR)}$"))
    found.append((Line2D([], [], color="#777777", linewidth=0.6), "thin: path 0"))
    if any((~(group.variables["casimir_rms"][1] <= TOP)).any() for group in groups):
        found.append(layout.mark("^", f"not finite, or above ${style.power(TOP)}$"))
    return found


def _of(group, name, c):
    return np.asarray(group.variables[name][1][..., c], float)


def _slopes(ax, groups, c):
    """Reference slopes at the errors of the scheme with the smallest ones in the end."""
    ends = [(values[-1], group.coordinates["n"], values) for group in groups for values in _of(group, "casimir_rms", c)]
    kept = [end for end in ends if 0 < end[0] < KEPT]
    if not kept:
        return
    _, n, values = min(kept, key=lambda end: end[0])
    x = np.array(ax.get_xlim())
    first = 1.7 * (values / np.sqrt(n)).max() * np.sqrt(x[0])
    ax.plot(x, first * np.sqrt(x / x[0]), zorder=1, **SLOPE_LOOKS[0])
    ax.plot(x, first * x / x[0], zorder=1, **SLOPE_LOOKS[1])


def _curves(ax, group, i, c, marker, colour, zorder):
    """The lines of one scheme at one step size, with a mark where the first leaves the panel."""
    n, top = group.coordinates["n"], ax.get_ylim()[1]
    rms, one = _of(group, "casimir_rms", c)[i], np.abs(_of(group, "casimir_one", c)[i])
    shown, single = (np.where((values > 0) & (values <= top), values, np.nan) for values in (rms, one))
    every = max(1, len(n) // MARKERS)
    look = {"color": colour, "marker": marker, "markersize": 4.5, "markevery": (i % every, every)}
    ax.plot(n, shown, label=_label(group, i, c), zorder=zorder, **look)
    ax.plot(n, single, color=colour, linewidth=0.5, zorder=2)
    above = ~(rms <= top)
    layout.edge_marks(ax, n[above][:1], rms[above][:1], colour)


def _label(group, i, c):
    p, low, high = (float(group.variables[name][1][i, c]) for name in ("growth", "growth_low", "growth_high"))
    text = f"{style.label(group)}, $h={style.number(float(group.coordinates['h'][i]), steps=True)}$"
    return f"{text}: $n^{{{p:.2f}}}$ [{low:.2f}, {high:.2f}]" if math.isfinite(p) else text
