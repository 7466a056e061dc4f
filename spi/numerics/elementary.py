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

# 2/pi in digits of 32 bits, after two zeros, and pi/2 in its first 26 bits and the rest, for angles beyond that
_TWO_OVER_PI_BITS = int(
    "a2f9836e4e441529fc2757d1f534ddc0db6295993c439041fe5163abdebbc561b7246e3a424dd2e006492eea09d1921c"
    "fe1deb1cb129a73ee88235f52ebb4484e99c7026b45f7e413991d639835339f49c845f8bbdf9283b1ff897ffde05980f"
    "ef2f118b5a0a6d1f6d367ecf27cb09b74f463f669e5fea2d7527bac7ebe5f17b3d0739f78a5292ea6bfb5fb11f8d5d08"
    "56033046fc7b6babf0cfbc209af4361da9e391615ee61b08",
    16,
)
_TWO_OVER_PI_DIGITS = np.array([(_TWO_OVER_PI_BITS >> 32 * k) % 2**32 for k in range(43, -1, -1)], np.uint64)
_DIGIT, _HALF = np.uint64(2**32 - 1), np.uint64(2**29)
_32, _30, _2 = np.uint64(32), np.uint64(30), np.uint64(2)
_FIRST_BITS = np.int64(-(2**27))  # of a float, all but the last 27
_PIO2_HIGH = float.fromhex("0x1.921fb50000000p+0")
_PIO2_LOW = float.fromhex("0x1.110b4611a6263p-26")

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

_TWO_THIRDS, _TWO_THIRDS_LOW = 0.6666666666666666, 3.700743415417188e-17
_SPLITTING = 134217729.0  # 2^27 + 1

_SIGNIFICAND = np.int64(0x000FFFFFFFFFFFFF)
_SQRT_HALF = np.int64(0x3FE6A09E667F3BCD)  # the bits of sqrt(1/2)
_52 = np.int64(52)
_52_OF_WORDS, _2_63 = np.uint64(52), np.uint64(2**63)
_2_52 = np.int64(0x4330000000000000)  # the bits of 2^52


def bits(x):
    """64 bits of a float64 as a signed integer."""
    return np.int64(struct.unpack("<q", struct.pack("<d", x))[0])


def from_bits(i):
    """Float64 whose bits are the signed integer `i`."""
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
    """Float64 of an integer 0 <= i < 2^52, by its bits: 256-bit vectors have no conversion of 64-bit integers."""
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
    s, v = _sine_versine_of(r, c)
    return s, v, bits(shifted)


@device
def _sine_versine_of(r, c):
    """(sin, versine) of r + c, |r| <= pi/4 and c no larger than the rounding error of r."""
    z = r * r
    # c cos r and c sin r; not as bare products, or tails would be rounded before c, which hardly varies, is added
    s = r + (r * z * _sine_tail(z) + (c - c * (z * (0.5 - z * _C1))))
    v = 0.5 * z - (z * z * _cosine_tail(z) - (c * r + c * (r * (z * (_S1 + z * _S2)))))
    return s, v


@device
def sin_versine(x):
    """(sin x, 1 - cos x) for |x| <= 1.6e6; larger arguments lose accuracy and must go to :func:`sin_versine_huge`."""
    s, v, quadrant = _reduced_sin_versine(x)
    return _in_quadrant(s, v, quadrant)


@device
def _in_quadrant(s, v, quadrant):
    """(sin, versine) of r + n pi/2, given those of r: (s, v), (1-v, 1+s), (-s, 2-v), (v-1, 1-s) for n = 0, 1, 2, 3."""
    odd = (quadrant & 1) != 0
    sign = -1.0 if (quadrant & 2) != 0 else 1.0
    sine = sign * ((1.0 - v) if odd else s)
    versine = (1.0 if odd else 1.0 - sign) + sign * (s if odd else v)
    return sine, versine


@device
def sin_cos(x):
    """(sin x, cos x) for |x| <= 1.6e6, the cosine to 2 ulp relative also where it is small."""
    s, v, quadrant = _reduced_sin_versine(x)
    return _sine_cosine_in_quadrant(s, v, quadrant)


@device
def _sine_cosine_in_quadrant(s, v, quadrant):
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


