"""Figure of stability: maps of regimes, and single quantities over the swept parameter."""

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.patches import Patch

from spi.drawing import panels, plots, style, sweeps

from .results import CASIMIR_LOST, FAILING, GROWTH, Stability

StabilityReadings = Sequence[Stability]

#: Colour and hatch of each regime, from good to bad: blue while the geometry is kept, then warm, then black.
LOOKS = (
    ("#0072B2", None),
    ("#A9D6F2", None),
    ("#F7E489", "....."),
    ("#E69F00", None),
    ("#D55E00", None),
    ("#CC79A7", "//////"),
    ("#3a3a3a", "xxxx"),
)
HATCHES = "#999999", "#ffffff"  # on a pale colour, and on others
CAP = 1e4  # relative errors and growths beyond that are only marked
_APART = 3  # schemes, values and step sizes from which on the lines of one panel would be too many
_THIN = {"linestyle": ":", "marker": ""}


def _regimes(readings: StabilityReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """A map of the regimes of each scheme over step size and value."""
    axes: dict[str, Any] = {"x": style.AXES["h"], "y": style.word(readings[0].word), "aspect": 0.9}
    for i, one in enumerate(readings):
        yield plots.Plot(title=style.label(one.about), own=_map(one), shared=i > 0, **axes)


def _map(reading: Stability) -> Any:
    """A function that draws the cells of step sizes and values, each in the colour of its regime."""
    h = reading.h[::-1]
    x, y = plots.Places(h, h, "log"), sweeps.even_places(np.sort(reading.values))
    regimes = reading.regimes[np.argsort(reading.values), ::-1]
    numbers = np.unique(regimes).tolist()

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        across, up = sweeps.cell_borders(x), sweeps.cell_borders(y)
        for number in numbers:
            corners = [(across[j : j + 2], up[i : i + 2]) for i, j in np.argwhere(regimes == number)]
            cells = [list(zip(a[[0, 1, 1, 0]], b[[0, 0, 1, 1]], strict=True)) for a, b in corners]
            ax.add_collection(PolyCollection(cells, label=str(number), **_look(number)))
        ax.set_xscale("log", base=2)
        ax.set_yscale("linear" if y.scale == "linear" else "log")
        ax.set(xlim=across[[0, -1]], ylim=up[[0, -1]])
        plots.ticks(ax.xaxis, x.at, x.values, steps=True, room=5)
        plots.ticks(ax.yaxis, y.at, y.values)
        return [(Patch(**_look(number)), _text(reading, number)) for number in numbers]

    return own


def _text(reading: Stability, number: int) -> str:
    texts = (
        rf"accurate: rms error $\leq {style.number(reading.accurate)}\,|y_0|$",
        "bounded, not accurate",
        "bounded, not positive",
        rf"Casimir lost: relative error $>{style.power(CASIMIR_LOST)}$",
        rf"not bounded: $|y|$ {style.number(GROWTH)} times too large",
        f"solver fails in more than {style.number(100 * FAILING)} % of steps",
        "paths diverged: NaN or infinity",
    )
    return texts[number]


def _look(number: int) -> dict[str, Any]:
    colour, hatch = LOOKS[number]
    return {"facecolor": colour, "hatch": hatch, "edgecolor": HATCHES[number > 2], "linewidth": 0}


_MEDIAN: plots.LegendEntry = plots.Line2D([], [], color="black", linestyle=":"), "dotted: median path, else the worst"


def _quantity(field: str, label: str, median: str = "", **options: Any) -> panels.OwnPanels:
    """A panel of one quantity over the swept value, a line for each scheme and step size, or over the only axis."""

    def drawn(readings: StabilityReadings, looks: style.Looks) -> Iterator[Any]:
        axes: dict[str, Any] = {"over": "value", "lines": "h"}
        if len(readings[0].values) == 1:
            axes = {"over": "h", "at": {"value": lambda one: 0}}
        given: dict[str, Any] = {"label": label, "log": True, "top": CAP} | axes | options
        each = [list(panels.CurvePanel(one, **given).expand(readings, looks)) for one in (field, median) if one]
        for plot, *others in zip(*each, strict=True):
            thin = [line._replace(label="", look=line.look | _THIN) for other in others for line in other.series]
            yield plot._replace(series=[*plot.series, *thin], entries=[*plot.entries, _MEDIAN]) if thin else plot

    return panels.OwnPanels(drawn)


def _law(readings: StabilityReadings, looks: style.Looks) -> Iterator[Any]:
    """Distance of the laws: of many lines a panel for each scheme, with one look for each step size."""
    if len(readings) < _APART or min(len(readings[0].values), len(readings[0].h)) < _APART:
        yield from _quantity("law_distance", _LAW).expand(readings, looks)
        return
    panel = panels.CurvePanel("law_distance", over="value", lines="h", label=_LAW, log=True, top=CAP)
    each = [(one, plot) for one in readings for plot in panel.expand([one], looks)]
    values = np.concatenate([line.y for _, plot in each for line in plot.series])
    shown = values[np.isfinite(values) & (values > 0) & (values < CAP)]
    row = []
    for i, (one, plot) in enumerate(each):
        rows = plots.spread(len(one.h), len(plot.series))
        colours = [to_hex(colour) for colour in matplotlib.colormaps["viridis"](np.linspace(0, 0.86, len(rows)))]
        lines = [
            line._replace(label=style.value_of("h", one.h[k]), look=line.look | {"color": colour, "marker": marker})
            for line, k, colour, marker in zip(plot.series, rows, colours, style.SEQUENCES[0], strict=False)
        ]
        row.append(
            plot._replace(
                series=lines, title=style.label(one.about), ylim=plots.limits(shown), shared=i > 0, entries=()
            )
        )
    yield row


_RMS = r"rms error at $T$  relative to $|y_0|$"
_LAW = r"$\max_\varphi\,|\mathrm{{E}}\,\varphi(y_h(T))-\mathrm{{E}}\,\varphi(y(T))|$"
PANELS = {
    "regimes": [panels.OwnPanels(_regimes)],
    "finite": [_quantity("finite", "finite paths", log=False, same="share of finite paths: {}")],
    "casimir": [_quantity("casimir_worst", "relative Casimir error", "casimir_median", nan_diverged=True)],
    "norm": [
        _quantity("largest_norm", r"largest $|y|\,/\,|y_0|$", nan_diverged=True, same=r"largest $|y|\,/\,|y_0|$: {}")
    ],
    "error": [_quantity("error", _RMS, nan_diverged=True)],
    "law": [panels.OwnPanels(_law)],
    "positive": [_quantity("positive", "share of positive paths", log=False, same="share of positive paths: {}")],
    "failures": [_quantity("failing_fraction", "solver failures per step", same="solver failures: {}")],
    "iterations": [_quantity("iterations_per_solve", "iterations per step", log=False)],
    "angle": [_quantity("largest_angle", "largest angle of a flow (rad)", top=1e100, same="largest angle: {}")],
}


def _facts(readings: StabilityReadings) -> dict[str, str]:
    first = readings[0]
    facts = style.facts(first, "reference_step", "reference_scheme", "samples", "functions")
    single = len(first.values) == 1
    return (
        {"swept": f"{style.word(first.word)}$\\,={style.number(float(first.values[0]))}$"} | facts if single else facts
    )


draw = panels.Figures(PANELS, _facts)
