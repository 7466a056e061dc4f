"""The figure of work and precision: errors, and errors of the Casimirs, against processor time."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.kinds.strong.figure import LABEL as STRONG
from spi.kinds.weak.figure import LABEL as WEAK
from spi.kinds.weak.study import label_of

from .results import WorkPrecision, requested

Readings = Sequence[WorkPrecision]

_FAR = 100.0  # an error so many times larger than the middle one of the schemes' largest is that of a blow-up
_SPOILT = 1e6  # and so is an error of a Casimir
_TARGET: dict[str, Any] = {"color": plots.GREY, "linewidth": 0.7, "linestyle": (0, (6, 4)), "zorder": 1}


def _errors(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Errors against time, the requested ones as lines across."""
    lines, largest, note = [], [], panels.order_of()
    for one in readings:
        error = np.where(np.isfinite(one.error), one.error, np.inf)
        half, poor = np.where(np.isfinite(one.half), one.half, 0.0), ~one.resolved
        lines.append(
            plots.series(
                one.seconds_per_path,
                error,
                panels.scheme_look(one, looks),
                style.label(one.about),
                half,
                poor=poor,
                note=note(one, 0, 0),
            )
        )
        good = error[one.resolved & (error < _SPOILT)]
        largest += [good.max()] if len(good) else []
    targets = requested(readings)

    def own(ax: plots.Axes) -> list[plots.Entry]:
        low, high = ax.get_ylim()
        seen = [target for target in targets if low < target < high]
        for target in seen:
            ax.axhline(target, **_TARGET)
        return [(plots.Line2D([], [], **_TARGET), "requested errors")] if seen else []

    label = (STRONG if readings[0].measure == "strong" else WEAK).format()
    top = _FAR * float(np.median(largest)) if largest else _SPOILT
    yield _over_time(lines, label, top)._replace(own=own)


def _casimirs(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The largest error of the Casimirs against time."""
    lines = [
        plots.series(
            one.seconds_per_path,
            np.where(np.isnan(drift), np.inf, drift),
            panels.scheme_look(one, looks),
            style.label(one.about),
        )
        for one in readings
        if (drift := one.largest_drift) is not None
    ]
    if lines:
        yield _over_time(lines, r"Casimir error  $\max\,|C(y_h(t_n))-C(y_0)|$", _SPOILT)


def _over_time(lines: list[Any], label: str, top: float) -> plots.Plot:
    return plots.Plot(lines, x="processor time of a path (s)", y=label, xscale="log", log=True, top=top)


def _facts(readings: Readings) -> dict[str, str]:
    """The facts of a case, without the estimator of its weak errors if that differs from scheme to scheme."""
    estimators = {reading.estimator for reading in readings}
    estimator = label_of(estimators.pop()) if len(estimators) == 1 else None
    names = "reference_step", "reference_scheme", "samples", "functions"
    return style.facts(readings[0], *names, estimator=estimator)


PANELS = {"errors": [panels.Own(_errors)], "casimirs": [panels.Own(_casimirs)]}

draw = panels.Figures(PANELS, _facts)
