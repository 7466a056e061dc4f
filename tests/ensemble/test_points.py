"""Increments and coins of paths along scrambled points, in Python against the points themselves."""

import numpy as np
import pytest
from helpers import LANES, ONE_NOISE, RIGID_BODY
from scipy.special import ndtri

from spi.compiler.dispatch import number
from spi.compiler.inlining import uncompiled
from spi.ensemble.increments import (
    by_bridges,
    coins_of_step,
    first_lane,
    kept_of_steps,
    noise_of_steps,
    points_of,
    row_length,
    words_length,
)
from spi.ensemble.loop import grid
from spi.numerics.rng import POINTS, STEPS_PER_DRAW
from spi.numerics.sobol import BITS, net_words
from spi.schemes import SCHEMES

H, BLOCK = 2.0**-3, 11


@pytest.mark.parametrize("steps", [1, 2, 5, 16])
def test_increments_by_bridges_are_independent_normal_numbers(steps):
    matrix = by_bridges(steps)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(steps), atol=1e-14)
    ends = np.cumsum(matrix, axis=0)
    np.testing.assert_allclose(ends[-1], np.eye(steps)[0] * np.sqrt(steps), atol=1e-14)


def drawn(scheme, model, steps):
    """(dW (fine steps, noises, LANES), coins (steps, LANES), noise) of a block, as the loop over time gets them."""
    record = SCHEMES[scheme].record
    kept, times = kept_of_steps(None, record, model), grid(H, steps)
    noise = points_of(5, POINTS, record, model, times)
    with uncompiled():
        rows = np.zeros((STEPS_PER_DRAW, row_length(kept, model)))
        words, bits = np.zeros(words_length(noise), np.uint64), np.zeros(4 * LANES, np.uint64)
        coins, dW = np.zeros((steps, LANES)), []
        for n in range(steps):
            if n % STEPS_PER_DRAW == 0:
                noise_of_steps(kept, model, rows, noise, np.uint64(n // STEPS_PER_DRAW), np.uint64(BLOCK), H, 0, words)
            row, parts = rows[n % STEPS_PER_DRAW], number(kept.substeps)
            firsts = [[first_lane(model, k, parts, part) for k in range(3)] for part in range(parts)]
            dW += [[row[first : first + LANES].copy() for first in one] for one in firsts]
            np.testing.assert_array_equal(row[: 3 * LANES], np.ravel(sum(map(np.array, dW[-parts:]))))
            coins_of_step(kept.coins, noise, n, np.uint64(BLOCK), bits, coins, n)
    return np.array(dW), coins, noise


def fractions(noise, d):
    with uncompiled():
        words = np.zeros(LANES, np.uint64)
        net_words(noise.directions[d], noise.shifts[d], BLOCK, words)
    return (words.astype(float) + 0.5) * 2.0**-BITS


@pytest.mark.parametrize(
    ("scheme", "model", "steps"),
    [
        ("splitting_order2", RIGID_BODY, 6),
        ("splitting_order2", ONE_NOISE, 3),
        ("splitting_symmetric", RIGID_BODY, 3),
    ],
)
def test_increments_and_coins_are_functions_of_the_points(scheme, model, steps):
    """Dimension i m + k is normal number i of the k-th of the m noises that are on; the coins come behind them."""
    dW, coins, noise = drawn(scheme, model, steps)
    on = 3 if model is RIGID_BODY else 1
    normals = np.array([[ndtri(fractions(noise, i * on + k)) for k in range(on)] for i in range(len(dW))])
    expected = np.einsum("ni,ikl->nkl", by_bridges(len(dW)), normals) * np.sqrt(H * steps / len(dW))
    np.testing.assert_allclose(dW[:, :on], expected, atol=1e-12)
    assert not dW[:, on:].any()
    if scheme == "splitting_order2":
        assert len(noise.shifts) == (on + 1) * steps
        first = on * steps
        assert np.array_equal(coins, [np.where(fractions(noise, first + n) < 0.5, -1.0, 1.0) for n in range(steps)])
    else:
        assert len(noise.shifts) == on * 2 * steps and not coins.any()
