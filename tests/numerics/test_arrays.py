"""Elementary functions of arrays against exact arithmetic, and that they are not those of NumPy."""

import mpmath
import numpy as np
import pytest
from elementary_cases import INF, NAN, assert_accurate
from helpers import COMPILED

from spi.numerics import arrays
from spi.numerics.arrays import of_array, whole_power

X = np.random.default_rng(1).normal(size=300)
NEAR_ZERO = 1e-9 * X[:50]
FUNCTIONS = {
    "sin": (arrays.Sin(), [10 * X, NEAR_ZERO]),
    "cos": (arrays.Cos(), [10 * X, 0.5 * np.pi + NEAR_ZERO]),
    "tan": (arrays.Tan(), [3 * X, NEAR_ZERO]),
    "tanh": (arrays.Tanh(), [3 * X, NEAR_ZERO]),
    "exp": (arrays.Exp(), [30 * X]),
    "log": (arrays.Log(), [np.exp(X)]),
}


@pytest.mark.parametrize(("function", "places"), FUNCTIONS.values(), ids=FUNCTIONS)
def test_values(function, places):
    x = np.concatenate(places)
    exact = getattr(mpmath, {"HyperbolicTangent": "tanh"}.get(type(function).__name__, function.of_numpy.__name__))
    if COMPILED:
        assert_accurate(x, of_array(function, x), exact)
    special = np.array([NAN, INF, -INF, 0.0, 1e8, -3.0])
    with np.errstate(all="ignore"):
        np.testing.assert_allclose(of_array(function, special), function.of_numpy(special), rtol=1e-15)


def test_arrays_of_any_shape():
    y = np.asfortranarray(X.reshape(3, 100))[:, ::2]
    np.testing.assert_allclose(of_array(arrays.Sin(), y), np.sin(y), rtol=1e-15)


@pytest.mark.parametrize("n", range(1, 16))
def test_whole_powers(n):
    np.testing.assert_allclose(whole_power(X, n), X**n, rtol=4e-15)
