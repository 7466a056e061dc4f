"""Elementary functions without branches, calls or tables, so that loops over lanes become vector instructions.

Every function takes and returns float64 and is accurate to 2 units in the last place over its stated range
(``tests/numerics/test_elementary.py`` checks this against mpmath).  NaN goes to NaN.

The logarithm uses the polynomial of Sun's fdlibm (1993), the standard minimax fit on [sqrt(1/2), sqrt(2)]; sine,
versine and exponential use Taylor polynomials, which converge fast enough.
"""

import struct

import numpy as np
from numba import types

from ..compiler.dispatch import device, intrinsic

#: Beyond this angle the quotient by pi/2 has more than 20 bits and reduction in three exact products fails.
REDUCIBLE = 1.6e6
SMALL = 0.25 * np.pi
TINY = 2.0**-5

_ROUND = 1.5 * 2.0**52  # adding and subtracting it rounds to an integer; its low bits are then that integer
_ROUND_BITS = np.int64(0x4338000000000000)
_TWO_OVER_PI = 2.0 / np.pi
# pi/2 in three pieces of 33 bits, whose product with an integer below 2^20 is exact, and a tail
_PIO2_1 = float.fromhex("0x1.921fb54400000p+0")
_PIO2_2 = float.fromhex("0x1.0b4611a600000p-34")
_PIO2_3 = float.fromhex("0x1.3198a2e000000p-69")
_PIO2_4 = float.fromhex("0x1.b839a252049c1p-104")

# The sine is its Taylor polynomial with rounded coefficients, whatever angle that is the sine of; the versine is fitted
# to it, so that both belong to one angle: C1 = -(S1 + 1/8) exactly, C2, C3, C4 are those of 1 - (1 - sine^2)^(1/2),
# and the last four make up for the terms that the polynomials leave out.  So sine^2 + versine^2 - 2 versine, which
# would make lengths drift, is below 1e-21 on [-pi/4, pi/4] before rounding, and 2e-22 in the mean; coefficients of the
# two Taylor series, each rounded on its own, give 1e-18.
_S1, _S2, _S3 = -0.16666666666666666, 0.008333333333333328, -0.00019841269841269803
_S4, _S5, _S6 = 2.755731922398576e-06, -2.505210838544149e-08, 1.605904383682136e-10
_S7, _S8 = -7.647163731819624e-13, 2.8114572543454145e-15
_C1, _C2, _C3 = 0.04166666666666666, -0.0013888888888888866, 2.480158730158746e-05
_C4, _C5, _C6 = -2.7557319223976253e-07, 2.087675678386655e-09, -1.147065075588114e-11
_C7, _C8 = 4.764550555762281e-14, -8.422855107761281e-17

_LN2_HI, _LN2_LO = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_LN2 = 0.6931471805599453
_LOG2_E = 1.44269504088896340736
_L1, _L2, _L3, _L4 = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
)
_L5, _L6, _L7 = 1.818357216161805012e-01, 1.531383769920937332e-01, 1.479819860511658591e-01

_SIGNIFICAND = np.int64(0x000FFFFFFFFFFFFF)
_SQRT_HALF = np.int64(0x3FE6A09E667F3BCD)  # the bits of sqrt(1/2)
_52 = np.int64(52)
_52_OF_WORDS, _2_63 = np.uint64(52), np.uint64(2**63)
_2_52 = np.int64(0x4330000000000000)  # the bits of 2^52


def bits(x):
    """The 64 bits of a float64 as a signed integer."""
    return np.int64(struct.unpack("<q", struct.pack("<d", x))[0])


def from_bits(i):
    """The float64 whose bits are the signed integer `i`."""
    return np.float64(struct.unpack("<d", struct.pack("<q", i))[0])


@intrinsic(bits)
def _(x):
    return types.int64(types.float64), _cast


@intrinsic(from_bits)
def _(i):
    return types.float64(types.int64), _cast


