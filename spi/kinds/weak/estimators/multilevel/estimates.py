"""What the sums of a multilevel estimator tell: errors, Giles' table, rates (see plans.py)."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.numerics.rng import LANES
from spi.schemes.splitting import has_antithetic_path
from spi.statistics.estimators import GROUPS, PARTS, fit_order, group_counts
from spi.storage.records import Order

from ...results import History, Sampled, WeakErrors
from ...results import Levels as LevelTable
from ...study.fields import extension, result_steps, sampled_errors, weak_errors
from ...study.sums import mean_over_paths, standard_deviation
from .extrapolated import errors_at_steps, shares_above
from .levels import CONTROL, DIFFERENCE, PRODUCT, VALUE

if TYPE_CHECKING:
    from .plans import Levels, MultilevelPlan

_CLEAR = 4.0  # a mean difference counts for the rate of means if it is so many times its standard error
_EQUAL = np.full(GROUPS, PARTS)  # all groups of a level are equally large, so any equal counts will do


class Errors(NamedTuple):
    """Errors and their leave-one-out values, in which each level lacks a group."""

    error: np.ndarray  #: (F, S)
    without: np.ndarray  #: (GROUPS, F, S)
    counts: np.ndarray  #: (GROUPS,) as good as the paths of each group


class Moments(NamedTuple):
    """Of each level, all (levels, F)."""

    mean: np.ndarray  #: of what is averaged, which with a control is Y - beta (Y_0 - E Y_0)
    variance: np.ndarray  #: of the same
    kurtosis: np.ndarray  #: of the difference Y itself, at the last level of the value


def errors(p: "MultilevelPlan", levels: "Levels") -> Errors:
    """The errors that the levels tell."""
    mean, without = averages(p, levels)
    error = errors_at_steps(p, mean[:-1])
    return Errors(error * extension(p), errors_at_steps(p, without[:, :-1]) * extension(p), _EQUAL)


def moments(p: "MultilevelPlan", levels: "Levels") -> Moments:
    """The moments that the levels tell."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        powers = means_of_powers(p, levels)
        m1, m2, m3, m4 = powers[DIFFERENCE]
        variance = np.maximum(m2 - m1 * m1, 0.0)
        kurtosis = (m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4) / variance**2
        if p.control:
            covariance = powers[PRODUCT][0] - m1 * powers[CONTROL][0]
            variance = np.maximum(variance - _beta(p, levels) * covariance, 0.0)
        return Moments(averages(p, levels)[0], variance, kurtosis)


def consistency(p: "MultilevelPlan", levels: "Levels") -> np.ndarray:
    """Giles' check |a - b - d| / (3 (sd a + sd b + sd d)), above 1 with probability 0.3 %, (levels - 1, F).

    d is the mean difference of a level, b the mean at its fine step, a that at its coarse step from the level above.
    """
    n, found = samples_of(levels).reshape(-1, 1), moments(p, levels)
    with np.errstate(invalid="ignore", divide="ignore"):
        fine, square = means_of_powers(p, levels)[VALUE][:2]
        sd, sd_fine = np.sqrt(found.variance / n), np.sqrt(np.maximum(square - fine**2, 0.0) / n)
        off = fine[1:] - fine[:-1] - found.mean[:-1]
        return np.abs(off) / (3.0 * (sd_fine[1:] + sd_fine[:-1] + sd[:-1]))


def results(p: "MultilevelPlan", levels: "Levels", seconds: float) -> WeakErrors:
    """The results of one scheme of a case, from its levels; `seconds` is the wall-clock time spent."""
    steps = sum(level.steps * int(n) * LANES for level, n in zip(p.levels, levels.blocks, strict=True))
    found, more = errors(p, levels), levels.more
    fields, sampled = sampled_errors(result_steps(p), *found)
    expectation, of_expectation = _expectations(p, levels, found.error)
    work: Any = {
        "samples": int(levels.blocks.sum()) * LANES,
        "ns_per_step": 1e9 * float(levels.cpu_seconds.sum() / steps),
    }
    return weak_errors(
        p,
        seconds,
        **fields,
        expectation=expectation,
        sampled=Sampled(**sampled, **of_expectation, **work),
        levels=_of_levels(p, levels),
        history=History(
            allocations=np.arange(1, len(more.history_cpu_seconds) + 1),
            error=more.history_error,
            error_stderr=more.history_error_stderr,
            cpu_seconds=more.history_cpu_seconds,
        ),
        cpu_seconds=float(levels.cpu_seconds.sum()),
    )


def _expectations(p: "MultilevelPlan", levels: "Levels", error: np.ndarray) -> tuple[np.ndarray, dict[str, Any]]:
    """E phi at all steps: at the largest one from the last level, at the others by the differences between levels.

    Beside it the fields of Sampled that say how sure it is.
    """
    h, found = np.array(p.case.steps), moments(p, levels)
    stderr, coarse = _stderr(levels, found), _coarse(p)
    fine, square = means_of_powers(p, levels)[VALUE][:2, -1]
    differences, largest = error / extension(p), error[:, :1] / extension(p)[:1]
    above = [(coarse > step) & (coarse <= h[0]) for step in h]  # levels between the largest step and this one
    spread = np.array([np.sqrt(stderr[-1] ** 2 + (stderr[:-1][used] ** 2).sum(axis=0)) for used in above]).T
    if p.part.extrapolate:
        to_reference, to_steps = shares_above(p)
        largest = (to_reference @ found.mean[:-1])[:, np.newaxis]
        spread = np.sqrt(stderr[-1] ** 2 + to_steps**2 @ stderr[:-1] ** 2).T
    return found.mean[-1][:, np.newaxis] - largest + differences, {
        "expectation_stderr": spread,
        "reference": found.mean[-1] - largest[:, 0],
        "sd": standard_deviation(fine, square),
    }


