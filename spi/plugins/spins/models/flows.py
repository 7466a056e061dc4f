"""Flows of classical spins: turns, exact for pairs and for sites whose neighbours are fixed, and damped precession.

With b = -grad_s H, the field at a spin s of moment mu, and the damping alpha,

    mu s' = b x s + alpha (b - (s . b) s).

Functions of one spin, or of a pair, take and return floats; loops over paths make them vector instructions.
"""

import math

import numpy as np

from spi.compiler.dispatch import device
from spi.numerics.angles import sinc_versinc
from spi.numerics.elementary import expm1, sinh_coshm1
from spi.numerics.rng import on_circle, uniform

NEAR = 0.5
_S1, _S2, _S3, _S4, _S5, _S6 = (1.0 / math.factorial(2 * k + 1) for k in range(1, 7))
_C1, _C2, _C3, _C4, _C5 = (1.0 / math.factorial(2 * k + 2) for k in range(1, 6))
_MOST_DAMPING = 300.0  #: exponent of the damped flow beyond which it has long arrived, and cosh would overflow


@device
def cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@device
def change_by_turn(angles, wx, wy, wz, x, y, z):
    """Change of a vector that turns about w by the angle |w| (Rodrigues' formula)."""
    sinc, versinc = sinc_versinc(angles, wx * wx + wy * wy + wz * wz)
    ax, ay, az = cross(wx, wy, wz, x, y, z)
    bx, by, bz = cross(wx, wy, wz, ax, ay, az)
    return ax + (sinc * ax + versinc * bx), ay + (sinc * ay + versinc * by), az + (sinc * az + versinc * bz)


@device
def towards(bx, by, bz, alpha_t, x, y, z):
    """Spin after damping for the time t in the field b: the flow of s' = alpha (b - (s . b) s).

    With n = b / |b|, u = s . n, c = cosh(alpha |b| t) and q = sinh(alpha |b| t), s becomes
    (s + ((c - 1) u + q) n) / (c + u q): a Moebius map of the sphere.
    """
    size = np.sqrt(bx * bx + by * by + bz * bz + 1e-300)
    exponent = alpha_t * size
    q, c1 = sinh_coshm1(exponent if exponent < _MOST_DAMPING else _MOST_DAMPING)
    inverse = 1.0 / size
    u = (x * bx + y * by + z * bz) * inverse
    scale = 1.0 / (1.0 + (c1 + u * q))
    along = (c1 * u + q) * inverse
    return (x + along * bx) * scale, (y + along * by) * scale, (z + along * bz) * scale


@device
def towards_near(bx, by, bz, alpha_t, x, y, z):
    """:func:`towards` where alpha |b| t is at most :data:`NEAR`: by the series of sinh and cosh in its square.

    With w = alpha t b the spin becomes (s + (S + C s . w) w) / (1 + C |w|^2 + S s . w), S = sinh |w| / |w| and
    C = (cosh |w| - 1) / |w|^2, without a root and with one division.
    """
    wx, wy, wz = alpha_t * bx, alpha_t * by, alpha_t * bz
    square, u = wx * wx + wy * wy + wz * wz, x * wx + y * wy + z * wz
    sinh = 1.0 + square * (_S1 + square * (_S2 + square * (_S3 + square * (_S4 + square * (_S5 + square * _S6)))))
    cosh = 0.5 + square * (_C1 + square * (_C2 + square * (_C3 + square * (_C4 + square * _C5))))
    scale, along = 1.0 / (1.0 + (cosh * square + sinh * u)), sinh + cosh * u
    return (x + along * wx) * scale, (y + along * wy) * scale, (z + along * wz) * scale


@device
def unit_factor(x, y, z):
    """Factor that takes away roundings of the length of a spin: a step of Newton's method for 1 / |s|."""
    return 1.5 - 0.5 * (x * x + y * y + z * z)


@device
def noise_factor(square):
    """Factor of the vector w of independent normals by which a spin turns, given |w|^2.

    One turn by w (1 - |w|^2 / 120) has the means of Brownian motion on the sphere up to the square of the variance, for
    spherical harmonics of all degrees l: E sum_m cos(m |w|) / (2l + 1) = exp(-l(l+1) v / 2) + O(v^3).
    """
    return 1.0 / (1.0 + square * (1.0 / 120.0))


@device
def versines_of_noise(v):
    """1 - cos of the two angles, equally likely, of a turn about a random axis that has the means of noise.

    With e = 1 - exp(-v), v the variance of a component of the Gaussian vector, they are e (3/2 +- (3/2 - 5 e/4)^(1/2)).
    Then E sum_m cos(m angle) / (2l + 1) = exp(-l(l+1) v / 2) holds exactly for l = 1 and 2, and up to O(v^3) for all l,
    because l = 1 and 2 determine the means of angle^2 and angle^4 up to the square of v.
    """
    e = -expm1(-v)
    root = np.sqrt(1.5 - 1.25 * e)
    return e * (1.5 - root), e * (1.5 + root)


@device
def direction(first, second):
    """A unit vector, uniformly distributed, from two 32-bit words: its z, and the angle of (x, y)."""
    u = uniform(first)
    x, y = on_circle(2.0 * np.sqrt(u * (1.0 - u)), second)
    return x, y, u - (1.0 - u)
