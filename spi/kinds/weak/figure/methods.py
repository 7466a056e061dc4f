"""Panels that compare the estimators of one weak error: accuracy, and the estimates, against processor time."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.markers import CARETDOWN, CARETUP

from spi.drawing import style
from spi.drawing.axes import HUGE, INTERVAL, legend_under, limits, rules
from spi.drawing.layout import Panel

from ..estimators import ESTIMATORS, label_of
from ..results import WeakErrors


class Run(NamedTuple):
    """An estimator's estimates of one error as its work grows."""

    estimator: str
    seconds: np.ndarray
    error: np.ndarray
    accuracy: np.ndarray  #: standard error; of what is not sampled the bound of the numerical error
    exact: bool  #: whether nothing is sampled

    @property
    def constant(self) -> float:
        """accuracy (seconds)^(1/2), of all its work."""
        return self.accuracy[-1] * math.sqrt(self.seconds[-1])


def panels(readings: Sequence[WeakErrors], f: int, title: str) -> list[list[Panel]]:
    """A line of two panels for each scheme of which plain results for the first so many paths are stored."""
    lines: list[list[Panel]] = []
    for variant in dict.fromkeys(reading.about.variant for reading in readings):
        of = {reading.about.estimator: reading for reading in readings if reading.about.variant == variant}
        if "plain" not in of or not of["plain"].prefixes:
            continue
        h = of["plain"].h
        middle = int(np.argmin(np.abs(np.log2(h) - 0.5 * (np.log2(h.min()) + np.log2(h.max())))))
        runs = [run for run in (_run(of[name], f, middle) for name in ESTIMATORS if name in of) if len(run.seconds)]
        label = style.label(of["plain"].about)
        what = "\n".join(filter(None, [title, f"{label}, $h={style.number(h[middle], steps=True)}$"]))
        lines.append([partial(panel, runs=runs, what=what) for panel in (accuracy_panel, estimates_panel)])
    return lines


def _run(reading: WeakErrors, f: int, i: int) -> Run:
    """The estimates at step size number i, of all stages with less work and of the whole."""
    last = reading.sampled.error_stderr if reading.sampled else reading.half
    points = [(reading.cpu_seconds, reading.error[f, i], last[f, i])]
    if reading.stages:
        each = zip(reading.stages.cpu_seconds, reading.stages.error, reading.stages.error_stderr, strict=True)
        less = [(seconds, error[f, i], stderr[f, i]) for seconds, error, stderr in each]
        points = [*(point for point in less if point[0] < reading.cpu_seconds), *points]
    found = np.array(points, float)
    drawable = (np.abs(found) < HUGE).all(axis=1) & (found[:, [0, 2]] > 1 / HUGE).all(axis=1)
    seconds, error, accuracy = found[drawable].T
    return Run(reading.about.estimator, seconds, error, accuracy, exact=reading.unsampled is not None)


def accuracy_panel(ax: Axes, runs: Sequence[Run], what: str) -> None:
    """Standard errors against processor time, with lines of slope -1/2."""
    ax.set(xscale="log", yscale="log", xlabel="processor time (s)", title=f"{what}: accuracy")
    ax.set_ylabel("standard error of the weak error")
    rules(ax)
    plain = next((run for run in runs if run.estimator == "plain"), None)
    seconds = np.concatenate([run.seconds for run in runs] or [np.ones(1)])
    ends = np.array([seconds.min() / 2, seconds.max() * 2])
    sampled = np.concatenate([run.accuracy for run in runs if not run.exact] or [np.ones(1)])
    low, high = limits(sampled)
    for run in runs:
        marker, colour = ESTIMATORS[run.estimator].keys.LOOK
        told = [label_of(run.estimator)]
        if run.exact:
            told.append(f"bound ${style.number(float(f'{run.accuracy[-1]:.1e}'))}$")
        if plain and run is not plain:
            told.append(f"{_times((plain.constant / run.constant) ** 2)} as fast as plain")
        look: dict[str, Any] = {"marker": marker, "color": colour, "linestyle": "none", "label": ", ".join(told)}
        if run.exact:
            low = max(low / 300, min(low, run.accuracy[-1] / 2))
            at = np.maximum(run.accuracy, low)
            ax.plot(run.seconds, at, markersize=10, clip_on=False, zorder=4, **look)
            if run.accuracy[-1] < low:
                below: dict[str, Any] = {"textcoords": "offset points", "xytext": (4, 12), "ha": "right", "fontsize": 8}
                ax.annotate(f"far below:\n{told[1]}", (run.seconds[-1], low), **below)
            continue
        ax.plot(run.seconds, run.accuracy, **look)
        ax.plot(ends, run.constant / np.sqrt(ends), color=colour, linewidth=0.9)
    ax.set(xlim=ends, ylim=(low, high))
    ax.plot([], [], color="#777777", linewidth=0.9, label="slope $-$1/2")
    legend_under(ax)


def estimates_panel(ax: Axes, runs: Sequence[Run], what: str) -> None:
    """Estimates of the error with 95 % intervals against processor time, over the exact value."""
    ax.set(xscale="log", xlabel="processor time (s)", title=f"{what}: estimates")
    ax.set_ylabel(r"weak error  $\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))$")
    rules(ax)
    found = [run for run in runs if not run.exact]
    if found:
        ax.set_ylim(_window(found))
    for run in runs:
        marker, colour = ESTIMATORS[run.estimator].keys.LOOK
        if run.exact:
            ax.axhline(run.error[-1], color=colour, linewidth=1.0, label=label_of(run.estimator), zorder=1)
            continue
        look: dict[str, Any] = {"marker": marker, "color": colour, "linestyle": "none", "elinewidth": 0.9, "capsize": 2}
        ax.errorbar(run.seconds, run.error, INTERVAL * run.accuracy, label=label_of(run.estimator), **look)
        edge: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 4}
        low, high = ax.get_ylim()
        for outside, mark, place in ((run.error < low, CARETDOWN, 0), (run.error > high, CARETUP, 1)):
            if outside.any():
                at = np.full(outside.sum(), place)
                ax.plot(run.seconds[outside], at, marker=mark, color=colour, linestyle="none", **edge)
    legend_under(ax)


def _window(runs: Sequence[Run]) -> tuple[float, float]:
    """Limits about the best estimate in which the narrowest intervals can be seen and the widest need not fit."""
    best = min(runs, key=lambda run: run.accuracy[-1])
    half = INTERVAL * np.concatenate([run.accuracy for run in runs])
    reach = max((np.abs(run.error - best.error[-1]) + INTERVAL * run.accuracy).max() for run in runs)
    room = 1.05 * min(reach, 4 * math.sqrt(half.min() * half.max()))
    return best.error[-1] - room, best.error[-1] + room


def _times(ratio: float) -> str:
    """A ratio with two digits, as a power of ten if it is large."""
    if not math.isfinite(ratio):
        return "?"
    if 1e-2 < ratio < 1e4:
        return f"{float(f'{ratio:.2g}'):g} times"
    return f"${style.number(float(f'{ratio:.1e}'))}$ times"
