"""Maps of regimes: what a scheme keeps, over step size and a parameter."""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Patch

from spi.drawing import style
from spi.drawing.cells import cell_places, edges, ticks
from spi.drawing.layout import Entry, Line

from ..results import CASIMIR_LOST, FAILING, GROWTH, Stability

SIZE = (2.3, 2.45)  # inches of a map
LEAST = 1.6  # inches of its width in a paper

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
_TICKS = 9


def lines(cases: Sequence[Sequence[Stability]], titles: list[str]) -> list[Line]:
    """A line of maps per case, a map per scheme; under the last line what the colours mean."""
    variants = list(dict.fromkeys(reading.about.variant for readings in cases for reading in readings))
    found = []
    for readings, title in zip(cases, titles, strict=True):
        of = {reading.about.variant: reading for reading in readings}
        panels = [partial(_map, reading=of.get(variant)) for variant in variants]
        found.append(Line(panels, SIZE, title, least=LEAST, shared=True))
    return [*found[:-1], found[-1]._replace(legend=[_legend([reading for case in cases for reading in case])])]


def _legend(readings: Iterable[Stability]) -> list[Entry]:
    """Entries of the regimes that occur, from good to bad."""
    present = sorted({number for reading in readings for number in np.unique(reading.regimes).tolist()})
    allowed = ", ".join(dict.fromkeys(style.number(reading.accurate) for reading in readings))
    texts = (
        rf"accurate: rms error $\leq {allowed}\,|y_0|$",
        "bounded, not accurate",
        "bounded, not positive",
        rf"Casimir lost: relative error $>{style.power(CASIMIR_LOST)}$",
        rf"not bounded: $|y|$ {style.number(GROWTH)} times too large",
        f"solver fails in more than {style.number(100 * FAILING)} % of steps",
        "paths diverged: NaN or infinity",
    )
    return [(Patch(linewidth=0, **_look(number)), texts[number]) for number in present]


def _look(number: int) -> dict[str, Any]:
    colour, hatch = LOOKS[number]
    return {"facecolor": colour, "hatch": hatch, "edgecolor": HATCHES[number > 2]}


def _map(ax: Axes, reading: Stability | None) -> None:
    """Cells over step size and value, each in the colour of its regime."""
    if reading is None:
        ax.set_axis_off()
        return
    h, values = reading.h, reading.values
    label = style.label(reading.about)
    ax.set_title("\n".join(style.wrapped(label.split(), " ", "axes.titlesize", SIZE[0] - 0.1)))
    places, is_log = cell_places(values)
    x, y = edges(h, True), edges(places, is_log)
    _cells(ax, x, y, reading.regimes)
    ax.set_xscale("log", base=2)
    if is_log:
        ax.set_yscale("log")
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()), xlabel="step size $h$")
    ticks(ax.xaxis, h, h, steps=True, room=5)
    ticks(ax.yaxis, places, values, steps=False, room=_TICKS)
    ax.tick_params(length=2.5)
    ax.set_ylabel(style.word(reading.word))


def _cells(ax: Axes, x: np.ndarray, y: np.ndarray, regimes: np.ndarray) -> None:
    """The cell of each step size, between `x` (S, 2), and value, between `y` (V, 2)."""
    for number in np.unique(regimes).tolist():
        cells = [_cell(x[j], y[i]) for i, j in np.argwhere(regimes == number)]
        ax.add_collection(PolyCollection(cells, linewidth=0, label=str(number), **_look(number)))
    borders = [_cell(x[j], y[i]) for i, j in np.ndindex(regimes.shape)]
    ax.add_collection(LineCollection(borders, color="white", linewidth=0.5, zorder=2))


def _cell(x: np.ndarray, y: np.ndarray) -> list[tuple[float, float]]:
    return [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])]
