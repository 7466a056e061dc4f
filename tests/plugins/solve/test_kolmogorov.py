"""Expectations without sampling, on spheres and cylinders, against roads that share nothing with them."""

import itertools
import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers import by_quadrature, composed
from scipy.integrate import solve_ivp

from spi.exact.expectations import expectations
from spi.models import MaxwellBloch, RigidBody
from spi.plugins.solve.exact import cylinder, sphere
from spi.plugins.solve.exact.harmonics import CLASSES, Harmonics, shifted
from spi.plugins.solve.exact.sphere import BackwardStep, factors, semigroup

INERTIA = (2.0, 1.0, 2.0 / 3.0)
STRONG = RigidBody(INERTIA, INERTIA, (1.0, 1.0, 1.0))
UNEQUAL = RigidBody(INERTIA, (1.0, 2.0, 3.0), (1.0, 0.6, None))
ON_AXES = np.array([math.cos(1.1), 0.0, math.sin(1.1)])
GENERAL = np.array([0.5, -0.3, 0.7])


class Surface(NamedTuple):
    """A system on a surface, with flows of pieces and noises that have numbers from 0 on."""

    model: Any
    initial: tuple
    half: tuple  #: a step of order 2 of the drift over half a step
    field: Callable  #: of the drift

    @property
    def schemes(self):
        """Compositions of weak order 1, 1 and 2."""
        count = len(self.model.sigma)
        drift, noise = (tuple((part, k, 1.0) for k in range(count)) for part in ("drift", "noise"))
        order_2 = [self.half + order + self.half for order in (noise, noise[::-1])]
        return ((1.0, noise + drift),), ((1.0, drift + noise),), tuple((0.5, word) for word in order_2)


def half(*flows):
    return tuple(("drift", k, share) for k, share in flows)


SPHERE = Surface(
    UNEQUAL,
    tuple(1.3 * GENERAL),
    half((0, 0.25), (1, 0.25), (2, 0.5), (1, 0.25), (0, 0.25)),
    lambda t, y: np.cross(y, y / np.array(INERTIA)),
)
CYLINDER = Surface(
    MaxwellBloch(sigma=(0.5, 0.4)),
    (0.4, -0.6, 0.7),
    half((0, 0.25), (1, 0.5), (0, 0.25)),
    lambda t, y: (y[1], y[2] * y[0], -y[1] * y[0]),
)
SURFACES = pytest.mark.parametrize("surface", [SPHERE, CYLINDER], ids=["sphere", "cylinder"])
SCHEMES = pytest.mark.parametrize("number", range(3), ids=["lie_trotter", "exchanged", "order_2"])


@pytest.fixture(scope="module", autouse=True)
def _each_limit_once():
    """The tests ask for the same limits with several schemes, on the same grids and at the same degrees."""
    known = {}

    def remembered(harmonics, which, turn, spread, time, V):
        key = (harmonics.L, which, *turn, *spread, time, V.shape, V.tobytes())
        if key not in known:
            known[key] = semigroup(harmonics, which, turn, spread, time, V)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sphere, "semigroup", remembered)
        patch.setattr(cylinder, "Mesh", cache(cylinder.Mesh))
        yield


def sines(y):
    return np.sin(2 * np.pi * y).sum(axis=0)


def slow_wave(y):
    return np.cos(y[0]) + y[1] * y[2]


def mixed(y):
    """Not symmetric, and on the sphere in all four classes."""
    return np.exp(y[0] - 0.5 * y[1]) * (1 + y[2] * y[0]) + y[0] * y[1] * y[2]


# --- against independent roads ----------------------------------------------------------------------------------------


