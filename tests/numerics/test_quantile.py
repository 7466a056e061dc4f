"""The quantile function of the normal law against mpmath and SciPy."""

import mpmath
import numpy as np
from elementary_cases import call
from scipy.special import ndtri

from spi.compiler.dispatch import kernel
from spi.numerics import quantile

UNITS = 7  # in the last place


@kernel
def of_both(u, central, tail):
    for i in range(u.size):
        central[i], tail[i] = quantile.central_quantile(0.5 - u[i]), quantile.tail_quantile(u[i])


def test_quantiles_have_full_accuracy():
    rng = np.random.default_rng(1)
    middle = np.concatenate([rng.uniform(0.125, 0.875, 300), [0.125, 0.875, 0.5 - 2.0**-50, 0.5 + 2.0**-53]])
    ends = np.concatenate([2.0 ** rng.uniform(-53, -3, 300), [0.125, np.nextafter(0.125, 0), 2.0**-53]])
    central, tail = call(of_both, middle, 2)[0], call(of_both, ends, 2)[1]
    with mpmath.workdps(40):
        for u, z in zip(middle, -central, strict=True):
            true = mpmath.sqrt(2) * mpmath.erfinv(2 * mpmath.mpf(u) - 1)
            assert abs(z - true) <= UNITS * np.spacing(abs(float(true)))
        for u, z in zip(ends, tail, strict=True):
            close = mpmath.mpf(float(ndtri(u)))  # one step of Newton's method from there
            true = close - (mpmath.erfc(-close / mpmath.sqrt(2)) / 2 - mpmath.mpf(u)) / mpmath.npdf(close)
            assert abs(z - true) <= UNITS * np.spacing(abs(float(true)))
    np.testing.assert_allclose(tail, ndtri(ends), rtol=2e-15)
