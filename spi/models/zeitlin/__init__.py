"""The stochastic sine-Euler equations for any odd N: Zeitlin's truncation of an ideal fluid on the torus.

The vorticity omega(x) = sum_m omega_m exp(i m.x) on [0, 2 pi)^2 has the modes of ``lattice.py``, and (the paper's
Example expl-SE, for every N = 2M + 1)

    B_{m,n} = c sin(2 pi (m x n) / N) omega_{m+n},    H = 1/2 sum_{m != 0} |omega_m|^2 / |m|^2,

with c = 1 as in the paper, or c = N / (2 pi) as in Zeitlin (Physica D 49, 1991), with which the equations are those of
Euler as N grows; with the paper's they are slower by the factor 2 pi / N.
"""

from typing import Literal, NamedTuple

from .lattice import Mode


class Noise(NamedTuple):
    """The noise of some modes: each has Wiener processes of its own."""

    modes: tuple[Mode, ...]
    sigma: float
    #: quadratic: one process per mode m with Ĥ = |omega_m|^2 / |m|^2, as in the paper; linear: two processes, with
    #: Ĥ = sqrt(2) Re omega_m / |m| and sqrt(2) Im omega_m / |m|, transport by given fields of root mean square speed 1
    hamiltonian: Literal["quadratic", "linear"] = "quadratic"


class Zeitlin(NamedTuple):
    """A two-dimensional ideal fluid of N^2 - 1 real components, with Casimirs C_k = tr W^k / N, k = 2, 3, ..."""

    n: int
    noise: tuple[Noise, ...] = ()
    normalisation: Literal["paper", "zeitlin"] = "paper"
    casimirs_watched: int = 4
