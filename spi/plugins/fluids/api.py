"""``spi.fluid``: fields, modes and spectra of vorticities on the torus, in NumPy.

A state y (..., N^2 - 1) of `sine_euler` or `zeitlin` is that of results and of ``spi.trajectory``, where N is its own
size.  A grid of G points a side has the places x = 2 pi (i, j) / G, i, j = 0, ..., G - 1, at [..., i, j].
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from .models import fields
from .models.tables import modes as modes_of

__all__ = ["energy", "enstrophy", "field", "modes", "order", "spectrum", "state", "velocity"]


def __dir__() -> list[str]:
    """Names of functions, without what they are made of."""
    return __all__


def field(y: Any, grid: int) -> np.ndarray:
    """Vorticity (..., G, G) on a grid of G = `grid` points a side, omega(x) = sum over all m of omega_m exp(i m.x).

    Raises ValueError if G < N.
    """
    return fields.vorticity(_states(y), grid)


def velocity(y: Any, grid: int) -> np.ndarray:
    """Velocities (..., 2, G, G) with the curl omega: u = (-d psi / d x_2, d psi / d x_1), Laplacian psi = omega.

    With the signs of the model vorticity, tracers and particles move with -u, times 2 pi / N where `normalisation` is
    `paper`: omega' = + u . grad omega, so that positive vorticity turns clockwise.  Raises ValueError if G < N.
    """
    return fields.velocity(_states(y), grid)


def modes(y: Any) -> np.ndarray:
    """Modes (..., N, N), complex: omega_m at [m_1, m_2], where negative numbers count from the end."""
    return fields.table_of(_states(y))


def order(n: int) -> Sequence[tuple[int, int]]:
    """Modes (m_1, m_2) of a state in their order; components 2 k and 2 k + 1, from 0 on, are Re and Im of number k."""
    return modes_of(n)


def state(values: Any, n: int) -> np.ndarray:
    """States (..., N^2 - 1) of fields (..., G, G), real, or of modes (..., N', N'), complex as of :func:`modes`.

    Modes beyond N = `n` are left out.  Raises ValueError if G or N' is below N, if a mean is not 0, or if the modes m
    and -m are not complex conjugates.
    """
    values = np.asarray(values)
    return (fields.state_of_table if np.iscomplexobj(values) else fields.projected)(values, n)


def spectrum(y: Any) -> np.ndarray:
    """Energies E(k) (..., shells), k = 1, 2, ...: 1/2 sum of |omega_m|^2 / |m|^2 over all m with |m| rounded to k."""
    return fields.energy_spectrum(_states(y))


def energy(y: Any) -> np.ndarray:
    """H (...): 1/2 sum over all m of |omega_m|^2 / |m|^2, the mean of |u|^2 / 2 over the torus."""
    return fields.energy(_states(y))


def enstrophy(y: Any) -> np.ndarray:
    """1/2 sum over all m of |omega_m|^2 (...), the mean of omega^2 / 2 over the torus."""
    return fields.enstrophy(_states(y))


def _states(y: Any) -> np.ndarray:
    """States as an array; ValueError if no odd N has as many components."""
    y = np.asarray(y, float)
    n = fields.size_of(y) if y.ndim else 0
    if n < 3 or n % 2 == 0 or y.shape[-1] != n * n - 1:
        raise ValueError(f"states have shape {y.shape}, whose last number must be N^2 - 1 for an odd N, as 8 or 24")
    return y
