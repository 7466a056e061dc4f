"""Initial states at random: their laws, each path its own, the same bits however many are drawn."""

import copy
import pickle

import numpy as np
from helpers import INITIAL, RIGID_BODY
from scipy import stats

from spi.ensemble.increments import brownian
from spi.ensemble.random_states import DrawnFromList, Gaussian, RandomState, first_states
from spi.exact.surfaces import spheres
from spi.numerics.rng import LANES

BLOCKS = 128
PATHS = BLOCKS * LANES
BODY = spheres(RIGID_BODY, INITIAL)


def drawn(law, blocks=BLOCKS, first=0, seed=1, stream=0):
    state = RandomState((0.0,) * 3, law, {})
    noise = brownian(seed)._replace(stream=np.uint64(stream))
    return first_states(state, noise, first, blocks)


def check_mean(values, truth):
    stderr = values.std(axis=-1) / np.sqrt(values.shape[-1])
    assert np.all(np.abs(values.mean(axis=-1) - truth) < 4.5 * stderr)
    assert np.all(stderr > 0)


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
    law = DrawnFromList(np.arange(12.0).reshape(4, 3), -np.log1p(-np.minimum(np.cumsum(share)[:-1], 1)))
    y = drawn(law)
    number = (y[0] / 3).astype(int)
    assert np.array_equal(y.T, law.points[number])
    counts = np.bincount(number, minlength=4)
    assert counts[1] == 0 and stats.chisquare(counts[share > 0], PATHS * share[share > 0]).pvalue > 1e-3


def check_alone(law):
    """The state of a path depends neither on other blocks, nor is it that of other seeds and streams."""
    y = drawn(law, 5)
    for first, blocks in ((0, 1), (2, 3), (4, 1)):
        some = drawn(law, blocks, first)
        assert some.tobytes() == np.ascontiguousarray(y[:, first * LANES : (first + blocks) * LANES]).tobytes()
    for other in (drawn(law, 5, seed=2), drawn(law, 5, stream=16)):
        assert not np.isclose(other[0], y[0]).any()


def test_the_state_of_a_path_depends_on_nothing_else():
    check_alone(Gaussian(INITIAL, ((0, 0, 1.0),), None))


def test_copies_and_what_they_are_equal_to():
    state = RandomState(INITIAL, Gaussian(INITIAL, ((0, 0, 1.0),), BODY), {"law": "gaussian"})
    for other in (pickle.loads(pickle.dumps(state)), copy.deepcopy(state)):
        assert other == state and hash(other) == hash(state) and other.law == state.law
    assert state != INITIAL and state != RandomState(INITIAL, state.law, {"law": "points"})