def _cast(context, builder, signature, arguments):
    return builder.bitcast(arguments[0], context.get_value_type(signature.return_type))


@device
def whole_float(i):
    """The float64 of an integer 0 <= i < 2^52, by its bits: 256-bit vectors have no conversion of 64-bit integers."""
    return from_bits(i | _2_52) - 2.0**52


@device
def _sine_tail(z):
    """(sin x - x) / x^3 for z = x^2."""
    return _S1 + z * (_S2 + z * (_S3 + z * (_S4 + z * (_S5 + z * (_S6 + z * (_S7 + z * _S8))))))


@device
def _cosine_tail(z):
    """(cos x - 1 + x^2/2) / x^4 for z = x^2."""
    return _C1 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * (_C6 + z * (_C7 + z * _C8))))))


@device
def sin_versine_small(x):
    """(sin x, 1 - cos x) for |x| <= pi/4, each to 2 ulp relative."""
    z = x * x
    return x + x * z * _sine_tail(z), 0.5 * z - z * z * _cosine_tail(z)


@device
def sin_versine_tiny(x):
    """(sin x, 1 - cos x) for |x| <= 2^-5: the same polynomials, without the terms that no longer count."""
    z = x * x
    s = x + x * z * (_S1 + z * (_S2 + z * _S3))
    return s, 0.5 * z - z * z * (_C1 + z * (_C2 + z * _C3))


@device
def _reduced_sin_versine(x):
    """(sin r, 1 - cos r, bits whose last two are n mod 4) for x = n pi/2 + r, |r| <= pi/4 and |x| <= 1.6e6.

    x = n pi/2 + r + c with c the rounding error of r (Cody and Waite's reduction), then the small-angle polynomials.
    """
    shifted = x * _TWO_OVER_PI + _ROUND
    n = shifted - _ROUND
    a = x - n * _PIO2_1  # exact
    b = a - n * _PIO2_2
    c = (((a - b) - n * _PIO2_2) - n * _PIO2_3) - n * _PIO2_4
    r = b + c
    c = c - (r - b)
    z = r * r
    # c cos r and c sin r; not as bare products, or tails would be rounded before c, which hardly varies, is added
    s = r + (r * z * _sine_tail(z) + (c - c * (z * (0.5 - z * _C1))))
    v = 0.5 * z - (z * z * _cosine_tail(z) - (c * r + c * (r * (z * (_S1 + z * _S2)))))
    return s, v, bits(shifted)


@device
def sin_versine(x):
    """(sin x, 1 - cos x) for |x| <= 1.6e6; larger arguments lose accuracy and must go to :func:`sin_versine_huge`."""
    s, v, quadrant = _reduced_sin_versine(x)
    # quadrant 0: (s, v), 1: (1-v, 1+s), 2: (-s, 2-v), 3: (v-1, 1-s)
    odd = (quadrant & 1) != 0
    sign = -1.0 if (quadrant & 2) != 0 else 1.0
    sine = sign * ((1.0 - v) if odd else s)
    versine = (1.0 if odd else 1.0 - sign) + sign * (s if odd else v)
    return sine, versine


@device
def sin_cos(x):
    """(sin x, cos x) for |x| <= 1.6e6, the cosine to 2 ulp relative also where it is small."""
    s, v, quadrant = _reduced_sin_versine(x)
    odd = (quadrant & 1) != 0
    sign = -1.0 if (quadrant & 2) != 0 else 1.0
    return sign * ((1.0 - v) if odd else s), sign * (-s if odd else 1.0 - v)


@device
def sinc_versinc_small(z):
    """(sin x / x - 1, (1 - cos x) / x^2) for z = x^2 and |x| <= pi/4, from the polynomials of sin_versine_small."""
    return z * _sine_tail(z), 0.5 - z * _cosine_tail(z)


@device
def sinc_versinc_tiny(z):
    """(sin x / x - 1, (1 - cos x) / x^2) for z = x^2 and |x| <= 2^-5."""
    return z * (_S1 + z * (_S2 + z * _S3)), 0.5 - z * (_C1 + z * (_C2 + z * _C3))