def _of_levels(p: "MultilevelPlan", levels: "Levels") -> LevelTable:
    """Giles' table of the levels that are differences, and how fast means and variances fall."""
    coarse, found, functions = _coarse(p), moments(p, levels), range(len(p.case.functions))
    (mean, without), stderr = averages(p, levels), _stderr(levels, found)
    mean, without, per_sample = mean[:-1], without[:, :-1], (levels.cpu_seconds / samples_of(levels))[:-1]
    clear = np.abs(mean) > _CLEAR * stderr[:-1]
    means = [fit_order(coarse, np.abs(mean[:, f]), np.abs(without[..., f]), _EQUAL, clear[:, f]) for f in functions]
    beta = _beta(p, levels)
    variances = [variance_rate(coarse, levels.sums[:-1, :, :, f], levels.blocks[:-1], beta[:-1, f]) for f in functions]
    return LevelTable(
        h=coarse,
        mean=mean.T,
        variance=found.variance[:-1].T,
        kurtosis=found.kurtosis[:-1].T,
        consistency=consistency(p, levels).T,
        samples=samples_of(levels)[:-1],
        nonfinite=levels.nonfinite[:-1],
        seconds=per_sample,
        mean_rate=tuple(means),
        variance_rate=tuple(variances),
        cost_rate=_cost_rate(coarse, per_sample),
        twins=has_antithetic_path(p.scheme),
        control="the limit without sampling" if p.control else "",
        control_bound=levels.more.control_bound,
    )


def _coarse(p: "MultilevelPlan") -> np.ndarray:
    """(levels - 1,) the coarse steps of the differences."""
    return p.case.reference_step * 2.0 ** np.arange(1, len(p.levels))


def samples_of(levels: "Levels") -> np.ndarray:
    """(levels,) samples done."""
    return levels.blocks * LANES


def _stderr(levels: "Levels", found: Moments) -> np.ndarray:
    """(levels, F) standard errors of the means of the levels."""
    return np.sqrt(found.variance / samples_of(levels).reshape(-1, 1))


def _counts(blocks: int) -> np.ndarray:
    return group_counts(int(blocks) * LANES)


def averages(p: "MultilevelPlan", levels: "Levels") -> tuple[np.ndarray, np.ndarray]:
    """Mean (levels, F) of the difference, or the value, of each level, and leave-one-out values (groups, levels, F)."""
    beta, mean, without = _beta(p, levels), [], []
    for j, (sums, blocks) in enumerate(zip(levels.sums, levels.blocks, strict=True)):
        found, left_out = mean_over_paths(sums[0, DIFFERENCE], _counts(blocks))
        if p.control:
            of_control, control_left_out = mean_over_paths(sums[0, CONTROL], _counts(blocks))
            found = found - beta[j] * (of_control - levels.more.known[j])
            left_out = left_out - beta[j] * (control_left_out - levels.more.known[j])
        mean.append(found)
        without.append(left_out)
    return np.array(mean), np.stack(without, axis=1)


def means_of_powers(p: "MultilevelPlan", levels: "Levels") -> np.ndarray:
    """Means of the powers of each quantity, (quantities, powers, levels, F)."""
    totals = levels.sums.sum(axis=-1) / samples_of(levels).reshape(-1, 1, 1, 1)
    return totals.transpose(2, 1, 0, 3)


def _beta(p: "MultilevelPlan", levels: "Levels") -> np.ndarray:
    """cov(Y, Y_0) / var(Y_0), (levels, F); 0 without control."""
    if not p.control:
        return np.zeros((len(p.levels), len(p.case.functions)))
    y, y0, product = (means_of_powers(p, levels)[quantity] for quantity in (DIFFERENCE, CONTROL, PRODUCT))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num((product[0] - y[0] * y0[0]) / (y0[1] - y0[0] ** 2))


def variance_rate(h: np.ndarray, sums: np.ndarray, blocks: np.ndarray, beta: np.ndarray) -> Order:
    """The rate p in V = O(h^p), with its interval, from the sums (n, powers, quantities, GROUPS) of n levels."""
    values, leave_out = [], []
    for of_level, n, factor in zip(sums, blocks, beta, strict=True):
        m, without = mean_over_paths(of_level[:2], _counts(n))
        values.append(_variance(m, factor))
        leave_out.append(_variance(np.moveaxis(without, 0, -1), factor))
    value, without = np.array(values), np.array(leave_out).T
    return fit_order(h, value, without, _EQUAL, value > 0)


def _variance(m: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """The variance of Y - beta Y_0 from means of powers (2, quantities, ...)."""
    variance = m[1, DIFFERENCE] - m[0, DIFFERENCE] ** 2
    if m.shape[1] <= CONTROL:
        return variance
    covariance = m[0, PRODUCT] - m[0, DIFFERENCE] * m[0, CONTROL]
    return variance - 2 * beta * covariance + beta**2 * (m[1, CONTROL] - m[0, CONTROL] ** 2)


def _cost_rate(h: np.ndarray, seconds: np.ndarray) -> float:
    """gamma in C_l = O(h^-gamma)."""
    return float(-np.polyfit(np.log(h), np.log(seconds), 1)[0]) if len(h) > 1 else float("nan")
