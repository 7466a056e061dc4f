"""What the line panels of stability show, by the words of a spec."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from spi.drawing.axes import INTERVAL

from ..results import Stability

CAP = 1e4  # relative errors and growths beyond that are only marked
ZERO = 2.0  # standard errors: up to these a value is statistically zero


Found = tuple[np.ndarray, np.ndarray | None] | None  #: values and, if they have any, their standard errors
Read = Callable[[Stability], Found]


class Quantity(NamedTuple):
    """What a panel shows."""

    label: str
    read: Read  #: what a reading has of it, or None
    is_log: bool = True
    lacking: str = "not stored"  #: what an empty panel says
    dotted: Read | None = None  #: the same as ``read`` for a second, dotted line
    nan_is_lost: bool = True  #: whether NaN stands for what is no number rather than for what is not known


class Values(NamedTuple):
    """A quantity of one reading; arrays (V, S)."""

    reading: Stability
    values: np.ndarray
    half: np.ndarray  #: half the 95 % interval, NaN where it has none
    dotted: np.ndarray | None


def _plain(name: str) -> Read:
    def read(reading: Stability) -> Found:
        values = getattr(reading, name)
        return None if values is None else (values, None)

    return read


def _of(part: str, name: str, stderr: str | None = None) -> Read:
    """The same for a field of an optional part of a reading, and the field of its standard errors if it has one."""

    def read(reading: Stability) -> Found:
        found = getattr(reading, part)
        return (getattr(found, name), getattr(found, stderr) if stderr else None) if found else None

    return read


_IMPLICIT = "no implicit scheme"

QUANTITIES = {
    "finite": Quantity("fraction of paths finite to $T$", _plain("finite"), is_log=False),
    "casimir": Quantity(
        "largest relative Casimir error",
        _of("casimirs", "largest_worst"),
        lacking="no Casimir",
        dotted=_of("casimirs", "largest_median"),
    ),
    "norm": Quantity(r"largest $|y|\,/\,|y_0|$", _plain("largest_norm")),
    "error": Quantity(r"rms error at $T$,  relative to $|y_0|$", lambda reading: (reading.error, reading.error_stderr)),
    "law": Quantity(
        r"$\max_\varphi\,|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$",
        _of("law", "distance", "distance_stderr"),
        lacking="the law is not known",
        nan_is_lost=False,
    ),
    "positive": Quantity("fraction of positive paths", _plain("positive"), is_log=False),
    "failures": Quantity("solver failures per step", _of("solver", "failing_fraction"), lacking=_IMPLICIT),
    "iterations": Quantity(
        "iterations per step",
        _of("solver", "iterations_per_solve"),
        is_log=False,
        lacking=_IMPLICIT,
        nan_is_lost=False,
    ),
    "angle": Quantity("largest angle of a flow (rad)", _plain("largest_angle")),
}


def values_of(readings: Iterable[Stability], word: str) -> list[Values]:
    """The quantity of each reading that has it and where anything of it is known."""
    quantity, found = QUANTITIES[word], []
    for reading in readings:
        pair = quantity.read(reading)
        if pair is None:
            continue
        values = np.where(np.isnan(pair[0]), np.inf, pair[0]) if quantity.nan_is_lost else np.asarray(pair[0], float)
        if np.isnan(values).all():
            continue
        half = np.full(values.shape, np.nan) if pair[1] is None else INTERVAL * pair[1]
        dotted = quantity.dotted(reading) if quantity.dotted else None
        found.append(Values(reading, values, half, dotted[0] if dotted else None))
    return found


def is_zero(one: Values) -> np.ndarray:
    """Where a value is zero within ZERO standard errors."""
    with np.errstate(invalid="ignore"):
        return one.values <= ZERO / INTERVAL * one.half
