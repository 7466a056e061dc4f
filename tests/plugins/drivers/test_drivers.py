"""Drivers that are no Brownian motion: their laws against formulas, and the same bits however they are asked for."""

import math

import mpmath
import numpy as np
import pytest
from helpers import COMPILED, INITIAL, RIGID_BODY, SCHEMES, compiled_only

from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated, paths_of
from spi.numerics.rng import LANES
from spi.plugins.drivers.ensemble import drivers
from spi.plugins.drivers.ensemble.drivers import (
    DrivenPaths,
    Fractional,
    OrnsteinUhlenbeck,
    Recorded,
    _coefficients,
    circulant,
)

PATHS = 4096 if COMPILED else 64
H = 2**-3
LAWS = [OrnsteinUhlenbeck(0.3), Fractional(0.7), Fractional(0.3)]
by_law = pytest.mark.parametrize("law", LAWS, ids=str)


def increments(law, steps=16, paths=PATHS, h=H, noises=2, first=0, first_path=0, parts=1, seed=1):
    return DrivenPaths(law, brownian(seed), 16 * H).increments(h, first, steps, first_path, paths, noises, parts)


def covariance(law, n, h):
    """Of increments over h that are n steps apart, from the variance of what drives."""
    tau = getattr(law, "tau", None)
    variance = (lambda t: t - tau * (1 - math.exp(-t / tau))) if tau else (lambda t: t ** (2 * law.hurst))
    return 0.5 * (variance((n + 1) * h) + variance(abs(n - 1) * h)) - variance(n * h)


@by_law
def test_gaussian_increments_have_their_covariances(law):
    dX = increments(law)
    for n in (0, 1, 5, 15):
        found = dX[n:] * dX[: 16 - n]
        mean = found.mean(axis=(0, 2))  # of each path, which are independent
        deviation = (mean.mean() - covariance(law, n, H)) / (mean.std() / math.sqrt(PATHS))
        assert abs(deviation) < 4.5, n
    across = (dX[..., 0] * dX[..., 1]).mean(axis=0)
    assert abs(across.mean()) < 4.5 * across.std() / math.sqrt(PATHS)
    assert abs(increments(law).mean()) < 4.5 * increments(law).mean(axis=(0, 2)).std() / math.sqrt(PATHS)


def test_limits_are_brownian_motion():
    assert np.allclose(circulant(0.5, H, 16), H, rtol=1e-12)
    tau = 1e-8  # along the Brownian path of the seed itself
    X = increments(OrnsteinUhlenbeck(tau)).cumsum(axis=0)
    W = np.stack([increments(Zero, first=n, steps=1)[0] for n in range(16)]).cumsum(axis=0)
    assert np.abs(X - W).max() < 8 * math.sqrt(tau)


class Zero:
    """Brownian motion as a law: the normal numbers of its stream."""

    @staticmethod
    def draw(asked, memory):
        return math.sqrt(asked.h) * asked.normals(0, asked.first, asked.count)


