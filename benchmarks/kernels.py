"""Our kernels beside a naive Numba loop, in one run: ns per step and path on one and two threads, with ratios.

The naive twins stand in naive.py.  Times are the best of several interleaved repetitions, since the machine is noisy;
compilation is not counted.  Ours counts everything a path needs: random numbers, increments, angle checks.

    python benchmarks/kernels.py [rigid_body|maxwell_bloch|sine_euler ...]
"""

import math
import os
import re
import sys
import tempfile
import time

_cache = tempfile.TemporaryDirectory()  # compiled anew, because only then is there assembly to look at
os.environ["SPI_CACHE_DIR"] = _cache.name

import naive
import numba
import numpy as np

from spi.ensemble import Noise, empty_report, grid, integrate, integrate_block, use_threads
from spi.estimators import GROUPS
from spi.expressions import parse_expression
from spi.models import MaxwellBloch, RigidBody, SineEuler
from spi.protocol import casimirs
from spi.rng import BROWNIAN, LANES
from spi.schemes import SCHEMES
from spi.studies.strong import StrongSums
from spi.studies.weak import plain
from spi.studies.weak.sums import add_powers, values_of_blocks

REPEATS = 7
STEP = 2.0**-16
RIGID_BODY = RigidBody((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0))
INITIAL = {
    RigidBody: (math.cos(1.1), 0.0, math.sin(1.1)),
    MaxwellBloch: (1.0, 2.0, 3.0),
    SineEuler: (0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1),
}


def naive_job(model, paths=2 * LANES, steps=1024):
    """(path steps, work) of the naive splitting loop."""
    loop = {RigidBody: naive.rigid_body, MaxwellBloch: naive.maxwell_bloch, SineEuler: naive.sine_euler}[type(model)]
    arrays = [np.array(x) for x in (*model, INITIAL[type(model)])]
    out = np.empty((paths, type(model).dimension))
    return paths * steps, lambda: loop(paths, steps, STEP, *arrays, out)


def our_job(scheme, model, h=STEP, truncate=False, doublings=(0,), blocks=4, steps=8192):
    """(path steps, work) of the bare ensemble at one step size, or of the strong study's pass with several."""
    initial, levels = INITIAL[type(model)], len(doublings)
    counts = steps >> np.array(doublings)
    sums = StrongSums(
        np.zeros((blocks, max(int(counts[1:].sum()), 1), 8)),
        np.zeros((blocks, levels, type(model).conserved, LANES)),
        np.zeros((blocks, levels), np.int64),
        np.concatenate(([0, 0], np.cumsum(counts[1:-1])))[:levels].astype(np.int64),
        counts,
        casimirs(model, initial),
    )
    noise = Noise(np.uint64(1), np.uint64(BROWNIAN))
    report = empty_report(blocks, levels)
    times = grid(h, steps, doublings, truncate)
    job = (SCHEMES[scheme].record, model, initial, times, noise, sums, report, 0, blocks, blocks * LANES)
    return blocks * LANES * steps, lambda: integrate(*job)


def weak_job(scheme, model, blocks=64, steps=256):
    """(path steps, work) of the weak study: the bare ensemble, the paper's test function and sums over paths."""
    functions = (parse_expression("sin(2*pi*y1) + sin(2*pi*y2) + sin(2*pi*y3)", type(model).dimension),)
    times, noise = grid(STEP, steps), Noise(np.uint64(1), np.uint64(BROWNIAN))
    plan = plain.Plan(SCHEMES[scheme].record, model, INITIAL[type(model)], times, noise, functions, 0, (), None)

    def work():
        values, _ = values_of_blocks(plan, times, noise, 0, blocks, blocks * LANES)
        add_powers(values.reshape(blocks, -1, LANES), 0, blocks * LANES, np.zeros((2, 1, GROUPS)))

    return blocks * LANES * steps, work


JOBS = {
    "rigid_body": {
        "naive splitting": lambda: naive_job(RIGID_BODY),
        "splitting": lambda: our_job("splitting", RIGID_BODY),
        "  every angle reduced": lambda: our_job("splitting", RIGID_BODY, h=16.0),
        "  truncated noise": lambda: our_job("splitting", RIGID_BODY, truncate=True),
        "  strong study, 9 coarser steps": lambda: our_job(
            "splitting", RIGID_BODY, truncate=True, doublings=(0, *range(3, 12))
        ),
        "  one noise": lambda: our_job("splitting", RIGID_BODY._replace(sigma=(1.0, None, None))),
        "  paths of 256 steps": lambda: our_job("splitting", RIGID_BODY, blocks=64, steps=256),
        "  the same with the weak study": lambda: weak_job("splitting", RIGID_BODY),
        "splitting of weak order 2": lambda: our_job("splitting_order2", RIGID_BODY),
        "Euler-Maruyama": lambda: our_job("euler_maruyama", RIGID_BODY),
        "midpoint, truncated noise": lambda: our_job("midpoint", RIGID_BODY, truncate=True),
    },
    "maxwell_bloch": {
        "naive splitting": lambda: naive_job(MaxwellBloch()),
        "splitting": lambda: our_job("splitting", MaxwellBloch()),
        "  one noise": lambda: our_job("splitting", MaxwellBloch((1.0, None))),
        "splitting of weak order 2": lambda: our_job("splitting_order2", MaxwellBloch()),
        "Euler-Maruyama": lambda: our_job("euler_maruyama", MaxwellBloch()),
    },
    "sine_euler": {
        "naive splitting": lambda: naive_job(SineEuler()),
        "splitting": lambda: our_job("splitting", SineEuler()),
        "  one noise": lambda: our_job("splitting", SineEuler((1.0, None, None, None))),
        "splitting of weak order 2": lambda: our_job("splitting_order2", SineEuler()),
        "Euler-Maruyama": lambda: our_job("euler_maruyama", SineEuler()),
    },
}


def best_times(jobs, threads):
    """ns per step and path of every job, the best of interleaved repetitions."""
    use_threads(threads)
    best = dict.fromkeys(jobs, math.inf)
    for _ in range(REPEATS):
        for name, (path_steps, work) in jobs.items():
            began = time.perf_counter()
            work()
            best[name] = min(best[name], 1e9 * (time.perf_counter() - began) / path_steps)
    return best


def main():
    most = min(2, numba.config.NUMBA_NUM_THREADS)
    print(f"ns per step and path, best of {REPEATS}; per reference step where there are several step sizes")
    print(f"{'':36}{'1 thread':>10}{f'{most} threads':>11}{'1 / 2':>8}{'naive / ours':>14}")
    for model in sys.argv[1:] or JOBS:
        jobs = {name: job() for name, job in JOBS[model].items()}
        for _, work in jobs.values():
            work()  # compile
        one, two = best_times(jobs, 1), best_times(jobs, most)
        print(model)
        for name in jobs:
            ratio = one["naive splitting"] / one[name]
            print(f"  {name:34}{one[name]:10.2f}{two[name]:11.2f}{one[name] / two[name]:8.2f}{ratio:14.1f}")
    print("vector registers named in the assembly of the block kernels")
    for signature, text in integrate_block.inspect_asm().items():
        scheme, model = (t.name.split("(")[0] for t in signature[:2])
        print(f"  {scheme:14} {model:13} zmm {len(re.findall('%zmm', text)):6} ymm {len(re.findall('%ymm', text)):6}")


if __name__ == "__main__":
    main()
