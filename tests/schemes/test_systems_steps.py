"""Steps of each scheme for the systems by the paper's formulas, and their Casimir functions over many steps.

States are arrays [component, path]; increments [step, noise, path] are drawn here, with fixed seeds.
"""

import math

import numpy as np
import pytest
import system_formulas
from helpers import COMPILED, LANES, compiled_only, take_step, take_steps
from system_formulas import EULER_MARUYAMA, LIE_POISSON, MIDPOINT, SPLITTING, SYSTEMS, clipped, weighted

from spi.ensemble.protocol import strengths

# fixtures
generator = system_formulas.generator


FAILURES = 2  # column of a report


@pytest.fixture(params=SYSTEMS.values(), ids=SYSTEMS.keys())
def system(request):
    return request.param


@pytest.fixture(params=LIE_POISSON.values(), ids=LIE_POISSON.keys())
def lie_poisson(request):
    return request.param


def increments(generator, system, h, steps=None):
    """Clipped as the midpoint rule needs it: |dW| <= sqrt(h) A_h."""
    shape = (type(system.model).noises, LANES)
    dW = math.sqrt(h) * generator.standard_normal(shape if steps is None else (steps, *shape))
    return clipped(dW, h)


PATHS = 16  # of a block, to be composed by hand


def relative(a, b):
    """The largest distance of two arrays of states [component, path], relative to the length of the second."""
    return np.max(np.linalg.norm(a - b, axis=0) / np.maximum(np.linalg.norm(b, axis=0), 1e-300))


@pytest.mark.parametrize("h", [1e-3, 0.1])
def test_step_of_splitting_is_the_printed_composition(system, h, generator):
    y, dW = system.draw(generator), increments(generator, system, h)
    new, _ = take_step(SPLITTING, system.model, h, dW, y)
    expected, other = (
        np.transpose([system.composition(system.model, h, dW[:, i], y[:, i], swap) for i in range(PATHS)])
        for swap in (False, True)
    )
    assert relative(new[:, :PATHS], expected) < 1e-13
    assert relative(new[:, :PATHS], other) > h * h / 100  # negative control: the pieces in the other order


@pytest.mark.parametrize("h", [1e-3, 0.1])
def test_step_of_euler_maruyama_is_the_ito_formula(system, h, generator):
    y, dW = system.draw(generator), increments(generator, system, h)
    new, _ = take_step(EULER_MARUYAMA, system.model, h, dW, y)
    field, noise = system.fields(y)
    explicit = y + h * field + weighted(system, dW, noise)
    correction = sum(s**2 * c for s, c in zip(strengths(system.model), system.correction(y), strict=True))
    assert relative(new, explicit + 0.5 * h * correction) < 1e-14
    assert relative(new, explicit) > h / 100  # negative control


@pytest.mark.parametrize("h", [1e-3, 0.02])
def test_step_of_midpoint_satisfies_its_equation(lie_poisson, h, generator):
    system = lie_poisson
    y, dW = system.draw(generator), increments(generator, system, h)
    new, report = take_step(MIDPOINT, system.model, h, dW, y)
    field, noise = system.fields(0.5 * (y + new))
    assert relative(new, y + h * field + weighted(system, dW, noise)) < 1e-13
    assert report[FAILURES] == 0


CHUNK = 5000


def run(scheme, system, h, steps, seed):
    """The states of 64 paths after many steps, and the sum of the reports."""
    generator = np.random.default_rng(seed)
    y, total = np.repeat(np.array(system.start)[:, np.newaxis], LANES, axis=1), 0.0
    for first in range(0, steps, CHUNK):
        y, report = take_steps(scheme, system.model, h, increments(generator, system, h, min(CHUNK, steps - first)), y)
        total = total + report
    return y, total


def drifts(system, y):
    """(C(y) - C(y_0)) / |C(y_0)|, an array [Casimir, path]."""
    before = system.casimirs(np.array(system.start)[:, np.newaxis])
    return (system.casimirs(y) - before) / np.abs(before)


def unbiased(drift):
    """Whether the paths of a walk end around 0, within four standard errors."""
    return abs(drift.mean()) <= 4 * drift.std(ddof=1) / math.sqrt(LANES)


@pytest.mark.share(1)
@compiled_only
def test_casimirs_of_splitting_stay_for_a_million_steps(lie_poisson):
    """Constants of the flows that are merely rounded would show as a bias of 3.6e-19 a step for Maxwell-Bloch."""
    y, _ = run(SPLITTING, lie_poisson, 2.0**-10, 10**6, seed=1)
    for drift in drifts(lie_poisson, y):
        assert np.abs(drift).mean() <= 1e-12
        assert abs(drift.mean()) <= 4e-13  # a bias of 1e-17 a step would be 1e-11
        assert unbiased(drift)
        assert drift.std() > 1e-15  # and something was computed


def test_quadratic_casimirs_of_midpoint(lie_poisson):
    y, report = run(MIDPOINT, lie_poisson, 0.01, 2000 if COMPILED else 3, seed=2)
    assert report[FAILURES] == 0
    assert np.abs(drifts(lie_poisson, y)[0]).max() < 1e-12


@pytest.mark.parametrize("h", [1e-3, 0.02])
def test_cubic_casimir_of_midpoint_changes_by_a_quarter_of_itself_at_the_increment(h, generator):
    """For C homogeneous of degree 3 with C'(x) F(x) = 0 at x = (y + z)/2, z = y + F: C(z) - C(y) = C(F)/4, exactly."""
    system = SYSTEMS["sine_euler"]
    y, dW = system.draw(generator), increments(generator, system, h)
    z, _ = take_step(MIDPOINT, system.model, h, dW, y)
    change = system.casimirs(z) - system.casimirs(y)
    assert np.abs(change[0]).max() < 1e-13
    assert np.abs(change[1] - system.casimirs(z - y)[1] / 4).max() < 1e-13
    assert np.abs(change[1]).max() > h**1.5 / 100


def test_what_is_not_kept(lie_poisson):
    """Negative controls: the cubic Casimir of sine-Euler by the midpoint rule, all by Euler-Maruyama."""
    steps = 100 if COMPILED else 3
    y, _ = run(EULER_MARUYAMA, lie_poisson, 0.01, steps, seed=2)
    assert np.median(np.abs(drifts(lie_poisson, y)), axis=1).min() > (1e-2 if COMPILED else 1e-4)
    if len(drifts(lie_poisson, y)) == 2:
        y, _ = run(MIDPOINT, lie_poisson, 0.01, steps, seed=2)
        quadratic, cubic = np.median(np.abs(drifts(lie_poisson, y)), axis=1)
        assert quadratic < 1e-14 and cubic > (1e-4 if COMPILED else 1e-6)


@compiled_only
def test_cubic_casimir_of_midpoint_walks_with_the_step():
    """Each step adds C_2(F)/4 of size h^(3/2); together a walk of size h^(3/2) (T/h)^(1/2) = h T^(1/2)."""
    system, sizes = SYSTEMS["sine_euler"], {}
    for h in (2.0**-5, 2.0**-7, 2.0**-9):
        y, _ = run(MIDPOINT, system, h, round(10 / h), seed=3)
        sizes[h] = np.sqrt((drifts(system, y)[1] ** 2).mean())
    assert sizes[2.0**-9] > 1e-6
    slope = np.polyfit(np.log(list(sizes)), np.log(list(sizes.values())), 1)[0]
    assert abs(slope - 1.0) < 0.25
