"""The figure of statistics: means with bands, quantiles, differences, variances, autocorrelations, histograms, maps."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import KNOWN, cell_edges, dress_function, dress_map, histogram
from spi.statistics.cells import heights, mollweide

from .results import Statistics

SIZE = (3.4, 2.7)  # inches of a panel
MAP = (3.6, 2.3)  # inches of a map
_MOST_MARKERS = 12
_MOST_COLUMNS = 4
SOME_KNOWN: dict[str, Any] = {"color": "black", "marker": "+", "markersize": 8, "linestyle": "none", "zorder": 4}


def draw(title: str, cases: Sequence[Sequence[Statistics]]) -> Figure:
    """The figure of a study of kind statistics: for each case lines of panels, one panel for each function."""
    return layout.of_cases(title, cases, lambda reading: style.facts(reading, "samples", "step"), _lines)


def _lines(readings: Sequence[Statistics], looks: style.Looks) -> list[layout.Line]:
    each = (_panels(readings, looks), SIZE), (_maps(readings), MAP)
    curves, maps = (layout.in_lines(one, layout.even(len(one), _MOST_COLUMNS), size, least=2.4) for one, size in each)
    if curves:
        curves[-1] = curves[-1]._replace(legend=[_entries(readings, looks)])
    return [*curves, *maps]


def _panels(readings: Sequence[Statistics], looks: style.Looks) -> list[layout.Panel]:
    """Those of each function, of which its share of paths that have passed has no law, and of correlations."""
    first = readings[0]
    every = range(len(first.functions))
    of_values = [f for f in every if first.passages is None or np.isnan(first.passages.time[f])]
    passages = [f for f in every if f not in of_values]
    shown: dict[str, tuple[Callable[..., None], Sequence[int]]] = {
        "mean": (_over_time, every),
        "difference": (_differences, [f for f in every if _known(first.difference, f)]),
        "histogram": (_densities, of_values if first.histogram else ()),
        "passages": (_passage_densities, passages if first.passages and first.passages.density is not None else ()),
        "variance": (_variances, of_values if first.variance is not None else ()),
        "autocorrelation": (_autocorrelations, [f for f in every if _known(first.autocorrelation, f)]),
    }
    panels: list[layout.Panel] = [
        partial(panel, readings=readings, f=f, looks=looks)
        for word, (panel, functions) in shown.items()
        if ("histogram" if word == "passages" else word) in first.panels
        for f in functions
    ]
    if "correlations" in first.panels and first.covariance is not None and len(every) > 1:
        panels.append(partial(_correlations, reading=first))
    return panels


def _maps(readings: Sequence[Statistics]) -> list[layout.Panel]:
    """Those of each scheme at each time, with the same colours for all schemes."""
    found = [(one, one.density_map) for one in readings if one.density_map and "maps" in one.panels]
    if not found:
        return []
    highest, law = np.max([one.density.max(axis=(1, 2)) for _, one in found], axis=0), found[0][1].law
    panels = [
        partial(map_panel, reading=reading, m=m, highest=float(highest[m]) or 1.0)
        for reading, one in found
        for m in range(len(one.t))
    ]
    known = [] if law is None else [partial(law_panel, reading=found[0][0], highest=float(highest[-1]) or 1.0)]
    return [*panels, *known]


def _known(values: np.ndarray | None, f: int) -> bool:
    return values is not None and bool(np.isfinite(values[f]).any())


def _entries(readings: Sequence[Statistics], looks: style.Looks) -> list[layout.Entry]:
    found = [layout.scheme_entry(reading.about, looks, markerfacecolor="none") for reading in readings]
    if "mean" not in readings[0].panels:
        return found
    found.append((Line2D([], [], color="#777777", linewidth=5, alpha=0.35), "95 % band of all means at once"))
    if (quantiles := readings[0].quantiles) is not None:
        levels = ", ".join(f"{level:g}" for level in quantiles.level)
        found.append((Line2D([], [], color="#777777", linewidth=0.8, linestyle=":"), f"quantiles {levels}"))
    if readings[0].reference is not None:
        finer = readings[0].reference_step
        text = f"reference: known, or with $h={style.number(finer, steps=True)}$" if finer else "reference mean"
        found.append((Line2D([], [], **KNOWN), text))
        if any(np.isfinite(one).any() and not np.isfinite(one).all() for one in readings[0].reference):
            found.append((Line2D([], [], **SOME_KNOWN), "known at some times"))
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
        with np.errstate(invalid="ignore"):
            ends = reading.mean[f] - half, reading.mean[f] + half
        ax.fill_between(t, *ends, color=look["color"], alpha=0.3, linewidth=0)
        if reading.quantiles:
            ax.plot(t, reading.quantiles.quantile[f], color=look["color"], linewidth=0.8, linestyle=":")
    if (known := readings[0].reference) is not None and (there := np.isfinite(known[f])).any():
        ax.plot(readings[0].t[there], known[f, there], **(KNOWN if there.all() else SOME_KNOWN))
    dress_function(ax, readings[0], f, "time $t$", "mean")


def _variances(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    for one in readings:
        _with_intervals(ax, one, one.t, one.variance, one.variance_stderr, f, looks)
    dress_function(ax, readings[0], f, "time $t$", "variance")


def _differences(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    ax.axhline(0, **KNOWN)
    for one in readings:
        _with_intervals(ax, one, one.t, one.difference, one.difference_stderr, f, looks)
    dress_function(ax, readings[0], f, "time $t$", "mean less reference")


def _autocorrelations(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    ax.axhline(0, **KNOWN | {"linewidth": 0.6})
    for one in readings:
        if one.since is not None:
            lag = one.t - one.since[f]
            _with_intervals(ax, one, lag, one.autocorrelation, one.autocorrelation_stderr, f, looks)
            since = style.number(float(one.since[f]))
            dress_function(ax, one, f, f"lag $s$, from $t={since}$", "autocorrelation")


def _with_intervals(
    ax: Axes,
    one: Statistics,
    x: np.ndarray,
    values: np.ndarray | None,
    errors: np.ndarray | None,
    f: int,
    looks: style.Looks,
) -> None:
    """A line through what is known of a function, with 95 % intervals."""
    if values is None or errors is None:
        return
    there = np.isfinite(values[f])
    x, value, half = x[there], values[f, there], one.interval * errors[f, there]
    look = _look(one, looks)
    ax.plot(x, value, linewidth=1.1, **look)
    ax.fill_between(x, value - half, value + half, color=look["color"], alpha=0.3, linewidth=0)


def _densities(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    """The histogram at the last time, with 95 % intervals, without empty bins at both ends."""
    for reading in readings:
        if not (found := reading.histogram):
            continue
        cells, density = (found.bin_low[f, -1], found.bin_width[f, -1]), found.density[f, -1]
        colour = looks[reading.about.variant][1]
        histogram(ax, cells, density, found.density_stderr[f, -1], colour, np.zeros_like(density))
    ax.set_ylim(bottom=0)
    dress_function(ax, readings[0], f, None, f"density at $t={readings[0].t[-1]:.4g}$")


def _passage_densities(ax: Axes, readings: Sequence[Statistics], f: int, looks: style.Looks) -> None:
    """The density of first times, with 95 % intervals."""
    for reading in readings:
        found = reading.passages
        if found is None or found.density is None or found.density_stderr is None:
            continue
        if found.from_t is None or found.until_t is None:
            continue
        colour = looks[reading.about.variant][1]
        ax.stairs(found.density[f], np.append(found.from_t, found.until_t[-1]), color=colour, linewidth=1.0)
        middle, half = (found.from_t + found.until_t) / 2, reading.interval * np.nan_to_num(found.density_stderr[f])
        ax.errorbar(middle, found.density[f], half, color=colour, linestyle="none", elinewidth=0.6)
    dress_function(ax, readings[0], f, "first time $t$", "density")


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
        text = f"{matrix[i, j]:.2f}".replace("-", "\N{MINUS SIGN}")
        colour = "white" if abs(matrix[i, j]) > 0.6 else "black"
        ax.text(j, i, text, color=colour, ha="center", va="center", fontsize=7)
    names = [style.plain(name) for name in reading.functions]
    ax.set_xticks(range(count), names, rotation=30, ha="right", rotation_mode="anchor")
    ax.set_yticks(range(count), names)
    ax.set_title(f"correlations at $t={reading.t[-1]:.4g}$, {style.label(reading.about)}")


_COLOURS = "YlGnBu"  # white for no paths
_FINER = 4  # points between the edges of cells, which are curved


def map_panel(ax: Axes, reading: Statistics, m: int, highest: float) -> None:
    """The density at one of the times, with colours up to `highest`."""
    found = reading.density_map
    if found is None:
        return
    look: dict[str, Any] = {"cmap": _COLOURS, "vmin": 0.0, "vmax": highest, "rasterized": True}
    density = np.where(found.density[m] > 0, found.density[m], np.nan)
    if found.is_sphere:  # cells of equal area on the sphere are such cells of an ellipse
        density = np.repeat(np.repeat(density, _FINER, axis=0), _FINER, axis=1)
        sides, longitude = cell_edges(found, m)[0], cell_edges(found, m, _FINER)[1]
        z = np.append([heights(*side, _FINER + 1)[:-1] for side in pairwise(sides.tolist())], sides[-1])
        places = mollweide(*np.meshgrid(z, longitude, indexing="ij"))
        mesh = ax.pcolormesh(*places, density, **look)
    else:
        edges = cell_edges(found, m)
        mesh = ax.pcolormesh(*edges, density.T, **look)
        used = [np.flatnonzero(np.isfinite(density).any(axis=across)) for across in (1, 0)]
        if used[0].size:  # as far as there are paths
            xlim, ylim = ((edge[one[0]], edge[one[-1] + 1]) for edge, one in zip(edges, used, strict=True))
            ax.set(xlim=xlim, ylim=ylim)
    dress_map(ax, reading.about, found, m, mesh)


def law_panel(ax: Axes, reading: Statistics, highest: float) -> None:
    """The Gibbs law beside the last of the maps, in its colours."""
    found = reading.density_map
    if found is not None and found.law is not None:
        last = len(found.t) - 1
        density = np.broadcast_to(found.law, found.density.shape)
        map_panel(ax, replace(reading, density_map=replace(found, density=density)), last, highest)
        ax.set_title("Gibbs law, exp($-H/T$)", pad=14)
