"""`spi run` beside other SDE solvers on one problem: time per path at equal strong error.

    python benchmarks/peers.py [--reference 16] [--repeats 7] [error ...]

The peers are diffrax and torchsde, where they are installed; neither is a dependency.  The problem is the rigid body
with three noises that do not commute.  Errors of spi, at the final time, are those of a run of the kind `strong`: each
scheme against itself at the smallest step.  The peers follow the same Brownian paths, the sums of `spi.increments`, and
are compared with `spi.Integrator` by Munthe-Kaas with areas at the smallest step.

Times count all that a path needs, random numbers included, but not compilation; they are processor time of one
thread, the best of several repetitions.  Those of spi are `ns_per_step` of runs of the kind `statistics` that look at
a path once; these are made before and after the peers, and the lesser count.  Each peer runs in double precision in
the fastest way found, and once more as its documentation shows ("plain").  diffrax: one solve with a batch as its
state, all increments drawn before it; plain: vmap over paths, UnsafeBrownianPath, a matrix of noise fields.
torchsde: g_prod and no matrix, fresh normals at each step; plain: the matrix, and its default, a BrownianInterval.

A time at an error is interpolated between step sizes.  Where the smallest step does not reach the error, it follows
from the order over the four smallest steps, and has a star; it goes as error^-2 for order 1/2, so that the errors'
standard errors count twice in it.

Supports: README.md and docs/why.md (times at the same strong error); docs/performance.md, "Peers at equal error" and
"Peers at small errors".

Short form: --reference 11 --repeats 1 1e-2
"""

import argparse
import math
import os
import sys
import time
from contextlib import suppress
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
from peer_programs import BATCH, BODY, EXPONENTS, INITIAL, PATHS, diffrax_rows, torchsde_rows
from through_spec import results, said

import spi

ERRORS = (0.05, 0.02, 1e-2, 1e-3, 1e-4)  # at which times are compared
REFERENCE, REPEATS = 16, 7
PATH_STEPS = 2**25  # of a scheme of ours and a step size: some tenths of a second
AREAS = "munthe_kaas_areas"
SCHEMES = "splitting", "euler_maruyama", "munthe_kaas_euler", "munthe_kaas_midpoint", "splitting_areas", AREAS
IMPLICIT = "midpoint", "isospectral_midpoint"


COMMON = {
    "model": BODY,
    "initial": INITIAL,
    "final_time": 1,
    "cases": [
        {"name": "explicit", "schemes": SCHEMES},
        {"name": "implicit", "schemes": IMPLICIT, "truncate_noise": True},
    ],
}


def errors_spec(reference):
    """Strong errors of each of our schemes against itself."""
    steps = f"2^-{EXPONENTS[0]} .. 2^-{EXPONENTS[-1]}"
    return {**COMMON, "kind": "strong", "steps": steps, "reference_step": f"2^-{reference}", "samples": PATHS}


def times_spec(exponent):
    """Paths of one step size, looked at once."""
    look = {"times": [1], "statistics": ["mean"], "functions": {"y1": "y1"}}
    samples = PATH_STEPS >> exponent
    return {**COMMON, **look, "kind": "statistics", "step": f"2^-{exponent}", "samples": samples}


class Row(NamedTuple):
    """What was measured of a scheme of a program, by step size."""

    program: str
    scheme: str
    error: np.ndarray
    stderr: np.ndarray
    microseconds: np.ndarray  # of a path


def our_rows(reference):
    """The rows of spi, by runs of both specs."""
    found, times = results(errors_spec(reference)), our_times()
    for part, us in zip(found.parts, times, strict=True):
        of = found[part]
        yield Row("spi", of.dataset.attrs["scheme_label"], of.error_final.values, of.error_final_stderr.values, us)


def our_times():
    """Microseconds per path (schemes, step sizes)."""
    began, found = time.process_time(), []
    for k in EXPONENTS:
        run = results(times_spec(k))
        found.append([run[part].dataset.attrs["ns_per_step"] * 2**k / 1e3 for part in run.parts])
    taken = (time.process_time() - began) / len(EXPONENTS)
    print(f"spi {spi.__version__}: times of 2^-{k}: said {said(times_spec(k))[0]}; took {taken:.1f} s, as the others")
    return np.transpose(found)


def increments(reference):
    """Increments (steps, 3, PATHS) by exponent of the step size: sums of the finest, those of a run with seed 1."""
    portion = 2 ** max(reference - 4, reference - EXPONENTS[-1])  # of the finest at a time
    sums = []
    for first in range(0, 2**reference, portion):
        fine = spi.increments(1, PATHS, 2.0**-reference, portion, noises=3, first_step=first)
        sums.append(fine.reshape(-1, 2 ** (reference - EXPONENTS[-1]), PATHS, 3).sum(axis=1))
    found = {EXPONENTS[-1]: np.concatenate(sums).transpose(0, 2, 1)}
    for k in reversed(EXPONENTS[:-1]):
        found[k] = found[k + 1][::2] + found[k + 1][1::2]
    return found


