"""Energies of bonds of Heisenberg's chain of classical spins, open and on rings, see docs/equilibria.md.

python benchmarks/spin_chain.py

Supports: docs/equilibria.md, chains of spins.

Short form: without arguments
"""

import numpy as np
from scipy.special import spherical_in

RINGS = 6, 8, 16


def open_chain(K):
    """E x_i.x_(i+1) at the temperature 1/K, H = sum x_i.x_(i+1)."""
    return 1 / K - 1 / np.tanh(K)


def ring(n, K, most=40):
    """The same on a ring of n spins, -d log Z/dK / n, from the eigenvalues (-1)^l i_l(K) of the transfer operator."""
    order = np.arange(most)
    value, slope = ((-1.0) ** order * spherical_in(order, K, derivative=d) for d in (False, True))
    return -((2 * order + 1) * value ** (n - 1) * slope).sum() / ((2 * order + 1) * value**n).sum()


if __name__ == "__main__":
    print("1/T        open", *(f"{f'ring of {n}':>12}" for n in RINGS))
    for K in (0.25, 1.0, 2.0, 4.0):
        print(f"{K:<6g}{open_chain(K):10.6f}", *(f"{ring(n, K):12.6f}" for n in RINGS))
