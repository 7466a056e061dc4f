"""Axes for the values of a parameter: where these, cells around them, and ticks stand."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, NullLocator

from . import style
from .axes import power_ticks, rules

_WIDE = 20.0  # ratio of values above which their axis is logarithmic
_UNEVEN = 3.0  # largest gap over smallest, in logarithms


def swept_axis(ax: Axes, word: str, values: np.ndarray) -> np.ndarray:
    """Scale, ticks and label of a horizontal axis for the values of a parameter; returns where its points are."""
    rules(ax)
    ax.set_xlabel(style.word(word))
    positive = values[values > 0]
    if len(values) > 2 and len(positive) == len(values) and (np.frexp(values)[0] == 0.5).all():
        ax.set_xscale("log", base=2)
        ax.set_xlim(values.min() / 1.25, values.max() * 1.25)
        power_ticks(ax, values)
        return values
    sizes = np.abs(values[values != 0])
    if sizes.size and sizes.max() <= _WIDE * sizes.min():
        return values
    places, is_log = value_places(values)
    if is_log:
        ax.set_xscale("log")
    else:
        ax.set_xticks(places, [f"${style.number(float(value))}$" for value in values])
    return places


def value_places(values: np.ndarray) -> tuple[np.ndarray, bool]:
    """Where values stand on an axis, and whether it is logarithmic; values that are not all positive by their rank."""
    if (values > 0).all():
        return values, True
    return np.argsort(np.argsort(values)).astype(float), False


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
