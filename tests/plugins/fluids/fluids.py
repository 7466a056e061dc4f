"""The model `zeitlin` a second time, by plain sums and matrices in NumPy, to check the package's kernels against.

Of the package only the order of modes and lines is used (``tables.py`` of the model) and the record with the
parameters (``Zeitlin``).  States are arrays y [..., d] in that order.  A table is an N x N array of the modes omega_m,
at [m1 mod N, m2 mod N].

Derivatives: for a real function f of the state, df/d omega_m = (df/d Re omega_m - i df/d Im omega_m) / 2 for the modes
that stand for all, and the complex conjugate of it for -m, so that {f, g} = sum_{m,n} df/d omega_m B_{m,n} dg/d omega_n
runs over all modes, with B_{m,n} = {omega_m, omega_n} = c sin(2 pi (m x n) / N) omega_{m+n}.
"""

import functools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from spi.plugins.fluids.models.tables import lines, modes, nearest, places


def speed(model):
    """The factor c of the bracket."""
    return {"paper": 1.0, "zeitlin": model.n / (2 * math.pi)}[model.normalisation]


# --- states and tables -----------------------------------------------------------------------------------------------


@functools.cache
def _rows_and_columns(n):
    """Where the modes that stand for all lie in a table."""
    return np.array(modes(n)).T % n


def table(n, y):
    """All omega_m, from a state."""
    y = np.asarray(y, float)
    values, (rows, columns) = y[..., ::2] + 1j * y[..., 1::2], _rows_and_columns(n)
    omega = np.zeros((*values.shape[:-1], n, n), complex)
    omega[..., rows, columns] = values
    omega[..., -rows, -columns] = np.conj(values)
    return omega


def state(n, omega):
    """The state of a table, [..., d]."""
    rows, columns = _rows_and_columns(n)
    values = omega[..., rows, columns]
    return np.stack([values.real, values.imag], axis=-1).reshape(*values.shape[:-1], n**2 - 1)


def derivatives(n, gradient):
    """All df/d omega_m, from the gradient [..., d] in the real components."""
    return np.conj(table(n, gradient)) / 2


@functools.cache
def squares(n):
    """|m|^2 of the modes that stand for all."""
    return np.array([a * a + b * b for a, b in modes(n)], float)


# --- the equations: structure, Hamiltonians, fields ------------------------------------------------------------------


