"""Means, standard errors and orders of convergence, from sums over jackknife groups of paths.

Paths fall into GROUPS jackknife groups, lane l of block b into group (b mod 8) * 8 + l mod 8, of which only sums are
kept, so that memory does not grow with the number of paths.  Standard errors and intervals come from leaving out one
group at a time, which needs no assumption on how the errors at different step sizes depend on one another: they share
their paths.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spi.numerics.types import Array

from ..numerics.groups import GROUPS, ROUND
from ..numerics.groups import group_counts as group_counts  # where paths and sums over groups are looked for
from ..numerics.rng import LANES, PARTS
from ..storage.records import Order, student
from .tallies import Batch

# ---------------------------------------------------------------------------------------------------------------------
# Sums of powers of values over jackknife groups of paths, and the means that follow from them.
# ---------------------------------------------------------------------------------------------------------------------


def with_powers(sums: np.ndarray, values: np.ndarray, batch: Batch) -> np.ndarray:
    """Sums (powers, ..., GROUPS) with the values (blocks, ..., LANES) of a batch and their powers added.

    One after the other, so that the bits do not depend on how blocks are divided into batches.
    """
    blocks, before = batch.blocks, batch.first % ROUND
    rounds = -(-(before + blocks) // ROUND)
    counted = batch.counted.reshape(blocks, *[1] * (values.ndim - 2), LANES)
    values = np.where(counted, values, 0.0)
    # (rounds, lanes of a part, ...): what is added to the sums of all groups at once
    ordered = np.zeros((rounds, LANES // PARTS, values[0, ..., 0].size, ROUND, PARTS))
    by_part = values.reshape(blocks, -1, LANES // PARTS, PARTS)
    for block, parts in enumerate(by_part, before):
        ordered[block // ROUND, :, :, block % ROUND] = parts.swapaxes(0, 1)
    added, power = np.empty_like(sums), np.ones_like(ordered)
    for k, sum_of_power in enumerate(sums):
        with np.errstate(all="ignore"):
            power = power * ordered
            rows = power.reshape(rounds * LANES // PARTS, -1)
            added[k] = np.add.reduce(np.vstack([sum_of_power.reshape(1, -1), rows])).reshape(sum_of_power.shape)
    return added


def by_group(values: Array, batch: Batch) -> Array:
    """(..., GROUPS): sums over jackknife groups of values (blocks, LANES, ...) of a batch, whatever idle paths hold."""
    sums = np.zeros((*values.shape[2:], ROUND, PARTS), values.dtype)
    for b, (block, counted) in enumerate(zip(values, batch.counted, strict=True), batch.first):
        used = np.where(counted.reshape(-1, *[1] * (block.ndim - 1)), block, 0)
        parts = used.reshape(LANES // PARTS, PARTS, *block.shape[1:]).sum(axis=0)
        sums[..., b % ROUND, :] += np.moveaxis(parts, 0, -1)
    return sums.reshape(*values.shape[2:], GROUPS)


def mean_over_paths(sums: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over all paths of sums (..., GROUPS), and the same without each group in turn, (groups with paths, ...)."""
    used = counts > 0
    sums, counts = sums[..., used], counts[used]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        total = sums.sum(axis=-1)
        without = (total[..., np.newaxis] - sums) / (counts.sum() - counts)
        return total / counts.sum(), np.moveaxis(without, -1, 0)


def standard_deviation(mean: np.ndarray, mean_square: np.ndarray) -> np.ndarray:
    """The standard deviation of a quantity, from the means of it and of its square."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.sqrt(np.maximum(mean_square - mean**2, 0.0))


def kurtosis(powers: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """E (x - E x)^4 / variance^2 from the means (4, ...) of x, x^2, x^3 and x^4."""
    m1, m2, m3, m4 = powers
    with np.errstate(all="ignore"):
        return np.asarray((m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4) / variance**2)


#: Samples at least, in units of their kurtosis: below, the standard error of their mean is not to be trusted.
TAILS = 8.0
_BY_CHANCE = 16.0  # kurtosis that few samples of a law without heavy tails may have


def kurtosis_of_groups(variance: np.ndarray, without: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Kurtosis of n samples, whose variance has the relative variance (kurtosis - 1) / n by the jackknife."""
    with np.errstate(all="ignore"):
        return np.asarray(1.0 + counts.sum() * (jackknife_stderr(variance, without, counts) / variance) ** 2)


def few_carry(kurtosis: np.ndarray, samples: int) -> np.ndarray:
    """Whether few of the samples carry their variance, so that there may be larger ones that none shows."""
    with np.errstate(invalid="ignore"):
        return (kurtosis > _BY_CHANCE) & (samples < TAILS * kurtosis)