@device(inline=False)
def _sin_versine_far(x):
    """As :func:`_reduced_sin_versine` for |x| >= 2^20, by whole numbers (Payne and Hanek); NaN for infinity.

    |x| = m 2^e with a whole m < 2^53.  Of 2/pi only eight digits of 32 bits matter: those before them add multiples of
    4 to the quotient by pi/2, and those behind them less than 2^-130.
    """
    i = bits(abs(x))
    e = np.int64(i >> _52) - 1075
    m = np.uint64((i & _SIGNIFICAND) | (np.int64(1) << _52))
    low, high = m & _DIGIT, m >> _32
    place, shift = (e + 62) // 32, np.uint64((e + 62) % 32)  # the first digit, and the bits of it that do not matter
    product, carry, last, before = np.empty(9, np.uint64), np.uint64(0), np.uint64(0), np.uint64(0)
    product[8] = np.uint64(0)
    for k in range(7, -1, -1):  # m times the digits; of each digit its product with `high` belongs one place further on
        digit = _TWO_OVER_PI_DIGITS[place + k]
        ours, theirs = low * digit, high * last
        total = (ours & _DIGIT) + (theirs & _DIGIT) + before + carry
        before = (ours >> _32) + (theirs >> _32)
        product[k], carry, last = total & _DIGIT, total >> _32, digit
    first = ((product[0] << shift) | (product[1] >> (_32 - shift))) & _DIGIT
    quadrant = np.int64(first >> _30)
    negative = (first & _HALF) != 0  # the fraction, whose first bit this is, is above 1/2: that minus 1 is near
    quotient, rest, unit = 0.0, 0.0, 2.0**-32
    for k in range(6):
        here = ((product[k] << shift) | (product[k + 1] >> (_32 - shift))) & _DIGIT
        there = ((product[k + 1] << shift) | (product[k + 2] >> (_32 - shift))) & _DIGIT
        digit = ((here << _2) | (there >> _30)) & _DIGIT
        term = unit * whole_float(np.int64((_DIGIT - digit) if negative else digit))
        total = quotient + term
        rest = rest + (term - (total - quotient))
        quotient, unit = total, unit * 2.0**-32
    a = from_bits(bits(quotient) & _FIRST_BITS)
    b = (quotient - a) + rest
    c = a * _PIO2_LOW + b * (_PIO2_HIGH + _PIO2_LOW)
    r = a * _PIO2_HIGH + c  # a product without rounding
    c = c - (r - a * _PIO2_HIGH)
    sign = -1.0 if negative != (x < 0.0) else 1.0
    nothing = x - x  # NaN for infinity
    s, v = _sine_versine_of(sign * r + nothing, sign * c)
    quadrant = quadrant + 1 if negative else quadrant
    return s, v, -quadrant if x < 0.0 else quadrant


@device
def sin_versine_huge(x):
    """(sin x, 1 - cos x) for any x, which takes longer than :func:`sin_versine` beyond its range."""
    s, v, quadrant = _sin_versine_far(x) if abs(x) > REDUCIBLE else _reduced_sin_versine(x)
    return _in_quadrant(s, v, quadrant)


@device
def sin_cos_huge(x):
    """(sin x, cos x) for any x, likewise."""
    s, v, quadrant = _sin_versine_far(x) if abs(x) > REDUCIBLE else _reduced_sin_versine(x)
    return _sine_cosine_in_quadrant(s, v, quadrant)


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
def log_parts(x):
    """(high, low): ln x to about 65 bits, x >= 0; infinite at 0 and infinity.

    x = 2^k m as in :func:`log_normal`, s = f/(2+f) in two parts, and ln m = 2 s + 2/3 s^3 + ..., the first two terms in
    two parts.
    """
    tiny = x < 2.2250738585072014e-308
    given = x * 18014398509481984.0 if tiny else x
    i = bits(given) - _SQRT_HALF
    f = from_bits((i & _SIGNIFICAND) + _SQRT_HALF) - 1.0
    k = whole_float(np.int64((np.uint64(i) ^ _2_63) >> _52_OF_WORDS)) - (2102.0 if tiny else 2048.0)
    below = 2.0 + f
    s = f / below
    p, rest = exact_product(s, below)
    s_low = ((f - p) - rest - s * (f - (below - 2.0))) / below
    z, z_low = exact_product(s, s)
    z_low = z_low + 2.0 * s * s_low
    cube, cube_low = exact_product(z, s)
    cube_low = cube_low + (z * s_low + z_low * s)
    third, third_low = exact_product(cube, _TWO_THIRDS)
    third_low = third_low + (cube * _TWO_THIRDS_LOW + cube_low * _TWO_THIRDS)
    tail = 2.0 / 27.0
    for n in range(25, 3, -2):
        tail = 2.0 / n + z * tail
    high, first = exact_sum(k * _LN2_HI, 2.0 * s)
    high, second = exact_sum(high, third)
    low = (first + second) + ((2.0 * s_low + third_low) + (cube * z * tail + k * _LN2_LO))
    total = high + low
    low = low - (total - high)
    total = -np.inf if x == 0.0 else (x if not x < np.inf else total)
    return total, (0.0 if x == 0.0 or not x < np.inf else low)


@device
def exact_sum(a, b):
    """(a + b rounded, what rounding has left out)."""
    s = a + b
    part = s - a
    return s, (a - (s - part)) + (b - part)


@device
def exact_product(a, b):
    """(a b rounded, what rounding has left out), by Dekker's splitting into halves (Numerische Mathematik 18, 1971)."""
    p = a * b
    c = _SPLITTING * a
    high = c - (c - a)
    low = a - high
    c = _SPLITTING * b
    first = c - (c - b)
    last = b - first
    return p, ((high * first - p) + high * last + low * first) + low * last


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


@device
def sinh_coshm1(x):
    """(sinh x, cosh x - 1), to all digits also for small x."""
    e = expm1(abs(x))
    f = e / (1.0 + e)
    s = 0.5 * (e + f)
    return (s if x >= 0.0 else -s), 0.5 * e * f
