"""What a call of ``spi.Integrator`` costs: ns per step and path against the kernel of a run, and µs of a short call.

    python benchmarks/integrator.py [PATHS [STEPS [SCHEME ...]]]

All are timed in turn, on one thread, and the least of 15 is taken.

Supports: docs/integrator.md (20 µs; 1.04 to 1.08 times). It compares `spi.Integrator` with the kernel of a run.

Short form: 640 10 splitting
"""

import sys
import time

import numpy as np

import spi
from spi.ensemble.increments import brownian
from spi.ensemble.loop import arguments_of, grid, integrate, limited_threads
from spi.numerics.rng import LANES

BODY = {"name": "rigid_body", "inertia": [2, 1, 2 / 3], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
H, INITIAL, REPEATS = 2**-7, [1, 0, 0.5], 15
SCHEMES = ("splitting", "splitting_areas", "munthe_kaas_midpoint")


def least_seconds(*calls):
    """The least time of each of some calls, made in turn."""
    times = np.zeros((REPEATS, len(calls)))
    for row in times:
        for i, call in enumerate(calls):
            began = time.perf_counter()
            call()
            row[i] = time.perf_counter() - began
    return times.min(axis=0)


def ratios(scheme, paths, steps):
    """ns per step and path of a run's kernel, of ``sample`` and of ``steps``."""
    one = spi.Integrator(BODY, scheme, H, initial=INITIAL, threads=1)
    y, noise = one.start(paths), one.noise(paths, steps)
    times, blocks = grid(H, steps, area_terms=one.area_terms), -(-paths // LANES)
    arguments = arguments_of(*one.compiled[1][:2], INITIAL, times, brownian(1), 0, blocks, paths)
    with limited_threads(1):
        seconds = least_seconds(
            lambda: integrate(*arguments), lambda: one.sample(y, steps), lambda: one.steps(y, *noise)
        )
    return seconds * 1e9 / (paths * steps)


def main(paths=10_000, steps=100, *schemes):
    """Print the table."""
    print(f"{paths} paths, {steps} steps, one thread: ns per step and path, and multiples of a run")
    for scheme in schemes or SCHEMES:
        run, sample, given = ratios(scheme, paths, steps)
        told = f"sample {sample:6.2f} ({sample / run:.2f})   steps {given:6.2f} ({given / run:.2f})"
        print(f"{scheme:24} run {run:6.2f}   {told}")
    one = spi.Integrator(BODY, "splitting", H, initial=INITIAL)
    y, (dW, _, _) = one.start(LANES), one.noise(LANES, 1)
    (seconds,) = least_seconds(lambda: [one.step(y, dW[0]) for _ in range(100)])
    print(f"one step of {LANES} paths: {1e4 * seconds:.1f} µs")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
