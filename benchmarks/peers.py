"""Our schemes beside other SDE solvers, in one run, on one problem: time per path at equal strong error.

The peers are diffrax and torchsde, where they are installed; neither is a dependency.  The problem is the rigid body
with three noises that do not commute.  All programs are fed the same Brownian paths, those of spi's generator, and
their error is the root mean square distance at the final time from one reference, our scheme of the smallest error at a
fine step.

Times count all that a path needs, random numbers included, but not compilation; they are the best of several
interleaved repetitions, since the machine is noisy, and on one thread time of the processor.  Each peer runs in double
precision in the fastest way found, and once more as its documentation shows ("plain").  diffrax: one solve with a batch
as its state, all increments drawn before it; plain: vmap over paths, UnsafeBrownianPath, a matrix of noise fields.
torchsde: g_prod and no matrix, fresh normals at each step; plain: the matrix, and its default, a BrownianInterval.

    python benchmarks/peers.py [--reference 16] [--repeats 7] [error ...]

A time at an error is interpolated between step sizes.  Where the smallest step does not reach the error, it follows
from the order over the four smallest steps, and has a star; it goes as error^-2 for order 1/2, so that the errors'
standard errors count twice in it.

Supports: README.md and docs/why.md (4 to 19 and 8 to 21 times); docs/performance.md, "Peers at equal error" and
"Peers at small errors". It times `integrated`, not `spi run`.

Short form: --reference 11 --repeats 1 1e-2
"""

import argparse
import math
import os
import sys
import time
from contextlib import suppress
from functools import partial
from importlib.metadata import version

import numba
import numpy as np
from peer_problem import BATCH, EXPONENTS, INITIAL, MODEL, PATHS, REFERENCE, Row
from peer_programs import diffrax_rows, torchsde_rows

import spi
from spi.compiler.dispatch import kernel
from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import RandomStream
from spi.ensemble.loop import grid, integrated, paths_of, use_threads
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW, draw_increments
from spi.schemes import SCHEMES

NOISE = RandomStream(np.uint64(1), np.uint64(BROWNIAN))
ERRORS = (0.05, 0.02, 1e-2, 1e-3, 1e-4)  # at which times are compared
REPEATS, SECONDS = 7, 5.0  # at least


