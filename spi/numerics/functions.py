"""Further functions of one float, made of those of ``elementary.py``.

Nothing here calls the C library, whose last digits are other ones on other systems.  Each function is accurate to 4
units in the last place for any argument, and NaN goes to NaN (``tests/numerics/test_functions.py``).
"""

import numpy as np

from ..compiler.dispatch import device
from .elementary import exact_product, exp, expm1, log_parts, sin_cos_huge

_LARGE = 700.0  # beyond which e^|x| may overflow where sinh and cosh do not
_MOST_EXPONENT = 800.0  # beyond which e^x is 0 or infinite

# The arctangents of 0, 1/2, 1, 3/2 and infinity in two parts, and the polynomial of Sun's fdlibm (1993).
_HIGH = (0.0, 0.4636476090008061, 0.7853981633974483, 0.982793723247329, 1.5707963267948966)
_LOW = (0.0, 2.2698777452961687e-17, 3.061616997868383e-17, 1.3903311031230998e-17, 6.123233995736766e-17)
_A0, _A1, _A2, _A3 = (
    3.33333333333329318027e-01,
    -1.99999999998764832476e-01,
    1.42857142725034663711e-01,
    -1.11111104054623557880e-01,
)
_A4, _A5, _A6, _A7 = (
    9.09088713343650656196e-02,
    -7.69187620504482999495e-02,
    6.66107313738753120669e-02,
    -5.83357013379057348645e-02,
)
_A8, _A9, _A10 = 4.97687799461593236017e-02, -3.65315727442169155270e-02, 1.62858201153657823623e-02


@device
def sine(x):
    """sin x."""
    return sin_cos_huge(x)[0]


@device
def cosine(x):
    """cos x."""
    return sin_cos_huge(x)[1]


@device
def tangent(x):
    """tan x."""
    s, c = sin_cos_huge(x)
    return s / c


@device
def sinh(x):
    """sinh x = (e + e / (1 + e)) / 2 for x >= 0, with e = e^x - 1; where that is too large by the square of e^(x/2)."""
    size = abs(x)
    e = expm1(_LARGE if size > _LARGE else size)
    half = exp(0.5 * size)
    value = (0.5 * half) * half if size > _LARGE else 0.5 * (e + e / (1.0 + e))
    return value if x > 0.0 else (-value if x < 0.0 else x)


@device
def cosh(x):
    """cosh x = (e^|x| + e^-|x|) / 2, likewise."""
    size = abs(x)
    e = exp(_LARGE if size > _LARGE else size)
    half = exp(0.5 * size)
    return (0.5 * half) * half if size > _LARGE else 0.5 * (e + 1.0 / e)


@device
def tanh(x):
    """tanh x = (e^(2 |x|) - 1) / (e^(2 |x|) + 1) with the sign of x."""
    size = abs(x)
    rest = expm1(40.0 if size > 20.0 else 2.0 * size)
    value = rest / (rest + 2.0)
    return value if x > 0.0 else (-value if x < 0.0 else x)


@device
def arctan(x):
    """Angle of tangent x between -pi/2 and pi/2: that of one of five tangents and the angle that is left."""
    t = abs(x)
    large = t > 2.4375
    c = 0.5 if t < 0.6875 else (1.0 if t < 1.1875 else 1.5)
    high = _HIGH[1] if t < 0.6875 else (_HIGH[2] if t < 1.1875 else _HIGH[3])
    low = _LOW[1] if t < 0.6875 else (_LOW[2] if t < 1.1875 else _LOW[3])
    small = t < 0.4375
    c, high, low = (0.0 if small else c), (0.0 if small else high), (0.0 if small else low)
    high, low = (_HIGH[4] if large else high), (_LOW[4] if large else low)
    z = (-1.0 if large else t - c) / (t if large else 1.0 + c * t)
    w = z * z
    p = _A0 + w * (
        _A1 + w * (_A2 + w * (_A3 + w * (_A4 + w * (_A5 + w * (_A6 + w * (_A7 + w * (_A8 + w * (_A9 + w * _A10))))))))
    )
    value = high - ((z * (w * p) - low) - z)
    return value if x > 0.0 else (-value if x < 0.0 else x)


@device
def sign(x):
    """-1, 0 or 1."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else x)


@device
def power(x, exponent):
    """x^exponent, as C's `pow` but for the sign of 0: 0^0 = 1, NaN for x < 0 where the exponent is no whole number.

    e^(exponent ln |x|), with ln |x| to 65 bits and the product with what rounding leaves out.
    """
    size = abs(x)
    high, low = log_parts(size)
    whole = exponent * high
    far = not abs(whole) < _MOST_EXPONENT  # also NaN, as of 0 times infinity
    p, rest = exact_product(0.0 if far else exponent, high)
    rest = rest + (0.0 if far else exponent * low)
    p = (whole if abs(whole) >= _MOST_EXPONENT else np.nan) if far else p
    value = exp(p)
    value = value if far else value + value * rest
    value = 1.0 if size == 1.0 else value
    half = 0.5 * exponent
    odd = np.floor(exponent) == exponent and np.floor(half) != half
    value = -value if x < 0.0 and odd else value
    value = np.nan if x < 0.0 and size < np.inf and np.floor(exponent) != exponent else value
    return 1.0 if exponent == 0.0 or x == 1.0 else value
