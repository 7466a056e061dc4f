"""Figure of answers: estimates at the steps of the levels beside the answer, and the differences of levels."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.drawing import panels, plots, style
from spi.printing.text import readable
from spi.storage.records import INTERVAL

from .results import Answer, Chosen

_LOOKS = (("#0072B2", "o"), ("#D55E00", "s"), ("#009E73", "D"), ("#CC79A7", "^"), ("#E69F00", "v"), ("#56B4E9", "P"))


def _all_estimates(readings: Sequence[Answer], looks: style.Looks) -> Iterator[plots.Plot]:
    """Estimates of each function, or the values where nothing was sampled."""
    for one in readings:
        if one.chosen:
            yield from (_estimates(one, one.chosen, f, name) for f, name in enumerate(_names(one)))
        else:
            yield _values(one)


def _differences(readings: Sequence[Answer], looks: style.Looks) -> Iterator[plots.Plot]:
    """Differences of levels, where there are any."""
    return (_levels(one, one.chosen) for one in readings if one.chosen)


def _look(f: int) -> dict[str, Any]:
    colour, marker = _LOOKS[f % len(_LOOKS)]
    return {"color": colour, "marker": marker, "markersize": 5.5}


def _names(one: Answer) -> list[str]:
    """Functions as they are called, or as formulas where they have no name of their own."""
    texts = (formula if name == "phi" else name for name, formula in zip(one.functions, one.formulas, strict=True))
    return [style.maths(readable(text), one.about.variables) for text in texts]


def _estimates(one: Answer, chosen: Chosen, f: int, name: str) -> plots.Plot:
    """Expectation at each step without extrapolation, with its sampling error, and the answer as a band.

    The largest step is sampled alone; its mean is what the answer has besides the differences of levels.
    """
    levels, value = chosen.levels, float(one.value[f])
    first = value - levels.share @ levels.mean[f]
    rest = max(float(one.stderr[f]) ** 2 - levels.share**2 @ levels.stderr[f] ** 2, 0.0)
    h = np.array([chosen.largest_step, *levels.h])
    estimates = np.cumsum([first, *levels.mean[f]])
    half = INTERVAL * np.sqrt(np.cumsum([rest, *levels.stderr[f] ** 2]))
    ends, answer = h[[0, -1]], np.full(2, value)
    band = {"color": plots.GREY, "marker": ""}
    lines = [
        plots.series(ends, answer, band, "answer (95 %)", np.full(2, one.half[f]), band=True),
        plots.series(h, estimates, _look(f) | {"linestyle": "none"}, "estimate at $h$", half),
    ]
    label = rf"$\mathrm{{E}}\,${name} at $t={style.number(one.about.final_time)}$"
    return plots.Plot(lines, x="step size $h$", y=label, xscale="steps")


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
    """Values with their intervals."""
    place, names = np.arange(len(one.functions)), _names(one)
    lines = [plots.series(place, one.value, _look(0) | {"linestyle": "none"}, "value", one.half)]

    def own(ax: Any) -> list[Any]:
        ax.set_xticks(place, names)
        return []

    return plots.Plot(lines, y=r"$\mathrm{E}\,\varphi(y(T))$", xlim=(-0.5, len(place) - 0.5), own=own)


PANELS = {"estimates": [panels.OwnPanels(_all_estimates)], "levels": [panels.OwnPanels(_differences)]}

draw = panels.Figures(PANELS, ("accuracy",))
