"""The figure of long times: growth of errors of the Casimirs, the law of long paths, and means of functions."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.plugins.dynamics.drawing import maps

from .results import Averages, Equilibrium

Readings = Sequence[Equilibrium]

# ---------------------------------------------------------------------------------------------------------------------
# Growth of the errors of the Casimirs.
# ---------------------------------------------------------------------------------------------------------------------

FLOOR = 1e-11  #: errors of schemes that preserve a Casimir but for rounding are expected to stay below this
TOP = 1e2  # larger errors are only marked
PRESERVED = 1e-6  # only a scheme whose errors end below that has reference slopes
_LINES = {"1/2": "--", "1": ":"}  # of slopes
_FLOOR_LOOK: dict[str, Any] = {"color": "black", "linestyle": "-.", "linewidth": 0.8}


def _exponent(reading: Equilibrium, c: int, i: int) -> str:
    """The fitted growth of the error of Casimir `c` at step size `i`."""
    p, low, high = (float(values[i, c]) for values in (reading.growth, reading.growth_low, reading.growth_high))
    return f"$n^{{{p:.2f}}}$ [{low:.2f}, {high:.2f}]" if math.isfinite(p) else ""


def _with_slopes(plot: plots.Plot, readings: Readings, c: int) -> plots.Plot:
    """Slope 1/2 just above the errors of the scheme that preserves Casimir `c` best, and slope 1 from its start."""
    ends = [(rms[-1], reading.n, rms) for reading in readings for rms in reading.casimir_rms[..., c]]
    small = [end for end in ends if 0 < end[0] < PRESERVED]

    def own(ax: plots.Axes) -> list[plots.Entry]:
        ax.axhline(FLOOR, zorder=1, **_FLOOR_LOOK)
        entries: list[plots.Entry] = [(plots.Line2D([], [], **_FLOOR_LOOK), f"${style.power(FLOOR)}$")]
        if not small:
            return entries
        _, n, values = min(small, key=lambda end: end[0])
        x = np.array(ax.get_xlim())
        first = 1.7 * (values / np.sqrt(n)).max() * np.sqrt(x[0])
        for (text, dashes), power in zip(_LINES.items(), (0.5, 1.0), strict=True):
            look: dict[str, Any] = {"linestyle": dashes, "color": plots.GREY, "linewidth": 1.0, "zorder": 1}
            entries += [(line, f"slope {text}") for line in ax.plot(x, first * (x / x[0]) ** power, **look)]
        return entries

    shown = np.concatenate([line.y for line in plot.series])
    drawn = plot.own
    return plot._replace(
        own=lambda ax: [*(drawn(ax) if drawn else []), *own(ax)],
        ylim=plots.limits(np.append(shown[(shown > 0) & (shown <= TOP)], FLOOR)),
    )


# ---------------------------------------------------------------------------------------------------------------------
# The law of long paths beside the exact stationary one.
# ---------------------------------------------------------------------------------------------------------------------

MOST = 4  # variables shown
NARROWEST, WIDEST = 0.03, 0.6  # deviations of a density from 1 that the axis reaches at least, and at most
APART = 0.006  # between the markers of two schemes in one bin


def _is_chosen(reading: Equilibrium, place: int) -> bool:
    """Whether a variable is shown: all are, or of many the first, the second and the last two."""
    count = len(reading.law.variables) if reading.law else 0
    return count <= MOST or place < 2 or place >= count - 2


def _law(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Frequency over exact probability in bins of equal probability, at the largest step size without lost paths."""
    laws = [(one, one.law, i) for one in readings if one.law and (i := one.largest_finite) is not None]
    if not laws:
        return
    first = laws[0][0]
    variables = [v for v in range(len(laws[0][1].variables)) if _is_chosen(first, v)]
    drawn, reach = [], []
    for k, (one, law, i) in enumerate(laws):
        bins = law.fraction.shape[2]
        x = (np.arange(bins) + 0.5) / bins + APART * (k - (len(laws) - 1) / 2)
        look, label = panels.scheme_look(one, looks, markersize=3.5), style.label(one.about)
        factor = one.interval("fraction")
        arrays = [(bins * law.fraction[i, v], factor * bins * law.fraction_stderr[i, v]) for v in variables]
        drawn.append([plots.series(x, value, look, label, half) for value, half in arrays])
        reach.append(max(float(np.nanmax(np.abs(value - 1) + half)) for value, half in arrays))
    room = 1.08 * max(NARROWEST, min(reach), min(max(reach), max(WIDEST, 3 * min(reach))))
    for i, v in enumerate(variables):
        name = style.maths(laws[0][1].variables[v], first.about.variables)
        yield plots.Plot(
            [lines[i] for lines in drawn],
            x=f"distribution function of {name}",
            y="frequency / exact",
            xlim=(0, 1),
            ylim=(1 - room, 1 + room),
            across=[(1.0, "exact")],
            shared=i > 0,
        )


