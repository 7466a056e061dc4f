"""The table of kernels, to find what bounds them: every model and scheme, beside a naive Numba loop, timed in one run.

    python benchmarks/kernels.py [model ...] [--schemes ...]      by default all, about five minutes
    python benchmarks/kernels.py --special        the same kernels in the situations of the studies, about one minute

Times are ns per step and path, the best of several interleaved repetitions, since machines are noisy; compilation is
not counted.  Naive twins (naive.py where written by hand, otherwise generic.py) run on one thread.  What counts as a
floating-point operation says flops.py; the random numbers of a step are included.

Supports: no page; it is for finding. Times of steps on pages are those of steps.py, through `spi run`.

Short form: lotka_volterra --schemes splitting euler_maruyama
"""

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

# Compiled anew, because only then is there assembly to look at; processes that are started here, which import this
# file under another name, have folders in that of the first one.
_cache = tempfile.TemporaryDirectory(dir=os.environ["SPI_CACHE_DIR"] if __name__ == "__mp_main__" else None)
os.environ["SPI_CACHE_DIR"] = _cache.name

import pairs
import special
from examples import TIMED, example, why_not
from machine import arithmetic_peak, ns_per_normal

from spi.ensemble.protocol import noise_indices
from spi.ensemble.scheme_protocol import substeps
from spi.schemes import SCHEMES

ENOUGH = 10  # times as fast as the naive twin
_PAIRS = {}  # of this process


def compile_pair(key):
    pair = _PAIRS[key] = pairs.Pair(*key)
    return pair.twin, pair.width


def time_pair(key):
    return _PAIRS[key].times()


def compile_all(keys, workers):
    """Every pair in the next free one of some processes: {pair: (process, twin, width)}."""
    left, compiled = iter(keys), {}

    def keep_busy(worker):
        for key in left:
            compiled[key] = worker, *worker.submit(compile_pair, key).result()
            if sys.stderr.isatty():
                print(f"\r{len(compiled)} of {len(keys)} kernels compiled", end="", file=sys.stderr, flush=True)

    with ThreadPoolExecutor(len(workers)) as threads:
        list(threads.map(keep_busy, workers))
    return compiled


class Machine:
    """What bounds a kernel on one core."""

    def __init__(self, flops):
        self.peak, self.ns_per_normal = arithmetic_peak(), ns_per_normal()
        self.flops, self.flops_per_normal = flops, sum(flops["normal"].values())

    def step(self, model, scheme):
        """(flops of a step, ns of its random numbers alone, ns of the rest at the peak)."""
        normals = len(noise_indices(example(model)[0])) * substeps(SCHEMES[scheme].record)
        rest = sum(self.flops[f"{model} {scheme}"].values())
        return normals * self.flops_per_normal + rest, normals * self.ns_per_normal, rest / self.peak

    def describe(self):
        return (
            f"one core: {self.peak:.1f} flops per ns at most (multiply-adds in registers, measured)\n"
            f"random numbers alone: {self.ns_per_normal:.2f} ns and {self.flops_per_normal:.0f} flops per increment; "
            "the integer arithmetic of Philox takes time and counts no flops"
        )


def count_flops(models):
    """The process that counts."""
    command = [sys.executable, str(Path(__file__).with_name("flops.py")), *models]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


HEAD = (
    f"{'scheme':32}{'1 thread':>8}{f'{pairs.THREADS} threads':>10}{'1/2':>6}{'naive':>8}{'':9}{'naive/ours':>10}"
    f"{'vectors':>12}{'flops':>7}{'of peak':>8}"
)


def line(scheme, times, twin, width, flops, peak):
    speedup = times.one_thread / times.more_threads
    ratio = "" if math.isnan(times.naive) else f"{times.naive / times.one_thread:.1f}"
    naive = "" if math.isnan(times.naive) else f"{times.naive:.1f}"
    vectors = f"{width[0]} {width[1]:4.0%}" if width else "none"
    return (
        f"{scheme:32}{times.one_thread:8.2f}{times.more_threads:10.2f}{speedup:6.2f}{naive:>8} {twin or 'no twin':8}"
        f"{ratio:>10}{vectors:>12}{flops:7.0f}{flops / times.one_thread / peak:8.0%}"
    )


def verdict(model, all_times, machine):
    """How much faster than naive the two schemes are that everybody knows, and why not more."""
    parts = []
    for scheme, label in (("splitting", "splitting"), ("euler_maruyama", "Euler-Maruyama")):
        times = all_times[model, scheme]
        ratio = times.naive / times.one_thread
        text = f"{label} " + ("without a naive twin" if math.isnan(ratio) else f"{ratio:.1f}x")
        if ratio < ENOUGH:
            _, random, rest = machine.step(model, scheme)
            text += (
                f" (at most {times.naive / (random + rest):.1f}x: of {times.one_thread:.2f} ns, random numbers alone "
                f"take {random:.2f}, the rest of the flops at the peak {rest:.2f})"
            )
        parts.append(text)
    return f"{model}: {', '.join(parts)} over naive"


def table(models, schemes):
    """Print everything."""
    keys = [(m, s) for m in models for s in schemes if not why_not(s, example(m)[0])]
    counting = count_flops(models)
    context = get_context("spawn")
    workers = [ProcessPoolExecutor(1, mp_context=context) for _ in range(pairs.THREADS)]
    compiled = compile_all(keys, workers)
    machine = Machine(json.loads(counting.communicate()[0]))
    print(f"\n{machine.describe()}\n\nns per step and path\n{HEAD}")
    times = {}
    for model in models:
        print(model)
        for scheme in schemes:
            if reason := why_not(scheme, example(model)[0]):
                print(f"  {scheme:29} not for this model: {reason}")
                continue
            worker, twin, width = compiled[model, scheme]
            times[model, scheme] = worker.submit(time_pair, (model, scheme)).result()
            flops, _, _ = machine.step(model, scheme)
            print(line(f"  {scheme}", times[model, scheme], twin, width, flops, machine.peak), flush=True)
    print()
    for model in models if {"splitting", "euler_maruyama"} <= {*schemes} else ():
        print(verdict(model, times, machine))
    for worker in workers:
        worker.shutdown()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", metavar="model", help=f"of {', '.join(TIMED)}; default: all")
    parser.add_argument("--schemes", nargs="+", default=[*SCHEMES], choices=SCHEMES, metavar="scheme")
    parser.add_argument("--special", action="store_true", help="time the situations of the studies instead")
    options = parser.parse_args()
    if unknown := set(options.models) - set(TIMED):
        parser.error(f"no such model: {', '.join(sorted(unknown))}")
    if options.special:
        special.table()
    else:
        table(options.models or TIMED, options.schemes)


if __name__ == "__main__":
    main()
