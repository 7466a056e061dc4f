"""What the line panels of stability show, by the words of a spec."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from spi.drawing.axes import INTERVAL

from ..results import Stability

CAP = 1e4  # relative errors and growths beyond that are only marked
ZERO = 2.0  # standard errors: up to these a value is statistically zero


class Quantity(NamedTuple):
    """What a panel shows."""

    label: str
    field: str  #: of a reading, perhaps of a part that it need not have
    is_log: bool = True
    lacking: str = "not stored"  #: what an empty panel says
    dotted: str = ""  #: the same for a second, dotted line
    nan_is_lost: bool = True  #: whether NaN stands for what is no number rather than for what is not known


class Values(NamedTuple):
    """A quantity of one reading; arrays (V, S)."""

    reading: Stability
    values: np.ndarray
    half: np.ndarray  #: half the 95 % interval, NaN where it has none
    dotted: np.ndarray | None


_IMPLICIT = "no implicit scheme"

QUANTITIES = {
    "finite": Quantity("fraction of paths finite to $T$", "finite", is_log=False),
    "casimir": Quantity(
        "largest relative Casimir error",
        "casimirs.largest_worst",
        lacking="no Casimir",
        dotted="casimirs.largest_median",
    ),
    "norm": Quantity(r"largest $|y|\,/\,|y_0|$", "largest_norm"),
    "error": Quantity(r"rms error at $T$,  relative to $|y_0|$", "error"),
    "law": Quantity(
        r"$\max_\varphi\,|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$",
        "law.distance",
        lacking="the law is not known",
        nan_is_lost=False,
    ),
    "positive": Quantity("fraction of positive paths", "positive", is_log=False),
    "failures": Quantity("solver failures per step", "solver.failing_fraction", lacking=_IMPLICIT),
    "iterations": Quantity(
        "iterations per step",
        "solver.iterations_per_solve",
        is_log=False,
        lacking=_IMPLICIT,
        nan_is_lost=False,
    ),
    "angle": Quantity("largest angle of a flow (rad)", "largest_angle"),
}


def values_of(readings: Iterable[Stability], word: str) -> list[Values]:
    """The quantity of each reading that has it and where anything of it is known."""
    quantity, found = QUANTITIES[word], []
    for reading in readings:
        values = reading.known(quantity.field)
        if values is None:
            continue
        values = np.where(np.isnan(values), np.inf, values) if quantity.nan_is_lost else np.asarray(values, float)
        if np.isnan(values).all():
            continue
        stderr = reading.known(f"{quantity.field}_stderr")
        half = np.full(values.shape, np.nan) if stderr is None else INTERVAL * stderr
        found.append(Values(reading, values, half, reading.known(quantity.dotted) if quantity.dotted else None))
    return found


def is_zero(one: Values) -> np.ndarray:
    """Where a value is zero within ZERO standard errors."""
    with np.errstate(invalid="ignore"):
        return one.values <= ZERO / INTERVAL * one.half
