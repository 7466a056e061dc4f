"""The scales that a vorticity on the torus modulo N resolves.

The bracket sin(2 pi (m x k) / N) N / (2 pi) is that of a fluid where m x k is small beside N: matrices of N x N entries
hold cells of area (2 pi)^2 / N.  How much finer a state is shows in its Casimirs: C_k = tr W^k / N is the mean of
omega^k where the cells are small enough, and less in modulus where a vortex fills few of them.

By NumPy and not by the kernels, so that `spi check` compiles nothing for it.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import Zeitlin
from .fields import size_of, vorticity
from .tables import modes

_MOST = 4  # of the Casimirs C_2, C_3, ...
_SMALL = 1e-3  # of the mean of |omega|^k: a mean of omega^k that cannot be compared with


def report(model: Any, initial: Sequence[float]) -> list[str]:
    """Lines on the resolution of an initial state of a model; none of a model that is no such fluid."""
    if not isinstance(model, Zeitlin):
        return []
    lines = [f"N = {model.n} resolves cells of 2 pi/sqrt(N) = {cell(model.n):.2f}, not the grid of its modes"]
    each = enumerate(ratios(np.array(initial), min(_MOST, model.n - 1)), 2)
    if casimirs := ", ".join(f"C_{k} {ratio:.2f}" for k, ratio in each if math.isfinite(ratio)):
        lines.append(f"Casimirs at the start, of the means of omega^k (1 for a fluid): {casimirs}")
    return lines


def cell(n: int) -> float:
    """The side of a cell, 2 pi / sqrt(N)."""
    return 2 * math.pi / math.sqrt(n)


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
    m1, m2 = np.array(modes(n)).T
    omega = np.zeros((n, n), complex)
    omega[m1, m2] = y[::2] + 1j * y[1::2]
    omega[-m1, -m2] = omega[m1, m2].conj()
    turned = np.fft.ifft(omega, axis=0, norm="forward")  # [j, s]: sum over m1 of omega_(m1, s) exp(2 pi i m1 j / N)
    a, s = np.indices((n, n))
    w = np.empty((n, n), complex)
    w[a, (a + s) % n] = turned[(2 * a + s) % n, s]
    return w
