"""Panels that compare the law of long paths with the exact stationary law."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import INTERVAL, error_axes, legend_under, limits, rules

from ..results import Equilibrium, with_laws

MOST = 4  # variables shown
ZERO = 2.0  # standard errors: up to these a distance is statistically zero
NARROWEST, WIDEST = 0.03, 0.6  # deviations of a density from 1 that the axis reaches at least, and at most
APART = 0.006  # between the markers of two schemes in one bin
FAR = 6.0  # standard errors: a mean further from the exact value is only marked


def chosen(names: tuple[str, ...]) -> tuple[str, ...]:
    """The variables shown: all, or of many the first, the second and the last two."""
    return names if len(names) <= MOST else (*names[:2], *names[-2:])


def scheme_entries(readings: Sequence[Equilibrium], looks: style.Looks, word: str) -> list[layout.Entry]:
    """The entries of the legend of a line of panels: the schemes, of the law with the step size, and one more."""
    row = []
    for reading in readings:
        more = ""
        if word == "law":
            more = ": paths diverge at every $h$" if reading.largest_finite is None else f", {_step(reading)}"
        row.append(layout.scheme_entry(reading.about, looks, more, markersize=5, linewidth=0.9))
    if word == "law":
        return [*row, (Line2D([], [], color="black", linewidth=0.9), "exact")]
    return [*row, layout.zero_mark()]


def _step(reading: Equilibrium) -> str:
    return f"$h={style.number(float(reading.h[reading.largest_finite]), steps=True)}$"


def _densities(readings: Sequence[Equilibrium], name: str) -> Iterator[tuple[Equilibrium, np.ndarray, np.ndarray]]:
    """(reading, frequency over exact probability, half the 95 % interval) of each scheme that kept all paths.

    At its largest step size that did.
    """
    for reading, law in with_laws(readings):
        i = reading.largest_finite
        if i is not None:
            at = i, law.variables.index(name)
            values, stderr = law.fraction[at], law.fraction_stderr[at]
            yield reading, len(values) * values, INTERVAL * len(values) * stderr


def law_limits(readings: Sequence[Equilibrium], names: tuple[str, ...]) -> tuple[float, float]:
    """Limits of the axis of densities, about 1: all of the best scheme, and of the others what is not far away."""
    reach: dict[str, float] = {}
    for name in names:
        for reading, values, half in _densities(readings, name):
            farthest, variant = float(np.nanmax(np.abs(values - 1) + half)), reading.about.variant
            reach[variant] = max(reach.get(variant, 0.0), farthest)
    if not reach:
        return 0.0, 2.0
    best = min(reach.values())
    room = 1.08 * max(NARROWEST, best, min(max(reach.values()), max(WIDEST, 3 * best)))
    return 1 - room, 1 + room


def law_panel(
    ax: Axes, readings: Sequence[Equilibrium], name: str, limits: tuple[float, float], looks: style.Looks
) -> None:
    """Frequency over exact probability in bins of equal probability, at the largest step size that keeps all paths."""
    _begin(ax, name, "frequency / exact")
    ax.set(xlabel="exact distribution function", xlim=(0, 1), ylim=limits)
    ax.set_xticks([0, 0.5, 1], ["0", "1/2", "1"])
    rules(ax)
    ax.axhline(1, color="black", linewidth=0.9, zorder=1)
    found = list(_densities(readings, name))
    for k, (reading, values, half) in enumerate(found):
        marker, colour = looks[reading.about.variant]
        x = (np.arange(len(values)) + 0.5) / len(values) + APART * (k - (len(found) - 1) / 2)
        look: dict[str, Any] = {
            "marker": marker,
            "color": colour,
            "markersize": 3.5,
            "linewidth": 0.7,
            "elinewidth": 0.7,
        }
        inside = (values >= limits[0]) & (values <= limits[1])
        ax.errorbar(x, np.where(inside, values, np.nan), half, zorder=3, **look)
        layout.edge_marks(ax, x[~inside], values[~inside], colour)


def _begin(ax: Axes, name: str, label: str) -> None:
    ax.set_title(f"${style.formula(name)}$")
    ax.set_ylabel(label)


def _distances(readings: Sequence[Equilibrium], name: str) -> Iterator[tuple[Equilibrium, np.ndarray, np.ndarray]]:
    """(reading, distance, standard error), arrays (h,), of each scheme."""
    for reading, law in with_laws(readings):
        at = law.variables.index(name)
        yield reading, law.distance[:, at], law.distance_stderr[:, at]


def distance_limits(readings: Sequence[Equilibrium], names: tuple[str, ...]) -> tuple[float, float]:
    """Limits of the axis of distances: all of them, and the sampling errors."""
    each = []
    for name in names:
        for _, value, stderr in _distances(readings, name):
            each += [value, np.maximum(value - INTERVAL * stderr, stderr)]
    known = np.concatenate(each)
    known = known[np.isfinite(known) & (known > 0)]
    return limits(known if known.size else np.array([1.0]))


def distance_panel(
    ax: Axes, readings: Sequence[Equilibrium], name: str, limits: tuple[float, float], looks: style.Looks
) -> None:
    """Largest difference of the distribution functions against the step size, hollow where it is statistically zero."""
    found = list(_distances(readings, name))
    error_axes(ax, np.concatenate([reading.h for reading, _, _ in found]))
    _begin(ax, name, r"$\max\,|F_h-F|$")
    ax.set_ylim(limits)
    bottom, top = limits
    for reading, value, stderr in found:
        marker, colour = looks[reading.about.variant]
        shown = np.where((value >= bottom) & (value <= top), value, np.nan)
        ax.plot(reading.h, shown, color=colour, linewidth=0.9, alpha=0.6, zorder=2)
        look = {"marker": marker, "color": colour, "markersize": 5}
        layout.points(ax, reading.h, value, INTERVAL * stderr, ~(value > ZERO * stderr), look)
        layout.edge_marks(ax, reading.h, value, colour)


def moments_panel(ax: Axes, readings: Sequence[Equilibrium], names: tuple[str, ...], looks: style.Looks) -> None:
    """Means less exact values in standard errors, of each scheme at the largest step size that keeps all paths."""
    ax.set(xlim=(-0.6, len(names) - 0.4), ylim=(-FAR, FAR), ylabel="(mean $-$ exact) / standard error")
    ax.set_xticks(range(len(names)), [f"${style.formula(name)}$" for name in names])
    rules(ax)
    ax.axhspan(-INTERVAL, INTERVAL, color="#eeeeee", linewidth=0, zorder=0.2, label="95 % if the law is exact")
    ax.axhline(0, color="black", linewidth=0.9, zorder=1)
    far = False
    for k, (reading, law) in enumerate(with_laws(readings)):
        if reading.largest_finite is None:
            continue
        marker, colour = looks[reading.about.variant]
        z = law.z[reading.largest_finite]
        x = np.arange(len(names)) + 0.12 * (k - (len(readings) - 1) / 2)
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 5, "linestyle": "none"}
        inside = np.abs(z) <= FAR
        ax.plot(
            x, np.where(inside, z, np.nan), label=f"{style.label(reading.about)}, {_step(reading)}", zorder=3, **look
        )
        layout.edge_marks(ax, x[~inside], z[~inside], colour)
        far |= not inside.all()
    if far:
        ax.plot([], [], "^", color="black", label=f"further away than {FAR:g}, or not finite")
    legend_under(ax)
