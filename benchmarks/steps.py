"""ns per step and path of `spi run`, beside a naive Numba loop: python benchmarks/steps.py [model ...] [--schemes ...]

Each line is a spec (below) of the kind `statistics` that looks at a path once, run by `spi.run` on one thread for at
least half a second of processor time, REPEATS times, each time followed by a naive loop of the same scheme (naive.py
where written by hand, otherwise generic.py).  Stated are the median of `ns_per_step` of the results, and the median of
the ratios of a naive step to one of ours that were measured one after the other.  Beside them stand what the program
predicts: the ns of a step that `spi check` counts with, and its seconds and memory against the processor seconds that
the whole of `spi.run` takes.  All times are those of the processor; those of a busy machine are up to a third longer.

Supports: README.md ("Speed, and when not to use it"), docs/performance.md (table of steps), docs/why.md (naive loop),
docs/own_schemes.md (Heun beside the splitting, by `heun`), docs/statistics.md (--every 1 and 4),
docs/appendix/literature_schemes.md (--schemes roessler_rs2 splitting_order2 splitting_symmetric, and those with areas).

Short form: rigid_body --schemes splitting
"""

import argparse
import math
import os
import statistics
import time
from pathlib import Path

import numba
import numpy as np
from examples import TIMED, example, row, why_not
from pairs import PATHS, naive_work
from through_spec import LEAST, long_enough, run, said

STEP, STEPS, REPEATS = "2^-16", 2048, 5
SCHEMES = "splitting", "splitting_order2", "euler_maruyama", "euler_maruyama_renormalised", "midpoint"
HEUN = str(Path(__file__).parents[1] / "experiments" / "schemes" / "heun.py")


def spec(model, scheme, every=None):
    """One look at the end of paths of 2,048 steps, the example of a model; or one after every so many steps."""
    record, initial = example(model)
    parameters = {key: list(value) if isinstance(value, tuple) else value for key, value in record._asdict().items()}
    return {
        "kind": "statistics",
        "model": {"name": model, **parameters},
        "initial": list(initial),
        "final_time": "2^-5",
        "step": STEP,
        **({"every": every} if every else {"times": ["2^-5"], "statistics": ["mean"]}),
        "functions": {"y1": "y1", **({"first": {"passage": "y1 < 0"}} if every else {})},
        "schemes": [scheme],
        **({"compositions": {"heun": {"python": HEUN, "name": "Heun"}}} if scheme == "heun" else {}),
        **({"truncate_noise": True} if scheme != "heun" and row(scheme).needs_truncation else {}),
    }


def naive_loop(model, scheme):
    """A function that takes the processor's ns for a step of the naive twin, or None."""
    if scheme == "heun":
        return None
    record, initial = example(model)
    _, make = naive_work(model, scheme, row(scheme).record, record, initial)
    if make is None:
        return None
    numba.set_num_threads(1)
    steps = 256
    make(4)()
    while seconds(make(steps)) < LEAST / 2:
        steps *= 2
    work = make(steps)
    return lambda: 1e9 * seconds(work) / (PATHS * steps)


def seconds(work):
    numba.set_num_threads(1)
    began = time.process_time()
    work()
    return time.process_time() - began


def line(model, scheme, every=None):
    """Measure one row."""
    wanted = long_enough(spec(model, scheme, every), STEPS)
    told, told_ns = said(wanted)
    loop = None if every else naive_loop(model, scheme)
    ours, taken, ratios = [], [], []
    for _ in range(REPEATS):
        ns, spent = run(wanted)
        ours.append(ns)
        taken.append(spent)
        ratios.append(loop() / ns if loop else math.nan)
    ratio = f"{statistics.median(ratios):.1f} ({min(ratios):.1f} to {max(ratios):.1f})" if loop else ""
    ns = f"{statistics.median(ours):.2f} ({min(ours):.2f} to {max(ours):.2f})"
    print(
        f"{model:24}{scheme:30}{ns:>24}{told_ns:>8.2f}{ratio:>22}   said {told}; took {np.median(taken):.2f} s",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*", metavar="model", help=f"of {', '.join(TIMED)}; default: all")
    parser.add_argument("--schemes", nargs="+", default=SCHEMES, metavar="scheme")
    parser.add_argument("--every", type=int, help="observe after so many steps, with the statistics of the kind")
    options = parser.parse_args()
    if unknown := set(options.models) - set(TIMED):
        parser.error(f"no such model: {', '.join(sorted(unknown))}")
    print(f"load {os.getloadavg()[0]:.1f}; ns per step and path: the median (least to most), predicted, naive / ours")
    for model in options.models or TIMED:
        for scheme in options.schemes:
            if scheme == "heun" or not why_not(scheme, example(model)[0]):
                line(model, scheme, options.every)


if __name__ == "__main__":
    main()
