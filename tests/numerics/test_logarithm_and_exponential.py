"""Logarithm and exponential against exact arithmetic."""

import math

import mpmath
import numpy as np
import pytest
from elementary_cases import (
    COMPILED,
    DENORMAL,
    INF,
    LARGEST,
    NAN,
    TINY,
    N,
    assert_accurate,
    call,
    spread,
    with_neighbours,
)

from spi.compiler.dispatch import kernel
from spi.numerics import elementary


@kernel
def log_normal(x, y):
    for i in range(x.size):
        y[i] = elementary.log_normal(x[i])


@kernel
def log(x, y):
    for i in range(x.size):
        y[i] = elementary.log(x[i])


@kernel
def exp(x, y):
    for i in range(x.size):
        y[i] = elementary.exp(x[i])


@kernel
def expm1(x, y):
    for i in range(x.size):
        y[i] = elementary.expm1(x[i])


@pytest.mark.parametrize("function", [log_normal, log])
def test_log(function):
    random = np.random.default_rng(11)
    near_one = 1.0 + spread(2.0**-52, 0.5, N // 2, 12)
    powers = with_neighbours(2.0 ** np.arange(-1021, 1024, 1 if COMPILED else 41))
    x = np.concatenate(
        [
            np.abs(spread(TINY, LARGEST, N // 2, 13)),
            random.uniform(0.0, 2.0, N // 2) + TINY,
            near_one,
            with_neighbours([1.0, math.sqrt(0.5), math.sqrt(2.0), math.e]),
            powers,
            [TINY, np.nextafter(TINY, 1.0), LARGEST],
        ]
    )
    y = call(function, x)
    assert_accurate(x, y, mpmath.log)
    assert call(function, [1.0])[0] == 0.0


def test_log_of_denormals():
    x = np.concatenate(
        [np.abs(spread(DENORMAL, TINY, N // 4, 14)), DENORMAL * np.arange(1, 50), [np.nextafter(TINY, 0.0)]]
    )
    assert_accurate(x, call(log, x), mpmath.log)


def test_log_outside_its_domain():
    y = call(log, [0.0, -0.0, INF, -DENORMAL, -TINY, -1.0, -LARGEST, -INF, NAN])
    assert y[0] == -INF and y[1] == -INF and y[2] == INF
    assert np.all(np.isnan(y[3:]))


# exp overflows above the first, has denormal results below the second, and rounds to zero below the third
OVERFLOW, DENORMAL_RESULT, UNDERFLOW = 709.782712893384, -708.3964185322641, -745.1332191019412


def test_exp():
    random = np.random.default_rng(15)
    x = np.concatenate(
        [
            random.uniform(-708.0, 709.0, N),
            spread(1e-300, 1.0, N // 2, 16),
            with_neighbours([0.0, 1.0, -1.0, 0.5 * math.log(2.0), math.log(2.0), OVERFLOW, DENORMAL_RESULT]),
            with_neighbours((np.arange(-2000, 2000, 1 if COMPILED else 41) / 2.0 + 0.25) * (0.7 * math.log(2.0))),
        ]
    )
    x = x[x <= OVERFLOW]
    assert_accurate(x, call(exp, x), mpmath.exp)
    assert np.array_equal(call(exp, [0.0, -0.0]), [1.0, 1.0])


def test_exp_fades_through_the_denormals():
    x = np.concatenate(
        [np.random.default_rng(17).uniform(UNDERFLOW, DENORMAL_RESULT, N // 4), with_neighbours([UNDERFLOW])]
    )
    assert_accurate(x, call(exp, x), mpmath.exp)
    assert call(exp, [-745.0])[0] == DENORMAL


def test_exp_at_the_edges():
    assert np.all(call(exp, [OVERFLOW + 1e-9, 709.8, 710.0, 711.0, 1e4, LARGEST, INF]) == INF)
    assert np.all(call(exp, [-745.14, -746.0, -747.0, -1e4, -LARGEST, -INF]) == 0.0)
    assert np.isnan(call(exp, [NAN])[0])


def test_expm1():
    x = np.concatenate(
        [
            np.random.default_rng(18).uniform(-100.0, 708.0, N),
            spread(1e-300, 1.0, N, 19),
            with_neighbours([1.0, -1.0, 0.5 * math.log(2.0), -0.5 * math.log(2.0), math.log(2.0), -math.log(2.0)]),
        ]
    )
    assert_accurate(x, call(expm1, x), mpmath.expm1)
    assert np.array_equal(call(expm1, [0.0, -101.0, -LARGEST, -INF]), [0.0, -1.0, -1.0, -1.0])
    assert np.isnan(call(expm1, [NAN])[0])
