"""The law of drawn Lévy areas: moments, covariances given the increments, and the distance to the true law."""

import itertools
import math

import numpy as np
import pytest
from helpers import LANES, RIGID_BODY, compiled_only

from spi.compiler.inlining import uncompiled
from spi.ensemble import areas as area_draws
from spi.ensemble.areas import GAUSSIAN, TAILS, all_pairs, area_count, area_distance, draw_fourier_areas
from spi.ensemble.increments import brownian, draw_noise, empty_noise
from spi.ensemble.protocol import area_pairs
from spi.models import SineEuler
from spi.numerics.rng import STEPS_PER_DRAW
from spi.schemes import SCHEMES

PAIRS = ((0, 1), (0, 2), (1, 2))
EXACT = (1, 40)


@pytest.fixture(scope="module")
def drawn():
    """terms -> (dW [noise, sample], areas [pair, sample]) of steps of size 1, as runs have them."""
    found = {}
    for terms in (*EXACT, GAUSSIAN):
        given = empty_noise(scheme := SCHEMES["munthe_kaas_areas"].record, RIGID_BODY, 256, 16 * LANES)
        draw_noise(scheme, RIGID_BODY, brownian(1), 1.0, terms, 0, 0, given)
        found[terms] = given.dW.reshape(-1, 3).T.copy(), given.areas.reshape(-1, 3).T.copy()
    return found


def deviation(values, expected):
    """How many standard errors the mean of some samples is from what is expected."""
    return abs(values.mean() - expected) / (values.std() / math.sqrt(values.size))


@compiled_only
@pytest.mark.parametrize("terms", [*EXACT, GAUSSIAN])
def test_joint_moments_of_increments_and_areas(drawn, terms):
    """Up to the fourth degree; those of fourth degree in the areas are right but for Gaussian areas."""
    dW, areas = drawn[terms]
    for p, (k, m) in enumerate(PAIRS):
        a = areas[p]
        assert deviation(a, 0) < 4 and deviation(a**3, 0) < 4
        assert deviation(a**2, 1 / 4) < 4
        assert deviation(a**2 * dW[k] ** 2, 5 / 12) < 4
        assert deviation(a * dW[k] * dW[m], 0) < 4
        (other,) = {0, 1, 2} - {k, m}
        assert deviation(a**2 * dW[other] ** 2, 1 / 4) < 4
    for (p, first), (q, second) in itertools.combinations(enumerate(PAIRS), 2):
        ((k,), (m,)) = (set(pair) - (set(first) & set(second)) for pair in (first, second))
        sign = 1 if (first.index(k) == 1) == (second.index(m) == 1) else -1
        assert deviation(areas[p] * areas[q], 0) < 4
        assert deviation(areas[p] * areas[q] * dW[k] * dW[m], sign / 12) < 4
    # 3 E Var(A | dW)^2 = 3 E (1 + dW_k^2 + dW_l^2)^2 / 144 = 13/48 in place of 5/16
    right, other = (13 / 48, 5 / 16) if terms == GAUSSIAN else (5 / 16, 13 / 48)
    assert all(deviation(a**4, right) < 4 < deviation(a**4, other) for a in areas)
    assert deviation(areas[0] ** 2, 1 / 4 * 0.98) > 4  # negative control: an area too small by 1 % would be seen


@compiled_only
def test_characteristic_function_of_an_increment_and_an_area(drawn):
    """E exp(i (u dW_k + x A_kl)) = sech(x/2) exp(-u^2 tanh(x/2) / x): Lévy's formula for h = 1."""
    worst = {}
    for terms, (dW, areas) in drawn.items():
        deviations = [
            deviation(np.cos(u * dW[k] + x * areas[p]), np.exp(-(u**2) * math.tanh(x / 2) / x) / math.cosh(x / 2))
            for p, (k, _) in enumerate(PAIRS)
            for u in (0.0, 1.0, 2.5)
            for x in (1.0, 3.0, 6.0)
        ]
        worst[terms] = max(deviations)
    assert all(worst[terms] < 4 for terms in EXACT)
    assert worst[GAUSSIAN] > 5  # negative control: they have the moments, and not the law


# --- covariances given the increments --------------------------------------------------------------------------------


def with_commuting(*pairs):
    """Sine-Euler, with four noises, of which some are said to commute."""
    return type("Some", (SineEuler,), {"commuting_noises": pairs, "__module__": SineEuler.__module__})()


GROUPS = {
    "all pairs": RIGID_BODY,
    "a noise off": RIGID_BODY._replace(sigma=(1.0, None, 1.0)),
    "two groups": with_commuting((0, 1), (0, 3), (1, 2), (2, 3)),
    "a chain": with_commuting((0, 2), (0, 3), (1, 3)),
}


