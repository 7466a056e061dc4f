"""The figure of long times: growth of errors of the Casimirs, the law of long paths, and means of functions."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style

from .results import Equilibrium

Readings = Sequence[Equilibrium]

FLOOR = 1e-11  #: errors of schemes that preserve a Casimir but for rounding are expected to stay below this
TOP = 1e2  # larger errors are only marked
MOST = 4  # variables of a law that are shown
NARROWEST, WIDEST = 0.03, 0.6  # deviations of a frequency from 1 that the axis reaches at least, and at most
_ENDS = 0.02  # an autocorrelation is shown until it is less than that, and for so many lags
_FEWEST = 6


def _exponent(reading: Equilibrium, c: int, i: int) -> str:
    """The fitted growth of the error of Casimir `c` at step size `i`."""
    p, low, high = (float(values[i, c]) for values in (reading.growth, reading.growth_low, reading.growth_high))
    return f"$n^{{{p:.2f}}}$ [{low:.2f}, {high:.2f}]" if math.isfinite(p) else ""


def _with_floor(plot: plots.Plot, readings: Readings, c: int) -> plots.Plot:
    shown = np.concatenate([line.y for line in plot.series])
    bounds = plots.limits(np.append(shown[(shown > 0) & (shown <= TOP)], FLOOR))
    return plot._replace(across=[(FLOOR, f"${style.power(FLOOR)}$")], ylim=bounds)


def _is_chosen(reading: Equilibrium, place: int) -> bool:
    """Whether a variable is shown: all are, or of many the first, the second and the last two."""
    count = len(reading.law.variables) if reading.law else 0
    return count <= MOST or place < 2 or place >= count - 2


def _beside_1(plot: plots.Plot, readings: Readings, v: int) -> plots.Plot:
    """Frequencies over exact probabilities, in bins of equal probability."""
    away = [np.abs(end - 1).max() for line in plot.series for end in (line.low, line.high) if end is not None]
    room = 1.08 * float(np.clip(max(away), NARROWEST, WIDEST))
    name = style.maths(readings[0].law.variables[v], readings[0].about.variables) if readings[0].law else ""
    x = f"distribution function of {name}"
    return plot._replace(x=x, xlim=(0, 1), ylim=(1 - room, 1 + room), across=[(1.0, "exact")])


def _has_biases(reading: Equilibrium, f: int) -> bool:
    """Whether the mean of a function has a reference, and several step sizes."""
    averages = reading.averages
    return averages is not None and len(reading.h) > 1 and bool(np.isfinite(averages.bias[:, f]).any())


def _smallest_finite(reading: Equilibrium) -> int | None:
    finite = np.flatnonzero(reading.nonfinite == 0)
    return int(finite[-1]) if len(finite) else None


def _until_small(plot: plots.Plot, readings: Readings, f: int) -> plots.Plot:
    """An autocorrelation as far as it differs from 0."""
    last = [np.flatnonzero(np.abs(line.y) > _ENDS)[-1:] for line in plot.series]
    ends = [line.x[min(len(line.x) - 1, max(_FEWEST, *at))] for line, at in zip(plot.series, last, strict=True)]
    return plot._replace(xlim=(0.0, float(max(ends))), ylim=(-0.15, 1.05))


def _response(reading: Equilibrium, f: int) -> float:
    return reading.averages.response(f)[1] if reading.averages else math.nan


def _named_response(plot: plots.Plot, readings: Readings, f: int) -> plots.Plot:
    averages: Any = readings[0].averages
    name, f_name = averages.response(f)[0], style.maths(averages.functions[f], readings[0].about.variables).strip("$")
    power = "T^2" if name == "heat capacity" else "T"
    return plot._replace(y=f"{name}  $\\mathrm{{Var}}\\,[{f_name}]/{power}$")


_MEANS = r"$|\,\overline{{{f}}}-\mathrm{{reference}}\,|$"
PANELS: dict[str, Any] = {
    "growth": [
        panels.CurvePanel(
            "casimir_rms",
            "n",
            "casimir",
            "h",
            label="rms of ${f}(y_n)\\,/\\,{f}(y_0)-1$",
            log=True,
            top=TOP,
            note=_exponent,
            nan_diverged=True,
            slopes=(1 / 2, 1),
            then=_with_floor,
            look={"markersize": 4.5},
        )
    ],
    "law": [
        panels.CurvePanel(
            "law.frequency",
            "bin",
            "variable",
            axes="h variable bin",
            label="frequency / exact",
            along=lambda one, v: (np.arange(one.law.fraction.shape[2]) + 0.5) / one.law.fraction.shape[2],
            at={"h": lambda one: one.largest_finite},
            only=_is_chosen,
            then=_beside_1,
        )
    ],
    "distance": [
        panels.ErrorPanel("law.distance", facet="variable", label=r"$\max\,|F_h-F|$ of ${f}$", only=_is_chosen)
    ],
    "means": [
        panels.ErrorPanel(
            "averages.bias",
            facet="function",
            axes="h function",
            label=_MEANS,
            only=_has_biases,
            note=panels.order_of("averages.order"),
        ),
        panels.CurvePanel(
            "averages.average",
            "h",
            "function",
            label=r"$\overline{{{f}}}$",
            reference="reference",
            only=lambda one, f: not _has_biases(one, f),
        ),
    ],
    "histogram": [
        panels.HistogramPanel(
            "averages.density", "cell_low", "cell_width", lambda one: one.largest_finite, exact="density_exact"
        )
    ],
    "autocorrelation": [
        panels.CurvePanel(
            "averages.correlation",
            "lag",
            "function",
            label="autocorrelation of ${f}$",
            zero=True,
            at={"h": _smallest_finite},
            then=_until_small,
        )
    ],
    "heat": [
        panels.CurvePanel(
            "averages.variance",
            "h",
            "function",
            factor=_response,
            reference="reference_variance",
            reference_name="exact",
            only=lambda one, f: math.isfinite(_response(one, f)),
            then=_named_response,
        )
    ],
    "acceptance": [
        panels.CurvePanel("acceptance.noise_accepted", "h", axes="h", label="accepted noise flows"),
        panels.CurvePanel("acceptance.drift_accepted", "h", axes="h", label="accepted steps of the drift"),
    ],
}


def _facts(readings: Readings) -> dict[str, str]:
    first = readings[0]
    each = "" if first.averages else f" of ${style.number(first.steps_each, steps=True)}$ steps"
    return {**style.facts(first), "paths": f"{style.count(first.samples)} paths{each}"}


draw = panels.Figures(PANELS, _facts)
