"""The functions that generated models call, and angles of any size, against exact arithmetic."""

import mpmath
import numpy as np
import pytest
from elementary_cases import DENORMAL, INF, LARGEST, NAN, TINY, call, spread, with_neighbours, worst

from spi.compiler.dispatch import kernel
from spi.numerics import functions
from spi.numerics.elementary import sin_versine_huge

COUNT, ULPS = 2000, 4.0


@kernel
def all_of(x, sine, cosine, tangent, sinh, cosh, tanh, arctan, sign, versine):
    for i in range(x.size):
        sine[i], cosine[i], tangent[i] = functions.sine(x[i]), functions.cosine(x[i]), functions.tangent(x[i])
        sinh[i], cosh[i], tanh[i] = functions.sinh(x[i]), functions.cosh(x[i]), functions.tanh(x[i])
        arctan[i], sign[i], versine[i] = functions.arctan(x[i]), functions.sign(x[i]), sin_versine_huge(x[i])[1]


@kernel
def powers(x, exponent, y):
    for i in range(x.size):
        y[i] = functions.power(x[i], exponent[i])


EXACT = {
    "sine": mpmath.sin,
    "cosine": mpmath.cos,
    "tangent": mpmath.tan,
    "sinh": mpmath.sinh,
    "cosh": mpmath.cosh,
    "tanh": mpmath.tanh,
    "arctan": mpmath.atan,
    "sign": mpmath.sign,
    "versine": lambda x: 2 * mpmath.sin(x / 2) ** 2,
}


def values(x):
    return dict(zip(EXACT, call(all_of, x, len(EXACT)), strict=True))


#: Floats near multiples of pi/2: that of 6381956970095103 x 2^797 is the nearest of all, 4.7e-19 away (Kahan).
NEAR = [6381956970095103.0 * 2.0**797, 5.319372648326541e255, 8.23549664582643e15, 2.0**1023, 1e22, 1e300, LARGEST]


def test_any_argument():
    angles = np.concatenate(
        [
            spread(1e-300, 1e300, COUNT, 1),
            spread(1e-3, 1e3, COUNT, 2),
            spread(1e6, 1e16, COUNT, 3),
            NEAR,
            np.negative(NEAR),
        ]
    )
    small = np.concatenate(
        [spread(1e-300, 709.0, COUNT, 4), spread(1e-2, 5.0, COUNT, 5), with_neighbours([0.4375, 0.6875])]
    )
    small = np.concatenate([small, with_neighbours([1.1875, 2.4375, 20.0, 700.0]), [DENORMAL, -TINY, 0.0, 710.0]])
    for x, names in ((angles, ("sine", "cosine", "tangent", "arctan", "sign", "versine")), (small, EXACT)):
        computed = values(x)
        for name in names:
            error, at = worst(x, computed[name], EXACT[name])
            assert error <= ULPS, f"{name}: {error} ulp at {at!r}"
    with mpmath.workdps(400):
        assert abs(float(mpmath.cos(mpmath.mpf(NEAR[0])))) < 1e-18  # so that one digit of 2/pi less would be seen


def test_arguments_that_are_no_numbers():
    at = {name: value.tolist() for name, value in values([NAN, INF, -INF, 0.0, -0.0]).items()}
    assert all(np.isnan(value[0]) for value in at.values())
    assert np.isnan([at[name][1:3] for name in ("sine", "cosine", "tangent", "versine")]).all()
    assert at["sinh"][1:3] == [INF, -INF] and at["cosh"][1:3] == [INF, INF] and at["tanh"][1:3] == [1.0, -1.0]
    assert at["arctan"][1:3] == [np.pi / 2, -np.pi / 2] and at["sign"][1:] == [1.0, -1.0, 0.0, 0.0]
    assert all(at[name][3] == 0.0 for name in ("sine", "sinh", "tanh", "arctan"))


def test_powers():
    rng = np.random.default_rng(6)
    size = np.abs(spread(1e-300, 1e300, 3 * COUNT, 7))
    size[: 2 * COUNT] = np.exp(rng.uniform(-3, 3, 2 * COUNT))
    size[:COUNT] = 1.0 + rng.uniform(-1e-3, 1e-3, COUNT)
    exponent = rng.uniform(-700, 700, 3 * COUNT) / np.abs(np.log(size))  # results from e^-700 to e^700
    exponent[: 2 * COUNT : 2] = rng.uniform(-3, 3, COUNT)
    exponent[COUNT : 2 * COUNT : 3] = np.round(exponent[COUNT : 2 * COUNT : 3])
    pairs = dict(zip(size.tolist(), exponent.tolist(), strict=True))
    error, at = worst(size, powered(size, exponent), lambda x: mpmath.power(x, pairs[float(x)]))
    assert error <= ULPS, f"{error} ulp at {at!r}^{pairs[at]!r}"


def powered(x, exponent):
    y = np.empty(len(x))
    with np.errstate(all="ignore"):
        powers(np.asarray(x, float), np.asarray(exponent, float), y)
    return y


@pytest.mark.parametrize("x", [0.0, 1.0, -1.0, 2.0, -2.0, 0.5, INF, -INF, NAN, DENORMAL, 1e300, -3.0])
def test_powers_as_in_c(x):
    """At the edges the values of C's pow, but for the sign of 0."""
    exponents = [0.0, 1.0, -1.0, 2.0, 3.0, -3.0, 0.5, -0.5, INF, -INF, NAN, 1e300, 17.0, 1e17, 2.0**53 + 2]
    with np.errstate(all="ignore"):
        expected = np.power(x, exponents)
    np.testing.assert_allclose(powered([x] * len(exponents), exponents), expected, rtol=1e-14)