def covariance(pairs, W):
    """Of W_k M_l - W_l M_k + G_kl given W."""

    def of(first, second):
        (k, m), (i, j) = first, second
        same = W[k] * W[i] * (m == j) + W[m] * W[j] * (k == i)
        return (first == second) + same - W[k] * W[j] * (m == i) - W[m] * W[i] * (k == j)

    return np.array([[of(first, second) for second in pairs] for first in pairs])


@pytest.mark.parametrize("name", GROUPS)
def test_covariances_of_gaussian_areas_given_the_increments(name, monkeypatch):
    """To rounding: the normal numbers are unit vectors, a lane each, so that the areas are columns of a matrix."""
    model, h, W = GROUPS[name], 0.25, np.array([0.3, -1.2, 0.8, 0.5])
    pairs, seen = area_pairs(model), {}
    assert all_pairs(model) == (name != "a chain")

    def unit_vectors(noise, channel, draw, block, words, normals):
        lane = seen.setdefault(channel, len(seen))
        assert channel < 4 or channel >= TAILS
        normals[:] = 0.0
        normals[lane::LANES] = 1.0

    monkeypatch.setattr(area_draws, "draw_coefficients", unit_vectors)
    row = np.zeros((STEPS_PER_DRAW, (type(model).noises + len(pairs)) * LANES))
    row[:, : type(model).noises * LANES] = np.repeat(math.sqrt(h) * W[: type(model).noises], LANES)
    with uncompiled():
        draw_fourier_areas(model, row, brownian(1), 0, 0, h, GAUSSIAN, np.empty(STEPS_PER_DRAW * LANES, np.uint64))
    columns = row[0, -area_count(model) * LANES :].reshape(-1, LANES)
    assert len(seen) == len(pairs) + (0 if all_pairs(model) else 4)
    np.testing.assert_allclose(columns @ columns.T, h * h / 12 * covariance(pairs, W), rtol=0, atol=1e-16)


# --- the distance to the true law ------------------------------------------------------------------------------------

ZETA2, ZETA4 = math.pi**2 / 6, math.pi**4 / 90


def weights(terms):
    """The squares of the weights of the terms of the series, and what is left for the tail."""
    if terms == 0:
        return [], ZETA2
    last = math.sqrt(ZETA4 - sum(r**-4.0 for r in range(1, terms)))
    squares = [*(r**-2.0 for r in range(1, terms)), last]
    return squares, ZETA2 - sum(squares)


def quantiles(characteristic, noises, count=40_000):
    """Those of |T| / (2 pi), T = 2 pi A / h given W = 0, whose law is invariant under rotations for 2 and 3 noises.

    P(|T| <= r) = 2/pi int f(u) sin(ru)/u du in one dimension, and with sin(ru)/u - r cos(ru) in three.
    """
    u, r = np.linspace(1e-9, 30.0, 3001), np.linspace(0.0, 16.0, 801)
    f, du = characteristic(u), u[1] - u[0]
    inner = np.sin(np.outer(r, u)) / u - (r[:, np.newaxis] * np.cos(np.outer(r, u)) if noises == 3 else 0.0)
    distribution = 2 / math.pi * du * ((inner * f).sum(axis=1) - 0.5 * (inner[:, 0] * f[0]))
    increasing = np.maximum.accumulate(np.clip(distribution, 0.0, 1.0))
    return np.interp((np.arange(count) + 0.5) / count, increasing, r) / (2 * math.pi)


def distance(terms, noises):
    """The quadratic Wasserstein distance per pair, in units of h; quantiles of |T| are coupled with one another."""
    squares, rest = weights(terms)
    true = quantiles(lambda u: math.pi * u / np.sinh(math.pi * u), noises)
    made = quantiles(
        lambda u: np.exp(-rest * u * u) / np.prod([np.ones_like(u), *(1 + s * u * u for s in squares)], axis=0), noises
    )
    return math.sqrt(((true - made) ** 2).mean() / (noises * (noises - 1) / 2))


@pytest.mark.parametrize("noises", [2, 3])
def test_drawn_areas_are_no_farther_from_the_true_ones_than_is_said(noises):
    """Of the law given W = 0, by characteristic functions; near there the distance is largest."""
    found = np.array([distance(n, noises) for n in (1, 2, 3)])
    said = np.array([area_distance(n, noises) for n in (1, 2, 3)])
    assert np.all(found < said) and np.all(said < 2 * found)
    assert distance(0, noises) > 10 * found[0]  # negative control: Gaussian areas
