"""Stored trajectories as records."""

import math
from typing import NamedTuple

import numpy as np

from spi.storage.records import Description, Group


class SolverMeans(NamedTuple):
    """What an implicit scheme reports of its equations, over all steps."""

    failures: int
    iterations_per_step: float
    largest_residual: float  #: relative


class Trajectory(NamedTuple):
    """One path of a scheme at the times t_n = n k h, n = 0, ..., N, of a model with d components and C Casimirs."""

    about: Description
    t: np.ndarray  #: (N + 1,)
    y: np.ndarray  #: (N + 1, d), not finite from where the path diverged
    hamiltonian: np.ndarray  #: (N + 1,) H(y_n)
    casimirs: np.ndarray  #: (N + 1, C)
    casimir_changes: np.ndarray  #: (N + 1, C) C(y_n) - C(y_0), with damping exp(k gamma t) C(y_n) - C(y_0)
    casimir_drift: tuple[float, ...]  #: (C,) their largest modulus
    nonfinite_from: float | None  #: the first time at which y is not finite
    step: float  #: h
    every: int  #: k, of so many states one is stored
    path: int  #: number of the Brownian path
    panels: tuple[str, ...]  #: what the figure of the case shows
    preserves: str  #: what the scheme preserves, as its row in ``spi.schemes.SCHEMES`` says
    largest_angle: float  #: of a rotation, in rad; 0 if none exceeded pi/4
    solver: SolverMeans | None  #: None for an explicit scheme
    lattice: int | None  #: N where y is a vorticity on the lattice modulo N, see ``spi.models.zeitlin.lattice``
    times: tuple[float, ...]  #: those of the stored states at which fields are drawn, () if the spec names none

    @property
    def shown(self) -> list[int]:
        """The numbers of the states that are drawn as fields: by default the first, the one in the middle, the last."""
        if self.times:
            return np.searchsorted(self.t, [t - self.t[1] / 2 for t in self.times]).tolist()
        return sorted({0, (len(self.t) - 1) // 2, len(self.t) - 1})

    @property
    def preserves_nothing(self) -> bool:
        """Whether the scheme makes no promise that would hold its paths together."""
        return self.preserves == "nothing"

    @property
    def preserves_casimirs(self) -> bool:
        """Whether the scheme preserves all Casimirs, as a Poisson map does."""
        return "Poisson structure" in self.preserves

    @property
    def lowest(self) -> np.ndarray:
        """(d,) the smallest value of each component where it is finite; infinite where it never is."""
        return np.where(np.isfinite(self.y), self.y, np.inf).min(axis=0)


def read(group: Group) -> Trajectory:
    """The trajectory in a stored group."""
    v, a = group.arrays, group.attributes
    solver = None
    if "solver_failures" in a:
        solver = SolverMeans(a["solver_failures"], a["solver_iterations_mean"], a["solver_largest_residual"])
    with np.errstate(invalid="ignore", over="ignore"):
        change = v["casimirs"] - v["casimirs"][0]
    return Trajectory(
        about=Description.of(group),
        t=group.coordinates["t"],
        y=v["y"],
        hamiltonian=v["hamiltonian"],
        casimirs=v["casimirs"],
        casimir_changes=v.get("casimir_changes", change),
        casimir_drift=a["casimir_drift"],
        step=a["step"],
        every=a.get("every") or 1,
        path=a["path"],
        panels=a["panels"],
        preserves=a["preserves"],
        nonfinite_from=None if np.isnan(a["nonfinite_from"]) else a["nonfinite_from"],
        largest_angle=a.get("largest_angle", 0.0),
        solver=solver,
        lattice=math.isqrt(v["y"].shape[1] + 1) if a.get("lattice") == "torus" else None,
        times=a.get("times") or (),
    )
