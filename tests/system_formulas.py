"""The paper's formulas for Maxwell-Bloch, sine-Euler and Lotka-Volterra in plain NumPy."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import random_states
from scipy.linalg import expm

from spi.ensemble.protocol import strengths
from spi.models import LotkaVolterra, MaxwellBloch, SineEuler
from spi.schemes import SCHEMES

SPLITTING, EULER_MARUYAMA, MIDPOINT = (SCHEMES[n].record for n in ("splitting", "euler_maruyama", "midpoint"))


@pytest.fixture
def generator():
    return np.random.default_rng(20)


def maxwell_bloch_rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1, 0, 0], [0, c, s], [0, -s, c]])


def maxwell_bloch_shear(t):
    return np.array([[1, t, 0], [0, 1, 0], [0, 0, 1]])


def maxwell_bloch_fields(y):
    """B grad H as printed, and f_1 and f_3, the right-hand sides of the two subsystems."""
    y1, y2, y3 = y
    zero = 0 * y1
    return np.array([y2, y1 * y3, -y1 * y2]), np.array([[zero, y3 * y1, -y2 * y1], [y2, zero, zero]])


def maxwell_bloch_correction(y):
    """f_k' f_k: f_1 turns (y2, y3), so twice it is -y1^2 (0, y2, y3); f_3 moves y1 by y2, which stands still."""
    y1, y2, y3 = y
    zero = 0 * y1
    return np.array([[zero, -(y1**2) * y2, -(y1**2) * y3], [zero, zero, zero]])


def maxwell_bloch_composition(model, h, dW, y, pieces_exchanged=False):
    """Eq. smbI for one path: exp(h H_3) o exp(h H_1) o exp(sigma_3 dW_3 Ĥ_3) o exp(sigma_1 dW_1 Ĥ_1)."""
    s1, s3 = strengths(model)
    y = maxwell_bloch_rotation(y[0] * s1 * dW[0]) @ y
    y = maxwell_bloch_shear(s3 * dW[1]) @ y
    if pieces_exchanged:
        y = maxwell_bloch_shear(h) @ y
        return maxwell_bloch_rotation(h * y[0]) @ y
    y = maxwell_bloch_rotation(h * y[0]) @ y
    return maxwell_bloch_shear(h) @ y


MODES = ((1, 0), (1, 1), (0, 1), (-1, 1))
CELL = ((0, 1), (0, -1), (1, 1), (-1, -1), (1, 0), (-1, 0), (-1, 1), (1, -1))


def cross(m, n):
    return m[0] * n[1] - m[1] * n[0]


def square(n):
    return n[0] ** 2 + n[1] ** 2


def modulo_3(n):
    """The index in {-1, 0, 1}^2."""
    return tuple((i + 1) % 3 - 1 for i in n)


def modes(y):
    """omega at all nine indices, from (Re, Im) of the four independent modes."""
    omega = {(0, 0): 0j * y[0]}
    for i, n in enumerate(MODES):
        omega[n] = y[2 * i] + 1j * y[2 * i + 1]
        omega[-n[0], -n[1]] = np.conj(omega[n])
    return omega


def components(values):
    """(Re, Im) of the four independent modes."""
    return np.array([part for value in values for part in (np.real(value), np.imag(value))])


def sum_formula(y, among=CELL, factor=1.0):
    """omega_m' = sum_n sin(2 pi/3 m x n) / |n|^2 omega_{m+n} omega_{-n}, n running through `among`."""
    omega = modes(y)
    return components(
        sum(
            math.sin(2 * math.pi / 3 * cross(m, n))
            / (factor * square(n))
            * omega[modulo_3((m[0] + n[0], m[1] + n[1]))]
            * omega[-n[0], -n[1]]
            for n in among
        )
        for m in MODES
    )


def line_matrix(k, y):
    """The real matrix A with y' = A y the subsystem of H_k: the terms n = k and -k, linear in the other modes."""
    n, columns = MODES[k], []
    for e in np.eye(8):
        e[2 * k : 2 * k + 2] = y[2 * k : 2 * k + 2]  # omega_k is a constant of the subsystem
        columns.append(sum_formula(e, among=(n, (-n[0], -n[1]))))
    matrix = np.transpose(columns)
    matrix[:, 2 * k : 2 * k + 2] = 0.0
    return matrix