def test_circulant_matrix_has_the_covariances():
    for hurst in (0.2, 0.7, 0.95):
        of_circle = np.fft.irfft(circulant(hurst, H, 16), 32)[:16]
        assert np.allclose(of_circle, [covariance(Fractional(hurst), n, H) for n in range(16)], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("x", [1e-9, 1e-4, 0.009, 0.011, 1.0, 50.0])
def test_coefficients_where_they_cancel(x):
    with mpmath.workdps(50):
        b = 1 - mpmath.exp(-mpmath.mpf(x))
        exact = b, 1 - b / x, (1 - mpmath.exp(-2 * mpmath.mpf(x))) / 2 - b * b / x
        assert np.allclose(_coefficients(x), [float(v) for v in exact], rtol=1e-7, atol=0)


@by_law
def test_increments_are_functions_of_seed_path_and_step(law):
    whole = increments(law, paths=70)
    driver = DrivenPaths(law, brownian(1), 16 * H)
    for first, steps in ((5, 3), (8, 4), (2, 9)):  # on, on after a gap, and back
        assert np.array_equal(driver.increments(H, first, steps, 0, 70, 2), whole[first : first + steps])
    assert np.array_equal(increments(law, paths=6, first_path=64), whole[:, 64:])
    assert not np.array_equal(increments(law, paths=70, seed=2), whole)


@by_law
def test_larger_steps_are_sums(law):
    fine = DrivenPaths(law, brownian(1), 16 * H, parts=2)
    halves = fine.increments(H, 3, 4, 0, 8, 2, parts=2)
    assert np.array_equal(fine.increments(H, 3, 4, 0, 8, 2), halves[0::2] + halves[1::2])


@compiled_only
@by_law
def test_states_do_not_depend_on_how_much_is_made_at_a_time(law, monkeypatch):
    scheme, times = SCHEMES["splitting"].record, grid(2**-8, 512, (2, 0))
    driver = DrivenPaths(law, brownian(1), 2.0)

    def states(first, blocks, end):
        found, _ = integrated(scheme, RIGID_BODY, INITIAL, times, driver, first, blocks, end)
        return paths_of(found, 3)

    expected = states(0, 2, 70)[..., :70]
    monkeypatch.setattr(drivers, "_BYTES", 1)
    assert len(list(driver.pieces(scheme, RIGID_BODY, times, 0, 1, LANES))) == 4
    piece = next(driver.pieces(scheme, RIGID_BODY, times, 0, 1, 3 * LANES))  # of one block of three
    assert piece[1].dW.shape[1] == piece[3] == LANES
    assert driver.most_blocks(RIGID_BODY, times) == 1
    assert np.array_equal(states(0, 2, 70)[..., :70], expected)
    assert np.array_equal(states(1, 1, 70)[..., :6], expected[..., 64:])
    assert np.abs(expected[0] - expected[1]).max() > 1e-3


@by_law
def test_rotation_about_one_axis(law):
    """A body with y_3 = 1 that only this noise turns: y_1 is the cosine of the driver."""
    model = RIGID_BODY._replace(inertia=(1e30,) * 3, noise_inertia=(1.0, 1.0, 1.0), sigma=(0.0, 0.0, 0.6))
    times, driver = grid(2**-3, 16), DrivenPaths(law, brownian(3), 2.0)
    states, _ = integrated(SCHEMES["splitting"].record, model, (1.0, 0.0, 1.0), times, driver, 0, PATHS // 64, PATHS)
    y = paths_of(states, 3)[0]
    expected = math.exp(-(0.6**2) * covariance(law, 0, 2.0) / 2)
    assert abs(y[0].mean() - expected) < 4.5 * y[0].std() / math.sqrt(PATHS)
    assert np.abs((y**2).sum(axis=0) - 2.0).max() < 1e-12
    assert abs(expected - math.exp(-0.36)) > 0.01  # that of Brownian motion


def test_increments_of_a_file_are_summed_or_bridged():
    generator = np.random.default_rng(1)
    dW = generator.standard_normal((3, 8, 2))
    law = Recorded(dW, H, "digest")
    path = np.moveaxis(dW, 0, 1)
    assert np.array_equal(increments(law, 3, 2, first=2, first_path=1), path[2:5, 1:])
    assert np.allclose(increments(law, 2, 3, h=4 * H), path.reshape(2, 4, 3, 2).sum(axis=1))
    fine = increments(law, 11, 3, h=H / 4, first=3)
    assert np.allclose(fine[1:9].reshape(2, 4, 3, 2).sum(axis=1), path[1:3])
    assert np.array_equal(fine[2:], increments(law, 9, 3, h=H / 4, first=5))
    law = Recorded(math.sqrt(H) * generator.standard_normal((PATHS, 2, 2)), H, "digest")
    fine = increments(law, 8, h=H / 4)
    for n in (0, 1, 4):
        mean = (fine[n:] * fine[: 8 - n]).mean(axis=(0, 2))
        assert abs(mean.mean() - (n == 0) * H / 4) < 4.5 * mean.std() / math.sqrt(PATHS)