# ---------------------------------------------------------------------------------------------------------------------
# Means of functions over time: biases, histograms, autocorrelations, fluctuations, acceptance.
# ---------------------------------------------------------------------------------------------------------------------

_ENDS = 0.02  # an autocorrelation is shown until it is less than that
_GONE = 0.1  # autocorrelations of which there is no panel if they are less from the first lag on
_FEWEST = 6  # lags that are shown at least


def _has_biases(reading: Equilibrium, f: int) -> bool:
    """Whether the mean of a function has a reference, and several step sizes."""
    averages = reading.averages
    return averages is not None and len(reading.h) > 1 and bool(np.isfinite(averages.bias[:, f]).any())


def _varies(reading: Equilibrium, f: int) -> bool:
    """Whether a function is not constant up to rounding."""
    return reading.averages is None or not reading.averages.is_constant[f]


def _smallest_finite(reading: Equilibrium) -> int | None:
    finite = np.flatnonzero(reading.nonfinite == 0)
    return int(finite[-1]) if len(finite) else None


def _until_small(plot: plots.Plot, readings: Readings, f: int) -> plots.Plot | str:
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
    return reading.averages.response(f)[1] if reading.averages else math.nan


def _named_response(plot: plots.Plot, readings: Readings, f: int) -> plots.Plot:
    averages: Averages = next(one.averages for one in readings if one.averages)
    name, f_name = averages.response(f)[0], style.maths(averages.functions[f], readings[0].about.variables).strip("$")
    power = "T^2" if name == "heat capacity" else "T"
    return plot._replace(y=f"{name}  $\\mathrm{{Var}}\\,[{f_name}]/{power}$")


def _acceptance(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Shares of accepted noise flows (line) and steps of the drift (dashed), against the step size."""
    lines = []
    for one in readings:
        if rates := one.acceptance:
            look, label = panels.scheme_look(one, looks), style.label(one.about)
            lines.append(plots.series(one.h, rates.noise_accepted, look, label))
            lines.append(
                plots.series(one.h, rates.drift_accepted, look | {"linestyle": "--"}, f"{label}: steps of the drift")
            )
    if lines:
        yield plots.Plot(lines, x=style.AXES["h"], y="share of accepted noise flows", xscale="steps")


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
            then=_with_slopes,
            look={"markersize": 4.5},
        )
    ],
    "law": [panels.Own(_law)],
    "distance": [
        panels.ErrorPanel("law_distance", facet="variable", label=r"$\max\,|F_h-F|$ of ${f}$", only=_is_chosen)
    ],
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
    "acceptance": [panels.Own(_acceptance)],
}


def _facts(readings: Readings) -> dict[str, str]:
    first = readings[0]
    each = "" if first.averages else f" of ${style.number(first.steps_each, steps=True)}$ steps"
    return {**style.facts(first), "paths": f"{style.count(first.samples)} paths{each}"}


draw = panels.Figures(PANELS, _facts)
