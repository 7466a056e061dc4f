"""The figure of statistics: means with bands and quantiles over time, variances, and histograms at the last time."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import INTERVAL, rules

from .results import Statistics

SIZE = (3.4, 2.7)  # inches of a panel
_MOST_MARKERS = 12
_MOST_COLUMNS = 4
KNOWN: dict[str, Any] = {"color": "black", "linewidth": 1.0, "linestyle": (0, (4, 3)), "zorder": 4}


def draw(title: str, cases: Sequence[Sequence[Statistics]]) -> Figure:
    """The figure of a study of kind statistics: for each case lines of panels, one panel for each function."""
    looks = style.looks(cases)
    shared, own = style.split_facts([style.facts(readings[0], "samples", "step") for readings in cases])
    lines = []
    for readings, facts in zip(cases, own, strict=True):
        panels = _panels(readings, looks)
        found = [
            layout.Line(panels[i : i + _MOST_COLUMNS], SIZE, least=2.4) for i in range(0, len(panels), _MOST_COLUMNS)
        ]
        width = len(found[0].panels) * SIZE[0]
        case = layout.case_title(readings[0].about, facts, width) if len(cases) > 1 else ""
        found[0] = found[0]._replace(title=case)
        found[-1] = found[-1]._replace(legend=[_entries(readings, looks)])
        lines += found
    return layout.arranged(title, lines, shared)


def _panels(readings: Sequence[Statistics], looks: style.Looks) -> list[layout.Panel]:
    """Of each function its panels over time, and behind them those of histograms, variances and correlations."""
    first = readings[0]
    told: dict[str, Any] = {"readings": readings, "looks": looks}
    every = range(len(first.functions))
    panels: list[layout.Panel] = [partial(_over_time, f=f, **told) for f in every]
    of_values = [f for f in every if first.corrected is None or np.isnan(first.corrected.share[f]).all()]
    if first.histogram:
        panels += [partial(_densities, f=f, **told) for f in of_values]
    if first.variance is not None:
        panels += [partial(_variances, f=f, **told) for f in of_values]
    if first.covariance is not None and len(every) > 1:
        panels.append(partial(_correlations, reading=first))
    return panels


def _entries(readings: Sequence[Statistics], looks: style.Looks) -> list[layout.Entry]:
    found: list[layout.Entry] = []
    for reading in readings:
        marker, colour = looks[reading.about.variant]
        found.append((Line2D([], [], color=colour, marker=marker, markerfacecolor="none"), style.label(reading.about)))
    found.append((Line2D([], [], color="#777777", linewidth=5, alpha=0.35), "95 % band of all means at once"))
    if (quantiles := readings[0].quantiles) is not None:
        levels = ", ".join(f"{level:g}" for level in quantiles.level)
        found.append((Line2D([], [], color="#777777", linewidth=0.8, linestyle=":"), f"quantiles {levels}"))
    if readings[0].corrected:
        found.append(
            (Line2D([], [], color="#777777", linewidth=0.8, linestyle="-."), "passages without the bias of times")
        )
    if readings[0].reference is not None:
        found.append((Line2D([], [], **KNOWN), "known mean"))
    return found


def _look(reading: Statistics, looks: style.Looks) -> dict[str, Any]:
    marker, colour = looks[reading.about.variant]
    every = max(1, len(reading.t) // _MOST_MARKERS)
    return {"color": colour, "marker": marker, "markersize": 4, "markerfacecolor": "none", "markevery": every}


def _over_time(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    """Means with simultaneous bands, and quantiles."""
    for reading in readings:
        look, t = _look(reading, looks), reading.t
        half = reading.band[f] * reading.mean_stderr[f]
        ax.plot(t, reading.mean[f], linewidth=1.1, **look)
        if reading.corrected and (known := np.isfinite(reading.corrected.share[f])).any():
            ax.plot(t[known], reading.corrected.share[f, known], color=look["color"], linewidth=0.8, linestyle="-.")
        ax.fill_between(t, reading.mean[f] - half, reading.mean[f] + half, color=look["color"], alpha=0.3, linewidth=0)
        if reading.quantiles:
            ax.plot(t, reading.quantiles.quantile[f], color=look["color"], linewidth=0.8, linestyle=":")
    if (known := readings[0].reference) is not None and np.isfinite(known[f]).any():
        ax.plot(readings[0].t, known[f], **KNOWN)
    _dress(ax, readings[0], f, "time $t$", "mean")


def _dress(ax: Axes, reading: Statistics, f: int, x: str, what: str) -> None:
    name, text = reading.functions[f], reading.texts[f]
    ax.set(xlabel=x, ylabel=what)
    ax.set_title(style.plain(name if name == text or len(text) > 30 else f"{name}: {text}"))
    rules(ax)


def _variances(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    for reading in readings:
        if reading.variance is None or reading.variance_stderr is None:
            continue
        look, half = _look(reading, looks), INTERVAL * reading.variance_stderr[f]
        value = reading.variance[f]
        ax.plot(reading.t, value, linewidth=1.1, **look)
        ax.fill_between(reading.t, value - half, value + half, color=look["color"], alpha=0.3, linewidth=0)
    _dress(ax, readings[0], f, "time $t$", "variance")


def _densities(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    """The histogram at the last time, with 95 % intervals, without empty bins at both ends."""
    for reading in readings:
        if not (found := reading.histogram):
            continue
        density, width = found.density[f, -1], found.bin_width[f, -1]
        used = np.flatnonzero(density)
        low, high = (used[0], used[-1] + 1) if len(used) else (0, len(density))
        edges = found.bin_low[f, -1] + width * np.arange(low, high + 1)
        colour, half = looks[reading.about.variant][1], INTERVAL * found.density_stderr[f, -1]
        ax.stairs(density[low:high], edges, color=colour, linewidth=1.0)
        middle, chosen = (edges[1:] + edges[:-1]) / 2, slice(low, high)
        ax.errorbar(middle, density[chosen], half[chosen], color=colour, linestyle="none", elinewidth=0.6)
    ax.set_ylim(bottom=0)
    name = readings[0].functions[f]
    _dress(ax, readings[0], f, style.plain(name), f"density at $t={readings[0].t[-1]:.4g}$")


def _correlations(ax: Axes, reading: Statistics) -> None:
    """The matrix of correlations at the last time."""
    if reading.covariance is None:
        return
    matrix = reading.covariance[:, :, -1]
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.diag(matrix))
        matrix = matrix / np.outer(scale, scale)
    count = len(matrix)
    ax.imshow(matrix, vmin=-1, vmax=1, cmap="RdBu_r")
    for i, j in np.ndindex(count, count):
        text, colour = (
            f"{matrix[i, j]:.2f}".replace("-", "\N{MINUS SIGN}"),
            "white" if abs(matrix[i, j]) > 0.6 else "black",
        )
        ax.text(j, i, text, color=colour, ha="center", va="center", fontsize=7)
    names = [style.plain(name) for name in reading.functions]
    ax.set_xticks(range(count), names)
    ax.set_yticks(range(count), names)
    ax.set_title(f"correlations at $t={reading.t[-1]:.4g}$, {style.label(reading.about)}")