@functools.cache
def _double_sum(n):
    """For the modes m that stand for all and every n: the place of m + n in a table, and sin(2 pi (m x n) / N)."""
    m1, m2 = (part[:, np.newaxis, np.newaxis] for part in np.array(modes(n)).T)
    n1, n2 = np.indices((n, n))
    products = (m1 * n2 - m2 * n1 + n // 2) % n - n // 2
    return ((m1 + n1) % n, (m2 + n2) % n), np.sin(2 * math.pi * products / n)


def structure(model, y, v):
    """B(y) v by the double sum: omega_m' = sum_n B_{m,n} df/d omega_n, where v is the gradient of f."""
    n = model.n
    sums, sines = _double_sum(n)
    values = np.einsum("mij,...mij,...ij->...m", sines, table(n, y)[..., *sums], derivatives(n, v))
    return speed(model) * np.stack([values.real, values.imag], axis=-1).reshape(*values.shape[:-1], n**2 - 1)


def hamiltonian(model, y):
    """H = 1/2 sum over all m of |omega_m|^2 / |m|^2."""
    return ((y[..., ::2] ** 2 + y[..., 1::2] ** 2) / squares(model.n)).sum(-1)


def drift_gradient(model, y, own=None):
    """The gradient of H, or of the part of H that has the modes `own`."""
    gradient = 2 * np.asarray(y, float) / np.repeat(squares(model.n), 2)
    return gradient if own is None else gradient * np.repeat([m in own for m in modes(model.n)], 2)


class Process(NamedTuple):
    """One Wiener process of the noise."""

    mode: tuple  #: the mode that stands for its mode and the opposite one
    sigma: float
    gradient: Callable  #: y -> the gradient of its Ĥ


def processes(model):
    """All of them: noise after noise, mode after mode, with a linear Ĥ first that of Re omega_m, then that of Im.

    A mode is there in place of the one of m and -m that stands for both, which decides the sign of Im omega_m.
    """
    found, place = [], places(model.n)
    for noise in model.noise:
        for m in noise.modes:
            i, _ = place[nearest(model.n, m)]
            mode = modes(model.n)[i]
            if noise.hamiltonian == "quadratic":
                found.append(Process(mode, noise.sigma, functools.partial(drift_gradient, model, own=(mode,))))
                continue
            for part in (0, 1):
                v = np.zeros(model.n**2 - 1)
                v[2 * i + part] = math.sqrt(2.0 / squares(model.n)[i])
                found.append(Process(mode, noise.sigma, functools.partial(_constant, v)))
    return found


def _constant(v, y):
    """The gradient of a linear function."""
    return np.broadcast_to(v, np.shape(y))


def drift_field(model, y):
    """B(y) grad H(y)."""
    return structure(model, y, drift_gradient(model, y))


def noise_fields(model, y):
    """f_k(y) = B(y) grad Ĥ_k(y) of all processes, [process, ..., d]."""
    return np.array([structure(model, y, p.gradient(y)) for p in processes(model)])


def ito_correction(model, y):
    """1/2 sum_k sigma_k^2 f_k'(y) f_k(y), where f_k' f_k = B(f_k) grad Ĥ_k, for f_k has no part on the line of Ĥ_k."""
    total = np.zeros(np.shape(y))
    for p in processes(model):
        v = p.gradient(y)
        total += p.sigma**2 / 2 * structure(model, structure(model, y, v), v)
    return total


# --- the same in matrices --------------------------------------------------------------------------------------------


def clock_and_shift(n, m):
    """T_m with the entries exp(-2 pi i m1 (j + k) / N) where k = j + m2 mod N, else 0.

    T_m T_n = exp(2 pi i (m x n) / N) T_{m+n}, T_m* = T_{-m} and tr T_m = 0, so that the commutator of T_m and T_n is
    2i sin(2 pi (m x n) / N) T_{m+n}.
    """
    j, k = np.indices((n, n))
    return np.where((k - j - m[1]) % n == 0, np.exp(-2j * math.pi / n * (m[0] * (j + k) % n)), 0)


@functools.cache
def _phases(n):
    """exp(-2 pi i a b / N)."""
    a, b = np.indices((n, n))
    return np.exp(-2j * math.pi / n * (a * b % n))


def matrix(n, omega):
    """W = sum_m omega_m T_m of a table."""
    j, k = np.indices((n, n))
    return (_phases(n) @ omega)[..., (j + k) % n, (k - j) % n]


def table_of(n, W):
    """omega_m = tr(T_m* W) / N."""
    f, m2 = np.indices((n, n))
    half = (n + 1) // 2
    return np.conj(_phases(n)) @ W[..., half * (f - m2) % n, half * (f + m2) % n] / n


def casimirs(model, y, degrees):
    """C_k = tr W^k / N, [..., degree]."""
    W = matrix(model.n, table(model.n, y))
    powers = [np.linalg.matrix_power(W, k) for k in degrees]
    return np.stack([np.trace(P, axis1=-2, axis2=-1).real / model.n for P in powers], axis=-1)


def generator(model, v):
    """The matrix A with W' = A W - W A where omega' = B(omega) v: A = c / (2i) sum_m conj(df/d omega_m) T_m."""
    return speed(model) / 2j * matrix(model.n, np.conj(derivatives(model.n, v)))


# --- flows -----------------------------------------------------------------------------------------------------------


def linear_system(model, v):
    """The real matrix A(v) with A(v) y = B(y) v."""
    units = np.eye(model.n**2 - 1)
    return structure(model, units, np.broadcast_to(v, units.shape)).T


def moved_in_modes(model, y, v):
    """The state at time 1 of y' = B(y) v with constant v, by the exponential of a d x d matrix."""
    return expm(linear_system(model, v)) @ y


def moved_in_matrices(model, y, v):
    """The same by W -> U W U*, U the exponential of an N x N matrix."""
    n = model.n
    U = expm(generator(model, v))
    return state(n, table_of(n, U @ matrix(n, table(n, y)) @ U.conj().T))


def moved(model, y, v):
    """The road that is short enough."""
    return (moved_in_modes if model.n <= 5 else moved_in_matrices)(model, y, v)


def drift_flow(model, k, t, y):
    """The flow of the part of H that has the modes of line number k; they stand still, and so does its gradient."""
    return moved(model, y, t * drift_gradient(model, y, own=lines(model.n)[k][1]))


def noise_lines(model):
    """The processes by their numbers, line by line; the lines in the order of their first noises."""
    line_of = {m: g for g, own in lines(model.n) for m in own}
    found = {}
    for k, p in enumerate(processes(model)):
        found.setdefault(line_of[p.mode], []).append(k)
    return list(found.values())


def noise_flow(model, numbers, dW, y):
    """The flow of several noises of one line at once."""
    known = processes(model)
    return moved(model, y, sum(known[k].sigma * dW[k] * known[k].gradient(y) for k in numbers))


# --- steps -----------------------------------------------------------------------------------------------------------


def drift(model, h, y, numbers):
    """The flows of these lines, one after the other, over the time h."""
    for k in numbers:
        y = drift_flow(model, k, h, y)
    return y


def noise(model, dW, y, chosen):
    """The flows of these lists of processes, one after the other."""
    for numbers in chosen:
        y = noise_flow(model, numbers, dW, y)
    return y


def lie_trotter(model, h, dW, y):
    """`splitting`, the paper's eq. slpI: all noises, then all lines."""
    return drift(model, h, noise(model, dW, y, noise_lines(model)), range(len(lines(model.n))))


def symmetric_drift(model, h, y):
    """All lines but the last over h/2, the last over h, the others back."""
    last = len(lines(model.n)) - 1
    y = drift(model, h / 2, y, range(last))
    y = drift(model, h, y, [last])
    return drift(model, h / 2, y, range(last - 1, -1, -1))


def symmetric(model, h, halves, y):
    """`splitting_symmetric`: [drift 1/2, noise 1 symmetric, drift 1/2 backwards]."""
    chosen, count = noise_lines(model), len(lines(model.n))
    y = noise(model, halves[0], drift(model, h / 2, y, range(count)), chosen[:-1])
    y = noise(model, np.add(*halves), y, chosen[-1:])
    y = noise(model, halves[1], y, chosen[-2::-1])
    return drift(model, h / 2, y, range(count - 1, -1, -1))


def order_2(model, h, dW, coin, y):
    """`splitting_order2`, the paper's remark rem:order2."""
    chosen = noise_lines(model)
    y = noise(model, dW, symmetric_drift(model, h / 2, y), chosen if coin == 1 else chosen[::-1])
    return symmetric_drift(model, h / 2, y)


def euler_maruyama(model, h, dW, y):
    """z = y + h (f + 1/2 sum_k sigma_k^2 f_k' f_k) + sum_k sigma_k dW_k f_k."""
    weights = np.array([p.sigma for p in processes(model)]) * dW
    kicks = np.tensordot(weights, noise_fields(model, y), 1) if len(weights) else 0.0
    return y + h * (drift_field(model, y) + ito_correction(model, y)) + kicks


def random_state(n, seed=1, slope=1.0):
    """A random state with amplitudes like |m|^-slope and a mean square vorticity of 1."""
    y = np.random.default_rng(seed).standard_normal(n**2 - 1) * np.repeat(squares(n), 2) ** (-slope / 2)
    return y / math.sqrt(2 * (y @ y))