@pytest.mark.share
@SURFACES
@SCHEMES
def test_without_noise_it_is_an_ordinary_differential_equation(surface, number):
    """Steps that are made, and on the cylinder one so small that its error is interpolated."""
    model, scheme = surface.model._replace(sigma=(None,) * len(surface.model.sigma)), surface.schemes[number]
    steps, functions = (1.0, 1 / 8, *(1 / 20, 2.0**-9) * (surface is CYLINDER)), (slow_wave, mixed)
    found = expectations(model, scheme, surface.initial, 1.0, steps, functions, 1e-8)
    end = solve_ivp(surface.field, (0, 1), surface.initial, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1:]
    limit = np.array([phi(end)[0] for phi in functions])
    assert np.all(abs(found.limit - limit) < found.limit_bound + 1e-12) and np.all(found.limit_bound < 1e-7)
    for s, h in enumerate(steps):
        y = surface.initial
        for _ in range(round(1 / h)):  # without noise the words of order 2 are the same
            y = composed(model, scheme[0][1], h, y, None)
        value = np.array([phi(np.array(y)[:, None])[0] for phi in functions])
        assert np.all(abs(found.value[:, s] - value) < found.value_bound[:, s] + 1e-12), h
        assert np.all(abs(found.weak_error[:, s] - (value - limit)) < found.weak_error_bound[:, s] + 1e-12), h
        assert np.all(found.value_bound[:, s] < 1e-6)


@pytest.mark.share
@SURFACES
@SCHEMES
@pytest.mark.parametrize("n", [1, 2])
def test_one_and_two_steps_against_quadrature(surface, number, n):
    """The reversed composition of order 1 is another scheme."""
    scheme, h = surface.schemes[number], 0.25
    found = expectations(surface.model, scheme, surface.initial, n * h, [h], [mixed], 1e-6)
    value = by_quadrature(surface.model, scheme, surface.initial, h, n, mixed, 24)
    assert abs(found.value[0, 0] - value) < found.value_bound[0, 0] + 1e-11 < 1e-6
    if number < 2:
        backwards = ((1.0, scheme[0][1][::-1]),)
        other = by_quadrature(surface.model, backwards, surface.initial, h, n, mixed, 24)
        assert abs(other - value) > 100 * found.value_bound[0, 0]


def test_a_noise_may_occur_several_times_with_increments_of_its_own():
    """Two halves of a noise around the drift, by quadrature over independent increments; and the order of that scheme.

    Negative control: one increment for both halves gives another expectation.
    """
    halves, drift = [("noise", k, 0.5) for k in range(3)], [("drift", k, 1.0) for k in range(3)]
    h, model = 0.25, UNEQUAL._replace(sigma=(1.0, None, None))
    found = expectations(model, ((1.0, (*halves, *drift, *halves[::-1])),), GENERAL, h, [h], [mixed], 1e-8)
    x, w = np.polynomial.hermite_e.hermegauss(40)
    w = w / w.sum()

    def mean(first, second, weights):
        y = composed(model, halves, h, tuple(np.full(weights.shape, v) for v in GENERAL), {0: first})
        y = composed(model, (*drift, *halves[::-1]), h, y, {0: second})
        return np.sum(weights * mixed(np.array(y)))

    first, second = np.array(np.meshgrid(*[math.sqrt(h / 2) * x] * 2)).reshape(2, -1)
    assert abs(found.value[0, 0] - mean(first, second, np.outer(w, w).ravel())) < found.value_bound[0, 0] < 1e-8
    assert abs(found.value[0, 0] - mean(math.sqrt(h / 2) * x, math.sqrt(h / 2) * x, w)) > 1e-4


@pytest.mark.parametrize("k", range(3))
def test_one_axis_is_exact(k):
    """y_k stays; z = y_{k+1} + i y_{k+2} turns by -y_k t / I_k - sigma y_k W / Î_k: E z^m = exp(...) z_0^m."""
    inertia, sigma = [math.inf] * 3, [None] * 3
    inertia[k], sigma[k] = 0.8, 1.1
    model, time = RigidBody(tuple(inertia), (1.5, 0.7, 1.2), tuple(sigma)), 1.5
    a, b = (k + 1) % 3, (k + 2) % 3
    functions = [lambda y: y[k], lambda y: y[a], lambda y: y[b] ** 2, lambda y: y[a] * y[b], lambda y: 1.0]
    found = expectations(model, SPHERE.schemes[2], GENERAL, time, [time, time / 8], functions, 1e-11)

    def moment(m):
        width = sigma[k] * GENERAL[k] / model.noise_inertia[k]
        turn = np.exp(-1j * m * GENERAL[k] * time / inertia[k] - (m * width) ** 2 * time / 2)
        return turn * (GENERAL[a] + 1j * GENERAL[b]) ** m

    both = GENERAL[a] ** 2 + GENERAL[b] ** 2
    exact = [GENERAL[k], moment(1).real, (both - moment(2).real) / 2, moment(2).imag / 2, 1.0]
    np.testing.assert_allclose(found.limit, exact, atol=1e-12)
    np.testing.assert_allclose(found.value, np.array([exact, exact]).T, atol=1e-12)
    np.testing.assert_allclose(found.weak_error, 0, atol=1e-13)


