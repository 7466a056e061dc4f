"""Stored results of long times as records."""

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from spi.storage.records import Description, Group, Solver


class Law(NamedTuple):
    """The law of the states beside the exact stationary one, at S step sizes, from the snapshots of all paths.

    Means of M moments such as y_1^2, and V variables such as y_1, each with B bins of equal probability.
    """

    variables: tuple[str, ...]  #: (V,)
    moments: tuple[str, ...]  #: (M,)
    mean: np.ndarray  #: (S, M)
    mean_stderr: np.ndarray  #: (S, M)
    mean_exact: np.ndarray  #: (M,)
    fraction: np.ndarray  #: (S, V, B) of the snapshots in each bin; exact: 1 / B
    fraction_stderr: np.ndarray  #: (S, V, B)
    distance: np.ndarray  #: (S, V) largest difference from the exact distribution function
    distance_stderr: np.ndarray  #: (S, V)

    @property
    def z(self) -> np.ndarray:
        """(S, M) means less their exact values, in standard errors."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self.mean - self.mean_exact) / self.mean_stderr


class LongTimes(NamedTuple):
    """Paths of one scheme over very many steps at S step sizes, from large to small, of a model with C Casimirs.

    Errors of the Casimirs are C(y_n) / C(y_0) - 1 (absolute ones if C(y_0) = 0), after N numbers of steps.
    """

    about: Description
    h: np.ndarray  #: (S,)
    n: np.ndarray  #: (N,) numbers of steps
    casimir_mean: np.ndarray  #: (S, N, C) mean error over the paths
    casimir_rms: np.ndarray  #: (S, N, C) root of its mean square
    casimir_worst: np.ndarray  #: (S, N, C) largest modulus
    casimir_one: np.ndarray  #: (S, N, C) error of path 0
    growth: np.ndarray  #: (S, C) p of rms = const n^p; NaN where it cannot be fitted, as the next two
    growth_low: np.ndarray  #: (S, C) of its 95 % interval
    growth_high: np.ndarray  #: (S, C)
    bias: np.ndarray  #: (S, C) mean error at the end, per step
    bias_stderr: np.ndarray  #: (S, C)
    nonfinite: np.ndarray  #: (S,) diverged paths (NaN or infinity)
    solver: Solver | None  #: (S,) each; None for an explicit scheme
    law: Law | None  #: None where the stationary law is not known
    samples: int  #: paths
    steps_each: int  #: of each path
    snapshots: int  #: of each path that count for the law
    panels: tuple[str, ...]  #: what the figure of the case shows
    wall_seconds: float
    threads: int

    @property
    def casimir_count(self) -> int:
        """C."""
        return self.casimir_rms.shape[2]

    @property
    def largest_finite(self) -> int | None:
        """Number of the largest step size at which all paths are finite; None if there is none."""
        finite = np.flatnonzero(self.nonfinite == 0)
        return int(finite[np.argmax(self.h[finite])]) if len(finite) else None


def with_laws(readings: Iterable[LongTimes]) -> Iterator[tuple[LongTimes, Law]]:
    """The readings of which the law is known, each with its law."""
    return ((reading, reading.law) for reading in readings if reading.law)


#: The fields of :class:`LongTimes` that are variables and attributes of a group.
_VARIABLES = (
    *("casimir_mean", "casimir_rms", "casimir_worst", "casimir_one"),
    *("growth", "growth_low", "growth_high", "bias", "bias_stderr", "nonfinite"),
)
_ATTRIBUTES = ("samples", "steps_each", "snapshots", "panels", "wall_seconds", "threads")


def read(group: Group) -> LongTimes:
    """The results of long times in a stored group."""
    v, a = group.arrays, group.attributes
    fields: dict[str, Any] = {name: v[name] for name in _VARIABLES} | {name: a[name] for name in _ATTRIBUTES}
    return LongTimes(
        about=Description.of(group),
        h=group.coordinates["h"],
        n=group.coordinates["n"],
        **fields,
        solver=Solver.of(v),
        law=_law(group.coordinates, v) if "law_distance" in v else None,
    )


def _law(coordinates: dict[str, np.ndarray], v: dict[str, np.ndarray]) -> Law:
    same = ("mean", "mean_stderr", "mean_exact", "fraction", "fraction_stderr")
    return Law(
        variables=tuple(coordinates["variable"].tolist()),
        moments=tuple(coordinates["moment"].tolist()),
        **{name: v[name] for name in same},
        distance=v["law_distance"],
        distance_stderr=v["law_distance_stderr"],
    )