@kernel
def draw_block(noise, block, scale, dW):
    """Fill `dW` (steps, 3, LANES) with the increments of the paths of a block."""
    words = np.empty(STEPS_PER_DRAW * LANES, np.uint64)
    for draw in range(len(dW) // STEPS_PER_DRAW):
        rows = dW[draw * STEPS_PER_DRAW :].reshape(-1)
        for k in range(3):
            to, d, b = rows[k * LANES :], np.uint64(draw), np.uint64(block)
            draw_increments(noise.seed, noise.stream, np.uint64(k), d, b, scale, words, to, 3 * LANES)


def our_increments(finest):
    """Increments (steps, 3, PATHS) by exponent of the step size, added up as the ensemble does."""
    blocks, fine = [], np.empty((2**finest, 3, LANES))
    for block in range(PATHS // LANES):
        draw_block(NOISE, block, 2.0 ** (-finest / 2), fine)
        dW = fine
        while len(dW) > 2 ** EXPONENTS[-1]:
            dW = dW[::2] + dW[1::2]
        blocks.append(dW)
    increments = {EXPONENTS[-1]: np.concatenate(blocks, axis=-1)}
    for k in reversed(EXPONENTS[:-1]):
        increments[k] = increments[k + 1][::2] + increments[k + 1][1::2]
    return increments


def our_states(scheme, exponent, paths, doublings=(0,), areas_drawn=False):
    """Last states (step sizes, paths, 3) at the steps 2^doublings 2^-exponent; areas are the path's, or drawn."""
    row, steps = SCHEMES[scheme], 2**exponent
    terms = fourier_terms(MODEL, [row.record], 1.0 / steps) if areas_drawn else 0
    times = grid(1.0 / steps, steps, doublings, row.needs_truncation, area_terms=terms)
    states, _ = integrated(row.record, MODEL, INITIAL, times, NOISE, 0, paths // LANES, paths)
    return paths_of(states, 3).swapaxes(1, 2)


def our_work(scheme, n):
    our_states(scheme, round(math.log2(n)), BATCH["spi"], areas_drawn=True)


def our_rows(finest):
    """The rows of spi, and the last states of the reference."""
    rows, reference = [], None
    schemes = (
        "splitting",
        "euler_maruyama",
        "midpoint",
        "munthe_kaas_euler",
        "munthe_kaas_midpoint",
        "isospectral_midpoint",
        "splitting_areas",
        "munthe_kaas_areas",
    )
    for scheme in schemes:
        *others, last = our_states(scheme, finest, PATHS, (*(finest - k for k in EXPONENTS), 0))
        reference = last if scheme == "munthe_kaas_areas" else reference
        states = dict(zip(EXPONENTS, others, strict=True))  # of the same increments, which need not be fed
        final = lambda dW, states=states: states[round(math.log2(len(dW)))]  # noqa: E731
        rows.append(Row("spi", SCHEMES[scheme].label, final, partial(our_work, scheme)))
    return rows, reference


def all_rows(finest):
    """The rows of spi and of each peer that is installed, and the reference's last states."""
    rows, reference = our_rows(finest)
    print(f"spi {spi.__version__}: {BATCH['spi']} paths at once when timed")
    for name, below, make in ("diffrax", "jax", diffrax_rows), ("torchsde", "torch", torchsde_rows):
        try:
            rows += make()
        except ImportError:
            print(f"{name} is not installed: skipped (pip install {name})")
        else:
            print(f"{name} {version(name)} on {below} {version(below)}: {BATCH[name]} paths at once when timed")
    return rows, reference


def strong_errors(row, increments, reference):
    """Root mean square distances at the final time and their standard errors, (2, step sizes)."""
    squares = np.array([((row.final(increments[k]) - reference) ** 2).sum(axis=1) for k in EXPONENTS])
    error = np.sqrt(squares.mean(axis=1))
    return np.stack([error, squares.std(axis=1) / math.sqrt(PATHS) / (2.0 * error)])


def limit_threads(threads, cpus):
    """Confine all programs to so many threads; a running jax has no setting for it but keeps to its processors."""
    use_threads(threads)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(threads)
    for task in os.listdir("/proc/self/task") if cpus else ():
        with suppress(ProcessLookupError):  # a thread may have ended meanwhile
            os.sched_setaffinity(int(task), cpus[:threads])


def best_times(rows, threads, cpus, least):
    """Microseconds per path (rows, step sizes), the best of interleaved repetitions."""
    limit_threads(threads, cpus)
    clock = time.process_time if threads == 1 and cpus else time.perf_counter
    best = np.full((len(rows), len(EXPONENTS)), np.inf)
    repeats, until = 0, time.perf_counter() + (SECONDS if least > 1 else 0.0)
    while (repeats := repeats + 1) <= least or time.perf_counter() < until:
        for i, row in enumerate(rows):
            for j, k in enumerate(EXPONENTS):
                began = clock()
                row.work(2**k)
                best[i, j] = min(best[i, j], 1e6 * (clock() - began) / BATCH[row.program])
    return best


def print_table(rows, errors, times):
    print(f"\n{'program':10}{'scheme':22}{'h':>5}{'error':>10}{'+-':>9}   us per path,", end="")
    print(" ".join(f"{f'threads: {n}':>12}" for n in times))
    for i, row in enumerate(rows):
        for j, k in enumerate(EXPONENTS):
            error, stderr = errors[i][:, j]
            print(f"{row.program:10}{row.scheme:22}{f'2^-{k}':>5}{error:10.5f}{stderr:9.5f}{'':14}", end="")
            print("".join(f"{t[i, j]:13.3f}" for t in times.values()))


def at_error(target, errors, values):
    """The value where the error is `target`, linear in logarithms between step sizes; by the order below, NaN above."""
    x, y, at = np.log(errors[0, ::-1]), np.log(values[::-1]), math.log(target)
    below = np.polyval(np.polyfit(x[:4], y[:4], 1), at) if at < x[0] else np.nan
    return math.exp(np.interp(at, x, y, left=below, right=np.nan))


def print_ratios(target, rows, errors, times):
    """Times at one error, and their ratios to those of our splitting and of our cheapest scheme there."""
    print(f"\n{f'at error {target:g}':32}{'h':>9} ", end="")
    print("".join(f"{f'us, threads: {n}':>17}{'/ splitting':>13}{'/ cheapest':>12}" for n in times))
    all_h = [at_error(target, e, 2.0 ** -np.array(EXPONENTS)) for e in errors]
    values = [[at_error(target, e, t) for e, t in zip(errors, ts, strict=True)] for ts in times.values()]
    cheapest = [np.fmin.reduce([v for v, row in zip(vs, rows, strict=True) if row.program == "spi"]) for vs in values]
    for i, (row, h) in enumerate(zip(rows, all_h, strict=True)):
        print(f"{row.program:10}{row.scheme:22}", end="")
        if math.isnan(h):
            print("not within these steps")
            continue
        print(f"{h:9.2g}{'*' if target < errors[i][0].min() else ' '}", end="")
        ratios = ((vs[i], vs[i] / vs[0], vs[i] / best) for vs, best in zip(values, cheapest, strict=True))
        print("".join(f"{us:17.3f}{first:13.2f}{best:12.2f}" for us, first, best in ratios))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("errors", type=float, nargs="*", default=ERRORS, help="at which times are compared")
    parser.add_argument("--reference", type=int, default=REFERENCE, help=f"has steps 2^-this; at least {EXPONENTS[-1]}")
    parser.add_argument("--repeats", type=int, default=REPEATS, help="how often a time is taken, at least")
    chosen = parser.parse_args()
    cpus = sorted(os.sched_getaffinity(0)) if sys.platform == "linux" else []
    print(f"rigid body, three noises, to time 1; errors over {PATHS} paths, the same for all programs, against our")
    print(
        f"Munthe-Kaas with areas at h = 2^-{chosen.reference}; times are the best of {chosen.repeats} or more", end=", "
    )
    print("on one thread", end=" ")
    print("time of the processor" if cpus else "wall clock, and jax always has all threads")
    rows, reference = all_rows(chosen.reference)
    increments = our_increments(chosen.reference)
    errors = [strong_errors(row, increments, reference) for row in rows]
    for row in rows:
        for k in EXPONENTS:
            row.work(2**k)  # compile
    times = {n: best_times(rows, n, cpus, chosen.repeats) for n in sorted({1, numba.config.NUMBA_NUM_THREADS})}
    print_table(rows, errors, times)
    for target in chosen.errors:
        print_ratios(target, rows, errors, times)


if __name__ == "__main__":
    main()