@device
def sin_versine_huge(x):
    """(sin x, 1 - cos x) for any x by the library's scalar sine: right, and slow."""
    half = np.sin(0.5 * x)
    return np.sin(x), 2.0 * half * half


@device
def log_normal(x):
    """ln x for finite x >= 2^-1022.

    x = 2^k m with m in [sqrt(1/2), sqrt(2)), f = m - 1, s = f/(2+f), and ln(1+f) = f - f^2/2 + s (f^2/2 + R(s^2)).
    """
    i = bits(x) - _SQRT_HALF
    f = from_bits((i & _SIGNIFICAND) + _SQRT_HALF) - 1.0
    k = whole_float(np.int64((np.uint64(i) ^ _2_63) >> _52_OF_WORDS)) - 2048.0  # i >> 52, without signed shifts
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    r = w * (_L2 + w * (_L4 + w * _L6)) + z * (_L1 + w * (_L3 + w * (_L5 + w * _L7)))
    h = 0.5 * f * f
    return k * _LN2_HI - ((h - (s * (h + r) + k * _LN2_LO)) - f)


@device
def log(x):
    """ln x for any float64: ln 0 = -inf, negative numbers give NaN, denormals are handled."""
    tiny = x < 2.2250738585072014e-308
    y = log_normal(x * 18014398509481984.0 if tiny else x)
    y = y - 54.0 * _LN2 if tiny else y
    y = x if x == np.inf else y
    y = -np.inf if x == 0.0 else y
    return y if x >= 0.0 else np.nan


@device
def _reduced_exp(x):
    """(e^r - 1, n + _ROUND) for x = n ln 2 + r with |r| <= ln(2)/2, by the Taylor polynomial of degree 13 in r."""
    shifted = x * _LOG2_E + _ROUND
    n = shifted - _ROUND
    r = (x - n * _LN2_HI) - n * _LN2_LO
    c = ((x - n * _LN2_HI) - r) - n * _LN2_LO
    p = 1.6059043836821613e-10
    p = 2.08767569878681e-09 + r * p
    p = 2.505210838544172e-08 + r * p
    p = 2.755731922398589e-07 + r * p
    p = 2.7557319223985893e-06 + r * p
    p = 2.48015873015873e-05 + r * p
    p = 1.984126984126984e-04 + r * p
    p = 1.388888888888889e-03 + r * p
    p = 8.333333333333333e-03 + r * p
    p = 4.1666666666666664e-02 + r * p
    p = 1.6666666666666666e-01 + r * p
    p = 0.5 + r * p
    return r + (c + r * r * p), shifted


@device
def exp(x):
    """e^x for any float64: overflows to inf above 709.78, fades through the denormals to 0 below -745.13.

    x = n ln 2 + r as in :func:`_reduced_exp`, and a scaling by 2^n in two factors.
    """
    x = 710.0 if x > 710.0 else x
    x = -746.0 if x < -746.0 else x
    rest, shifted = _reduced_exp(x)
    y = 1.0 + rest
    i = bits(shifted) - _ROUND_BITS
    half = i >> np.int64(1)
    return y * from_bits((half + 1023) << _52) * from_bits((i - half + 1023) << _52)


@device
def expm1(x):
    """e^x - 1, to 2 ulp relative also where it is small: 2^n (e^r - 1) + (2^n - 1), see :func:`exp`.

    For x <= 709; inf above 710, -1 below -100.
    """
    x = 710.0 if x > 710.0 else x
    x = -100.0 if x < -100.0 else x
    rest, shifted = _reduced_exp(x)
    i = bits(shifted) - _ROUND_BITS
    half = i >> np.int64(1)
    a, b = from_bits((half + 1023) << _52), from_bits((i - half + 1023) << _52)
    return a * rest * b + (a * b - 1.0)
