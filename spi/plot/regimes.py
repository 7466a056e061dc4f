"""Maps of regimes: what a scheme keeps, over step size and a parameter."""

from functools import partial

import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, NullLocator

from ..regimes import CASIMIR_LOST, FAILING, GROWTH, regimes
from . import style
from .layout import Line

SIZE = (2.3, 2.45)  # inches of a map

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
_UNEVEN = 3.0  # largest gap over smallest, in logarithms
_TICKS = 9


def lines(cases, titles):
    """A line of maps per case, a map per scheme; under the last line what the colours mean."""
    names = list(dict.fromkeys(group.scheme for groups in cases for group in groups))
    found = []
    for groups, title in zip(cases, titles, strict=True):
        of = {group.scheme: group for group in groups}
        first = next(name for name in names if name in of)
        panels = [partial(_map, group=of.get(name), first=name == first) for name in names]
        found.append(Line(panels, SIZE, title))
    return [*found[:-1], found[-1]._replace(legend=[_legend(cases)])]


def _legend(cases):
    """Entries of the regimes that occur, from good to bad."""
    present = sorted({number for groups in cases for group in groups for number in np.unique(regimes(group)).tolist()})
    allowed = ", ".join(dict.fromkeys(style.number(g.attributes["accurate"]) for groups in cases for g in groups))
    texts = (
        rf"accurate: rms error $\leq {allowed}\,|y_0|$",
        "bounded, not accurate",
        "bounded, not positive",
        rf"Casimir lost: relative error $>{style.power(CASIMIR_LOST)}$",
        rf"not bounded: $|y|$ {style.number(GROWTH)} times too large",
        f"solver fails in more than {style.number(100 * FAILING)} % of steps",
        "paths lost: not finite",
    )
    return [(Patch(linewidth=0, **_look(number)), texts[number]) for number in present]


def _look(number):
    colour, hatch = LOOKS[number]
    return {"facecolor": colour, "hatch": hatch, "edgecolor": HATCHES[number > 2]}


def _map(ax, group, first):
    """Cells over step size and value, each in the colour of its regime."""
    if group is None:
        ax.set_axis_off()
        return
    h, values = group.coordinates["h"], group.coordinates["value"]
    label = style.label(group)
    ax.set_title("\n".join(style.wrapped(label.split(), " ", 9, SIZE[0] - 0.1)))
    places, is_log = cell_places(values)
    x, y = edges(h, True), edges(places, is_log)
    found = regimes(group)
    for number in np.unique(found).tolist():
        cells = [_cell(x[j], y[i]) for i, j in np.argwhere(found == number)]
        ax.add_collection(PolyCollection(cells, linewidth=0, label=str(number), **_look(number)))
    borders = [_cell(x[j], y[i]) for i, j in np.ndindex(found.shape)]
    ax.add_collection(LineCollection(borders, color="white", linewidth=0.5, zorder=2))
    ax.set_xscale("log", base=2)
    if is_log:
        ax.set_yscale("log")
    ax.set(xlim=(x.min(), x.max()), ylim=(y.min(), y.max()), xlabel="step size $h$")
    _ticks(ax.xaxis, h, h, steps=True, room=5)
    _ticks(ax.yaxis, places, values, steps=False, room=_TICKS)
    ax.tick_params(length=2.5)
    if first:
        ax.set_ylabel(sweep_label(group))
    else:
        ax.tick_params(labelleft=False)


def value_places(values):
    """Where values stand on an axis, and whether it is logarithmic; values that are not all positive by their rank."""
    if (values > 0).all():
        return values, True
    return np.argsort(np.argsort(values)).astype(float), False


def cell_places(values):
    """The same for cells, also by rank if the gaps differ so much that some cells could not be seen."""
    places, is_log = value_places(values)
    gaps = np.diff(np.sort(np.log(values))) if is_log else np.ones(1)
    if len(gaps) > 1 and gaps.max() > _UNEVEN * gaps.min():
        return np.argsort(np.argsort(values)).astype(float), False
    return places, is_log


def sweep_label(group):
    """The axis label of the swept parameter."""
    word = group.attributes.get("sweep", "value")
    label = group.attributes.get("sweep_label") or style.SYMBOLS.get(word, word if len(word) == 1 else None)
    return f"${label}$" if label else style.plain(word.replace("_", " "))


def edges(places, is_log):
    """(low, high) of the cell around each place, half way to its neighbours; shape (places, 2)."""
    x = np.log2(places) if is_log else np.asarray(places, float)
    order = np.argsort(x)
    x = x[order]
    middle = (x[1:] + x[:-1]) / 2
    outer = (x[1:] - x[:-1]) / 2 if len(x) > 1 else np.array([0.5])
    bounds = np.concatenate([[x[0] - outer[0]], middle, [x[-1] + outer[-1]]])
    found = np.empty((len(x), 2))
    found[order] = np.column_stack([bounds[:-1], bounds[1:]])
    return 2.0**found if is_log else found


def _cell(x, y):
    return [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1]), (x[0], y[0])]


def _ticks(axis, places, values, steps, room):
    """Ticks at the places, named by the values, at most so many of them."""
    order = np.argsort(places)[:: -1 if steps else 1][:: int(np.ceil(len(places) / room))]
    names = [f"${style.number(v, steps=True) if steps else style.power(v)}$" for v in map(float, values[order])]
    axis.set_major_locator(FixedLocator(places[order]))
    axis.set_minor_locator(NullLocator())
    axis.set_ticklabels(names)