def test_moments_on_a_cylinder():
    """y_2^2 + y_3^2 is conserved; with the noises alone E(y_2 + i y_3) decays."""
    functions = (lambda y: y[1] ** 2 + y[2] ** 2, lambda y: y[1], lambda y: y[2], lambda y: y[0])
    only_noise = ((1.0, (("noise", 0, 1.0), ("noise", 1, 1.0))),)
    y1, z, sigma, h = 0.5, 1.0 + 0.5j, 0.9, 0.5
    found = expectations(MaxwellBloch((sigma, 0.4)), only_noise, (y1, 1.0, 0.5), h, (h,), functions, 1e-8)
    mean = z * np.exp(-0.5 * sigma**2 * y1**2 * h)
    np.testing.assert_allclose(found.value[:, 0], (1.25, mean.real, mean.imag, y1), atol=1e-9)
    assert (found.value_bound < 1e-6).all() and abs(found.limit[0] - 1.25) < found.limit_bound[0] + 1e-12


def test_generator():
    """d/dt E y_j at 0: (y x grad H)_j - sum_{k != j} (sigma_k y_k / Î_k)^2 y_j / 2, the second part from Itô."""
    model, time = UNEQUAL._replace(sigma=(1.0, 0.6, 0.8)), 1e-6
    found = expectations(model, SPHERE.schemes[0], GENERAL, time, [time], [lambda y, k=k: y[k] for k in range(3)])
    squares = (np.array(model.sigma) * GENERAL / model.noise_inertia) ** 2
    exact = np.cross(GENERAL, GENERAL / np.array(INERTIA)) - (squares.sum() - squares) * GENERAL / 2
    np.testing.assert_allclose((found.limit - GENERAL) / time, exact, atol=1e-5)


def test_fixed_points():
    """An axis is an equilibrium of every flow."""
    for y in np.vstack([np.eye(3), np.zeros(3)]):
        found = expectations(STRONG, SPHERE.schemes[0], y, 1.0, [0.25, 1.0], [sines, mixed])
        for i, phi in enumerate((sines, mixed)):
            np.testing.assert_allclose(found.value[i], phi(y[:, None])[0], atol=1e-10)
    model, at_rest = MaxwellBloch((1.0, 1.0)), (0.7, 0.0, 0.0)
    found = expectations(model, CYLINDER.schemes[2], at_rest, 1.0, (1.0, 1 / 32), (sines,), 1e-8)
    np.testing.assert_allclose([*found.value[0], found.limit[0]], np.sin(1.4 * np.pi), atol=1e-12)


# --- orders and errors ------------------------------------------------------------------------------------------------


@pytest.mark.share(3)
@SURFACES
@SCHEMES
def test_orders(surface, number):
    """The limit from the generator is the one to which the scheme converges; a cylinder interpolates the finest."""
    phi, finest = (mixed, 7) if surface is SPHERE else (sines, 8)
    order, steps = (1, 1, 2)[number], [2.0**-k for k in range(5, finest + 1)]
    found = expectations(surface.model, surface.schemes[number], surface.initial, 0.5, steps, [phi], 1e-7)
    weak = found.weak_error[0]
    assert abs(np.log2(weak[-2] / weak[-1]) - order) < 0.05
    assert np.all(found.weak_error_bound[0] < 0.05 * abs(weak))
    extrapolated = (2**order * weak[-1] - weak[-2]) / (2**order - 1)
    assert abs(extrapolated) < 0.05 * abs(weak[-1])