def printed_casimirs(y):
    omega = modes(y)
    first = 0.5 * sum(omega[n] * np.conj(omega[n]) for n in CELL)
    second = sum(
        math.cos(2 * math.pi / 3 * cross(n, m)) * omega[n] * omega[m] * omega[modulo_3((-n[0] - m[0], -n[1] - m[1]))]
        for n, m in itertools.product(CELL, CELL)
    )
    assert np.all(np.abs(np.imag(first)) < 1e-12) and np.all(np.abs(np.imag(second)) < 1e-12)
    return np.real(first), np.real(second)


def sine_euler_composition(model, h, dW, y, pieces_exchanged=False):
    """Eq. stochSEI for one path."""
    for k, sigma in enumerate(strengths(model)):
        y = expm(sigma * dW[k] * line_matrix(k, y)) @ y
    for k in reversed(range(4)) if pieces_exchanged else range(4):
        y = expm(h * line_matrix(k, y)) @ y
    return y


def sine_euler_fields(y):
    pairs = [(n, (-n[0], -n[1])) for n in MODES]
    return sum_formula(y), np.array([sum_formula(y, among=pair) for pair in pairs])


def sine_euler_correction(y):
    columns = [[(m := line_matrix(k, y[:, lane])) @ m @ y[:, lane] for lane in range(y.shape[1])] for k in range(4)]
    return np.transpose(columns, (0, 2, 1))


def lotka_volterra_fields(y):
    """y1 y2 J grad H with H = y1 - ln y1 + y2 - 2 ln y2, and with Ĥ = -ln y1 + ln y2."""
    y1, y2 = y
    return np.array([y1 * (y2 - 2), y2 * (1 - y1)]), np.array([[y1, y2]])


def lotka_volterra_composition(model, h, dW, y, pieces_exchanged=False):
    y1, y2 = y * math.exp(strengths(model)[0] * dW[0])
    if pieces_exchanged:
        y1 = y1 * math.exp(h * (y2 - 2))
        return np.array([y1, y2 * math.exp(h * (1 - y1))])
    y2 = y2 * math.exp(h * (1 - y1))
    return np.array([y1 * math.exp(h * (y2 - 2)), y2])


SYSTEMS = {
    "maxwell_bloch": SimpleNamespace(
        model=MaxwellBloch((0.8, 1.3)),
        start=(1.0, 2.0, 3.0),
        composition=maxwell_bloch_composition,
        fields=maxwell_bloch_fields,
        correction=maxwell_bloch_correction,
        draw=random_states,
        casimirs=lambda y: np.array([(y[1] ** 2 + y[2] ** 2) / 2]),
    ),
    "sine_euler": SimpleNamespace(
        model=SineEuler((0.8, 1.3, 1.0, 0.6)),
        start=(0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1),
        composition=sine_euler_composition,
        fields=sine_euler_fields,
        correction=sine_euler_correction,
        draw=lambda generator: 0.5 * random_states(generator, 8),
        casimirs=lambda y: np.array(printed_casimirs(y)),
    ),
    "lotka_volterra": SimpleNamespace(
        model=LotkaVolterra((0.8,)),
        start=(1.0, 1.0),
        composition=lotka_volterra_composition,
        fields=lotka_volterra_fields,
        correction=lambda y: np.array([y]),
        draw=lambda generator: np.exp(0.5 * random_states(generator, 2)),
        casimirs=lambda y: np.empty((0, y.shape[1])),
    ),
}
LIE_POISSON = {name: SYSTEMS[name] for name in ("maxwell_bloch", "sine_euler")}


def clipped(dW, h):
    bound = math.sqrt(4 * h * abs(math.log(h)))
    return np.clip(dW, -bound, bound)


def weighted(system, dW, noise):
    """sum_k sigma_k dW_k f_k."""
    return sum(sigma * dW[k] * noise[k] for k, sigma in enumerate(strengths(system.model)))
