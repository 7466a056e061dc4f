"""The figure of strong errors: error against step size, with 95 % intervals and reference slopes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spi.drawing import style
from spi.drawing.axes import (
    ERRORS,
    INTERVAL,
    case_panels,
    error_axes,
    legend_under,
    limits,
    note_diverged,
    note_pale,
    panel_grid,
    slopes,
    with_order,
)
from spi.drawing.layout import edge_marks

from .results import StrongErrors

FACTS = ("reference_step", "reference_scheme", "samples")  #: what is told above the figure of the whole study

#: The reference slopes: (order, line style, whether the line lies above the data or below).
SLOPES = ((1 / 2, "--", True), (1, ":", False))


def draw(title: str, cases: Sequence[Sequence[StrongErrors]]) -> Figure:
    """The figure of a study of kind strong: a panel per case."""
    facts, looks = [style.facts(readings[0], *FACTS) for readings in cases], style.looks(cases)
    columns, *_ = panel_grid(len(cases))
    fig, axes = case_panels(title, cases, facts, max(map(len, cases)) + len(SLOPES))
    for i, ((ax,), readings) in enumerate(zip(axes, cases, strict=True)):
        _panel(ax, readings, looks)
        if i % columns == 0:
            ax.set_ylabel(ERRORS["strong"])
    return fig


def _panel(ax: Axes, readings: Sequence[StrongErrors], looks: style.Looks) -> None:
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    resolved = np.concatenate([_points(reading, resolved=True) for reading in readings])
    drawn = resolved if len(resolved) else np.concatenate([_points(reading, resolved=False) for reading in readings])
    if len(drawn):
        slopes(ax, drawn, _slopes(readings))
        ax.set_ylim(limits(drawn[:, 1]))
    for reading in readings:
        _scheme(ax, reading, *looks[reading.about.variant])
    _remarks(ax, readings)
    legend_under(ax)


def _slopes(readings: Sequence[StrongErrors]) -> Sequence[tuple[float, str, bool]]:
    """The reference slopes; with another driver than Brownian motion the least and the largest order expected."""
    if not readings[0].about.driver:
        return SLOPES
    expected = sorted({one.expected_order for one in readings if one.expected_order is not None})
    return [(order, *SLOPES[i][1:]) for i, order in enumerate(dict.fromkeys((*expected[:1], *expected[-1:])))]


def _points(reading: StrongErrors, resolved: bool) -> np.ndarray:
    """The finite points (h, error) of a scheme that are resolved, or those that are not."""
    chosen = np.isfinite(reading.error) & (reading.error > 0) & (reading.resolved == resolved)
    return np.column_stack([reading.h, reading.error])[chosen]


def _scheme(ax: Axes, reading: StrongErrors, marker: str, colour: str) -> None:
    """Draw one scheme; what lies beyond the top of the panel becomes a mark at its edge."""
    h, error, resolved = reading.h, reading.error, reading.resolved
    beyond = ~(error <= ax.get_ylim()[1])
    bars = INTERVAL * np.where(np.isfinite(reading.error_stderr), reading.error_stderr, 0.0)
    look: dict[str, Any] = {
        "marker": marker,
        "markerfacecolor": "none",
        "elinewidth": 0.7,
        "capsize": 0,
        "markeredgewidth": 1.2,
    }
    good, poor = resolved & (error > 0), ~resolved & ~beyond & (error > 0)
    label = with_order(style.label(reading.about), *reading.order[:3])
    ax.errorbar(h[good], error[good], bars[good], color=colour, label=label, zorder=3, **look)
    if poor.any():
        ax.errorbar(h[poor], error[poor], bars[poor], color=colour, alpha=0.4, linestyle="none", zorder=2, **look)
    edge_marks(ax, h[beyond], error[beyond], colour)


def _remarks(ax: Axes, readings: Sequence[StrongErrors]) -> None:
    """Legend entries for what is not an ordinary point."""
    top = ax.get_ylim()[1]
    errors = np.concatenate([reading.error for reading in readings])
    resolved = np.concatenate([reading.resolved for reading in readings])
    if ((errors <= top) & ~resolved).any():
        note_pale(ax)
    if not (errors <= top).all():
        note_diverged(ax)