def test_tiny_weak_errors_survive_cancellation():
    """Weak errors of 1e-9 to four digits, where rounding of 4096 steps would otherwise be seen."""
    model = STRONG._replace(sigma=(1e-3, None, None))
    found = expectations(model, SPHERE.schemes[2], ON_AXES, 1.0, [2.0**-8, 2.0**-12, 2.0**-16], [sines])
    c = found.weak_error[0] / found.h**2
    assert abs(c[1] / c[0] - 1) < 1e-4
    allowed = found.weak_error_bound[0] + 1e-5 * abs(c[0]) * found.h**2
    assert np.all(abs(found.weak_error[0] - c[0] * found.h**2) < allowed) and np.all(found.value_bound[0] < 1e-10)


@SURFACES
def test_refining_moves_results_by_less_than_the_stated_error(surface, monkeypatch):
    found = []
    for accuracy, levels in ((1e-6, (24, 32, 48)), (1e-8, (48, 64, 96))):
        monkeypatch.setattr(sphere, "LEVELS", levels)
        question = surface.schemes[0], surface.initial, 0.5, [0.5, 2.0**-5], [sines, mixed], accuracy
        found.append(expectations(surface.model, *question))
    coarse, fine = found
    for name in ("value", "limit", "weak_error"):
        moved = abs(getattr(coarse, name) - getattr(fine, name))
        assert np.all(moved < getattr(coarse, f"{name}_bound")) and moved.max() > 0


def test_what_is_not_resolved_is_said(monkeypatch):
    monkeypatch.setattr(sphere, "LEVELS", (16, 24, 32))
    functions = [lambda y: np.cos(100 * y[0]), mixed]
    found = expectations(STRONG, SPHERE.schemes[0], ON_AXES, 1.0, [0.25, 0.5, 1.0], functions)
    assert np.all(np.isinf(found.value_bound[0])) and np.all(np.isinf(found.weak_error_bound[0]))
    assert np.all(np.isfinite(found.value_bound[1]))


@SURFACES
@pytest.mark.parametrize(
    ("steps", "composition", "message"),
    [([0.3], (1.0, ()), "does not divide"), ([0.5], (1.0, (("jump", 0, 1.0),)), "not 'jump'")],
)
def test_bad_questions(surface, steps, composition, message):
    with pytest.raises(ValueError, match=message):
        expectations(surface.model, (composition,), surface.initial, 1.0, steps, [sines])


# --- the parts --------------------------------------------------------------------------------------------------------


def test_harmonics():
    """Functions are the sum of their classes, and the shift acts as it says."""
    harmonics, unit = Harmonics(24), GENERAL / np.linalg.norm(GENERAL)
    coefficients, evaluation = harmonics.project([mixed], 1.0), harmonics.evaluation(unit)
    value = sum(evaluation[c] @ coefficients[c][:, 0] for c in CLASSES)
    assert abs(value - mixed(unit)) < 1e-13
    turned = harmonics.project([lambda y: mixed(y[[1, 2, 0]])], 1.0)
    for c in CLASSES:
        at = harmonics.starts[c]
        shift = [u @ coefficients[c][at[i] : at[i + 1]] for i, u in enumerate(harmonics.turn[c])]
        np.testing.assert_allclose(np.concatenate(shift), turned[shifted(c)], atol=1e-13)


@pytest.mark.parametrize("c", CLASSES)
def test_powers_do_not_depend_on_the_way(c, monkeypatch):
    harmonics = Harmonics(20)
    words = [(p, factors([1.0, 0.5, 2.0], [0.3, 0.0, 0.8], word, 0.01)) for p, word in SPHERE.schemes[2]]
    step = BackwardStep(harmonics, c, words)
    V = harmonics.project([mixed, sines], 1.0)[c]
    found = []
    for doublings in (None, 0, 3):
        monkeypatch.setattr("spi.plugins.solve.exact.sphere.cheapest", lambda *_, k=doublings: (0.0, k))
        found.append(step.power(V, 37))
    for one, other in itertools.pairwise(found):
        np.testing.assert_allclose(one, other, atol=1e-13)
    one, other = (BackwardStep(harmonics, c, [(1.0, word)]).increment(V) for _, word in words)
    np.testing.assert_allclose(step.increment(V), (one + other) / 2, atol=1e-15)