# ---------------------------------------------------------------------------------------------------------------------
# Richardson extrapolation: values at the steps h, 2h, 4h, ... combined so that the first powers of h cancel.
#
# Where v(h) = v(0) + a h^p + b h^q + ..., the combination (2^p v(h) - v(2h)) / (2^p - 1) is v(0) + b' h^q + ...; doing
# the same with q, and so on, is one linear combination of v(h), v(2h), v(4h), ... whose weights add up to 1.
#
# Sums are no matrix products, because in these the order of summation, so the last digits, depends on the processor.
# ---------------------------------------------------------------------------------------------------------------------


def weights(exponents: Sequence[float]) -> np.ndarray:
    """w with sum_i w_i = 1 and sum_i w_i 2^(i q) = 0 for each q in `exponents`, shape (len(exponents) + 1,).

    sum_i w_i v(2^i h) then has no term of these powers of h.
    """
    w = np.ones(1)
    for q in exponents:
        w = (2.0**q * np.append(w, 0.0) - np.append(0.0, w)) / (2.0**q - 1.0)
    return w


def places(steps: Sequence[float], levels: int) -> np.ndarray:
    """Indices of h, 2h, ..., 2^levels h in `steps`, (S', levels + 1): a row for each h for which all of these exist."""
    at = {h: i for i, h in enumerate(steps)}
    multiples = [[h * 2.0**i for i in range(levels + 1)] for h in steps]
    rows = [[at[step] for step in row] for row in multiples if all(step in at for step in row)]
    return np.array(rows, np.int64).reshape(-1, levels + 1)


class Extrapolation(NamedTuple):
    """Linear combinations that extrapolate values at S steps, giving values at S' <= S steps; none without levels."""

    places: np.ndarray  #: (S', levels + 1), see :func:`places`
    weights: np.ndarray  #: (levels + 1,), see :func:`weights`

    @classmethod
    def of(cls, steps: Sequence[float], exponents: Sequence[float]) -> "Extrapolation":
        """Extrapolation that removes the powers `exponents` of h, one for each level."""
        return cls(places(steps, len(exponents)), weights(exponents))

    @property
    def levels(self) -> int:
        """Number of powers of h that are removed."""
        return len(self.weights) - 1

    @property
    def chosen(self) -> np.ndarray:
        """(S',) the indices of the steps at which there are extrapolated values."""
        return self.places[:, 0]

    def combined(self, values: np.ndarray) -> np.ndarray:
        """Values (..., S) extrapolated, (..., S')."""
        return (values[..., self.places] * self.weights).sum(axis=-1) if self.levels else values

    def combined_bounds(self, bounds: np.ndarray) -> np.ndarray:
        """Bounds of the errors of the combined values, (..., S'), from those of the values, (..., S)."""
        return (bounds[..., self.places] * np.abs(self.weights)).sum(axis=-1) if self.levels else bounds


#: A value counts as resolved if it is at least this many standard errors.
RESOLVED = 4.0
_EXACT = 0.01  # errors are no powers of h to better than this, so that a more exact one has no more weight in a fit
_SMALL = 1e-5  # relative, of what selection adds to a value
_ITERATIONS = 20  # each moves a point at RESOLVED by about 0.7 of what the one before did, others by less


def root_mean_square(sums: Array, counts: Array) -> tuple[Array, Array]:
    """Root of the mean and its leave-one-out values.

    `sums` (GROUPS, ...) are sums of squares, `counts` (GROUPS,) the numbers of paths.  Returns the root of total sum
    over total count, shape (...), and the same without each group in turn, shape (groups with paths, ...).
    """
    used = counts > 0
    sums, counts = sums[used], counts[used]
    total, n = sums.sum(axis=0), counts.sum()
    rest = (n - counts).reshape(-1, *[1] * total.ndim)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # the difference of nearly equal sums may round to just below 0
        without = np.sqrt(np.maximum(total - sums, 0.0) / rest) if len(counts) > 1 else np.full_like(sums, np.nan)
        return np.sqrt(total / n), without


def stderr_of_mean(values: Array) -> Array:
    """Standard error of the mean over the last axis, independent paths; NaN for one path."""
    paths = values.shape[-1]
    with np.errstate(all="ignore"):
        return values.std(axis=-1, ddof=1) / np.sqrt(paths) if paths > 1 else np.full(values.shape[:-1], np.nan)


class Jackknife(NamedTuple):
    """What leave-one-out values tell of a value, of shape (...)."""

    value: Array  #: without its bias of the order of 1 over the number of groups, as of the square of a mean
    stderr: Array
    third: Array  #: its third cumulant, by which its law is skewed


