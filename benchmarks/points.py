"""What scrambled points are worth: the variance of independent paths over that of as many points, with 95 % intervals.

    python benchmarks/points.py [--seeds 32] [--points 4096] [--sigma 1 0.25]
    python benchmarks/points.py --cost

The problem is that of docs/quasi.md: rigid body, noise inertia (1, 2, 3), h = 2^-4, T = 1.  Each seed has 64 scrambles;
intervals are those of the bootstrap over all scrambles, since means over points have no normal law.

Supports: docs/quasi.md, "Bridges", what points are worth; with --cost, which runs `spi.run` on the spec below and
prints what `spi check` predicts, the table of "Cost".

Short form: --seeds 2 --points 64 --sigma 1
"""

import argparse

import numpy as np
from through_spec import run, said

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


def cost(samples=2**21, repeats=5):
    """ns of a step and path by independent paths and by points, on one thread, in turn."""
    spec = {
        "kind": "weak",
        "model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
        "initial": ["cos(1.1)", 0, "sin(1.1)"],
        "final_time": 1,
        "steps": ["2^-4"],
        "reference_step": "2^-5",
        "functions": {"square": "y1^2"},
        "samples": samples,
    }
    for scheme in ("splitting", "splitting_order2"):
        specs = [{**spec, "schemes": [scheme], "estimators": [name]} for name in ("plain", "quasi")]
        for one in specs:
            run({**one, "samples": 2**12})  # compiles
        found = np.array([[run(one) for one in specs] for _ in range(repeats)])
        (paths, points), (first, second) = np.median(found, axis=0).T
        print(f"{scheme}: {paths:.2f} ns, points {points:.2f} ns ({points / paths:.2f} times);", end=" ")
        told = [said(one)[0] for one in specs]
        print(f"said {told[0]} and {told[1]}; took {first:.1f} and {second:.1f} s", flush=True)


def main():
    """A line for each strength and scheme."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=32)
    parser.add_argument("--points", type=int, default=4096)
    parser.add_argument("--sigma", type=float, nargs="+", default=[1.0, 0.25])
    parser.add_argument("--schemes", nargs="+", default=["splitting"])
    parser.add_argument("--cost", action="store_true", help="time independent paths and points instead")
    given = parser.parse_args()
    if given.cost:
        cost()
        return
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
