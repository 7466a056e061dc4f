"""Munthe-Kaas and the isospectral midpoint rule: steps by matrices, Casimirs, limits and orders."""

import itertools
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
import scheme_cases
from helpers import COMPILED, INITIAL, LANES, RIGID_BODY, SCHEMES, random_states, take_step, take_steps
from scheme_cases import FAILURES, RESIDUAL, increments, on_the_sphere, relative
from scipy.linalg import expm

from spi.compiler.inlining import uncompiled
from spi.ensemble import fields
from spi.ensemble.fields import cross_product, lie_poisson
from spi.ensemble.lanes import load_lane, store_lane
from spi.ensemble.protocol import (
    casimirs,
    dimension,
    drift_gradient,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noises,
    strengths,
    structure,
)
from spi.models import LotkaVolterra, MaxwellBloch, RigidBodySharedNoise, SineEuler
from spi.models.delegation import damped
from spi.numerics.angles import (
    ANY_ANGLES,
    REDUCED_ANGLES,
    SMALL_ANGLES,
    TINY_ANGLES,
    SmallAngles,
    TinyAngles,
    sinc_versinc,
)
from spi.schemes import strong_order
from spi.schemes.munthe_kaas import act, action_size

# fixtures
generator = scheme_cases.generator

EULER, MIDPOINT, ISOSPECTRAL = (
    SCHEMES[name].record for name in ("munthe_kaas_euler", "munthe_kaas_midpoint", "isospectral_midpoint")
)
SHARED = RigidBodySharedNoise((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0))
MODELS = {"shared_noise": SHARED, "rigid_body": RIGID_BODY, "sine_euler": SineEuler((0.5, 1.5, 1.0, 0.7))}


def matrix(model, v):
    """M(v), column by column: M(v) y = B(y) v."""
    return np.array([structure(model, tuple(e), tuple(v)) for e in np.eye(dimension(model))]).T


def step_gradient(model, h, dW, y):
    y, sigma = tuple(y), strengths(model)
    total = h * np.array(drift_gradient(model, y))
    for k in noise_indices(model):
        total += sigma[k] * dW[k] * np.array(noise_gradient(model, k, y))
    return total


def correction(model, y):
    """1/2 sum_k sigma_k^2 Hess Ĥ_k f_k."""
    total, y = np.zeros(len(y)), tuple(y)
    for k in noise_indices(model):
        field = structure(model, y, noise_gradient(model, k, y))
        total += 0.5 * strengths(model)[k] ** 2 * np.array(noise_hessian(model, k, y, field))
    return total


def by_exponentials(scheme, model, h, dW, y):
    if scheme is EULER:
        return expm(matrix(model, step_gradient(model, h, dW, y) + h * correction(model, y))) @ y
    middle = expm(0.5 * matrix(model, step_gradient(model, h, dW, y))) @ y
    return expm(matrix(model, step_gradient(model, h, dW, middle))) @ y


@pytest.mark.share
@pytest.mark.parametrize("scheme", [EULER, MIDPOINT], ids=["euler", "midpoint"])
@pytest.mark.parametrize("name", MODELS)
def test_steps_of_munthe_kaas_are_exponentials_of_matrices(name, scheme, generator):
    """Steps that need one exponential series and no reduction of angles, and steps that need many parts."""
    model = MODELS[name]
    for h, bound in ((1e-4, 5e-16), (0.1, 5e-15), (1.0, 1e-13))[: None if COMPILED else 2]:
        y, dW = (
            random_states(generator, dimension(model)),
            np.sqrt(h) * generator.standard_normal((noises(model), LANES)),
        )
        new, _ = take_step(scheme, model, h, dW, y)
        with uncompiled():
            expected = np.transpose(
                [by_exponentials(scheme, model, h, dW[:, lane], y[:, lane]) for lane in range(LANES)]
            )
        assert relative(new, expected) < bound
    other, _ = take_step(MIDPOINT if scheme is EULER else EULER, model, h, dW, y)
    assert relative(other, expected) > 1e-2  # negative control


