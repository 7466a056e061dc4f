"""The schemes, run by the loop over time, converge to the right equation with the right orders."""

import functools
import itertools

import numpy as np
import pytest
from ensemble_cases import increments_of
from helpers import INITIAL, LANES, RIGID_BODY, SCHEMES, compiled_only, in_loops, simulate

from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import drift_field, noise_field

#: Strengths 0 rather than None, so that one compiled kernel serves it and three noises.
ONE_NOISE = RIGID_BODY._replace(sigma=(1.0, 0.0, 0.0))


PATHS = 512
LEVELS = tuple(range(7))  # h = 2^-10, ..., 2^-4


def root_mean_square(differences):
    """Of the lengths of differences [level, component, path]: values [level] and their relative standard errors."""
    squares = (differences**2).sum(axis=1)
    values = np.sqrt(squares.mean(axis=1))
    return values, 0.5 * squares.std(axis=1, ddof=1) / np.sqrt(squares.shape[1]) / values**2


def slope(differences, steps):
    """The order with its standard error by the jackknife over 16 groups of paths."""
    x = np.log2(steps)

    def fit(d):
        return np.polyfit(x, np.log2(root_mean_square(d)[0]), 1)[0]

    groups = np.array_split(np.arange(differences.shape[-1]), 16)
    left_out = np.array([fit(np.delete(differences, group, axis=-1)) for group in groups])
    return fit(differences), np.sqrt(15 / 16 * ((left_out - left_out.mean()) ** 2).sum())


@pytest.fixture(scope="module")
def at_time_one():
    """Of a name the states at T = 1, an array [level, component, path], driven by the same truncated Brownian paths."""
    options = {
        "h": 2.0**-10,
        "steps": 2**10,
        "doublings": LEVELS,
        "blocks": PATHS // LANES,
        "truncate": True,
    }

    @functools.cache
    def states(name):
        if name == "wrong":
            return np.array(list(map(without_correction, STEP_SIZES, increments_of(**options))))
        return simulate(SCHEMES[name].record, area_terms=4, **options)[0][:, 0]

    return states


def without_correction(h, increments):
    """A wrong scheme, in NumPy: Euler-Maruyama that takes the Stratonovich equation for an Itô equation."""
    y = np.repeat(np.reshape(INITIAL, (3, 1)), PATHS, axis=1)
    with uncompiled():
        for dW in increments:
            noise = sum(np.array(noise_field(RIGID_BODY, k, tuple(y))) * dW[k] for k in range(3))
            y = y + h * np.array(drift_field(RIGID_BODY, tuple(y))) + noise
    return y


STEP_SIZES = 2.0 ** (np.array(LEVELS) - 10)


#: Schemes that leave out the same Lévy areas, so that they differ by O(h).
ALIKE = (
    {"splitting", "splitting_drift_first", "splitting_joint_lie"},
    {"midpoint", "munthe_kaas_midpoint", "isospectral_midpoint", "heun_renormalised", "splitting_joint"},
)
#: Schemes that know the areas, of strong order 1.
WITH_AREAS = {"splitting_areas", "splitting_joint_areas", "munthe_kaas_areas"}
#: Distances in which a term of order h is so large that they fall faster.
STEEPER = ({"euler_maruyama_renormalised", "munthe_kaas_euler"},)


@compiled_only
@pytest.mark.parametrize(("a", "b"), [in_loops(*pair) for pair in itertools.combinations(SCHEMES, 2)])
def test_schemes_approach_each_other(at_time_one, a, b):
    """The distance of two schemes falls with the smaller of their orders."""
    differences = at_time_one(a) - at_time_one(b)
    distances, errors = root_mean_square(differences)
    # sub-steps and areas of the reference step itself are drawn independently
    first = 1 if {"splitting_symmetric", "roessler_rs2"} & {a, b} and WITH_AREAS & {a, b} else 0
    order, error = slope(differences[first:], STEP_SIZES[first:])
    expected = 1.0 if any({a, b} <= alike for alike in (*ALIKE, WITH_AREAS)) else 0.5
    more = 0.1 if any(schemes <= {a, b} for schemes in STEEPER) else 0.0
    assert error < 0.02
    assert -4 * error - 0.01 < order - expected < 4 * error + 0.01 + more
    assert np.all(np.diff(distances[first:]) > 0)
    # At h = 2^-10 far below the distance, 0.115, to the wrong equation of the next test.
    assert np.all(distances * (1 - 4 * errors) < 0.4 * STEP_SIZES**expected)


@compiled_only
@pytest.mark.parametrize("name", [in_loops(name) for name in SCHEMES])
def test_a_scheme_for_another_equation_is_caught(at_time_one, name):
    """Negative control: Euler-Maruyama without the Itô correction converges, but elsewhere."""
    differences = at_time_one("wrong") - at_time_one(name)
    distances, errors = root_mean_square(differences)
    order, _ = slope(differences[:4], STEP_SIZES[:4])
    assert distances[0] * (1 - 4 * errors[0]) > 0.1
    assert abs(order) < 0.03
    itself, _ = root_mean_square(np.diff(at_time_one("wrong"), axis=0))
    assert np.all(np.diff(itself) > 0) and itself[0] < 0.01
