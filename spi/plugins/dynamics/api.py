"""``spi.rank_histogram``: whether verifying paths are like the members of ensembles."""

from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from spi.numerics.types import Array

_LEAST = 5  # ensembles for each rank, from which on the law of chi^2 holds


class Ranks(NamedTuple):
    """Ranks of verifying values among the members of ensembles."""

    counts: Array  #: (bins,) how many ensembles have so many members below the verifying value
    chi_square: float  #: of equal counts
    p_value: float  #: the probability of a chi^2 as large where verifying values are like members
    spread: float  #: root of the mean variance of the members
    error: (
        float  #: root mean square of verifying value less ensemble mean, times sqrt(M / (M + 1)): equal to the spread
    )


def rank_histogram(members: Any, verifying: Any, *, bins: int | None = None, seed: int = 1) -> Ranks:
    """Rank histogram of the `verifying` value (K,) of each of K ensembles among its `members` (K, M).

    Where it has the law of the members each rank 0, ..., M is equally probable.  A U shape shows too little spread, a
    bump too much, a slope a bias.  With `bins`, a divisor of M + 1, neighbouring ranks are counted together.  Equal
    values are put in order at random, by `seed`.  The `error` of the result is the root mean square of verifying value
    less ensemble mean times sqrt(M / (M + 1)): up to sampling the `spread`, where both have one law.

    Raises ValueError about other shapes, values that are not finite, and fewer than 5 ensembles for each bin.
    """
    members, verifying = np.asarray(members, float), np.asarray(verifying, float)
    if members.ndim != 2 or members.shape[1] < 2 or verifying.shape != members.shape[:1]:
        raise ValueError(f"members are {members.shape} and verifying {verifying.shape}, not (K, M), M > 1, and (K,)")
    if not (np.isfinite(members).all() and np.isfinite(verifying).all()):
        raise ValueError("not all values are finite")
    ensembles, size = members.shape
    bins = size + 1 if bins is None else bins
    if bins < 2 or (size + 1) % bins:
        raise ValueError(f"bins is {bins}, no divisor of {size + 1}, the number of ranks")
    if ensembles < _LEAST * bins:
        raise ValueError(
            f"{ensembles} ensembles are too few for {bins} bins; {_LEAST * bins} are enough, or fewer bins"
        )
    below, equal = ((compare(members, verifying[:, np.newaxis])).sum(axis=1) for compare in (np.less, np.equal))
    ranks = below + np.random.Generator(np.random.Philox(seed)).integers(0, equal, endpoint=True)
    counts = np.bincount(ranks * bins // (size + 1), minlength=bins)
    chi_square = float(((counts - ensembles / bins) ** 2).sum() * bins / ensembles)
    squares = (verifying - members.mean(axis=1)) ** 2 * size / (size + 1)
    spread, error = np.sqrt(members.var(axis=1, ddof=1).mean()), np.sqrt(squares.mean())
    return Ranks(counts, chi_square, float(stats.chi2.sf(chi_square, bins - 1)), float(spread), float(error))
