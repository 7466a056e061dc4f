"""What the estimators that sample share: values of the test functions, their sums over groups of paths, and means."""

import numpy as np

from spi.compiler.dispatch import kernel
from spi.ensemble.loop import FinalStates, Grid, RandomStream, empty_report, integrate, shortest
from spi.expressions import evaluate_lanes
from spi.kinds.plans import KernelCall, PartPlan
from spi.numerics.rng import LANES
from spi.statistics.estimators import GROUPS, PARTS

ROUND = GROUPS // PARTS  #: blocks after which all groups have had equally many paths


@kernel
def function_values(functions, model, states, values):
    """The test functions, values (blocks, paths of a sample, F, LANES), of states (blocks, paths, d * LANES)."""
    for row in range(states.shape[0]):
        for path in range(states.shape[1]):
            evaluate_lanes(functions, model, states[row, path], values[row, path])


def values_of_blocks(
    p: PartPlan, grid: Grid, stream: RandomStream, first_block: int, blocks: int, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate blocks; the values of the test functions at the end (blocks, paths, F, LANES), and the report."""
    functions = p.case.expressions
    last = FinalStates(
        np.zeros((blocks, len(grid.doublings), len(p.initial) * LANES)), grid.reference_steps >> grid.doublings
    )
    report = empty_report(blocks, len(grid.doublings))
    integrate(p.scheme, p.model, p.initial, grid, stream, last, report, first_block, blocks, samples)
    values = np.empty((blocks, len(grid.doublings), len(functions), LANES))
    function_values(functions, p.model, last.y, values)
    return values, report


def sampling_calls(p: PartPlan, grid: Grid, stream: RandomStream) -> list[KernelCall]:
    """The calls of kernels that an estimator which samples makes, for one step of one block."""
    functions, times = p.case.expressions, shortest(grid)
    paths = len(grid.doublings)
    last = FinalStates(np.zeros((1, paths, len(p.initial) * LANES)), times.reference_steps >> times.doublings)
    values = np.zeros((1, paths, len(functions), LANES))
    what = p.scheme, p.model, p.initial, times, stream, last, empty_report(1, paths), 0, 1, LANES
    flat, sums = values.reshape(1, -1, LANES), np.zeros((1, values[..., 0].size, GROUPS))
    return [
        KernelCall(integrate, what),
        KernelCall(function_values, (functions, p.model, last.y, values)),
        KernelCall(add_powers, (flat, 0, LANES, sums)),
    ]


def compile_kernels(p: PartPlan) -> None:
    """Have everything compiled before anything is timed."""
    for call in p.kernel_calls():
        call.kernel(*call.arguments)


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


def with_powers(sums: np.ndarray, values: np.ndarray, first_block: int, samples: int) -> np.ndarray:
    """The sums (powers, ..., GROUPS) with the values (blocks, ..., LANES) and their powers added; see add_powers."""
    added = sums.copy()
    flat = np.ascontiguousarray(values).reshape(len(values), -1, LANES)
    add_powers(flat, first_block, samples, added.reshape(len(sums), -1, GROUPS))
    return added


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
    return np.sqrt(np.maximum(mean_square - mean**2, 0.0))
