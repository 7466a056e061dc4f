"""Initial states at random: their laws, each path its own, the same bits however many are drawn."""

import copy
import pickle

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from scipy import stats

from spi.ensemble.increments import brownian
from spi.ensemble.random_states import Gaussian, Gibbs, Listed, RandomState, Spheres, Uniform, first_states
from spi.exact.surfaces import least_on, quadratic, spheres
from spi.numerics.rng import LANES

BLOCKS = 128
PATHS = BLOCKS * LANES
BODY = spheres(RIGID_BODY, INITIAL)
TWO = Spheres((0.0, 0.0, 1.0, 0.0, 0.0, 1.0), ((0, 1, 2), (3, 4, 5)), (1.0,) * 6)


def drawn(law, blocks=BLOCKS, first=0, seed=1, stream=0):
    state = RandomState((0.0,) * 3, law, {})
    noise = brownian(seed)._replace(stream=np.uint64(stream))
    return first_states(state, noise, first, blocks)


def gibbs(surface, b, matrix):
    terms = [(i, c) for i, c in enumerate(b.tolist())]
    terms += [(i, j, 0.5 * matrix[i, j]) for i, j in np.argwhere(matrix).tolist()]
    return Gibbs(surface, tuple(terms), least_on(surface, b, matrix))


def of_body(temperature):
    _, b, matrix = quadratic(RIGID_BODY)
    return gibbs(BODY, b / temperature, matrix / temperature)


def check_mean(values, truth):
    stderr = values.std(axis=-1) / np.sqrt(values.shape[-1])
    assert np.all(np.abs(values.mean(axis=-1) - truth) < 4.5 * stderr)
    assert np.all(stderr > 0)


def test_uniform_on_a_sphere():
    """The height and the angle are uniform and independent; around another mean they are not."""
    y = drawn(Uniform(BODY))
    np.testing.assert_allclose((y**2).sum(axis=0), 1.0, rtol=1e-15)
    place = np.stack([(y[2] + 1) / 2, np.arctan2(y[1], y[0]) / (2 * np.pi) + 0.5])
    counts, _, _ = np.histogram2d(*place, bins=8, range=[[0, 1], [0, 1]])
    assert stats.chisquare(counts.ravel()).pvalue > 1e-3
    crooked = Gaussian((0.0, 0.0, 0.2), tuple((i, i, 1.0) for i in range(3)), BODY)
    counts, _ = np.histogram(drawn(crooked)[2], bins=8, range=(-1, 1))
    assert stats.chisquare(counts).pvalue < 1e-9


@pytest.mark.parametrize("temperature", [0.1, -0.1])
def test_gibbs_on_a_sphere_against_quadrature(temperature):
    """Moments of the components, at a negative temperature too, where the axis of most energy is the likeliest."""
    y = drawn(of_body(temperature))
    nodes, weights = np.polynomial.legendre.leggauss(60)
    angle = 2 * np.pi * np.arange(120) / 120
    height, angle = np.meshgrid(nodes, angle, indexing="ij")
    at = np.stack([np.sqrt(1 - height**2) * np.cos(angle), np.sqrt(1 - height**2) * np.sin(angle), height])
    energy = (at**2 / np.reshape(RIGID_BODY.inertia, (3, 1, 1)) / 2).sum(axis=0)
    density = weights[:, np.newaxis] * np.exp(-(energy - energy.min() * (temperature > 0)) / temperature)
    check_mean(y**2, (at**2 * density).sum(axis=(1, 2)) / density.sum())
    check_mean(y, 0.0)


def test_two_spins_of_gibbs():
    """With H = -s1.s2 / T the angle between them has the mean cosine of Langevin, coth(1/T) - T."""
    matrix = np.zeros((6, 6))
    matrix[[0, 1, 2, 3, 4, 5], [3, 4, 5, 0, 1, 2]] = -2.0
    y = drawn(gibbs(TWO, np.zeros(6), matrix))
    check_mean((y[:3] * y[3:]).sum(axis=0), 1 / np.tanh(2.0) - 0.5)


def test_gaussian():
    law = Gaussian((1.0, 0.0, 0.0), ((0, 0, 0.3), (1, 0, 0.4), (1, 1, 0.3)), None)
    y = drawn(law)
    assert np.array_equal(y[2], np.zeros(PATHS))
    check_mean(y[:2], np.array([1.0, 0.0]))
    check_mean(np.stack([(y[0] - 1) ** 2, (y[0] - 1) * y[1], y[1] ** 2]), np.array([0.09, 0.12, 0.25]))
    on_sphere = drawn(law._replace(surface=BODY))
    np.testing.assert_allclose((on_sphere**2).sum(axis=0), 1.0, rtol=1e-15)
    np.testing.assert_allclose(np.cross(y.T, on_sphere.T), 0.0, atol=1e-14)


def test_points_with_their_weights():
    share = np.array([0.5, 0.0, 0.2, 0.3])
    law = Listed(np.arange(12.0).reshape(4, 3), -np.log1p(-np.minimum(np.cumsum(share)[:-1], 1)))
    y = drawn(law)
    number = (y[0] / 3).astype(int)
    assert np.array_equal(y.T, law.points[number])
    counts = np.bincount(number, minlength=4)
    assert counts[1] == 0 and stats.chisquare(counts[share > 0], PATHS * share[share > 0]).pvalue > 1e-3


@pytest.mark.parametrize("law", [Uniform(BODY), of_body(0.05), Gaussian(INITIAL, ((0, 0, 1.0),), None)])
def test_the_state_of_a_path_depends_on_nothing_else(law):
    """Nor on other blocks; other seeds and streams give others."""
    y = drawn(law, 5)
    for first, blocks in ((0, 1), (2, 3), (4, 1)):
        some = drawn(law, blocks, first)
        assert some.tobytes() == np.ascontiguousarray(y[:, first * LANES : (first + blocks) * LANES]).tobytes()
    for other in (drawn(law, 5, seed=2), drawn(law, 5, stream=16)):
        assert not np.isclose(other[0], y[0]).any()


def test_copies_and_what_they_are_equal_to():
    state = RandomState(INITIAL, Uniform(BODY), {"law": "uniform_on_surface"})
    for other in (pickle.loads(pickle.dumps(state)), copy.deepcopy(state)):
        assert other == state and hash(other) == hash(state) and other.law == state.law
    assert state != INITIAL and state != RandomState(INITIAL, Uniform(BODY), {"law": "gibbs"})