def jackknife(value: Array | float, without: Array, counts: Array) -> Jackknife:
    """Value, standard error and skewness from leave-one-out values (groups, ...), for groups of unequal size.

    With weights w_g = n / n_g: the mean over paths, and sqrt(1/G sum_g (p_g - mean)^2 / (w_g - 1)), of the
    pseudo-values p_g = w_g value - (w_g - 1) without_g (Busing, Meijer and van der Leeden, Statistics and Computing 9,
    1999); and sum_g (p_g - mean)^3 / G^3.  NaN for fewer than two groups; inf or NaN where a value is not finite.
    """
    counts = counts[counts > 0]
    if len(counts) < 2:
        return Jackknife(*np.full((3, *np.shape(value)), np.nan))
    w = (counts.sum() / counts).reshape(-1, *[1] * np.ndim(value))
    with np.errstate(invalid="ignore", over="ignore"):
        pseudo = w * value - (w - 1.0) * without
        mean = (pseudo / w).sum(axis=0)
        away = pseudo - mean
        stderr = np.sqrt(np.mean(away**2 / (w - 1.0), axis=0))
        return Jackknife(mean, stderr, (away**3).sum(axis=0) / float(len(counts)) ** 3)


def jackknife_stderr(value: Array | float, without: Array, counts: Array) -> Array:
    """Standard error of :func:`jackknife`."""
    return jackknife(value, without, counts).stderr


def is_resolved(value: Array, stderr: Array) -> Array:
    """Whether a value stands clear of its standard error."""
    with np.errstate(invalid="ignore"):
        return np.isfinite(value) & np.isfinite(stderr) & (value > 0.0) & (value >= RESOLVED * stderr)


