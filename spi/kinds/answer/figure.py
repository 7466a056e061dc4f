"""The figure of answers: means and standard deviations of the differences of levels, beside the accuracy."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.storage.records import INTERVAL

from .results import Answer, Chosen

_LOOKS = (("#0072B2", "o"), ("#D55E00", "s"), ("#009E73", "D"), ("#CC79A7", "^"), ("#E69F00", "v"), ("#56B4E9", "P"))


def _answers(readings: Sequence[Answer], looks: style.Looks) -> Iterator[plots.Plot]:
    """The differences of levels, or the values where nothing was sampled."""
    for one in readings:
        yield _levels(one, one.chosen) if one.chosen else _values(one)


def _look(f: int) -> dict[str, Any]:
    colour, marker = _LOOKS[f % len(_LOOKS)]
    return {"color": colour, "marker": marker, "markersize": 5.5}


def _names(one: Answer) -> list[str]:
    return [style.maths(name, one.about.variables) for name in one.functions]


def _levels(one: Answer, chosen: Chosen) -> plots.Plot:
    """The moduli of the means with their intervals, and standard deviations, against the smaller step."""
    levels, lines = chosen.levels, []
    for f, name in enumerate(_names(one)):
        look, mean, half = _look(f), np.abs(levels.mean[f]), INTERVAL * levels.stderr[f]
        lines.append(plots.series(levels.h, mean, look, f"{name}: mean difference", half, poor=mean <= half))
        dotted = look | {"linestyle": ":"}
        lines.append(plots.series(levels.h, np.sqrt(levels.variance[f]), dotted, f"{name}: standard deviation"))
    label, aim = "difference of neighbouring steps", [(one.aim, "accuracy")]
    return plots.Plot(lines, x="smaller step size $h$", y=label, xscale="steps", log=True, across=aim)


def _values(one: Answer) -> plots.Plot:
    """The values with their intervals."""
    place, names = np.arange(len(one.functions)), _names(one)
    lines = [plots.series(place, one.value, _look(0) | {"linestyle": "none"}, "value", one.half)]

    def own(ax: Any) -> list[Any]:
        ax.set_xticks(place, names)
        return []

    return plots.Plot(lines, y=r"$\mathrm{E}\,\varphi(y(T))$", xlim=(-0.5, len(place) - 0.5), own=own)


draw = panels.Figures({"answers": [panels.Own(_answers)]}, ("accuracy",))
