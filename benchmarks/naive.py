"""The splitting scheme slpI as one writes it first: a scalar loop over paths in prange, np.random.normal, math.sin."""

import math

import numpy as np
from numba import njit, prange


@njit(parallel=True)
def rigid_body(paths, steps, h, inertia, noise_inertia, sigma, initial, out):
    root = math.sqrt(h)
    for p in prange(paths):
        y1, y2, y3 = initial[0], initial[1], initial[2]
        for _ in range(steps):
            a = y1 * sigma[0] * root * np.random.normal() / noise_inertia[0]
            c, s = math.cos(a), math.sin(a)
            y2, y3 = c * y2 + s * y3, c * y3 - s * y2
            a = y2 * sigma[1] * root * np.random.normal() / noise_inertia[1]
            c, s = math.cos(a), math.sin(a)
            y3, y1 = c * y3 + s * y1, c * y1 - s * y3
            a = y3 * sigma[2] * root * np.random.normal() / noise_inertia[2]
            c, s = math.cos(a), math.sin(a)
            y1, y2 = c * y1 + s * y2, c * y2 - s * y1
            a = y1 * h / inertia[0]
            c, s = math.cos(a), math.sin(a)
            y2, y3 = c * y2 + s * y3, c * y3 - s * y2
            a = y2 * h / inertia[1]
            c, s = math.cos(a), math.sin(a)
            y3, y1 = c * y3 + s * y1, c * y1 - s * y3
            a = y3 * h / inertia[2]
            c, s = math.cos(a), math.sin(a)
            y1, y2 = c * y1 + s * y2, c * y2 - s * y1
        out[p, 0], out[p, 1], out[p, 2] = y1, y2, y3


@njit(parallel=True)
def maxwell_bloch(paths, steps, h, sigma, initial, out):
    root = math.sqrt(h)
    for p in prange(paths):
        y1, y2, y3 = initial[0], initial[1], initial[2]
        for _ in range(steps):
            a = y1 * sigma[0] * root * np.random.normal()
            c, s = math.cos(a), math.sin(a)
            y2, y3 = c * y2 + s * y3, c * y3 - s * y2
            y1 += sigma[1] * root * np.random.normal() * y2
            a = y1 * h
            c, s = math.cos(a), math.sin(a)
            y2, y3 = c * y2 + s * y3, c * y3 - s * y2
            y1 += h * y2
        out[p, 0], out[p, 1], out[p, 2] = y1, y2, y3


@njit
def _turn_line(w, c, z0, z1, z2):
    """The flow of one mode w on the line z0, z1, z2: a 3-point Fourier transform, three phases, and back."""
    root = complex(-0.5, math.sqrt(3.0) / 2.0)
    back = root.conjugate()
    u0, u1, u2 = z0 + z1 + z2, z0 + z1 * back + z2 * root, z0 + z1 * root + z2 * back
    a0, a1, a2 = -2.0 * c * w.imag, -2.0 * c * (w * back).imag, -2.0 * c * (w * root).imag
    u0 *= complex(math.cos(a0), math.sin(a0)) / 3.0
    u1 *= complex(math.cos(a1), math.sin(a1)) / 3.0
    u2 *= complex(math.cos(a2), math.sin(a2)) / 3.0
    return u0 + u1 + u2, u0 + u1 * root + u2 * back, u0 + u1 * back + u2 * root


@njit(parallel=True)
def sine_euler(paths, steps, h, sigma, initial, out):
    root = math.sqrt(h)
    sine = math.sqrt(3.0) / 2.0
    for p in prange(paths):
        a = complex(initial[0], initial[1])
        b = complex(initial[2], initial[3])
        c = complex(initial[4], initial[5])
        d = complex(initial[6], initial[7])
        for _ in range(steps):
            for part in range(2):
                t0, t1, t2, t3 = h, h, h, h
                if part == 0:
                    t0, t1 = sigma[0] * root * np.random.normal(), sigma[1] * root * np.random.normal()
                    t2, t3 = sigma[2] * root * np.random.normal(), sigma[3] * root * np.random.normal()
                c, b, d = _turn_line(a, -sine * t0, c, b, d)
                a, d, z = _turn_line(b, 0.5 * sine * t1, a, d, c.conjugate())
                c = z.conjugate()
                a, b, z = _turn_line(c, sine * t2, a, b, d.conjugate())
                d = z.conjugate()
                a, c, z = _turn_line(d, 0.5 * sine * t3, a, c, b.conjugate())
                b = z.conjugate()
        out[p, 0], out[p, 1], out[p, 2], out[p, 3] = a.real, a.imag, b.real, b.imag
        out[p, 4], out[p, 5], out[p, 6], out[p, 7] = c.real, c.imag, d.real, d.imag
