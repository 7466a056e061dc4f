"""Sine, versine, logarithm and exponential against exact arithmetic."""

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
    worst,
)

from spi.compiler.dispatch import kernel
from spi.numerics import elementary

# The multiples n pi/2 below 1.6e6 that lie closest to a floating number, found by exact integers over all n.
NEAR_MULTIPLES = [29, 58, 116, 232, 464, 928, 1856, 3712, 7424, 14479, 29327, 58285, 58654, 204551, 263205]
NEAR_MULTIPLES += [409102, 554999, 789615, 818204]


@kernel
def sin_versine_small(x, s, v):
    for i in range(x.size):
        s[i], v[i] = elementary.sin_versine_small(x[i])


@kernel
def sin_versine(x, s, v):
    for i in range(x.size):
        s[i], v[i] = elementary.sin_versine(x[i])


@kernel
def sin_versine_huge(x, s, v):
    for i in range(x.size):
        s[i], v[i] = elementary.sin_versine_huge(x[i])


@kernel
def there_and_back(x, i, y):
    for k in range(x.size):
        i[k] = elementary.bits(x[k])
        y[k] = elementary.from_bits(i[k])


def versine(x):
    return 2 * mpmath.sin(x / 2) ** 2


def assert_both_accurate(function, x):
    s, v = call(function, x, 2)
    assert_accurate(x, s, mpmath.sin)
    assert_accurate(x, v, versine)


def multiples_of_half_pi(numbers):
    """n pi/2, rounded, with the floating neighbours."""
    with mpmath.workdps(40):
        return with_neighbours([float(int(n) * mpmath.pi / 2) for n in numbers])


SPECIAL_ANGLES = np.array([0.0, DENORMAL, -DENORMAL, 5 * DENORMAL, TINY, -TINY, 1e-300, 1e-160, 1e-20, 1e-8, -1e-8])


def test_small_angles():
    x = np.concatenate(
        [
            np.random.default_rng(1).uniform(-elementary.SMALL, elementary.SMALL, N),
            spread(1e-150, elementary.SMALL, N, 2),
            [elementary.SMALL, -elementary.SMALL, np.nextafter(elementary.SMALL, 0.0)],
        ]
    )
    assert_both_accurate(sin_versine_small, x)


