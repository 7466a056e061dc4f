"""E |omega_m|^2 by wave number along the later half of the paths of `zeitlin_temperature`, beside Kraichnan's formula.

That is the law exp(-H/T - mu sum |omega_m|^2) of independent modes, with mu for the right enstrophy (Kraichnan 1967,
doi:10.1063/1.1762301); the law of the model fixes the other Casimir functions as well.

    python benchmarks/fluid_equilibrium.py results/zeitlin_temperature.h5

Supports: docs/equilibria.md, the fluid.

Short form, after `spi run --profile quick zeitlin_temperature`: results/zeitlin_temperature.quick.h5
"""

import sys

import numpy as np
from scipy.optimize import brentq

import spi
from spi.plugins.fluids.models.fields import size_of
from spi.plugins.fluids.models.tables import modes

BATCHES = 8  # of the later half, each several correlation times long
TEMPERATURES = {"positive": 1 / 500, "none": np.inf, "negative": -1 / 500}


def kraichnan(temperature, square, total):
    """E |omega_m|^2 = 1/(mu + 1/(T |m|^2)), for one m of each m and -m, whose sum is `total`."""
    costs = 1 / (temperature * square)
    least = (-costs).max()
    mu = brentq(lambda mu: (1 / (mu + costs)).sum() - total, least + 1e-9, least + 1e6)
    return 1 / (mu + costs)


def main():
    results = spi.load(sys.argv[1])
    for case, temperature in TEMPERATURES.items():
        y = results[f"{case}/splitting_symmetric"].y
        y = np.asarray(y)[len(y) // 2 :]
        square = (np.asarray(modes(size_of(y))) ** 2).sum(axis=-1)
        powers = y[:, ::2] ** 2 + y[:, 1::2] ** 2
        found = powers.mean(axis=0)
        batches = [batch.mean() for batch in np.array_split((powers / square).sum(axis=1), BATCHES)]
        print(f"{case:10} standard error of H, from {BATCHES} batches: {np.std(batches, ddof=1) / BATCHES**0.5:.5f}")
        known = kraichnan(temperature, square, found.sum())
        shells = np.rint(np.sqrt(square)).astype(int)
        for name, power in (case, found), ("Kraichnan", known):
            by_shell = (f"{power[shells == k].mean():9.5f}" for k in range(1, 8))
            print(f"{name:10} H {(power / square).sum():8.5f}  |omega|^2 by shell", *by_shell)


if __name__ == "__main__":
    main()
