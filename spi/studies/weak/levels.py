"""What the sums of a multilevel estimator tell: errors, Giles' table, rates (see multilevel.py)."""

import numpy as np

from ...estimators import GROUPS, PARTS, fit_order, group_counts
from ...protocol import tosses
from ...rng import LANES
from .sums import error_variables, extension, means, order_variables


def _counts(blocks):
    return group_counts(int(blocks) * LANES)


def _estimates(p, state):
    """Mean (levels, F) of the difference, or the value, of each level, and leave-one-out values (groups, levels, F)."""
    functions, control = len(p.functions), slice(2 * len(p.functions), 3 * len(p.functions))
    beta, mean, without = _beta(p, state), [], []
    for j, (sums, blocks) in enumerate(zip(state.sums, state.blocks, strict=True)):
        found, left_out = means(sums[0, :functions], _counts(blocks))
        if p.control:
            of_control, control_left_out = means(sums[0, control], _counts(blocks))
            found = found - beta[j] * (of_control - state.known[j])
            left_out = left_out - beta[j] * (control_left_out - state.known[j])
        mean.append(found)
        without.append(left_out)
    return np.array(mean), np.stack(without, axis=1)


def _powers(p, state):
    """Means of the powers of each quantity, (quantities, powers, levels, F)."""
    totals = state.sums.sum(axis=-1) / (state.blocks * LANES).reshape(-1, 1, 1)
    return np.moveaxis(totals.reshape(*totals.shape[:2], -1, len(p.functions)), 2, 0).swapaxes(1, 2)


def _beta(p, state):
    """cov(Y, Y_0) / var(Y_0), (levels, F); 0 without control."""
    if not p.control:
        return np.zeros((len(p.levels), len(p.functions)))
    y, _, y0, product = _powers(p, state)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num((product[0] - y[0] * y0[0]) / (y0[1] - y0[0] ** 2))


def errors(p, state):
    """Errors (F, S), their leave-one-out values (groups, F, S), in which each level lacks a group, and counts.

    All groups of a level are equally large, so the levels' counts are as good as equal.
    """
    mean, without = (x[..., :-1, :] for x in _estimates(p, state))
    below = np.array([round(np.log2(h / p.reference_step)) for h in p.steps]) - 1  # the last level of each error
    factor = extension(p.steps, p.reference_step, p.reference_order)
    error = np.cumsum(mean, axis=0)[below].T * factor
    without = np.moveaxis(np.cumsum(without, axis=1)[:, below], 1, 2) * factor
    return error, without, np.full(GROUPS, PARTS)