def peer_rows(reference, cpus, repeats):
    """The rows of each peer that is installed."""
    schemes = []
    for name, below, make in ("diffrax", "jax", diffrax_rows), ("torchsde", "torch", torchsde_rows):
        try:
            schemes += make()
        except ImportError:
            print(f"{name} is not installed: skipped (pip install {name})")
        else:
            print(f"{name} {version(name)} on {below} {version(below)}: {BATCH[name]} paths at once when timed")
    if not schemes:
        return []
    exact = spi.Integrator(BODY, AREAS, 2.0**-reference, initial=INITIAL, threads=1)
    last, dW = exact.sample(exact.start(PATHS), 2**reference, seed=1), increments(reference)
    squares = [[((one.final(dW[k]) - last) ** 2).sum(axis=1) for k in EXPONENTS] for one in schemes]
    error = np.sqrt(np.mean(squares, axis=2))
    stderr = np.std(squares, axis=2) / math.sqrt(PATHS) / (2.0 * error)
    times = best_times(schemes, cpus, repeats)
    return [Row(one.program, one.scheme, *rest) for one, *rest in zip(schemes, error, stderr, times, strict=True)]


def best_times(schemes, cpus, repeats):
    """Microseconds per path (schemes, step sizes) on one thread, the best of interleaved repetitions."""
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)
    for task in os.listdir("/proc/self/task") if cpus else ():  # jax has no setting, but keeps to its processors
        with suppress(ProcessLookupError):  # a thread may have ended meanwhile
            os.sched_setaffinity(int(task), cpus[:1])
    clock = time.process_time if cpus else time.perf_counter
    best = np.full((len(schemes), len(EXPONENTS)), np.inf)
    for repeat in range(repeats + 1):  # the first compiles
        for i, one in enumerate(schemes):
            for j, k in enumerate(EXPONENTS):
                began = clock()
                one.work(2**k)
                taken = 1e6 * (clock() - began) / BATCH[one.program]
                best[i, j] = min(best[i, j], taken) if repeat else np.inf
    return best


def at_error(target, row, values):
    """The value where the error is `target`, linear in logarithms between step sizes; by the order below, NaN above."""
    x, y, at = np.log(row.error[::-1]), np.log(values[::-1]), math.log(target)
    below = np.polyval(np.polyfit(x[:4], y[:4], 1), at) if at < x[0] else np.nan
    return math.exp(np.interp(at, x, y, left=below, right=np.nan))


def print_ratios(target, rows):
    """Times at one error, and their ratios to those of our splitting and of our cheapest scheme there."""
    print(f"\n{f'at error {target:g}':37}{'h':>9} {'us':>10}{'/ splitting':>13}{'/ cheapest':>12}")
    times = [at_error(target, row, row.microseconds) for row in rows]
    cheapest = np.nanmin([us for us, row in zip(times, rows, strict=True) if row.program == "spi"])
    for row, us in zip(rows, times, strict=True):
        h, star = at_error(target, row, 2.0 ** -np.array(EXPONENTS)), "*" if target < row.error.min() else " "
        told = f"{h:9.2g}{star}{us:10.3f}{us / times[0]:13.2f}{us / cheapest:12.2f}"
        print(f"{row.program:10}{row.scheme:27}{'not within these steps' if math.isnan(us) else told}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("errors", type=float, nargs="*", default=ERRORS, help="at which times are compared")
    parser.add_argument("--reference", type=int, default=REFERENCE, help=f"has steps 2^-this; at least {EXPONENTS[-1]}")
    parser.add_argument("--repeats", type=int, default=REPEATS, help="how often a time of a peer is taken")
    chosen = parser.parse_args()
    cpus = sorted(os.sched_getaffinity(0)) if sys.platform == "linux" else []
    print(
        f"rigid body, three noises, {PATHS} paths, smallest step 2^-{chosen.reference}; load {os.getloadavg()[0]:.1f}"
    )
    print("one thread,", "time of the processor" if cpus else "wall clock, and jax always has all threads")
    before = [*our_rows(chosen.reference)]
    peers = peer_rows(chosen.reference, cpus, chosen.repeats)
    pairs = zip(before, our_times() if peers else [np.inf] * len(before), strict=True)
    rows = [*(row._replace(microseconds=np.fmin(row.microseconds, again)) for row, again in pairs), *peers]
    print(f"\n{'program':10}{'scheme':27}{'h':>5}{'error':>10}{'+-':>9}{'us per path':>13}{'ns per step':>13}")
    for program, scheme, *columns in rows:
        for k, error, stderr, us in zip(EXPONENTS, *columns, strict=True):
            told = f"{error:10.5f}{stderr:9.5f}{us:13.3f}{1e3 * us / 2**k:13.1f}"
            print(f"{program:10}{scheme:27}{f'2^-{k}':>5}{told}")
    for target in chosen.errors:
        print_ratios(target, rows)


if __name__ == "__main__":
    main()
