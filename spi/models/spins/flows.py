"""Flows of classical spins: turns, exact for pairs and for sites whose neighbours are fixed, and damped precession.

With b = -grad_s H, the field at a spin s of moment mu, and the damping alpha,

    mu s' = b x s + alpha (b - (s . b) s).

Functions of one spin, or of a pair, take and return floats; loops over paths make them vector instructions.
"""

import numpy as np

from ...compiler.dispatch import device
from ...numerics.angles import sinc_versinc
from ...numerics.motions import sinh_coshm1

_MOST_DAMPING = 300.0  #: exponent of the damped flow beyond which it has long arrived, and cosh would overflow


@device
def cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@device
def change_by_turn(angles, wx, wy, wz, x, y, z):
    """The change of a vector that turns about w by the angle |w| (Rodrigues' formula)."""
    sinc, versinc = sinc_versinc(angles, wx * wx + wy * wy + wz * wz)
    ax, ay, az = cross(wx, wy, wz, x, y, z)
    bx, by, bz = cross(wx, wy, wz, ax, ay, az)
    return ax + (sinc * ax + versinc * bx), ay + (sinc * ay + versinc * by), az + (sinc * az + versinc * bz)


@device
def towards(bx, by, bz, alpha_t, x, y, z):
    """The spin after damping for the time t in the field b: the flow of s' = alpha (b - (s . b) s).

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
def unit_factor(x, y, z):
    """The factor that takes away roundings of the length of a spin: a step of Newton's method for 1 / |s|."""
    return 1.5 - 0.5 * (x * x + y * y + z * z)


@device
def noise_factor(square):
    """The factor of the vector w of independent normals by which a spin turns, given |w|^2.

    One turn by w (1 - |w|^2 / 120) has the means of Brownian motion on the sphere up to the square of the variance, for
    spherical harmonics of all degrees l: E sum_m cos(m |w|) / (2l + 1) = exp(-l(l+1) v / 2) + O(v^3).
    """
    return 1.0 / (1.0 + square * (1.0 / 120.0))
