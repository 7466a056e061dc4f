"""What a scheme keeps of the equation at a step size and a value of a parameter, stored results as a record."""

from typing import NamedTuple

import numpy as np

from spi.storage.records import Description, Group, Solver

#: From good to bad; a scheme is in the worst regime that applies.
REGIMES = (
    *("accurate", "bounded, not accurate", "not positive"),
    *("Casimir lost", "not bounded", "solver fails", "paths diverged"),
)

FAILING = 1e-3  #: of the solves: more failures than that, and what is integrated is another scheme
CASIMIR_LOST = 1e-2  #: relative error of a Casimir
CASIMIR_KEPT = 1e-8  #: the same, of what is kept but for rounding and the solver's tolerance
GROWTH = 2.0  #: of the largest |y|, compared with that at the smallest step size


class CasimirErrors(NamedTuple):
    """The largest relative error along each path of C Casimir functions, of V values and S step sizes."""

    worst: np.ndarray  #: (V, S, C) of all paths
    median: np.ndarray  #: (V, S, C)

    @property
    def largest_worst(self) -> np.ndarray:
        """(V, S) that of the Casimir with the largest error; NaN counts as the largest."""
        return self.worst.max(axis=-1)

    @property
    def largest_median(self) -> np.ndarray:
        """(V, S) the same of the median path."""
        return self.median.max(axis=-1)


class Law(NamedTuple):
    """Expectations of F test functions at the final time against their true values, NaN where these are unknown."""

    names: tuple[str, ...]  #: (F,) of the test functions
    functions: tuple[str, ...]  #: (F,) their expressions
    expectation: np.ndarray  #: (V, S, F) means over the paths
    expectation_stderr: np.ndarray  #: (V, S, F)
    truth: np.ndarray  #: (V, F) E phi(y(T)) of the equation
    truth_bound: np.ndarray  #: (V, F) numerical error of it
    distance: np.ndarray  #: (V, S) the largest |mean - truth| over the test functions
    distance_stderr: np.ndarray  #: (V, S) sampling and numerical error of it


class Stability(NamedTuple):
    """What one scheme keeps of the equation at V values of a parameter and S step sizes, from large to small."""

    about: Description
    word: str  #: the swept parameter of the spec
    values: np.ndarray  #: (V,) of the swept parameter
    h: np.ndarray  #: (S,)
    finite: np.ndarray  #: (V, S) fraction of the paths that are finite at the final time
    largest_norm: np.ndarray  #: (V, S) largest |y| over paths and times, relative to |y_0|
    error: np.ndarray  #: (V, S) root mean square error at the final time, relative to |y_0|
    error_stderr: np.ndarray  #: (V, S)
    casimirs: CasimirErrors | None  #: None for a model without Casimir functions
    positive: np.ndarray | None  #: (V, S) fraction of the paths that stay positive; None unless y are populations
    largest_angle: np.ndarray | None  #: (V, S) of a rotation in rad, 0 if none exceeded pi/4; None if not watched
    solver: Solver | None  #: arrays (V, S); None for an explicit scheme
    law: Law | None  #: None without test functions
    accurate: float  #: an error up to this counts as accurate
    samples: int  #: paths
    reference_step: float
    reference_scheme: str | None  #: None where each scheme is its own reference
    panels: tuple[str, ...]  #: what the figure shows
    seconds: float  #: wall-clock time of the study
    threads: int  #: used for it

    @property
    def all_finite(self) -> np.ndarray:
        """(V, S) whether all paths are finite at the final time."""
        return self.finite >= 1.0

    @property
    def is_accurate(self) -> np.ndarray:
        """(V, S) whether the error counts as accurate; NaN does not."""
        return self.error <= self.accurate

    @property
    def regimes(self) -> np.ndarray:
        """(V, S) number of the regime in :data:`REGIMES`.

        A scheme is not bounded where |y| becomes more than GROWTH times as large as at the smallest step size, since
        the true solution may grow as well.  NaN is never good.
        """
        norm = np.where(np.isnan(self.largest_norm), np.inf, self.largest_norm)
        finest = norm[:, [np.argmin(self.h)]]
        never = np.zeros(norm.shape, bool)
        worst_first = [
            ~self.all_finite,
            self.solver.failing_fraction > FAILING if self.solver else never,
            ~(norm <= GROWTH * finest) | np.isinf(norm),
            ~(self.casimirs.largest_worst <= CASIMIR_LOST) if self.casimirs else never,
            never if self.positive is None else ~(self.positive >= 1.0),
            ~self.is_accurate,
            ~never,
        ]
        return np.select(worst_first, range(len(REGIMES))[::-1])


def read(group: Group) -> Stability:
    """The stability of a scheme in a stored group."""
    v, a = group.arrays, group.attributes
    return Stability(
        about=Description.of(group),
        word=a["sweep"],
        values=group.coordinates["value"],
        h=group.coordinates["h"],
        **{name: v[name] for name in ("finite", "largest_norm", "error", "error_stderr")},
        casimirs=CasimirErrors(v["casimir_worst"], v["casimir_median"]) if v["casimir_worst"].shape[-1] else None,
        positive=v.get("positive"),
        largest_angle=v.get("largest_angle"),
        solver=Solver.of(v),
        law=_law(group) if "function" in group.coordinates else None,
        accurate=a["accurate"],
        samples=a["samples"],
        reference_step=a["reference_step"],
        reference_scheme=a.get("reference_scheme"),
        panels=a["panels"],
        seconds=a["wall_seconds"],
        threads=a["threads"],
    )


def _law(group: Group) -> Law:
    v = group.arrays
    return Law(
        names=tuple(group.coordinates["function"].tolist()),
        functions=group.attributes["functions"],
        **{name: v[name] for name in ("expectation", "expectation_stderr", "truth", "truth_bound")},
        distance=v["law_distance"],
        distance_stderr=v["law_distance_stderr"],
    )


def largest_step(h: np.ndarray, good: np.ndarray) -> tuple[float, bool]:
    """The largest step size that is good together with all smaller ones, and whether that is all of them; NaN if none.

    `h` (S,) in any order, `good` (S,).
    """
    order = np.argsort(h)
    count = int(np.logical_and.accumulate(np.asarray(good, bool)[order]).sum())
    return (float(h[order][count - 1]) if count else float("nan")), count == len(order) > 0
