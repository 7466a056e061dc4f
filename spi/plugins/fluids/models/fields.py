"""Vorticity on the torus: from a state to a field and back, spectra, random states, and the scales that are resolved.

A state is (Re omega_m, Im omega_m) of the modes of ``tables.py``, shape (..., d) with d = N^2 - 1, and

    omega(x) = sum_m omega_m exp(i m.x),    x in [0, 2 pi)^2,    omega_{-m} the complex conjugate of omega_m.

A field has the values omega(2 pi i / G, 2 pi j / G) at [..., i, j], i, j = 0, ..., G - 1.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from spi.ensemble.protocol import geometry

from .tables import modes, shell

#: Sizes of rounding errors of the mean and of a mode of a sampled field, relative to its largest value.
MEAN_ROUNDING, MODE_ROUNDING = 1e-12, 1e-15

_ROUNDING = float(np.finfo(float).eps)  # of the largest energy: what is less is no longer seen in the energy
_SPARE = 1e-3  # of the smallest energy at the last time: how far down the spectra at earlier times are shown


def lattice_of(model: Any) -> int | None:
    """N of a model whose state is a vorticity on the lattice modulo N, damped or not; None of every other model."""
    place = geometry(model)
    return place["modes"] if place.get("on") == "torus" else None


def size_of(y: np.ndarray) -> int:
    """N of the states `y` (..., N^2 - 1)."""
    return math.isqrt(y.shape[-1] + 1)


def vorticity(y: np.ndarray, points: int) -> np.ndarray:
    """Fields (..., G, G) of states (..., d) on G = `points` points a side; ValueError if those are fewer than N."""
    y = np.asarray(y, float)
    _check_points(points, size_of(y))
    m1, m2 = _frequencies(size_of(y))
    spectrum = np.zeros((*y.shape[:-1], points, points // 2 + 1), complex)
    omega = y[..., ::2] + 1j * y[..., 1::2]
    spectrum[..., m1, m2] = omega
    real = m2 == 0  # a real transform has both of m and -m on this line
    spectrum[..., -m1[real], 0] = omega[..., real].conj()
    return np.fft.irfft2(spectrum, s=(points, points), norm="forward")


def projected(field: np.ndarray, n: int) -> np.ndarray:
    """States (..., N^2 - 1) with the modes of fields (..., G, G) on the lattice modulo N = `n`.

    Parts of modes that are rounding errors, below 1e-15 of the largest value, are 0.  ValueError if G < N or if a mean
    is not 0.
    """
    field = np.asarray(field, float)
    _check_points(field.shape[-1], n)
    m1, m2 = _frequencies(n)
    largest = np.abs(field).max(axis=(-2, -1))
    if (np.abs(field.mean(axis=(-2, -1))) > mean_rounding(field) * largest).any():
        raise ValueError("the mean of a vorticity on the torus must be 0")
    omega = np.fft.rfft2(field, norm="forward")[..., m1, m2]
    y = np.stack([omega.real, omega.imag], axis=-1).reshape(*omega.shape[:-1], -1)
    return np.where(np.abs(y) > MODE_ROUNDING * largest[..., None], y, 0.0)


def mean_rounding(field: np.ndarray) -> float:
    """Rounding error of the mean relative to the largest value, of numbers that all are of single precision or not."""
    with np.errstate(over="ignore"):
        single = np.array_equal(field, field.astype(np.float32))
    return float(np.finfo(np.float32).eps) if single else MEAN_ROUNDING


def velocity(y: np.ndarray, points: int) -> np.ndarray:
    """Velocities u (..., 2, G, G) of states, u = (-d psi / d x_2, d psi / d x_1) the Laplacian of psi being omega."""
    y = np.asarray(y, float)
    omega = y[..., ::2] + 1j * y[..., 1::2]
    m1, m2 = (part / _lengths(size_of(y)) ** 2 for part in _frequencies(size_of(y)))
    u = np.stack([1j * m2 * omega, -1j * m1 * omega], axis=-2)
    return vorticity(np.stack([u.real, u.imag], axis=-1).reshape(*u.shape[:-1], -1), points)


def table_of(y: np.ndarray) -> np.ndarray:
    """Modes (..., N, N) of states (..., d): omega_m at [m_1, m_2], where -1 is the last index; omega_0 = 0."""
    y, n = np.asarray(y, float), size_of(y)
    (m1, m2), omega = _frequencies(n), y[..., ::2] + 1j * y[..., 1::2]
    table = np.zeros((*y.shape[:-1], n, n), complex)
    table[..., m1, m2], table[..., -m1, -m2] = omega, omega.conj()
    return table


def state_of_table(table: np.ndarray, n: int) -> np.ndarray:
    """States (..., N^2 - 1), N = `n`, of modes (..., N', N') as of :func:`table_of`; those beyond N are left out.

    ValueError if N' < N, if omega_0 is not 0, or if omega_{-m} is not the complex conjugate of omega_m.
    """
    _check_points(table.shape[-1], n)
    m1, m2 = _frequencies(n)
    omega, rounding = table[..., m1, m2], MEAN_ROUNDING * np.abs(table).max()
    if (np.abs(table[..., 0, 0]) > rounding).any():
        raise ValueError("the mean of a vorticity on the torus must be 0")
    if (np.abs(table[..., -m1, -m2] - omega.conj()) > rounding).any():
        raise ValueError("modes m and -m must be complex conjugates")
    return np.stack([omega.real, omega.imag], axis=-1).reshape(*omega.shape[:-1], -1)


def energy_spectrum(y: np.ndarray) -> np.ndarray:
    """E(k) = 1/2 sum |omega_m|^2 / |m|^2 over the modes m and -m of shell k = 1, 2, ..., (..., shells) of states."""
    lengths, shells = _lengths(size_of(y)), shells_of(size_of(y))
    energies = _squares(y) / lengths**2
    return np.stack([energies[..., shells == k].sum(axis=-1) for k in range(1, shells.max() + 1)], axis=-1)


def seen_energies(each: Sequence[np.ndarray]) -> tuple[float, float]:
    """Limits of energies (times, shells) in figures.

    They end where rounding errors begin, and not far below the energies at the last time.
    """
    values, last = (_positive(np.concatenate(some)) for some in ([e.ravel() for e in each], [e[-1] for e in each]))
    if not values.size:
        return 0.1, 10.0
    largest = float(values.max())
    deepest = _SPARE * float(last[last > _ROUNDING * largest].min(initial=largest))
    return max(float(values.min()), _ROUNDING * largest, deepest) / 3, 3 * largest


def _positive(energies: np.ndarray) -> np.ndarray:
    """Energies that a logarithmic axis can show."""
    return energies[np.isfinite(energies) & (energies > 0)]


def energy(y: np.ndarray) -> np.ndarray:
    """H = 1/2 sum over all m of |omega_m|^2 / |m|^2, (...,) of states (..., d)."""
    return (_squares(y) / _lengths(size_of(y)) ** 2).sum(axis=-1)


def enstrophy(y: np.ndarray) -> np.ndarray:
    """1/2 sum over all m of |omega_m|^2, (...,) of states (..., d)."""
    return _squares(y).sum(axis=-1)


def random_state(n: int, spectrum: np.ndarray, energy_wanted: float, seed: int) -> np.ndarray:
    """A state (N^2 - 1,) with random phases and Gaussian amplitudes, whose H is as wanted.

    On average the energy of the shells k = 1, 2, ... is proportional to `spectrum` (shells,).  The normal numbers go to
    the modes ring by ring, max(|m1|, |m2|) = 1, 2, ..., and counter-clockwise within a ring, so that large scales are
    the same for every N, but for the common factor.
    """
    shells = shells_of(n)
    each = np.asarray(spectrum, float) / np.bincount(shells)[1:]
    m1, m2 = _frequencies(n)
    normal = np.empty((len(shells), 2))
    ring_by_ring = np.lexsort((np.arctan2(m2, m1), np.maximum(np.abs(m1), np.abs(m2))))
    normal[ring_by_ring] = np.random.Generator(np.random.Philox(seed)).standard_normal(normal.shape)
    y = (normal * (_lengths(n) * np.sqrt(each)[shells - 1])[:, None]).ravel()
    return y * np.sqrt(energy_wanted / energy(y))


def random_places(count: int, centre: tuple[float, float] | None, radius: float | None, seed: int) -> tuple[float, ...]:
    """x_1 of `count` places and then x_2 of them, independent and uniform in a disc, or on the torus for None."""
    uniform = np.random.Generator(np.random.Philox(seed)).random((2, count))
    if centre is None or radius is None:
        return tuple((2 * np.pi * uniform).ravel().tolist())
    turn, length = 2 * np.pi * uniform[0], radius * np.sqrt(uniform[1])
    x1, x2 = centre[0] + length * np.cos(turn), centre[1] + length * np.sin(turn)
    return (*x1.tolist(), *x2.tolist())


@functools.cache
def shells_of(n: int) -> np.ndarray:
    """(d / 2,) the shell of each mode."""
    return np.array([shell(m) for m in modes(n)])


@functools.cache
def _lengths(n: int) -> np.ndarray:
    """(d / 2,) |m| of each mode."""
    return np.hypot(*np.array(modes(n)).T)


def _squares(y: np.ndarray) -> np.ndarray:
    """(..., d / 2) |omega_m|^2 of each mode of the state."""
    return np.square(y[..., ::2]) + np.square(y[..., 1::2])


def _frequencies(n: int) -> tuple[np.ndarray, np.ndarray]:
    """m1 and m2 of all modes, as indices of arrays whose negative frequencies stand at the end."""
    m1, m2 = np.array(modes(n)).T
    return m1, m2


def _check_points(points: int, n: int) -> None:
    """ValueError unless a grid of `points` points a side distinguishes the modes."""
    if points < n:
        raise ValueError(f"{points} points a side are too few for the lattice modulo {n}; give at least {n}")


# ---------------------------------------------------------------------------------------------------------------------
# The scales that a vorticity on the torus modulo N resolves.
#
# The bracket sin(2 pi (m x k) / N) N / (2 pi) is that of a fluid where m x k is small beside N.  It is that of quantum
# mechanics with hbar = 4 pi / N, where a state takes the area 2 pi hbar = 8 pi^2 / N.  The torus has N / 2 such cells
# and W has N eigenvalues: those of a compact vortex come in nearly equal pairs, a pair for each cell.  How much finer a
# state is shows in its Casimirs: C_k = tr W^k / N is the mean of omega^k where the cells are small enough, and less in
# modulus where a vortex fills few of them.
#
# By NumPy and not by the kernels, so that `spi check` compiles nothing for it.
# ---------------------------------------------------------------------------------------------------------------------

_MOST = 4  # of the Casimirs C_2, C_3, ...
_SMALL = 1e-3  # of the mean of |omega|^k: a mean of omega^k that cannot be compared with


def report(model: Any, initial: Sequence[float]) -> list[str]:
    """Lines on the sense of rotation, and on what a model resolves of an initial state."""
    lines = ["vorticity, tracers and particles move with -u, where curl u = omega: positive vorticity turns clockwise"]
    lines += [f"N = {model.n} resolves cells of side 2 pi sqrt(2/N) = {cell(model.n):.2f}, not the grid of its modes"]
    each = enumerate(ratios(np.array(initial)[: model.n**2 - 1], min(_MOST, model.n - 1)), 2)
    if casimirs := ", ".join(f"C_{k} {ratio:.2f}" for k, ratio in each if math.isfinite(ratio)):
        lines.append(f"Casimirs at the start, of the means of omega^k (1 for a fluid): {casimirs}")
    return lines


def cell(n: int) -> float:
    """Side of a cell, whose area is 8 pi^2 / N."""
    return 2 * math.pi * math.sqrt(2 / n)


def ratios(y: np.ndarray, count: int) -> list[float]:
    """C_k / mean of omega^k, k = 2, 3, ...; NaN where that mean is nearly 0."""
    field = vorticity(y, 1 << (4 * size_of(y) - 1).bit_length())
    means = [(float((field**k).mean()), float((np.abs(field) ** k).mean())) for k in range(2, count + 2)]
    return [
        casimir / mean if abs(mean) > _SMALL * size else math.nan
        for casimir, (mean, size) in zip(casimirs_of(y, count).tolist(), means, strict=True)
    ]


def casimirs_of(y: np.ndarray, count: int) -> np.ndarray:
    """(C_2, C_3, ...), `count` of them: the means of the powers of the eigenvalues of W."""
    values = np.linalg.eigvalsh(matrix_of(y))
    return np.array([(values**k).mean() for k in range(2, count + 2)])


def matrix_of(y: np.ndarray) -> np.ndarray:
    """W of a state, the Hermitian N x N matrix of ``kernels.py``."""
    n = size_of(y)
    turned = np.fft.ifft(
        table_of(y), axis=0, norm="forward"
    )  # [j, s]: sum over m1 of omega_(m1, s) exp(2 pi i m1 j / N)
    a, s = np.indices((n, n))
    w = np.empty((n, n), complex)
    w[a, (a + s) % n] = turned[(2 * a + s) % n, s]
    return w
