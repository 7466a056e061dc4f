"""Panels of long paths: the growth of errors of the Casimirs, and how often flows were accepted."""

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style

from .results import LongRecord

LongReadings = Sequence[LongRecord]

FLOOR = 1e-11  #: errors of schemes that preserve a Casimir but for rounding are expected to stay below this
TOP = 1e2  # larger errors are only marked
PRESERVED = 1e-6  # only a scheme whose errors end below that has reference slopes
_LINES = {"1/2": "--", "1": ":"}  # of slopes
_FLOOR_LOOK: dict[str, Any] = {"color": "black", "linestyle": "-.", "linewidth": 0.8}


def _exponent(reading: LongRecord, c: int, i: int) -> str:
    """Fitted growth of the error of Casimir `c` at step size `i`."""
    p, low, high = (float(values[i, c]) for values in (reading.growth, reading.growth_low, reading.growth_high))
    return f"$n^{{{p:.2f}}}$ [{low:.2f}, {high:.2f}]" if math.isfinite(p) else ""


def _with_slopes(plot: plots.Plot, readings: LongReadings, c: int) -> plots.Plot:
    """Slope 1/2 just above the errors of the scheme that preserves Casimir `c` best, and slope 1 from its start."""
    ends = [(rms[-1], reading.n, rms) for reading in readings for rms in reading.casimir_rms[..., c]]
    small = [end for end in ends if 0 < end[0] < PRESERVED]

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        ax.axhline(FLOOR, zorder=1, **_FLOOR_LOOK)
        entries: list[plots.LegendEntry] = [(plots.Line2D([], [], **_FLOOR_LOOK), f"${style.power(FLOOR)}$")]
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


def _acceptance(readings: LongReadings, looks: style.Looks) -> Iterator[plots.Plot]:
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


#: The panels of these names.
GROWTH = [
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
]
ACCEPTANCE = [panels.OwnPanels(_acceptance)]
