"""Splitting (eq. (18) of the paper) and Euler-Maruyama as one writes them first: a path at a time, np.random, math.sin.

Every step is a function of the increments, so that it can be compared with the package's; see generic.py for the
schemes that are not written out here.  The Itô corrections are worked out by hand.
"""

import math

import numpy as np
from numba import njit, prange

step = njit(forceinline=True)  # no slower than with its text in the loop


def loop(step, noises):
    """A function that makes steps of size h with random increments, for all paths."""

    @njit(parallel=True)
    def run(parameters, h, initial, paths, steps, out):
        root = math.sqrt(h)
        for p in prange(paths):
            dW = np.empty(noises)
            y = initial
            for _ in range(steps):
                for k in range(noises):
                    dW[k] = root * np.random.normal()
                y = step(parameters, h, y, dW)
            for i in range(len(y)):
                out[p, i] = y[i]

    return run


@step
def lotka_volterra_splitting(parameters, h, y, dW):
    (sigma,) = parameters
    y1, y2 = y
    factor = math.exp(sigma[0] * dW[0])
    y1, y2 = y1 * factor, y2 * factor
    y2 *= math.exp(h * (1.0 - y1))
    y1 *= math.exp(h * (y2 - 2.0))
    return y1, y2


@step
def lotka_volterra_euler_maruyama(parameters, h, y, dW):
    """The noise field is f(y) = y, hence f' f = y."""
    (sigma,) = parameters
    y1, y2 = y
    noise = sigma[0] * dW[0] + 0.5 * h * sigma[0] ** 2
    return y1 + h * y1 * (y2 - 2.0) + noise * y1, y2 + h * y2 * (1.0 - y1) + noise * y2


@step
def maxwell_bloch_splitting(parameters, h, y, dW):
    (sigma,) = parameters
    y1, y2, y3 = y
    a = y1 * sigma[0] * dW[0]
    c, s = math.cos(a), math.sin(a)
    y2, y3 = c * y2 + s * y3, c * y3 - s * y2
    y1 += sigma[1] * dW[1] * y2
    a = y1 * h
    c, s = math.cos(a), math.sin(a)
    y2, y3 = c * y2 + s * y3, c * y3 - s * y2
    y1 += h * y2
    return y1, y2, y3


@step
def maxwell_bloch_euler_maruyama(parameters, h, y, dW):
    """f_1 = y1 (0, y3, -y2) has f_1' f_1 = -y1^2 (0, y2, y3), and f_3 = (y2, 0, 0) has f_3' f_3 = 0."""
    (sigma,) = parameters
    y1, y2, y3 = y
    a = (h + sigma[0] * dW[0]) * y1
    b = 0.5 * h * (sigma[0] * y1) ** 2
    return y1 + (h + sigma[1] * dW[1]) * y2, y2 + a * y3 - b * y2, y3 - a * y2 - b * y3


@step
def rigid_body_splitting(parameters, h, y, dW):
    inertia, noise_inertia, sigma = parameters
    y1, y2, y3 = y
    a = y1 * sigma[0] * dW[0] / noise_inertia[0]
    c, s = math.cos(a), math.sin(a)
    y2, y3 = c * y2 + s * y3, c * y3 - s * y2
    a = y2 * sigma[1] * dW[1] / noise_inertia[1]
    c, s = math.cos(a), math.sin(a)
    y3, y1 = c * y3 + s * y1, c * y1 - s * y3
    a = y3 * sigma[2] * dW[2] / noise_inertia[2]
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
    return y1, y2, y3


@step
def rigid_body_euler_maruyama(parameters, h, y, dW):
    """f_k turns y about axis k at the rate y_k / Î_k, so that f_k' f_k = -(y_k / Î_k)^2 (y - y_k e_k)."""
    inertia, noise_inertia, sigma = parameters
    y1, y2, y3 = y
    a1 = h * y1 / inertia[0] + sigma[0] * dW[0] * y1 / noise_inertia[0]
    a2 = h * y2 / inertia[1] + sigma[1] * dW[1] * y2 / noise_inertia[1]
    a3 = h * y3 / inertia[2] + sigma[2] * dW[2] * y3 / noise_inertia[2]
    b1 = 0.5 * h * (sigma[0] * y1 / noise_inertia[0]) ** 2
    b2 = 0.5 * h * (sigma[1] * y2 / noise_inertia[1]) ** 2
    b3 = 0.5 * h * (sigma[2] * y3 / noise_inertia[2]) ** 2
    return (
        y1 + a3 * y2 - a2 * y3 - (b2 + b3) * y1,
        y2 + a1 * y3 - a3 * y1 - (b3 + b1) * y2,
        y3 + a2 * y1 - a1 * y2 - (b1 + b2) * y3,
    )


