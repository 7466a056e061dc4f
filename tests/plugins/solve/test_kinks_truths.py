"""Errors stated for functions with kinks and jumps hold, at every refinement, against truths of other methods."""

import itertools

import numpy as np
import pytest
from phis import functions_of
from scipy.integrate import quad

from spi.exact.expectations import refiner
from spi.models import MaxwellBloch, RigidBody
from spi.plugins.solve.exact.refining import refined

pytestmark = pytest.mark.slow

LONGEST = 4.0  #: seconds of typical speed of the refinements that are tried


def outside(model, initial, texts, truths, accuracy=1e-6):
    """[(function, refinement, distance, error stated)] of what lies outside its stated error."""
    found = []
    for text, truth in zip(texts, truths, strict=True):
        one = refiner(model, initial, 1.0, functions_of([text], 3), accuracy)
        assert one.rough.all(), text
        number = sum(cost <= LONGEST for cost in one.costs)
        values, uncertain, _ = zip(*(one.refine(k) for k in range(number)), strict=True)
        each = [refined(values[: k + 1], uncertain[: k + 1], one.rough) for k in range(number)]
        assert number >= 5 and each[-1].bound[0] < 3e-3, (text, each[-1])
        off = [(text, k, abs(r.value[0] - truth), r.bound[0]) for k, r in enumerate(each)]
        found += [one for one in off if not one[2] <= one[3] + 1e-9]
    return found


ABOUT_AN_AXIS = [
    "abs(y1 - 0.2)",
    "abs(y1 + y2 - 0.3)",
    "(y2 - 0.1 + abs(y2 - 0.1))/2",
    "(y1 + y2 - abs(y1 - y2))/2",
    "abs(y1*y2)",
    "sqrt(abs(y1))",
    "abs(y1*y2)^0.5",
    "abs(y1 + y2 - 0.3)^0.3",
    "((y2 - 0.1 + abs(y2 - 0.1))/2)^0.7",
    "(1 + (y2 - 0.3)/abs(y2 - 0.3))/2",
]


def test_noise_about_one_axis():
    """Then y3 is conserved, and the angle about its axis is normal: an integral over one variable."""
    model = RigidBody((2.0, 2.0, 1.0), (1.0, 1.0, 1.5), (0.0, 0.0, 0.8))
    y = np.array([0.5, -0.3, 0.7])
    sd, mean = 0.8 * y[2] / 1.5, y[2] * (1 / 1.0 - 1 / 2.0)
    r, start = np.hypot(*y[:2]), np.arctan2(y[1], y[0])

    def truth(f):
        def density(z):
            angle = start - mean + sd * z
            state = np.array([r * np.cos(angle), r * np.sin(angle), y[2]])[:, None]
            return np.ravel(f(state))[0] * np.exp(-z * z / 2) / np.sqrt(2 * np.pi)

        z = np.linspace(-9, 9, 721)
        return sum(quad(density, a, b, epsabs=1e-12, limit=200)[0] for a, b in itertools.pairwise(z))

    truths = [truth(f) for f in functions_of(ABOUT_AN_AXIS, 3)]
    assert not outside(model, tuple(y), ABOUT_AN_AXIS, truths)


ON_TORUS = [
    "abs(y3 - 0.3)",
    "abs(y3 + 1)",
    "(y3 - 0.3 + abs(y3 - 0.3))/2",
    "sqrt(abs(y2))",
    "sqrt(abs(y3 - 0.3))",
    "((y3 - 0.3 + abs(y3 - 0.3))/2)^0.7",
    "abs(y3 - 0.3)^1.5",
    "(1 + (y3 - 0.3)/abs(y3 - 0.3))/2",
    "abs(y1 - 0.5)",
    "sqrt(abs(y1 - 0.5))",
]


@pytest.mark.parametrize("text", ON_TORUS)
def test_maxwell_bloch(text):
    """Waves on a torus, as paths do not get to where it closes; functions of one coordinate, with its waves exact."""
    initial = (1.0, 2.0, 3.0)
    truth = on_torus(functions_of([text], 3)[0], initial, "y1" in text)
    assert not outside(MaxwellBloch((0.5, 0.5)), initial, [text], [truth])


def on_torus(f, initial, of_y1, size=(1024, 240), half=24.0, sigma=0.5):
    """E f at time 1 from Strang's steps, without the two leading powers of their error."""
    r, begin = np.hypot(*initial[1:]), np.angle(initial[1] + 1j * initial[2])
    y1, angle = (np.arange(n) / n for n in size)
    y1, angle = initial[0] + half * (2 * y1 - 1), begin + 2 * np.pi * angle
    n = size[0] if of_y1 else size[1]
    fine = np.arange(n << 13) / (n << 13)
    x, a = (initial[0] + half * (2 * fine - 1), begin) if of_y1 else (initial[0], begin + 2 * np.pi * fine)
    y = np.array(np.broadcast_arrays(x, r * np.cos(a), r * np.sin(a)))
    wave = np.fft.rfft(f(y))[: n // 2 + 1] / 2**13
    wave[-1] = 0.0
    values = np.fft.irfft(wave, n)
    values = np.zeros(size) + (values[:, None] if of_y1 else values)
    k, m = np.pi / half * np.fft.fftfreq(size[0], 1 / size[0])[:, None], np.arange(size[1] // 2 + 1)
    y1, y2 = y1[:, None], r * np.cos(angle)

    def run(steps):
        h, u = 1.0 / steps, values
        turn = np.exp(-1j * m * y1 * h / 2 - (sigma * m * y1) ** 2 * h / 4)
        shear = np.exp(1j * k * y2 * h - (sigma * k * y2) ** 2 * h / 2)
        for _ in range(steps):
            u = np.fft.irfft(np.fft.rfft(u, axis=1) * turn, size[1], axis=1)
            u = np.fft.ifft(np.fft.fft(u, axis=0) * shear, axis=0).real
            u = np.fft.irfft(np.fft.rfft(u, axis=1) * turn, size[1], axis=1)
        return u[size[0] // 2, 0]

    coarse, middle, fine = (run(steps) for steps in (32, 64, 128))
    return (64 * fine - 20 * middle + coarse) / 45