@pytest.mark.parametrize("high", [10.0, 1e3, elementary.REDUCIBLE])
def test_reduced_angles(high):
    x = np.concatenate(
        [np.random.default_rng(3).uniform(-high, high, N // 2), spread(1e-150, high, N // 2, 4), [high, -high]]
    )
    assert_both_accurate(sin_versine, x)


def test_reduced_angles_where_roundings_add_up():
    """Versines just below a power of 2, with the largest errors of some 10^5 angles tried."""
    random = np.random.default_rng(19)
    angle = np.arccos(1.0 - random.uniform(0.235, 0.25, N // 4))
    x = np.concatenate(
        [random.integers(1, 250_000, N // 4) * (2.0 * math.pi) + angle, [1091195.3442515158, 1129973.6185690297]]
    )
    assert_both_accurate(sin_versine, x)


def test_reduced_angles_at_multiples_of_half_pi():
    random = np.random.default_rng(5).integers(1, 1_018_000, N // 6)
    x = multiples_of_half_pi([*range(1, N // 12), *random, *NEAR_MULTIPLES, 636_618, 636_619, 636_620])
    x = np.concatenate([x, -x])
    assert_both_accurate(sin_versine, x)


def test_reduced_angles_between_the_quadrants():
    """Odd multiples of pi/4, where the rounded quotient may fall on either side."""
    random = np.random.default_rng(6).integers(0, 1_000_000, N // 6)
    with mpmath.workdps(40):
        x = with_neighbours([float((2 * int(n) + 1) * mpmath.pi / 4) for n in [*range(N // 12), *random]])
    assert_both_accurate(sin_versine, x)


def test_any_angles():
    x = np.concatenate(
        [spread(1e-150, 1e300, N // 4, 7), multiples_of_half_pi(NEAR_MULTIPLES), [1e22, LARGEST, -LARGEST]]
    )
    assert_both_accurate(sin_versine_huge, x)


@pytest.mark.parametrize("function", [sin_versine_small, sin_versine, sin_versine_huge])
def test_special_angles(function):
    assert_both_accurate(function, SPECIAL_ANGLES)
    s, v = call(function, [0.0, -0.0], 2)
    assert np.all(s == 0.0) and np.all(v == 0.0)


@pytest.mark.parametrize("function", [sin_versine_small, sin_versine, sin_versine_huge])
def test_sine_is_odd_and_versine_even_to_the_bit(function):
    high = elementary.SMALL if function is sin_versine_small else elementary.REDUCIBLE
    x = np.concatenate([spread(1e-300, high, N, 8), SPECIAL_ANGLES])
    s, v = call(function, x, 2)
    s_opposite, v_opposite = call(function, -x, 2)
    assert np.array_equal(s, -s_opposite) and np.array_equal(v, v_opposite)


@pytest.mark.parametrize("function", [sin_versine, sin_versine_huge])
def test_sine_and_versine_stay_in_range(function):
    """A versine below 0 or above 2, or a sine above 1, would be no rotation at all."""
    x = np.concatenate([spread(1e-300, elementary.REDUCIBLE, N, 9), multiples_of_half_pi(range(1, N // 12))])
    s, v = call(function, x, 2)
    assert np.all(np.abs(s) <= 1.0) and np.all(v >= 0.0) and np.all(v <= 2.0)


@pytest.mark.parametrize("function", [sin_versine_small, sin_versine, sin_versine_huge])
def test_no_angle_gives_no_number(function):
    no_angles = [NAN] if function is sin_versine_small else [NAN, INF, -INF]
    s, v = call(function, no_angles, 2)
    assert np.all(np.isnan(s)) and np.all(np.isnan(v))


def test_a_versine_from_a_rounded_cosine_is_noticed():
    """The negative control of the accuracy tests: 1 - cos x loses all digits at small angles."""
    x = spread(1e-9, 1e-2, 200, 10)
    error, _ = worst(x, 1.0 - np.cos(x), versine)
    assert error > 1e6
    assert_accurate(x, call(sin_versine_small, x, 2)[1], versine)
    assert_accurate(x, call(sin_versine, x, 2)[1], versine)


def test_bits_are_those_of_the_number():
    x = np.concatenate([spread(DENORMAL, LARGEST, 100, 18), [0.0, -0.0, INF, -INF, NAN, DENORMAL, -DENORMAL]])
    i, y = np.empty(x.size, np.int64), np.empty_like(x)
    there_and_back(x, i, y)
    assert np.array_equal(i, x.view(np.int64))
    assert np.array_equal(y.view(np.int64), x.view(np.int64))


def test_sine_and_versine_belong_to_one_angle():
    """sine^2 + versine^2 - 2 versine of the polynomials themselves, before rounding: 2e-19 made Casimirs drift."""
    sines = [getattr(elementary, f"_S{i}") for i in range(1, 9)]
    versines = [getattr(elementary, f"_C{i}") for i in range(1, 9)]

    def defect(x, terms):
        z = x * x
        s = x + x * z * sum(c * z**i for i, c in enumerate(sines[:terms]))
        v = z / 2 - z * z * sum(c * z**i for i, c in enumerate(versines[:terms]))
        return s * s + v * v - 2 * v

    with mpmath.workdps(50):
        small = [defect(mpmath.mpf(elementary.SMALL) * i / 200, 8) for i in range(1, 201)]
        tiny = [defect(mpmath.mpf(elementary.TINY) * i / 50, 3) for i in range(1, 51)]
        assert max(map(abs, small)) < 1e-21 and abs(sum(small)) / 200 < 2e-22
        assert max(map(abs, tiny)) < 5e-21 and abs(sum(tiny)) / 50 < 1e-21


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
