"""Figure of work and precision: errors, and errors of the Casimirs, against processor time."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.kinds.strong.figure import LABEL as STRONG
from spi.kinds.weak.figure import LABEL as WEAK
from spi.kinds.weak.study import label_of

from .results import WorkPrecision, requested

WorkReadings = Sequence[WorkPrecision]

_FAR = 100.0  # an error so many times larger than the middle one of the schemes' largest is that of a blow-up
_SPOILT = 1e6  # and so is an error of a Casimir
_TARGET: dict[str, Any] = {"color": plots.GREY, "linewidth": 0.7, "linestyle": (0, (6, 4)), "zorder": 1}


def _with_targets(plot: plots.Plot, readings: WorkReadings, place: int) -> plots.Plot:
    """Panel of errors, the requested ones as lines across; those of a blow-up do not widen its axis."""
    if len({one.measure for one in readings}) > 1:
        raise ValueError("overlay: some cases have strong errors and others weak ones; leave it out")
    good = [one.error[one.resolved & (one.error < _SPOILT)] for one in readings]
    top = _FAR * float(np.median([error.max() for error in good if len(error)] or [_SPOILT / _FAR]))

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        low, high = ax.get_ylim()
        seen = [target for target in requested(readings) if low < target < high]
        for target in seen:
            ax.axhline(target, **_TARGET)
        return [(plots.Line2D([], [], **_TARGET), "requested errors")] if seen else []

    return plot._replace(y=(STRONG if readings[0].measure == "strong" else WEAK).format(), top=top, own=own)


def _over_time(field: str, **options: Any) -> panels.CurvePanel:
    """A field against the time of a path."""
    axis: dict[str, Any] = {"along": lambda one, place: one.seconds_per_path, "scale": "log"}
    return panels.ErrorPanel(field, x="processor time of a path (s)", modulus=False, **axis, **options)


def _facts(readings: WorkReadings) -> dict[str, str]:
    """Facts of a case, without the estimator of its weak errors if that differs from scheme to scheme."""
    estimators = {reading.estimator for reading in readings}
    estimator = label_of(estimators.pop()) if len(estimators) == 1 else None
    names = "reference_step", "reference_scheme", "samples", "functions"
    return style.facts(readings[0], *names, estimator=estimator)


_CASIMIR = r"Casimir error  $\max\,|C(y_h(t_n))-C(y_0)|$"
PANELS = {
    "errors": [_over_time("error", note=panels.order_of(), then=_with_targets)],
    "casimirs": [_over_time("casimir_drift", label=_CASIMIR, top=_SPOILT, resolved="")],
}

draw = panels.Figures(PANELS, _facts)
