"""What scrambled points are worth: the variance of independent paths over that of as many points, with 95 % intervals.

    python benchmarks/points.py [--seeds 32] [--points 4096] [--sigma 1 0.25]

The problem is that of docs/quasi.md: rigid body, noise inertia (1, 2, 3), h = 2^-4, T = 1.  Each seed has 64 scrambles;
intervals are those of the bootstrap over all scrambles, since means over points have no normal law.

Short form: --seeds 2 --points 64 --sigma 1
"""

import argparse

import numpy as np

from spi.ensemble.increments import points_of
from spi.ensemble.loop import grid, integrated, paths_of
from spi.models import RigidBody
from spi.numerics.rng import LANES, POINTS
from spi.numerics.sobol import SCRAMBLES
from spi.schemes import SCHEMES

FUNCTIONS = {"sin(2 pi y1)": lambda y: np.sin(2 * np.pi * y[0]), "y1^2": lambda y: y[0] ** 2}
INITIAL = (np.cos(1.1), 0.0, np.sin(1.1))


def means(scheme, sigma, points, seed):
    """(functions, SCRAMBLES) the means over the points of each scramble, and (functions,) the variances of paths."""
    record, model = SCHEMES[scheme].record, RigidBody((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0), (sigma,) * 3)
    times, blocks = grid(1 / 16, 16), points * SCRAMBLES // LANES
    noise = points_of(seed, POINTS, record, model, times)
    states, _ = integrated(record, model, INITIAL, times, noise, 0, blocks, blocks * LANES)
    values = np.array([f(paths_of(states, 3)[0]) for f in FUNCTIONS.values()])
    of_scrambles = values.reshape(len(FUNCTIONS), -1, 8, 8, 8).mean(axis=(1, 3))  # by block mod 8 and lane mod 8
    return of_scrambles.reshape(len(FUNCTIONS), SCRAMBLES), values.var(axis=1)


def main():
    """A line for each strength and scheme."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=32)
    parser.add_argument("--points", type=int, default=4096)
    parser.add_argument("--sigma", type=float, nargs="+", default=[1.0, 0.25])
    parser.add_argument("--schemes", nargs="+", default=["splitting"])
    given = parser.parse_args()
    generator = np.random.default_rng(1)
    for sigma in given.sigma:
        for scheme in given.schemes:
            words = scheme, sigma, given.points
            each = [means(*words, seed) for seed in range(1, given.seeds + 1)]
            found = np.concatenate([one for one, _ in each], axis=1)
            independent = np.mean([variance for _, variance in each], axis=0) / given.points
            told = []
            for name, values, variance in zip(FUNCTIONS, found, independent, strict=True):
                drawn = values[generator.integers(values.size, size=(1000, values.size))].var(axis=1, ddof=1)
                low, high = np.quantile(variance / drawn, (0.025, 0.975))
                told.append(f"{name} {variance / values.var(ddof=1):.4g} [{low:.4g}, {high:.4g}]")
            print(f"sigma = {sigma:g}, {scheme}: {', '.join(told)}", flush=True)


if __name__ == "__main__":
    main()