def moments(p, state):
    """Mean and variance of what is averaged, and kurtosis of the difference (value) itself, (3, levels, F)."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        y, *others = _powers(p, state)
        m1, m2, m3, m4 = y
        variance = np.maximum(m2 - m1 * m1, 0.0)
        kurtosis = (m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4) / variance**2
        if p.control:
            _, y0, product = others
            variance = np.maximum(variance - _beta(p, state) * (product[0] - m1 * y0[0]), 0.0)
        return np.array([_estimates(p, state)[0], variance, kurtosis])


def consistency(p, state):
    """Giles' check |a - b - d| / (3 (sd a + sd b + sd d)), above 1 with probability 0.3 %, (levels - 1, F).

    d is the mean difference of a level, b the mean at its fine step, a that at its coarse step from the level above.
    """
    n = (state.blocks * LANES).reshape(-1, 1)
    mean, variance = moments(p, state)[:2]
    with np.errstate(invalid="ignore", divide="ignore"):
        fine, square = _powers(p, state)[1][:2]
        sd, sd_fine = np.sqrt(variance / n), np.sqrt(np.maximum(square - fine**2, 0.0) / n)
        off = fine[1:] - fine[:-1] - mean[:-1]
        return np.abs(off) / (3.0 * (sd_fine[1:] + sd_fine[:-1] + sd[:-1]))


def _variance_rate(p, state, f):
    """beta in V_l = O(h^beta), with its interval."""
    functions, beta = len(p.functions), _beta(p, state)[:, f]
    values, leave_out = [], []
    for j, (sums, blocks) in enumerate(zip(state.sums[:-1], state.blocks[:-1], strict=True)):
        m, without = means(sums[:2, f::functions], _counts(blocks))
        values.append(_variance(m, beta[j]))
        leave_out.append(_variance(np.moveaxis(without, 0, -1), beta[j]))
    value, without = np.array(values), np.array(leave_out).T
    h = p.reference_step * 2.0 ** np.arange(1, len(p.levels))
    return fit_order(h, value, without, np.full(GROUPS, PARTS), value > 0)


def _variance(m, beta):
    """The variance of Y - beta Y_0 from means of powers (2, quantities, ...)."""
    variance = m[1, 0] - m[0, 0] ** 2
    if m.shape[1] == 2:
        return variance
    covariance = m[0, 3] - m[0, 0] * m[0, 2]
    return variance - 2 * beta * covariance + beta**2 * (m[1, 2] - m[0, 2] ** 2)


def results(p, state):
    """Coordinates, variables and attributes of the results."""
    error, without, counts = errors(p, state)
    mean, level_without = (x[..., :-1, :] for x in _estimates(p, state))
    moment = moments(p, state)
    coarse = p.reference_step * 2.0 ** np.arange(1, len(p.levels))
    level_stderr = np.sqrt(moment[1] / (state.blocks * LANES).reshape(-1, 1))
    base, base_stderr = moment[0][-1], level_stderr[-1]
    alone = _powers(p, state)[1][:2, -1]
    of_levels = ("function", "level")
    largest = error[:, :1] / extension(p.steps[:1], p.reference_step, p.reference_order)
    differences = error / extension(p.steps, p.reference_step, p.reference_order)
    above = [(coarse > h) & (coarse <= p.steps[0]) for h in p.steps]  # levels between the largest step and this one
    spread = np.array([np.sqrt(base_stderr**2 + (level_stderr[:-1][used] ** 2).sum(axis=0)) for used in above]).T
    rates = [
        fit_order(coarse, np.abs(mean[:, f]), np.abs(level_without[:, :, f]), counts, _clear(mean, level_stderr, f))
        for f in range(len(p.functions))
    ]
    per_sample = state.cpu_seconds / (state.blocks * LANES)
    variables = error_variables(p.steps, error, without, counts) | {
        "expectation": (("function", "h"), base[:, np.newaxis] - largest + differences),
        "expectation_stderr": (("function", "h"), spread),
        "reference": (("function",), base - largest[:, 0]),
        "sd": (("function",), np.sqrt(np.maximum(alone[1] - alone[0] ** 2, 0.0))),
        "level_mean": (of_levels, mean.T),
        "level_variance": (of_levels, moment[1][:-1].T),
        "level_kurtosis": (of_levels, moment[2][:-1].T),
        "level_consistency": (of_levels, consistency(p, state).T),
        "level_samples": (("level",), state.blocks[:-1] * LANES),
        "level_nonfinite": (("level",), state.nonfinite[:-1]),
        "level_seconds": (("level",), per_sample[:-1]),
        "history_error": (("allocation", "function", "h"), state.history[:, 0]),
        "history_error_stderr": (("allocation", "function", "h"), state.history[:, 1]),
        "history_cpu_seconds": (("allocation",), state.history_cpu_seconds),
        **order_variables(rates, "level_mean_rate"),
        **order_variables([_variance_rate(p, state, f) for f in range(len(p.functions))], "level_variance_rate"),
    }
    coordinates = {"h": p.steps, "level": coarse, "allocation": np.arange(1, len(state.history_cpu_seconds) + 1)}
    attributes = {
        "samples": int(state.blocks.sum()) * LANES,
        "cpu_seconds": float(state.cpu_seconds.sum()),
        "wall_seconds": state.seconds,
        "ns_per_step": 1e9 * float(state.cpu_seconds.sum() / _steps(p, state)),
        "twins": bool(tosses(p.scheme)),
        "control": "the limit without sampling" if p.control else "",
        "control_bound": state.control_bound,
        "level_cost_rate": _cost_rate(coarse, per_sample[:-1]),
    }
    return coordinates, variables, attributes


def _clear(mean, stderr, f):
    """Levels whose mean difference stands clear of its standard error."""
    return np.abs(mean[:, f]) > 4.0 * stderr[:-1, f]


def _cost_rate(h, seconds):
    """gamma in C_l = O(h^-gamma)."""
    return float(-np.polyfit(np.log(h), np.log(seconds), 1)[0]) if len(h) > 1 else float("nan")


def _steps(p, state):
    return sum(level.steps * int(n) * LANES for level, n in zip(p.levels, state.blocks, strict=True))
