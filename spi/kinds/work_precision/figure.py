"""The figure of work and precision: errors, and errors of the Casimirs, against processor time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter

from spi.drawing import style
from spi.drawing.axes import (
    ERRORS,
    HUGE,
    PANEL,
    case_panels,
    legend_under,
    limits,
    note_diverged,
    note_pale,
    panel_grid,
    rules,
    with_order,
)
from spi.kinds.weak.estimators import label_of

from .results import WorkPrecision, requested

CASIMIR = r"$\max\,|C(y_h(t_n))-C(y_0)|$"
TIME = "processor time of a path"

TARGET = "#8c8c8c"
_LOWER = 2.0  # inches of a panel of Casimirs
_FAR = 100.0  # an error so many times larger than the middle one of the schemes' largest is that of a blow-up
_SPOILT = 1e6  # and so is an error of a Casimir
_ROOM = 1.7  # at the sides of a panel, as a factor of time

_LOOK: dict[str, Any] = {"markerfacecolor": "none", "elinewidth": 0.7, "capsize": 0, "markeredgewidth": 1.2}
_BLACK: dict[str, Any] = {"color": "black", "linestyle": "none"}
_SMALL: dict[str, Any] = {"markerfacecolor": "none", "markeredgewidth": 1.0, "markersize": 4.5}


def draw(title: str, cases: Sequence[Sequence[WorkPrecision]]) -> Figure:
    """The figure of a study of kind work_precision: a column per case, under the errors those of the Casimirs."""
    looks, measured = style.looks(cases), [_has_casimirs(readings) for readings in cases]
    heights = (1.0, _LOWER / PANEL[1]) if any(measured) else (1.0,)
    entries = max(map(len, cases)) + 3  # of the legend, with remarks
    fig, grid = case_panels(title, cases, [_facts(readings) for readings in cases], entries, heights)
    columns, *_ = panel_grid(len(cases))
    for i, (axes, readings) in enumerate(zip(grid, cases, strict=True)):
        _errors(axes[0], readings, looks)
        if measured[i]:
            _casimirs(axes[1], readings, looks)
        if all(measured):
            axes[0].tick_params(labelbottom=False)
            axes[0].set_xlabel("")
        _legend(axes, readings, looks, measured[i])
        _name_axes(axes, readings, cases[i - 1] if i % columns else None)
    return fig


def _facts(readings: Sequence[WorkPrecision]) -> dict[str, str]:
    """The facts of a case, without the estimator of its weak errors if that differs from scheme to scheme."""
    names = "reference_step", "reference_scheme", "samples", "functions"
    estimators = {reading.estimator for reading in readings}
    return style.facts(readings[0], *names, estimator=label_of(estimators.pop()) if len(estimators) == 1 else None)


def _name_axes(axes: Sequence[Axes], readings: Sequence[WorkPrecision], left: Sequence[WorkPrecision] | None) -> None:
    """Label the vertical axes, unless those of the case to the left say it."""
    measure = readings[0].measure
    if left is None or left[0].measure != measure:
        axes[0].set_ylabel(ERRORS[measure])
    if _has_casimirs(readings) and (left is None or not _has_casimirs(left)):
        axes[1].set_ylabel(f"Casimir error\n{CASIMIR}")


def _has_casimirs(readings: Sequence[WorkPrecision]) -> bool:
    return any(reading.largest_drift is not None for reading in readings)


def _time_axes(ax: Axes, readings: Sequence[WorkPrecision]) -> None:
    """Logarithmic axes, the horizontal one for the times of all schemes."""
    ax.set(xscale="log", yscale="log", xlabel=TIME)
    seconds = np.concatenate([reading.seconds_per_path for reading in readings])
    seconds = seconds[(seconds > 0) & np.isfinite(seconds)]
    if seconds.size:
        ax.set_xlim(seconds.min() / _ROOM, seconds.max() * _ROOM)
        if seconds.max() < 20 * seconds.min():
            ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter(EngFormatter(unit="s"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    rules(ax)


def _errors(ax: Axes, readings: Sequence[WorkPrecision], looks: style.Looks) -> None:
    """Errors against time, the requested ones as lines across."""
    _time_axes(ax, readings)
    frame = _frame(readings)
    if frame is not None:
        ax.set_ylim(frame)
    for target in _targets(ax, readings):
        ax.axhline(target, color=TARGET, linewidth=0.7, linestyle=(0, (6, 4)), zorder=1)
    for reading in readings:
        _scheme(ax, reading, *looks[reading.about.variant])


def _targets(ax: Axes, readings: Sequence[WorkPrecision]) -> list[float]:
    """The requested errors that can be seen."""
    low, high = ax.get_ylim()
    return [target for target in requested(readings) if low < target < high]


def _frame(readings: Sequence[WorkPrecision]) -> tuple[float, float] | None:
    """The limits of the errors' axis; None if no error can be drawn."""
    found = [np.concatenate([_found(reading, resolved) for reading in readings]) for resolved in (True, False)]
    good, poor = (points[:, 2] for points in found)
    if not len(good):
        return limits(poor) if len(poor) else None
    largest = [found[:, 2].max() for found in (_found(reading, True) for reading in readings) if len(found)]
    good = good[good <= _FAR * np.median(largest)]
    return limits(np.concatenate([good, poor[(poor > good.min() / 10) & (poor < good.max())]]))