def hat(v):
    """The matrix with hat(v) x = v x x."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.parametrize("h", [1e-3, 0.1, 0.5])
def test_the_isospectral_midpoint_rule_in_matrices(h, generator):
    """W(y) = (1 + v/2) W (1 - v/2) and W(z) = (1 - v/2) W (1 + v/2); the unknown W is found by plain iteration."""
    y, dW = on_the_sphere(generator), increments(generator, h)
    new, report = take_step(ISOSPECTRAL, RIGID_BODY, h, dW, y)
    assert report[FAILURES] == 0 and report[RESIDUAL] <= ISOSPECTRAL.tolerance
    found = []
    for lane in range(LANES):
        u = y[:, lane]
        with uncompiled():
            for _ in range(200):
                v = 0.5 * hat(step_gradient(RIGID_BODY, h, dW[:, lane], u))
                inverse = np.linalg.inv(np.eye(3) + v)
                w = inverse @ hat(y[:, lane]) @ inverse.T
                u = 0.5 * u + 0.5 * np.array([w[2, 1], w[0, 2], w[1, 0]])
        z = (np.eye(3) - v) @ w @ (np.eye(3) + v)
        found.append([z[2, 1], z[0, 2], z[1, 0]])
    assert relative(new, np.transpose(found)) < 1e-14
    explicit = take_step(SCHEMES["midpoint"].record, RIGID_BODY, h, dW, y)[0]
    assert relative(explicit, new) > (1e-3 if h == 0.5 else 1e-8)  # negative control: the other midpoint rule


def test_the_isospectral_midpoint_rule_is_of_order_2_without_noise(generator):
    y, quiet = on_the_sphere(generator), RIGID_BODY._replace(sigma=(0.0, 0.0, 0.0))
    ends = []
    for n in (8, 16, 32, 64) if COMPILED else (8, 16, 32):
        z = y
        for _ in range(n):
            z, _ = take_step(ISOSPECTRAL, quiet, 1.0 / n, np.zeros((3, LANES)), z)
        ends.append(z)
    changes = [relative(a, b) for a, b in itertools.pairwise(ends)]
    assert all(3.7 < large / small < 4.3 for large, small in itertools.pairwise(changes))


@pytest.mark.parametrize("angles", [TINY_ANGLES, SMALL_ANGLES, REDUCED_ANGLES, ANY_ANGLES])
def test_sine_and_versine_divided_by_the_angle(angles):
    largest = {TinyAngles: 2.0**-5, SmallAngles: np.pi / 4}.get(type(angles), 50.0)
    for x in (0.0, 1e-200, 1e-9, 0.01 * largest, 0.5 * largest, largest):
        sinc, versinc = sinc_versinc(angles, x * x)
        half = np.sinc(0.5 * x / np.pi)
        assert sinc == pytest.approx(np.sinc(x / np.pi) - 1.0, rel=1e-11, abs=2e-16)
        assert versinc == pytest.approx(0.5 * half * half, rel=1e-15)


def test_which_systems_they_are_for():
    assert all(map(lie_poisson, (RIGID_BODY, SHARED, SineEuler(), MaxwellBloch)))
    assert not lie_poisson(LotkaVolterra()) and not lie_poisson(damped(RIGID_BODY, 0.1))
    assert cross_product(RIGID_BODY) and not cross_product(MaxwellBloch()) and not cross_product(SineEuler())


WALKS = [
    (EULER, RIGID_BODY, INITIAL, 2.0**-3),
    (MIDPOINT, RIGID_BODY, INITIAL, 2.0**-3),
    (ISOSPECTRAL, RIGID_BODY, INITIAL, 2.0**-3),
    (EULER, MaxwellBloch(), (1.0, 2.0, 3.0), 2.0**-5),
    (EULER, SineEuler(), (0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1), 2.0**-3),
]


@pytest.mark.share(2)
@pytest.mark.skipif(not COMPILED, reason="many steps")
@pytest.mark.parametrize("scheme, model, initial, h", WALKS)
def test_casimirs_walk_without_bias(scheme, model, initial, h, generator):
    """Maxwell-Bloch's drifted by 2e-17 a step, ten standard errors, when small sums were added to large ones.

    Over ten seeds 2.2e-18 a step are left there, a fiftieth of a rounding.
    """
    left = 3e-18 * 20_000 if isinstance(model, MaxwellBloch) else 0.0
    dW = np.sqrt(h) * np.clip(generator.standard_normal((20_000, noises(model), LANES)), -3.0, 3.0)
    y, _ = take_steps(scheme, model, h, dW, np.repeat(np.array(initial)[:, np.newaxis], LANES, axis=1))
    with uncompiled():
        before = np.array(casimirs(model, initial))
        drift = np.array(casimirs(model, tuple(y))) / before[:, np.newaxis] - 1.0
    error = drift.std(axis=1, ddof=1) / np.sqrt(LANES)
    assert np.all(np.abs(drift) < 1e-12) and np.all(error < 2e-14)
    assert np.all(np.abs(drift.mean(axis=1)) <= 4.5 * error + left)


class WithoutCorrection(NamedTuple):
    """A wrong scheme: the Euler type without the Hessians."""

    def work_size(scheme, model):
        return action_size(model)

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            store_lane(work, lane, fields.step_gradient(model, h, dW, lane, load_lane(model, y, lane)))
        act(model, work, y, report)


def distances(scheme, reference, model, exponents, generator):
    """Root mean square distances at time 1 of 64 paths to those of a reference at the finest step."""
    dW = 2.0 ** (-exponents[-1] / 2) * generator.standard_normal((2 ** exponents[-1], noises(model), LANES))
    y = np.repeat(np.array(INITIAL)[:, np.newaxis], LANES, axis=1)
    fine, _ = take_steps(reference, model, 2.0 ** -exponents[-1], dW, y)
    found = []
    for k in exponents[:-1]:
        sums = dW.reshape(2**k, -1, noises(model), LANES).sum(axis=1)
        found.append(np.sqrt(((take_steps(scheme, model, 2.0**-k, sums, y)[0] - fine) ** 2).sum(axis=0).mean()))
    return np.array(found)


@pytest.mark.share
@pytest.mark.skipif(not COMPILED, reason="many steps")
@pytest.mark.parametrize("scheme", [EULER, MIDPOINT], ids=["euler", "midpoint"])
@pytest.mark.parametrize("model", [SHARED, RIGID_BODY], ids=["one noise for all", "three noises"])
def test_limits_are_those_of_the_stratonovich_equation(model, scheme, generator):
    """As of Euler-Maruyama; where Hess Ĥ f is not 0, the Euler type needs its correction."""
    found = distances(scheme, SCHEMES["euler_maruyama"].record, model, (3, 6, 9, 15), generator)
    assert np.all(found[1:] < 0.55 * found[:-1]) and found[-1] < 0.05
    if model is SHARED and scheme is EULER:
        wrong = distances(WithoutCorrection(), EULER, model, (6, 9, 12), generator)
        assert np.all(wrong > 0.05) and wrong[-1] > 0.8 * wrong[0]


@pytest.mark.skipif(not COMPILED, reason="many steps")
def test_the_midpoint_type_has_order_1_with_one_noise_and_the_euler_type_has_not(generator):
    half, one = (distances(s, MIDPOINT, SHARED, (3, 5, 7, 13), generator) for s in (EULER, MIDPOINT))
    assert 0.35 < np.polyfit((3, 5, 7), -np.log2(half), 1)[0] < 0.7
    assert 0.85 < np.polyfit((3, 5, 7), -np.log2(one), 1)[0] < 1.15


def test_the_order_that_theory_expects_of_the_euler_type():
    """1 where the noises commute and Hess Ĥ_k f_l vanishes, as for one noise that is a function of one component."""
    orders = {
        RIGID_BODY: 0.5,
        RIGID_BODY._replace(sigma=(1.0, None, None)): 1.0,
        SHARED: 0.5,
        MaxwellBloch((1.0, None)): 1.0,
        SineEuler((1.0, None, None, None)): 1.0,
    }
    for model, order in orders.items():
        case = SimpleNamespace(model=model, noise=None, initial=np.full(dimension(model), 0.5))
        assert model is SHARED or strong_order(SCHEMES["munthe_kaas_areas"], model, case.initial) == 1.0
        assert strong_order(SCHEMES["munthe_kaas_euler"], case.model, case.initial, case.noise) == order
        assert strong_order(SCHEMES["munthe_kaas_midpoint"], case.model, case.initial, case.noise) == (
            0.5 if model is RIGID_BODY else 1.0
        )
