"""What scrambled points are worth: the variance of independent paths over that of as many points, with 95 % intervals.

    python benchmarks/points.py [--seeds 32] [--points 4096] [--sigma 1 0.25]
    python benchmarks/points.py --cost

All numbers are those of runs of the spec below: the rigid body with three noises, h = 2^-4, T = 1.  Each seed has 64
scrambles, whose variance is that of the results; intervals are those of the bootstrap over seeds.

Supports: docs/quasi.md, "Bridges", what points are worth; with --cost, which prints what `spi check` predicts beside
what a run takes, the table of "Cost".

Short form: --seeds 2 --points 64 --sigma 1
"""

import argparse

import numpy as np
from through_spec import results, run, said

SPEC = {
    "kind": "weak",
    "model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
    "initial": ["cos(1.1)", 0, "sin(1.1)"],
    "final_time": 1,
    "steps": ["2^-4"],
    "reference_step": "2^-5",
}
FUNCTIONS = {"sine": "sin(2*pi*y1)", "square": "y1^2"}
SCRAMBLES = 64  # of a run


def variances(estimator, scheme, sigma, samples, seed):
    """(functions,) those of the means over all samples of a run."""
    keys = {"functions": FUNCTIONS, "schemes": [scheme], "estimators": [estimator], "samples": samples, "seed": seed}
    found = results({**SPEC, **keys, "model": {**SPEC["model"], "sigma": [sigma] * 3}})
    return found[found.parts[0]].expectation_stderr.values[:, 0] ** 2


def cost(samples=2**21, repeats=5):
    """ns of a step and path by independent paths and by points, on one thread, in turn."""
    spec = {**SPEC, "functions": {"square": "y1^2"}, "samples": samples}
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
            words = scheme, sigma, given.points * SCRAMBLES
            found = np.array([variances("quasi", *words, seed) for seed in range(1, given.seeds + 1)])
            independent = variances("plain", *words, 1)
            told = []
            for name, values, variance in zip(FUNCTIONS, found.T, independent, strict=True):
                drawn = values[generator.integers(values.size, size=(1000, values.size))].mean(axis=1)
                low, high = np.quantile(variance / drawn, (0.025, 0.975))
                told.append(f"{name} {variance / values.mean():.4g} [{low:.4g}, {high:.4g}]")
            print(f"sigma = {sigma:g}, {scheme}: {', '.join(told)}", flush=True)


if __name__ == "__main__":
    main()