def samples_needed(value: Array, stderr: Array, samples: int) -> Array:
    """About how many samples would resolve a value that `samples` did not; NaN if that cannot be said."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return samples * (RESOLVED * stderr / value) ** 2


def note_unresolved(error: Array, stderr: Array, resolved: Array, samples: int) -> str:
    """The reason why errors are not resolved, and how many samples would do, as text; "" if all are."""
    finite = np.isfinite(error)
    if resolved.all():
        return ""
    if samples == 1:
        return "one path has no standard error: not resolved"
    if not finite.all():
        return "the mean square is infinite where paths diverged (NaN or infinity) or nearly so"
    if not error.any():
        return "errors of 0 have no order"
    needed = samples_needed(error, stderr, samples)[~resolved].max()
    if not np.isfinite(needed) or needed <= 0:
        return f"in brackets: errors below {RESOLVED:g} standard errors"
    return f"in brackets: not resolved, would need about {float(f'{needed:.1g}'):.0f} samples"


def fit_order(
    h: Array,
    value: Array,
    without: Array,
    counts: Array,
    use: Array,
    reference_step: float = 0.0,
    stderr: Array | None = None,
) -> Order:
    """Order p of value = C h^p, by least squares in logarithms through the points `use`, with its 95 % interval.

    The values are distances from a reference of the same scheme at step h_ref and lack the reference's own error, which
    makes a plain slope too steep (for steps from 8 to 2048 h_ref by 0.01 for p = 1/2).  If the two errors are
    independent, as they are for p = 1/2, C h^p is value / (1 - r^(2p))^(1/2) with r = h_ref/h; if p = 1 and they are
    proportional along each path, it is value / (1 - r).  The order is the middle of the slopes of the former and of
    value / (1 - r)^p, which for p = 1/2 are the same, and the interval covers both.

    The interval is, besides, the wider of two of Student's: from the jackknife, for the sampling, and from the scatter
    of the points about the line, for what is no power of h.  As long as the points bend by more than sampling can
    explain (at 95 %), the largest step is not yet asymptotic and is left out, down to four points.  A bend that
    sampling hides is not allowed for.  `value` has shape (steps,), `without` (groups, steps).

    With `stderr` (steps,), of values whose standard errors differ and of which `use` has those that are resolved, the
    points have weights, and what selection adds to them is taken away, see :func:`_selected`; a bend counts at 99 %.
    """
    use = np.flatnonzero(use)
    freedom = np.count_nonzero(counts) - 1
    clear = student(freedom, 0.95 if stderr is None else 0.99)

    def fitted(degree: int, steps: Array) -> _Fit:
        return _fit(degree, steps, value[use], without[:, use], counts, None if stderr is None else stderr[use])

    while len(use) > 4:
        bend = fitted(2, h[use] - reference_step)
        if not abs(bend.coefficient) > bend.stderr * clear + 1e-9:  # false for NaN
            break
        use = np.delete(use, np.argmax(h[use]))
    n = len(use)
    if n < 3:
        return Order(np.nan, np.nan, np.nan, n)
    line = fitted(1, h[use])
    r = reference_step / h[use]
    low = high = line.coefficient
    for _ in range(20):  # contractions by a factor of about 0.02
        low = line.coefficient - _slope(h[use], np.log(1.0 - r) * max(low, 0.0))
        high = line.coefficient - _slope(h[use], 0.5 * np.log(1.0 - r ** (2.0 * max(high, 0.01))))
    order = 0.5 * (low + high)
    y = line.logarithms - 0.5 * np.log(1.0 - r ** (2.0 * max(high, 0.01)))
    x, y = _centred(np.log(h[use]), line.weights), _centred(y, line.weights)
    scatter = np.sqrt((line.weights * (y - high * x) ** 2).sum() / (n - 2) / (line.weights * x @ x))
    half = float(np.maximum(line.stderr * student(freedom), scatter * student(n - 2)) + 0.5 * abs(high - low))
    return Order(order, order - half, order + half, n)


class Largest(NamedTuple):
    """Largest of several errors at each step size."""

    which: Array  #: (steps,) the number of the largest
    value: Array  #: (steps,) without its sign
    stderr: Array  #: (steps,)
    resolved: Array  #: (steps,)
    order: Order


def largest_over(h: Array, errors: Array, withouts: Array) -> Largest:
    """Largest of the absolute values of errors (n, steps) at each step size, and its order of convergence.

    `withouts` (n, groups, steps) are their leave-one-out values, of groups as large as one another.  Those of the
    largest are taken for its own, as if it were known beforehand which one is the largest.  What is not a number counts
    as larger than all numbers.
    """
    sizes, steps = np.abs(errors), np.arange(len(h))
    which = np.argmax(sizes, axis=0)
    value, without = sizes[which, steps], np.abs(withouts)[which, :, steps].T
    counts = np.full(len(without), PARTS)
    stderr = jackknife_stderr(value, without, counts)
    resolved = is_resolved(value, stderr)
    return Largest(which, value, stderr, resolved, fit_order(h, value, without, counts, resolved, stderr=stderr))


def _centred(x: Array, weights: Array) -> Array:
    return x - (weights * x).sum() / weights.sum()


def _slope(h: Array, y: Array) -> float:
    x = _centred(np.log(h), np.ones(len(h)))
    return float(y @ x / (x @ x))


class _Fit(NamedTuple):
    """A polynomial in ln(h) through the logarithms of values."""

    coefficient: float  #: the leading one
    stderr: float  #: its jackknife standard error
    logarithms: Array  #: of the values, without what selection adds to them
    weights: Array  #: of the points


def _fit(degree: int, h: Array, value: Array, without: Array, counts: Array, stderr: Array | None) -> _Fit:
    """Least squares fit to the points, all of one weight where there are no standard errors."""
    weights = np.ones(len(h)) if stderr is None else 1.0 / (_EXACT**2 + (stderr / value) ** 2)
    x = _centred(np.log(h), np.ones(len(h)))
    powers, root = np.vander(x, degree + 1), np.sqrt(weights)
    solve = np.linalg.pinv(powers * root[:, np.newaxis]) * root
    logs = np.log(value)
    logarithms = logs if stderr is None else _selected(logs, stderr, powers @ solve)
    coefficient = float(logarithms @ solve[0])
    with np.errstate(divide="ignore", invalid="ignore"):
        left_out = (np.log(without) - logs + logarithms) @ solve[0]
        return _Fit(coefficient, float(jackknife_stderr(coefficient, left_out, counts)), logarithms, weights)


def _selected(logarithms: Array, stderr: Array, smooth: Array) -> Array:
    """Logarithms of values, corrected for two biases: of choosing values that are resolved, and of the logarithm.

    A normal value of mean m and standard error 1, conditional on exceeding c = RESOLVED, has the mean m + phi(c - m) /
    Phi(m - c), and its logarithm the mean ln(m) - 1 / (2 m^2) to second order.  m is that of the fit: the matrix
    `smooth` maps the logarithms to the fitted ones.
    """
    from scipy.special import log_ndtr

    corrected = logarithms
    for _ in range(_ITERATIONS):
        with np.errstate(over="ignore", divide="ignore"):
            mean = np.exp(smooth @ corrected) / stderr
            beyond = RESOLVED - mean
            added = np.exp(-0.5 * beyond**2 - log_ndtr(-beyond)) / np.sqrt(2.0 * np.pi)
            before, corrected = corrected, logarithms - np.log1p(added / mean) + 0.5 / mean**2
        if np.abs(corrected - before).max() < _SMALL:
            break
    return corrected
