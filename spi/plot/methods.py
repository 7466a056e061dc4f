"""Panels that compare the estimators of one weak error: accuracy, and the estimates, against processor time."""

import math
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.markers import CARETDOWN, CARETUP

from . import style
from .errors import HUGE, INTERVAL, legend_under, limits, rules

#: Marker and colour of each estimator.
LOOKS = {"plain": ("o", "#0072B2"), "multilevel": ("D", "#D55E00"), "kolmogorov": ("*", "#000000")}


class Run(NamedTuple):
    """An estimator's estimates of one error as its work grows."""

    estimator: str
    seconds: np.ndarray
    error: np.ndarray
    accuracy: np.ndarray  #: standard error; of what is not sampled the bound of the numerical error

    @property
    def constant(self):
        """accuracy (seconds)^(1/2), of all its work."""
        return self.accuracy[-1] * math.sqrt(self.seconds[-1])


def panels(groups, f, title):
    """A line of two panels for each scheme of which plain results for the first so many paths are stored."""
    lines = []
    for scheme in dict.fromkeys(group.scheme for group in groups):
        of = {group.estimator: group for group in groups if group.scheme == scheme}
        if "plain" not in of or "prefix_cpu_seconds" not in of["plain"].variables:
            continue
        h = of["plain"].coordinates["h"]
        middle = int(np.argmin(np.abs(np.log2(h) - 0.5 * (np.log2(h.min()) + np.log2(h.max())))))
        runs = [run for run in (_run(of[name], f, middle) for name in LOOKS if name in of) if len(run.seconds)]
        label = style.label(of["plain"])
        what = "\n".join(filter(None, [title, f"{label}, $h={style.number(h[middle], steps=True)}$"]))
        lines.append([partial(panel, runs=runs, what=what) for panel in (accuracy_panel, estimates_panel)])
    return lines


def _run(group, f, i):
    v, a = group.arrays, group.attributes
    last = v["error_bound" if group.estimator == "kolmogorov" else "error_stderr"][f, i]
    points = [(a.get("cpu_seconds", math.nan), v["error"][f, i], last)]
    before = {"plain": "prefix", "multilevel": "history"}.get(group.estimator)
    if f"{before}_cpu_seconds" in v:
        stages = (v[f"{before}_cpu_seconds"], v[f"{before}_error"][:, f, i], v[f"{before}_error_stderr"][:, f, i])
        points = [*(point for point in zip(*stages, strict=True) if point[0] < points[0][0]), *points]
    found = np.array(points, float)
    drawable = (np.abs(found) < HUGE).all(axis=1) & (found[:, [0, 2]] > 1 / HUGE).all(axis=1)
    seconds, error, accuracy = found[drawable].T
    return Run(group.estimator, seconds, error, accuracy)


def accuracy_panel(ax, runs, what):
    """Standard errors against processor time, with lines of slope -1/2."""
    ax.set(xscale="log", yscale="log", xlabel="processor time (s)", title=f"{what}: accuracy")
    ax.set_ylabel("standard error of the weak error")
    rules(ax)
    plain = next((run for run in runs if run.estimator == "plain"), None)
    seconds = np.concatenate([run.seconds for run in runs] or [[1.0]])
    ends = np.array([seconds.min() / 2, seconds.max() * 2])
    sampled = np.concatenate([run.accuracy for run in runs if run.estimator != "kolmogorov"] or [[1.0]])
    low, high = limits(sampled)
    for run in runs:
        marker, colour = LOOKS[run.estimator]
        told = [style.ESTIMATORS[run.estimator]]
        if run.estimator == "kolmogorov":
            told.append(f"bound ${style.number(float(f'{run.accuracy[-1]:.1e}'))}$")
        if plain and run is not plain:
            told.append(f"{_times((plain.constant / run.constant) ** 2)} as fast as plain")
        look = {"marker": marker, "color": colour, "linestyle": "none", "label": ", ".join(told)}
        if run.estimator == "kolmogorov":
            low = max(low / 300, min(low, run.accuracy[-1] / 2))
            at = np.maximum(run.accuracy, low)
            ax.plot(run.seconds, at, markersize=10, clip_on=False, zorder=4, **look)
            if run.accuracy[-1] < low:
                below = {"textcoords": "offset points", "xytext": (4, 12), "ha": "right", "fontsize": 8}
                ax.annotate(f"far below:\n{told[1]}", (run.seconds[-1], low), **below)
            continue
        ax.plot(run.seconds, run.accuracy, **look)
        ax.plot(ends, run.constant / np.sqrt(ends), color=colour, linewidth=0.9)
    ax.set(xlim=ends, ylim=(low, high))
    ax.plot([], [], color="#777777", linewidth=0.9, label="slope $-$1/2")
    legend_under(ax)


def estimates_panel(ax, runs, what):
    """Estimates of the error with 95 % intervals against processor time, over the exact value."""
    ax.set(xscale="log", xlabel="processor time (s)", title=f"{what}: estimates")
    ax.set_ylabel(r"weak error  $\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))$")
    rules(ax)
    found = [run for run in runs if run.estimator != "kolmogorov"]
    if found:
        ax.set_ylim(_window(found))
    for run in runs:
        marker, colour = LOOKS[run.estimator]
        if run.estimator == "kolmogorov":
            ax.axhline(run.error[-1], color=colour, linewidth=1.0, label=style.ESTIMATORS["kolmogorov"], zorder=1)
            continue
        look = {"marker": marker, "color": colour, "linestyle": "none", "elinewidth": 0.9, "capsize": 2}
        ax.errorbar(run.seconds, run.error, INTERVAL * run.accuracy, label=style.ESTIMATORS[run.estimator], **look)
        for outside, mark, place in zip(_outside(run, ax.get_ylim()), (CARETDOWN, CARETUP), (0, 1), strict=True):
            edge = {"transform": ax.get_xaxis_transform(), "clip_on": False, "color": colour, "linestyle": "none"}
            if outside.any():
                ax.plot(run.seconds[outside], np.full(outside.sum(), place), marker=mark, zorder=4, **edge)
    legend_under(ax)


def _window(runs):
    """Limits about the best estimate in which the narrowest intervals can be seen and the widest need not fit."""
    best = min(runs, key=lambda run: run.accuracy[-1])
    half = INTERVAL * np.concatenate([run.accuracy for run in runs])
    reach = max((np.abs(run.error - best.error[-1]) + INTERVAL * run.accuracy).max() for run in runs)
    room = 1.05 * min(reach, 4 * math.sqrt(half.min() * half.max()))
    return best.error[-1] - room, best.error[-1] + room


def _outside(run, limits):
    return run.error < limits[0], run.error > limits[1]


def _times(ratio):
    """A ratio with two digits, as a power of ten if it is large."""
    if not math.isfinite(ratio):
        return "?"
    if 1e-2 < ratio < 1e4:
        return f"{float(f'{ratio:.2g}'):g} times"
    return f"${style.number(float(f'{ratio:.1e}'))}$ times"
