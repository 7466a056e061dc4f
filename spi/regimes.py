"""What a scheme keeps of the equation at a step size and a value of a parameter, read from stored results."""

import numpy as np

#: From good to bad; a scheme is in the worst regime that applies.
REGIMES = (
    *("accurate", "bounded, not accurate", "not positive"),
    *("Casimir lost", "not bounded", "solver fails", "paths lost"),
)

FAILING = 1e-3  #: of the solves: more failures than that, and what is integrated is another scheme
CASIMIR_LOST = 1e-2  #: relative error of a Casimir
CASIMIR_KEPT = 1e-8  #: the same, of what is kept but for rounding and the solver's tolerance
GROWTH = 2.0  #: of the largest |y|, compared with that at the smallest step size


def regimes(group):
    """Number of the regime in :data:`REGIMES` of each value and step size, shape (value, h).

    A scheme is not bounded where |y| becomes more than GROWTH times as large as at the smallest step size, since the
    true solution may grow as well.  NaN is never good.
    """
    v = group.arrays
    norm = np.where(np.isnan(v["largest_norm"]), np.inf, v["largest_norm"])
    finest = norm[:, [np.argmin(group.coordinates["h"])]]
    casimir = largest_casimir(v["casimir_worst"])
    never = np.zeros(norm.shape, bool)
    worst_first = [
        ~(v["finite"] >= 1.0),
        failing_fraction(v) > FAILING if "failures" in v else never,
        ~(norm <= GROWTH * finest) | np.isinf(norm),
        never if casimir is None else ~(casimir <= CASIMIR_LOST),
        ~(v["positive"] >= 1.0) if "positive" in v else never,
        ~(v["error"] <= group.attributes["accurate"]),
        ~never,
    ]
    return np.select(worst_first, range(len(REGIMES))[::-1])


def largest_casimir(values):
    """The largest over the last axis, Casimirs; None if there is none.  NaN counts as the largest."""
    return values.max(axis=-1) if values.shape[-1] else None


def failing_fraction(v):
    """Failures over solves of an implicit scheme; 0 where nothing was solved."""
    solves = np.asarray(v["solves"], float)
    return np.divide(v["failures"], solves, out=np.zeros(solves.shape), where=solves > 0)


def iterations_per_solve(v):
    """Iterations over solves of an implicit scheme; NaN where nothing was solved."""
    solves = np.asarray(v["solves"], float)
    return np.divide(v["iterations"], solves, out=np.full(solves.shape, np.nan), where=solves > 0)


def largest_step(h, good):
    """The largest step size that is good together with all smaller ones, and whether that is all of them; NaN if none.

    `h` (steps,) in any order, `good` (steps,).
    """
    order = np.argsort(h)
    count = int(np.logical_and.accumulate(np.asarray(good, bool)[order]).sum())
    return (float(h[order][count - 1]) if count else float("nan")), count == len(order) > 0
