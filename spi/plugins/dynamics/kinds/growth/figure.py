"""Figure of growth: errors of the Casimirs over the steps, and the law of long paths beside the uniform one."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.plugins.dynamics.kinds.long_paths.figure import ACCEPTANCE, GROWTH

from .results import Growth

GrowthReadings = Sequence[Growth]

MOST = 4  # variables shown
NARROWEST, WIDEST = 0.03, 0.6  # deviations of a density from 1 that the axis reaches at least, and at most
APART = 0.006  # between the markers of two schemes in one bin


def _is_chosen(reading: Growth, place: int) -> bool:
    """Whether a variable is shown: all are, or of many the first, the second and the last two."""
    count = len(reading.law.variables) if reading.law else 0
    return count <= MOST or place < 2 or place >= count - 2


def _law(readings: GrowthReadings, looks: style.Looks) -> Iterator[plots.Plot]:
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


PANELS: dict[str, Any] = {
    "growth": GROWTH,
    "law": [panels.OwnPanels(_law)],
    "distance": [
        panels.ErrorPanel("law_distance", facet="variable", label=r"$\max\,|F_h-F|$ of ${f}$", only=_is_chosen)
    ],
    "acceptance": ACCEPTANCE,
}


def _facts(readings: GrowthReadings) -> dict[str, str]:
    first = readings[0]
    steps = f" of ${style.number(first.steps_each, steps=True)}$ steps"
    return {**style.facts(first), "paths": f"{style.count(first.samples)} paths{steps}"}


draw = panels.Figures(PANELS, _facts)
