"""What the estimators of weak errors share: values of the test functions, their sums, and errors from sums."""

import numpy as np

from ...dispatch import kernel
from ...ensemble import FinalStates, empty_report, integrate
from ...estimators import GROUPS, PARTS, fit_order, is_resolved, jackknife_stderr
from ...expressions import evaluate_lanes
from ...rng import LANES
from ...schemes import has_theory

ROUND = GROUPS // PARTS  #: blocks after which all groups have had equally many paths


@kernel
def function_values(functions, model, states, values):
    """The test functions, values (blocks, paths of a sample, F, LANES), of states (blocks, paths, d * LANES)."""
    for row in range(states.shape[0]):
        for path in range(states.shape[1]):
            evaluate_lanes(functions, model, states[row, path], values[row, path])


def values_of_blocks(p, grid, noise, first_block, blocks, samples):
    """Integrate blocks; the values of the test functions at the end (blocks, paths, F, LANES), and the report."""
    last = FinalStates(
        np.zeros((blocks, len(grid.doublings), len(p.initial) * LANES)), grid.reference_steps >> grid.doublings
    )
    report = empty_report(blocks, len(grid.doublings))
    integrate(p.scheme, p.model, p.initial, grid, noise, last, report, first_block, blocks, samples)
    values = np.empty((blocks, len(grid.doublings), len(p.functions), LANES))
    function_values(p.functions, p.model, last.y, values)
    return values, report


def compile_kernels(p, grid, noise):
    """Have everything compiled before anything is timed, by one step of one block."""
    shortest = grid._replace(reference_steps=1 << int(grid.doublings[-1]))
    values, _ = values_of_blocks(p, shortest, noise, 0, 1, LANES)
    add_powers(values.reshape(1, -1, LANES), 0, LANES, np.zeros((1, values[0, :, :, 0].size, GROUPS)))


@kernel
def add_powers(values, first_block, samples, sums):
    """Add the values (blocks, quantities, LANES) and their powers to sums (powers, quantities, GROUPS).

    One after the other, so that the bits do not depend on how blocks are divided into calls; paths from number
    `samples` on do not count.
    """
    for row in range(values.shape[0]):
        block = first_block + row
        paths = min(LANES, samples - block * LANES)
        for i in range(values.shape[1]):
            for lane in range(paths):
                group = block % ROUND * PARTS + lane % PARTS
                value, power = values[row, i, lane], 1.0
                for k in range(sums.shape[0]):
                    power *= value
                    sums[k, i, group] += power


def means(sums, counts):
    """Means over all paths of sums (..., GROUPS), and the same without each group in turn, (groups with paths, ...)."""
    used = counts > 0
    sums, counts = sums[..., used], counts[used]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        total = sums.sum(axis=-1)
        without = (total[..., np.newaxis] - sums) / (counts.sum() - counts)
        return total / counts.sum(), np.moveaxis(without, -1, 0)


def expected_order(case, row):
    """The weak order of a scheme; None where theory says nothing."""
    return row.weak_order if has_theory(row, case.model) else None


def extension(h, reference_step, order):
    """By how much to multiply E phi(y_h) - E phi(y_ref), (1 - (h_ref/h)^p) C h^p, to have C h^p."""
    return 1.0 / (1.0 - (reference_step / h) ** order) if order else np.ones_like(h)


def error_variables(h, error, without, counts):
    """The variables and attributes that all estimators of errors (F, S) share; `without` is (groups, F, S)."""
    stderr = jackknife_stderr(error, without, counts)
    resolved = is_resolved(np.abs(error), stderr)
    orders = [fit_order(h, np.abs(error[f]), np.abs(without[:, f]), counts, resolved[f]) for f in range(len(error))]
    axes = ("function", "h")
    variables = {"error": (axes, error), "error_stderr": (axes, stderr), "resolved": (axes, resolved)}
    variables["error_without"] = (("left_out", *axes), without)  # for what is fitted across schemes and eps
    return variables | order_variables(orders)


def order_variables(orders, name="order"):
    """Fitted orders, one per test function, as variables."""
    values = np.array(orders, float).reshape(-1, 4)
    variables = {name: values[:, 0], f"{name}_low": values[:, 1], f"{name}_high": values[:, 2]}
    variables[f"{name}_points"] = values[:, 3].astype(np.int64)
    return {key: (("function",), v) for key, v in variables.items()}
