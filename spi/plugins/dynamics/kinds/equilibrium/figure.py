"""The figure of means over time: biases, histograms, autocorrelations, fluctuations."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.plugins.dynamics.drawing import maps
from spi.plugins.dynamics.kinds.long_paths.figure import ACCEPTANCE, GROWTH
from spi.specs.panels import Panels

from .results import Equilibrium

EquilibriumReadings = Sequence[Equilibrium]

_ENDS = 0.02  # an autocorrelation is shown until it is less than that
_GONE = 0.1  # autocorrelations of which there is no panel if they are less from the first lag on
_FEWEST = 6  # lags that are shown at least


def _has_biases(reading: Equilibrium, f: int) -> bool:
    """Whether the mean of a function has a reference, and several step sizes."""
    averages = reading.averages
    return len(reading.h) > 1 and bool(np.isfinite(averages.bias[:, f]).any())


def _varies(reading: Equilibrium, f: int) -> bool:
    """Whether a function is not constant up to rounding."""
    return not reading.averages.is_constant[f]


def _smallest_finite(reading: Equilibrium) -> int | None:
    finite = np.flatnonzero(reading.nonfinite == 0)
    return int(finite[-1]) if len(finite) else None


def _until_small(plot: plots.Plot, readings: EquilibriumReadings, f: int) -> plots.Plot | str:
    """An autocorrelation as far as it differs from 0, or the fact that it is gone at the first lag."""
    last = 0.0
    if all((np.abs(line.y[1:]) < _GONE).all() for line in plot.series):
        lag = style.number(float(plot.series[0].x[1]))
        return rf"$\mathrm{{autocorrelations}}<{_GONE}$ from lag ${lag}$ on"
    for line in plot.series:
        above = np.flatnonzero(np.abs(line.y) > np.fmax(_ENDS, (line.high - line.y) if line.high is not None else 0.0))
        end = min(len(line.x) - 1, max(_FEWEST, 3 * (above[-1] + 1) // 2 if len(above) else 0))
        last = max(last, float(line.x[end]))
    return plot._replace(xlim=(0.0, last or 1.0), ylim=(-0.15, 1.05))


def _response(reading: Equilibrium, f: int) -> float:
    return reading.averages.response(f)[1]


def _named_response(plot: plots.Plot, readings: EquilibriumReadings, f: int) -> plots.Plot:
    averages = readings[0].averages
    name, f_name = averages.response(f)[0], style.maths(averages.functions[f], readings[0].about.variables).strip("$")
    power = "T^2" if name == "heat capacity" else "T"
    return plot._replace(y=f"{name}  $\\mathrm{{Var}}\\,[{f_name}]/{power}$")


_MEANS = r"$|\,\overline{{{f}}}-\mathrm{{reference}}\,|$"
PANELS: dict[str, Any] = {
    "means": [
        panels.ErrorPanel(
            "average_bias",
            facet="function",
            label=_MEANS,
            only=_has_biases,
            note=panels.order_of("averages.order"),
        ),
        panels.CurvePanel(
            "average",
            "h",
            "function",
            label=r"$\overline{{{f}}}$",
            reference="reference",
            only=lambda one, f: not _has_biases(one, f),
        ),
    ],
    "histogram": [
        maps.HistogramPanel(
            "density", "cell_low", "cell_width", lambda one: one.largest_finite, exact="density_exact", only=_varies
        )
    ],
    "autocorrelation": [
        panels.CurvePanel(
            "correlation",
            "lag",
            "function",
            label="autocorrelation of ${f}$",
            zero=True,
            at={"h": _smallest_finite},
            only=_varies,
            then=_until_small,
        )
    ],
    "heat": [
        panels.CurvePanel(
            "variance",
            "h",
            "function",
            factor=_response,
            reference="reference_variance",
            reference_name="exact",
            only=lambda one, f: math.isfinite(_response(one, f)),
            then=_named_response,
        )
    ],
    "derived": [panels.CurvePanel("derived", "h", "quantity", label="${f}$")],
    "acceptance": ACCEPTANCE,
    "growth": GROWTH,
}


#: What plug-ins draw of means over paths they draw of means over time as well.
draw = panels.Figures(Panels("statistics", PANELS), ("samples",))