_SINE = math.sqrt(3.0) / 2.0


@step
def _turn_line(w, c, z0, z1, z2):
    """The flow of one mode w on the line z0, z1, z2: a 3-point Fourier transform, three phases, and back."""
    root = complex(-0.5, _SINE)
    back = root.conjugate()
    u0, u1, u2 = z0 + z1 + z2, z0 + z1 * back + z2 * root, z0 + z1 * root + z2 * back
    a0, a1, a2 = -2.0 * c * w.imag, -2.0 * c * (w * back).imag, -2.0 * c * (w * root).imag
    u0 *= complex(math.cos(a0), math.sin(a0)) / 3.0
    u1 *= complex(math.cos(a1), math.sin(a1)) / 3.0
    u2 *= complex(math.cos(a2), math.sin(a2)) / 3.0
    return u0 + u1 + u2, u0 + u1 * root + u2 * back, u0 + u1 * back + u2 * root


@step
def sine_euler_splitting(parameters, h, y, dW):
    (sigma,) = parameters
    a, b, c, d = y
    for part in range(2):
        t0, t1, t2, t3 = h, h, h, h
        if part == 0:
            t0, t1, t2, t3 = sigma[0] * dW[0], sigma[1] * dW[1], sigma[2] * dW[2], sigma[3] * dW[3]
        c, b, d = _turn_line(a, -_SINE * t0, c, b, d)
        a, d, z = _turn_line(b, 0.5 * _SINE * t1, a, d, c.conjugate())
        c = z.conjugate()
        a, b, z = _turn_line(c, _SINE * t2, a, b, d.conjugate())
        d = z.conjugate()
        a, c, z = _turn_line(d, 0.5 * _SINE * t3, a, c, b.conjugate())
        b = z.conjugate()
    return a, b, c, d


@step
def _along_line(w, s, h, sigma, dW, z0, z1, z2):
    """What the mode w adds to its line z0, z1, z2.

    The field of a mode is z_j' = s (conj(w) z_{j+1} - w z_{j-1}), which leaves w alone, so that its derivative along
    itself is the same linear map applied twice.
    """
    v = w.conjugate()
    f0, f1, f2 = s * (v * z1 - w * z2), s * (v * z2 - w * z0), s * (v * z0 - w * z1)
    g0, g1, g2 = s * (v * f1 - w * f2), s * (v * f2 - w * f0), s * (v * f0 - w * f1)
    t, u = h + sigma * dW, 0.5 * h * sigma**2
    return t * f0 + u * g0, t * f1 + u * g1, t * f2 + u * g2


@step
def sine_euler_euler_maruyama(parameters, h, y, dW):
    (sigma,) = parameters
    a, b, c, d = y
    c0, b0, d0 = _along_line(a, -_SINE, h, sigma[0], dW[0], c, b, d)
    a1, d1, c1 = _along_line(b, 0.5 * _SINE, h, sigma[1], dW[1], a, d, c.conjugate())
    a2, b2, d2 = _along_line(c, _SINE, h, sigma[2], dW[2], a, b, d.conjugate())
    a3, c3, b3 = _along_line(d, 0.5 * _SINE, h, sigma[3], dW[3], a, c, b.conjugate())
    return (
        a + a1 + a2 + a3,
        b + b0 + b2 + b3.conjugate(),
        c + c0 + c1.conjugate() + c3,
        d + d0 + d1 + d2.conjugate(),
    )


#: (model, scheme) -> step
STEPS = {
    ("lotka_volterra", "splitting"): lotka_volterra_splitting,
    ("lotka_volterra", "euler_maruyama"): lotka_volterra_euler_maruyama,
    ("maxwell_bloch", "splitting"): maxwell_bloch_splitting,
    ("maxwell_bloch", "euler_maruyama"): maxwell_bloch_euler_maruyama,
    ("rigid_body", "splitting"): rigid_body_splitting,
    ("rigid_body", "euler_maruyama"): rigid_body_euler_maruyama,
    ("sine_euler", "splitting"): sine_euler_splitting,
    ("sine_euler", "euler_maruyama"): sine_euler_euler_maruyama,
}


def arguments(name, model, initial):
    """(parameters, state) as the steps take them: arrays, and complex modes for sine_euler."""
    parameters = tuple(np.array(p, float) for p in model)
    if name == "sine_euler":
        initial = tuple(complex(re, im) for re, im in zip(initial[::2], initial[1::2], strict=True))
    return parameters, tuple(initial)


def real(y):
    """A state as a list of floats, whatever its form."""
    return [x for z in y for x in ((z.real, z.imag) if isinstance(z, complex) else (z,))]
