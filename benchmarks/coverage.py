"""How often the stated 95 % intervals of means at equilibrium hold the exact value, on three laws.

    python benchmarks/coverage.py [--runs 1000]

runs each experiment with as many seeds and prints a line for each: the share of the runs whose interval holds the value
of the quadrature, for a few functions; how much the value is off on average, in standard errors of the runs' means; and
how long a path is in autocorrelation times.  Of 1000 runs 95 +- 1.4 % are within two standard errors of 95 %.

Short form: --runs 4 uniform
"""

import argparse

import numpy as np

from spi.exact import gibbs
from spi.kinds.equilibrium import study
from spi.kinds.state import State
from spi.running import workers
from spi.running.load import load
from spi.storage.records import Part

BODY = """
title: coverage
kind: equilibrium
model: {{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}}
initial: [cos(1.1), 0, sin(1.1)]
steps: [{h}]
schemes: [{scheme}]
bins: 8
"""
#: What is run: a law, with many paths and with few or one.
LAWS = {
    "Gibbs law, T = 1/4, 16 paths": ("temperature: 1/4", 1, "splitting_metropolis", 512, 16, "{H: H, square: y3^2}"),
    "the same, 1 path": ("temperature: 1/4", 1, "splitting_metropolis", 4096, 1, "{H: H, square: y3^2}"),
    "uniform law, 9 paths": ("", 1, "splitting", 1024, 9, "{height: y3, H: H}"),
    "two wells, T = 1/16, 16 paths": ("temperature: 1/16", 1, "splitting_metropolis", 8192, 16, "{H: H, first: y1}"),
    "the same, 2 paths": ("temperature: 1/16", 1, "splitting_metropolis", 16384, 2, "{H: H, first: y1}"),
}


def intervals(text, seeds):
    """(runs, F) arrays: means, half widths, and lengths of paths in autocorrelation times; exact values; names."""
    (case,) = load("coverage.yaml", text=text).cases
    law, found = gibbs.law_of(case.model, case.initial, case.temperature), []
    for seed in seeds:
        plan = study.plan(case.model_copy(update={"seed": seed}), Part(case.schemes[0]))
        state = State(plan)
        workers.advance_here([state], lambda number: None)
        one = plan.results(state).averages
        found.append((one.average[0], one.average_half[0], one.kept * one.spacing / one.tau[0]))
    exact = np.array([law.expectation(function.values)[0] for function in case.path_functions])
    return *np.swapaxes(found, 0, 1), exact, tuple(case.functions)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000, help="how many seeds (default: %(default)s)")
    parser.add_argument("laws", nargs="*", help=f"beginnings of names; known: {'; '.join(LAWS)}")
    wanted = parser.parse_args()
    for name, (keys, h, scheme, time, samples, functions) in LAWS.items():
        if wanted.laws and not name.startswith(tuple(wanted.laws)):
            continue
        text = BODY.format(h=h, scheme=scheme) + f"{keys}\nfinal_time: {time}\nsamples: {samples}\n"
        mean, half, lengths, exact, names = intervals(text + f"functions: {functions}\n", range(1, wanted.runs + 1))
        held = np.abs(mean - exact) <= half
        bias = (mean.mean(axis=0) - exact) / (mean.std(axis=0, ddof=1) / np.sqrt(len(mean)))
        for f, function in enumerate(names):
            told = f"{held[:, f].mean():6.1%} held, off by {bias[f]:+.1f} standard errors of all runs"
            print(f"{name:34s} {function:8s} {told}, {np.median(lengths[:, f]):.0f} autocorrelation times", flush=True)


if __name__ == "__main__":
    main()
