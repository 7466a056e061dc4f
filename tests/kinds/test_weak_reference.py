"""What the reference of a weak error lacks: against errors of linear systems on so(3), which matrices give exactly."""

from pathlib import Path

import numpy as np
import pytest
from helpers import LANES, compiled_only
from scipy.linalg import expm
from scipy.stats import chi2
from states import finished
from weak_cases import after_blocks

from spi.kinds.weak import study as weak
from spi.kinds.weak.levels import EQUAL
from spi.kinds.weak.multilevel import MultilevelPlan
from spi.running.run import load
from spi.statistics.estimators import Extrapolation, jackknife_stderr
from spi.storage import Part

SPEC = """\
kind: weak
model: {algebra: so(3), hamiltonian: 3*y2, noises: [0.7*y1, 0.5*y2]}
initial: [1, 0.5, -0.5]
final_time: 2
steps: 2^0 .. 2^-3
reference_step: 2^-4
schemes: [splitting]
functions: {first: y1, second: y2, third: y3}
estimators: [plain]
samples: 64
seconds: 1
"""
SEEDS = 30


def generator(gradient):
    """The matrix A of y' = B(y) grad H = A y, of a linear H."""
    x, y, z = gradient
    return -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def exact_errors(case, levels):
    """E y_h(T) - E y(T) at the steps of the results, extrapolated so often: a step is a product of exponentials."""
    drift, *noises = map(generator, ([0, 3, 0], [0.7, 0, 0], [0, 0.5, 0]))
    limit = expm(case.final_time * (drift + sum(one @ one for one in noises) / 2)) @ case.initial
    errors = []
    for h in case.steps:
        step = np.eye(3)
        for flow in (*(h * one @ one / 2 for one in noises), h * drift):
            step = expm(flow) @ step
        errors.append(np.linalg.matrix_power(step, round(case.final_time / h)) @ case.initial - limit)
    return Extrapolation.of(case.steps, (1, 2)[:levels]).combined(np.array(errors).T)


def by_each_step(case, found):
    """Errors as they were completed before: what the reference lacks as a share of the difference at *each* step."""
    share = (case.reference_step / found.h) ** found.expected_order

    def of(errors):
        return (errors - errors[..., -1:] * share[-1]) / (1 - share)

    return of(found.error), of(found.sampled.error_without)


@pytest.mark.needs("systems")
@compiled_only
@pytest.mark.parametrize(
    ("levels", "keys", "blocks"),
    [(0, ("steps=2^0 .. 2^-3", "reference_step=2^-4"), 128), (1, ("steps=2^0 .. 2^-2", "reference_step=2^-3"), 256)],
    ids=["as they are", "extrapolated"],
)
@pytest.mark.parametrize("estimator", ["plain", "multilevel"])
def test_errors_are_within_their_intervals_at_all_steps(estimator, levels, keys, blocks):
    """The squares of the deviations of 30 seeds, in standard errors, are distributed like chi squared."""
    squares, of_another_rule = 0.0, 0.0
    for seed in range(1, SEEDS + 1):
        keys_of_seed = (*keys, f"seed={seed}", f"samples={blocks * LANES}", f"estimators=[{estimator}]")
        case = load(Path("so3.yaml"), overrides=[*keys_of_seed, f"extrapolate={levels}"], text=SPEC).cases[0]
        if estimator == "plain":
            p = weak.plan(case, Part("splitting", estimator, extrapolate=levels))
            found = p.results(finished(p))
        else:  # by levels of its own
            p = MultilevelPlan.by_levels(case, Part("splitting", estimator, extrapolate=levels))
            found = p.results(after_blocks(p, blocks))
        exact = exact_errors(case, levels)
        squares = squares + ((found.error - exact) / found.sampled.error_stderr) ** 2
        error, without = by_each_step(case, found)
        of_another_rule = of_another_rule + ((error - exact) / jackknife_stderr(error, without, EQUAL)) ** 2
    low, high = chi2.ppf([1e-4, 1 - 1e-4], SEEDS)
    assert np.all((low < squares) & (squares < high))
    assert of_another_rule[0, 0] > chi2.ppf(1 - 1e-8, SEEDS)  # negative control, at the largest step
    np.testing.assert_allclose(of_another_rule[:, -1], squares[:, -1], rtol=1e-9)  # where both rules are the same
