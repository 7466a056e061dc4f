"""Maps of cells over two parameters: where cells and ticks stand."""

import math

import numpy as np
from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, NullLocator

from . import style
from .sweeps import value_places

_UNEVEN = 3.0  # largest gap over smallest, in logarithms


def cell_places(values: np.ndarray) -> tuple[np.ndarray, bool]:
    """Where cells of values stand on an axis, and whether it is logarithmic.

    By their logarithms, or by their rank if they are not all positive, or if gaps differ so much that some cells could
    not be seen.
    """
    places, is_log = value_places(values)
    gaps = np.diff(np.sort(np.log(values))) if is_log else np.ones(1)
    if len(gaps) > 1 and gaps.max() > _UNEVEN * gaps.min():
        return np.argsort(np.argsort(values)).astype(float), False
    return places, is_log


def edges(places: np.ndarray, is_log: bool) -> np.ndarray:
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


def ticks(axis: Axis, places: np.ndarray, values: np.ndarray, steps: bool, room: int) -> None:
    """Ticks at the places, named by the values, at most so many of them."""
    order = np.argsort(places)[:: -1 if steps else 1][:: int(np.ceil(len(places) / room))]
    shown = [float(value) for value in values[order]]
    powers = all(value > 0 and math.isclose(math.log10(value) % 1, 0) for value in shown)
    names = [f"${style.power(value) if powers and not steps else style.number(value, steps)}$" for value in shown]
    axis.set_major_locator(FixedLocator(places[order].tolist()))
    axis.set_minor_locator(NullLocator())
    axis.set_ticklabels(names)
