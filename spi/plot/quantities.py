"""What the line panels of stability show, by the words of a spec."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..records import Group
from ..regimes import failing_fraction, iterations_per_solve, largest_casimir
from .errors import INTERVAL

CAP = 1e4  # relative errors and growths beyond that are only marked
ZERO = 2.0  # standard errors: up to these a value is statistically zero


class Quantity(NamedTuple):
    """What a panel shows."""

    label: str
    read: Callable  #: the arrays of a group by name -> (values, their standard errors or None), or None if it has none
    is_log: bool = True
    lacking: str = "not stored"  #: what an empty panel says
    dotted: Callable | None = None  #: the same as ``read`` for a second, dotted line
    nan_is_lost: bool = True  #: whether NaN stands for what is no number rather than for what is not known


class Values(NamedTuple):
    """A quantity of one group; arrays (value, h)."""

    group: Group
    values: np.ndarray
    half: np.ndarray  #: half the 95 % interval, NaN where it has none
    dotted: np.ndarray | None


def _plain(name):
    return lambda v: (v[name], None) if name in v else None


def _sampled(name):
    return lambda v: (v[name], v[f"{name}_stderr"]) if name in v else None


def _casimir(which):
    def read(v):
        values = largest_casimir(v[f"casimir_{which}"])
        return None if values is None else (values, None)

    return read


def _solver(ratio):
    return lambda v: (ratio(v), None) if "failures" in v else None


_IMPLICIT = "no implicit scheme"

QUANTITIES = {
    "finite": Quantity("fraction of paths finite to $T$", _plain("finite"), False),
    "casimir": Quantity("largest relative Casimir error", _casimir("worst"), True, "no Casimir", _casimir("median")),
    "norm": Quantity(r"largest $|y|\,/\,|y_0|$", _plain("largest_norm")),
    "error": Quantity(r"rms error at $T$,  relative to $|y_0|$", _sampled("error")),
    "law": Quantity(
        r"$\max_\varphi\,|\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))|$",
        *(_sampled("law_distance"), True, "the law is not known"),
        nan_is_lost=False,
    ),
    "positive": Quantity("fraction of positive paths", _plain("positive"), False),
    "failures": Quantity("solver failures per step", _solver(failing_fraction), True, _IMPLICIT),
    "iterations": Quantity("iterations per step", _solver(iterations_per_solve), False, _IMPLICIT, nan_is_lost=False),
    "angle": Quantity("largest angle of a flow (rad)", _plain("largest_angle")),
}


def read(groups, word):
    """The quantity of each group that has it and where anything of it is known."""
    quantity, found = QUANTITIES[word], []
    for group in groups:
        v = group.arrays
        pair = quantity.read(v)
        if pair is None:
            continue
        values = np.where(np.isnan(pair[0]), np.inf, pair[0]) if quantity.nan_is_lost else np.asarray(pair[0], float)
        if np.isnan(values).all():
            continue
        half = np.full(values.shape, np.nan) if pair[1] is None else INTERVAL * pair[1]
        found.append(Values(group, values, half, quantity.dotted(v)[0] if quantity.dotted else None))
    return found


def is_zero(one):
    """Where a value is zero within ZERO standard errors."""
    with np.errstate(invalid="ignore"):
        return one.values <= ZERO / INTERVAL * one.half
