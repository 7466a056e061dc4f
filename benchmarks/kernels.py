"""Our kernels beside a naive Numba loop, in one run: ns per step and path on one and two threads, with ratios.

The naive twin is what one writes first: a scalar loop over paths in prange, np.random.normal, math.sin and math.cos.
Times are the best of several interleaved repetitions, since the machine is noisy; compilation is not counted.
Ours counts everything a path needs: random numbers, increments, angle checks.  Run: python benchmarks/kernels.py
"""

import math
import os
import re
import tempfile
import time

_cache = tempfile.TemporaryDirectory()  # compiled anew, because only then is there assembly to look at
os.environ["SPI_CACHE_DIR"] = _cache.name

import numba
import numpy as np
from numba import njit, prange

from spi.ensemble import Grid, Noise, empty_report, integrate, integrate_block, use_threads
from spi.models.rigid_body import RigidBody
from spi.rng import BROWNIAN, LANES
from spi.schemes import SCHEMES
from spi.studies.strong import StrongSums

REPEATS = 7
MODEL = RigidBody((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0))
INITIAL = (math.cos(1.1), 0.0, math.sin(1.1))


@njit(parallel=True)
def naive(paths, steps, h, inertia, noise_inertia, sigma, initial, out):
    """The splitting scheme slpI for the rigid body with three noises, as one writes it first."""
    root = math.sqrt(h)
    for p in prange(paths):
        y1, y2, y3 = initial[0], initial[1], initial[2]
        for _ in range(steps):
            a = y1 * sigma[0] * root * np.random.normal() / noise_inertia[0]
            c, s = math.cos(a), math.sin(a)
            y2, y3 = c * y2 + s * y3, c * y3 - s * y2
            a = y2 * sigma[1] * root * np.random.normal() / noise_inertia[1]
            c, s = math.cos(a), math.sin(a)
            y3, y1 = c * y3 + s * y1, c * y1 - s * y3
            a = y3 * sigma[2] * root * np.random.normal() / noise_inertia[2]
            c, s = math.cos(a), math.sin(a)
            y1, y2 = c * y1 + s * y2, c * y2 - s * y1
            a = y1 * h / inertia[0]
            c, s = math.cos(a), math.sin(a)
            y2, y3 = c * y2 + s * y3, c * y3 - s * y2
            a = y2 * h / inertia[1]
            c, s = math.cos(a), math.sin(a)
            y3, y1 = c * y3 + s * y1, c * y1 - s * y3
            a = y3 * h / inertia[2]
            c, s = math.cos(a), math.sin(a)
            y1, y2 = c * y1 + s * y2, c * y2 - s * y1
        out[p, 0], out[p, 1], out[p, 2] = y1, y2, y3


def naive_job(paths=2 * LANES, steps=1024, h=2.0**-16):
    arrays = [np.array(x) for x in (*MODEL, INITIAL)]
    out = np.empty((paths, 3))
    return paths * steps, lambda: naive(paths, steps, h, *arrays, out)


def our_job(scheme, blocks=4, steps=8192, h=2.0**-16, truncate=False, doublings=(0,)):
    """The bare ensemble at one step size, or the strong study's pass with several."""
    levels = len(doublings)
    counts = steps >> np.array(doublings)
    points = max(int(counts[1:].sum()), 1)
    sums = StrongSums(
        np.zeros((blocks, points, 8)),
        np.zeros((blocks, levels, 1, LANES)),
        np.zeros((blocks, levels), np.int64),
        np.concatenate(([0, 0], np.cumsum(counts[1:-1])))[:levels].astype(np.int64),
        counts,
        (1.0,),
    )
    grid = Grid(h, steps, np.array(doublings), truncate)
    noise = Noise(np.uint64(1), np.uint64(BROWNIAN))
    record, report = SCHEMES[scheme].record, empty_report(blocks, levels)
    job = (record, MODEL, INITIAL, grid, noise, sums, report, 0, blocks, blocks * LANES)
    return blocks * LANES * steps, lambda: integrate(*job)


JOBS = {
    "naive splitting": naive_job(),
    "splitting": our_job("splitting"),
    "splitting, every angle reduced": our_job("splitting", h=16.0),
    "splitting, truncated noise": our_job("splitting", truncate=True),
    "splitting, strong study (9 coarser steps)": our_job("splitting", truncate=True, doublings=(0, *range(3, 12))),
    "Euler-Maruyama": our_job("euler_maruyama"),
    "midpoint, truncated noise": our_job("midpoint", truncate=True),
}


def best_times(threads):
    """ns per step and path of every job, the best of interleaved repetitions."""
    use_threads(threads)
    best = dict.fromkeys(JOBS, math.inf)
    for _ in range(REPEATS):
        for name, (path_steps, work) in JOBS.items():
            began = time.perf_counter()
            work()
            best[name] = min(best[name], 1e9 * (time.perf_counter() - began) / path_steps)
    return best


def main():
    for _, work in JOBS.values():
        work()  # compile
    most = min(2, numba.config.NUMBA_NUM_THREADS)
    one, two = best_times(1), best_times(most)
    print(
        f"rigid body, three noises; ns per step and path, best of {REPEATS}; per reference step where there are more"
    )
    print(f"{'':44}{'1 thread':>10}{f'{most} threads':>11}{'1 / 2':>8}{'naive / ours':>14}")
    for name in JOBS:
        ratio = one["naive splitting"] / one[name]
        print(f"{name:44}{one[name]:10.2f}{two[name]:11.2f}{one[name] / two[name]:8.2f}{ratio:14.1f}")
    for signature, text in integrate_block.inspect_asm().items():
        wide, narrow = len(re.findall("%zmm", text)), len(re.findall("%ymm", text))
        print(f"{signature[0].name.split('(')[0]:16} registers named in the assembly: zmm {wide}, ymm {narrow}")


if __name__ == "__main__":
    main()
