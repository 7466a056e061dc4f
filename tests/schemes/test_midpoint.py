"""The implicit midpoint rule: its equation, its reports and its elimination."""

from typing import NamedTuple

import numpy as np
import pytest
import scheme_cases
from helpers import LANES, RIGID_BODY, take_step, take_steps
from scheme_cases import FAILURES, ITERATIONS, LOCKED, RESIDUAL, SOLVES, field, increments, on_the_sphere, relative

from spi.compiler.dispatch import kernel
from spi.schemes.midpoint import Midpoint, eliminate

# fixtures
generator, model = scheme_cases.generator, scheme_cases.model


@pytest.mark.share
@pytest.mark.parametrize("h", [1e-3, 0.1, 0.5])
def test_midpoint_satisfies_its_equation(model, h, generator):
    y, dW = on_the_sphere(generator), increments(generator, h)
    new, report = take_step(Midpoint(), model, h, dW, y)
    assert relative(new, y + field(model, h, dW, 0.5 * (y + new))) < 1e-14
    # Negative control: explicit, or with the mean of two fields in place of the field at the mean.
    for wrong in (field(model, h, dW, y), 0.5 * (field(model, h, dW, y) + field(model, h, dW, new))):
        assert relative(new, y + wrong) > (1e-4 if h > 0.01 else 1e-8)
    assert report[SOLVES] == LANES and report[FAILURES] == 0
    assert LANES <= report[ITERATIONS] <= 8 * LANES
    assert report[RESIDUAL] <= Midpoint().tolerance


def test_midpoint_reports_what_it_could_not_solve(generator):
    y, dW = on_the_sphere(generator), increments(generator, 0.1)
    dW[:, 7] = 0.0
    still = (LOCKED, LOCKED, LOCKED)
    model = RIGID_BODY._replace(inertia=still)  # so that lane 7 is at rest and solved by its first guess
    for most in (0, 1):
        _, report = take_step(Midpoint(most_iterations=most), model, 0.1, dW, y)
        assert report[SOLVES] == LANES and report[ITERATIONS] == most * LANES
        assert report[FAILURES] == LANES - 1
        assert report[RESIDUAL] > 1e-8
    with np.errstate(all="ignore"):
        new, report = take_step(Midpoint(), model, 0.1, 1e3 * dW, y)
    assert 0 < report[FAILURES] < LANES  # increments this large are what truncation is for
    assert report[ITERATIONS] <= Midpoint().most_iterations * LANES
    assert np.array_equal(new[:, 7], y[:, 7])
    _, loose = take_step(Midpoint(tolerance=1.0, most_iterations=1), model, 0.1, dW, y)
    assert loose[FAILURES] == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_midpoint_reports_a_residual_that_is_not_finite(bad, generator):
    """However NaN comes about: the processor's own, from inf - inf, has its sign bit set.  And it is not forgotten."""
    y, dW = on_the_sphere(generator), increments(generator, 0.1, steps=2)
    y[1, 20] = bad
    with np.errstate(all="ignore"):
        _, report = take_steps(Midpoint(), RIGID_BODY, 0.1, dW, y)
    assert report[FAILURES] == 2
    assert not np.isfinite(report[RESIDUAL])


class OfDimension1(NamedTuple):
    dimension = 1


class OfDimension2(NamedTuple):
    dimension = 2


class OfDimension3(NamedTuple):
    dimension = 3


class OfDimension8(NamedTuple):
    dimension = 8


OF_DIMENSION = {cls.dimension: cls() for cls in (OfDimension1, OfDimension2, OfDimension3, OfDimension8)}


@kernel
def eliminate_block(model, matrix):
    eliminate(model, matrix)


def solutions(systems, right):
    """Of systems [lane, row, column], with the layout that `eliminate` wants: column by column, lanes together."""
    d = systems.shape[1]
    augmented = np.concatenate([systems, right[:, :, np.newaxis]], axis=2)
    matrix = np.concatenate([augmented.transpose(2, 1, 0).ravel(), np.full(2 * LANES, np.nan)])
    eliminate_block(OF_DIMENSION[d], matrix)
    return matrix[d * d * LANES : d * (d + 1) * LANES].reshape(d, LANES).T


@pytest.mark.parametrize("d", [1, 2, 3, 8])
def test_elimination(d, generator):
    systems, right = generator.standard_normal((LANES, d, d)), generator.standard_normal((LANES, d))
    expected = np.linalg.solve(systems, right[:, :, np.newaxis])[:, :, 0]
    conditions = np.linalg.cond(systems)
    errors = np.linalg.norm(solutions(systems, right) - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert np.all(errors < 1e-15 * d * conditions)


@pytest.mark.parametrize("d", [2, 3, 8])
def test_elimination_needs_its_pivots(d, generator):
    """Systems that fail without exchanges of rows: leading entries 0 or tiny, and permutations."""
    systems = generator.standard_normal((LANES, d, d)) + 2.0 * np.eye(d)[:, ::-1]
    systems[0:16, 0, 0] = 0.0
    systems[16:24, 0, 0] = 1e-20
    systems[24:32, : d - 1, 0] = 0.0  # only the last row has an entry in the first column
    for lane in range(32, LANES):
        systems[lane] = np.eye(d)[generator.permutation(d)]
    right = generator.standard_normal((LANES, d))
    expected = np.linalg.solve(systems, right[:, :, np.newaxis])[:, :, 0]
    conditions = np.linalg.cond(systems)
    assert conditions.max() < 1e5
    with np.errstate(all="ignore"):
        found = solutions(systems, right)
    errors = np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert np.all(errors < 1e-14 * d * conditions)


def test_elimination_of_singular_systems_is_not_finite_and_stays_in_its_lane(generator):
    systems, right = generator.standard_normal((LANES, 3, 3)), generator.standard_normal((LANES, 3))
    clean = solutions(systems, right)
    systems[11] = 0.0
    with np.errstate(all="ignore"):
        found = solutions(systems, right)
    assert not np.any(np.isfinite(found[11]))
    assert np.array_equal(np.delete(found, 11, axis=0), np.delete(clean, 11, axis=0))
