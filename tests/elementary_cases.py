"""What the tests of elementary functions share: kernels around them, and errors in units in the last place."""

import math

import mpmath
import numba
import numpy as np

COMPILED = not numba.config.DISABLE_JIT
N = 12_000 if COMPILED else 3_000
ULPS = 2.0
INF, NAN, DENORMAL, TINY, LARGEST = math.inf, math.nan, 2.0**-1074, 2.0**-1022, float(np.finfo(np.float64).max)


def call(function, x, results=1):
    """The results of a kernel at the points `x`; uncompiled NumPy warns where compiled code is silent."""
    x = np.asarray(x, np.float64)
    out = [np.empty_like(x) for _ in range(results)]
    with np.errstate(all="ignore"):
        function(x, *out)
    return out[0] if results == 1 else out


def ulps(computed, exact):
    """|computed - exact| in units of the spacing of float64 at the exact value."""
    if not math.isfinite(computed):
        return math.inf
    if exact == 0:
        return 0.0 if computed == 0.0 else math.inf
    spacing = mpmath.ldexp(1, max(int(mpmath.frexp(exact)[1]) - 53, -1074))
    return float(abs(mpmath.mpf(computed) - exact) / spacing)


def worst(x, computed, exact_function):
    """(ulps, x) where the error is largest.  40 digits are enough; mpmath adds what the reduction of x costs."""
    with mpmath.workdps(40):
        return max(
            (ulps(float(y), exact_function(mpmath.mpf(float(t)))), float(t)) for t, y in zip(x, computed, strict=True)
        )


def assert_accurate(x, computed, exact_function):
    error, at = worst(x, computed, exact_function)
    assert error <= ULPS, f"{error} ulp at {at!r}"


def spread(low, high, count, seed):
    """Both signs, sizes spread evenly in the logarithm between `low` and `high`, so that every binade is met."""
    random = np.random.default_rng(seed)
    return random.choice([-1.0, 1.0], count) * 2.0 ** random.uniform(math.log2(low), math.log2(high), count)


def with_neighbours(x):
    x = np.asarray(x, np.float64)
    return np.concatenate([np.nextafter(x, -INF), x, np.nextafter(x, INF)])