def _found(reading: WorkPrecision, resolved: bool) -> np.ndarray:
    """The points (h, seconds, error, half of the 95 % interval) that are resolved, or those that are not."""
    half = np.where(np.isfinite(reading.half), reading.half, 0.0)
    chosen = (reading.error > 0) & (reading.error < HUGE) & np.isfinite(reading.seconds_per_path)
    chosen &= reading.resolved == resolved
    return np.column_stack([reading.h, reading.seconds_per_path, reading.error, half])[chosen]


def _scheme(ax: Axes, reading: WorkPrecision, marker: str, colour: str) -> None:
    """Draw the errors of one scheme; what lies beyond the top of the panel becomes a mark at its edge."""
    top = ax.get_ylim()[1]
    look: dict[str, Any] = {"marker": marker, "color": colour, **_LOOK}
    for resolved, further in ((True, {"zorder": 3}), (False, {"alpha": 0.4, "linestyle": "none", "zorder": 2})):
        _, seconds, error, half = _found(reading, resolved).T
        inside = error <= top
        if inside.any():
            ax.errorbar(seconds[inside], error[inside], half[inside], **look, **further)
    _edge(ax, reading.seconds_per_path[_lost(reading, top)], 1, colour)


def _lost(reading: WorkPrecision, top: float) -> np.ndarray:
    return ~(reading.error <= top)


def _edge(ax: Axes, seconds: np.ndarray, end: int, colour: str) -> None:
    """Marks at the lower (0) or upper (1) edge of a panel."""
    place: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "linestyle": "none", "zorder": 4}
    if len(seconds):
        ax.plot(seconds, np.full(len(seconds), end), marker=(CARETDOWN, CARETUP)[end], color=colour, **place)


def _casimirs(ax: Axes, readings: Sequence[WorkPrecision], looks: style.Looks) -> None:
    """The largest error of the Casimirs against time; none at all, and a diverged path, are marks at the edges."""
    _time_axes(ax, readings)
    everything = _drifts(readings)
    drawn = everything[(everything > 0) & (everything < _SPOILT)]
    low, high = limits(drawn) if len(drawn) else (1e-17, 1e-15)
    ax.set_ylim(low / 10 if (everything == 0).any() else low, high)
    ax.yaxis.set_major_locator(LogLocator(numticks=6))
    for reading in readings:
        if reading.largest_drift is None:
            continue
        marker, colour = looks[reading.about.variant]
        drift, seconds = reading.largest_drift, reading.seconds_per_path
        inside = (drift > 0) & (drift < _SPOILT)
        ax.plot(seconds[inside], drift[inside], marker, linestyle="-", color=colour, **_SMALL)
        _edge(ax, seconds[drift == 0], 0, colour)
        _edge(ax, seconds[~(drift < _SPOILT)], 1, colour)


def _drifts(readings: Sequence[WorkPrecision]) -> np.ndarray:
    """The errors of the Casimirs of all schemes at all step sizes."""
    found = [reading.largest_drift for reading in readings if reading.largest_drift is not None]
    return np.concatenate(found) if found else np.empty(0)


def _legend(axes: Sequence[Axes], readings: Sequence[WorkPrecision], looks: style.Looks, measured: bool) -> None:
    """One legend for both panels of a case, under the lower one or in its place."""
    ax = axes[-1]
    for reading in readings:
        marker, colour = looks[reading.about.variant]
        label = with_order(style.label(reading.about), *reading.order[:3])
        ax.plot([], [], marker=marker, color=colour, markerfacecolor="none", markeredgewidth=1.2, label=label)
    _remarks(ax, axes[0], readings)
    legend = legend_under(ax)
    if len(axes) > 1 and not measured:
        legend.set_bbox_to_anchor((0.5, 1.0), ax.transAxes)
        ax.set_axis_off()


def _remarks(ax: Axes, errors: Axes, readings: Sequence[WorkPrecision]) -> None:
    """Legend entries for what is no scheme."""
    top = errors.get_ylim()[1]
    drifts = _drifts(readings)
    if _targets(errors, readings):
        ax.plot([], [], color=TARGET, linewidth=0.7, linestyle=(0, (6, 4)), label="requested errors")
    if any((_found(reading, False)[:, 2] <= top).any() for reading in readings):
        note_pale(ax)
    if any(_lost(reading, top).any() for reading in readings) or not (drifts < _SPOILT).all():
        note_diverged(ax)
    if (drifts == 0).any():
        ax.plot([], [], marker=CARETDOWN, label="the Casimirs have not changed at all", **_BLACK)
