"""What threads, worker processes and parts make of the same work, and what a chunk costs that another process computes.

    python benchmarks/scaling.py [SAMPLES]

Times are wall clock of paths alone (kernels are compiled and processes started before), the best of three, and ratios
to one thread.  A machine with more processors than two takes larger SAMPLES (100000) to tell anything.

Supports: docs/long_runs.md, "Cost". It times the workers of a run, not `spi run`.

Short form: 1000
"""

import os
import sys
import tempfile
import time
from pathlib import Path

from spi.ensemble.loop import use_threads
from spi.kinds.plans import State
from spi.running import shards, workers
from spi.running.checkpoint import Limits, Shard
from spi.running.compiling import processors
from spi.running.load import Source, load, plans
from spi.statistics import tallies

SPEC = Path(__file__).parents[1] / "experiments" / "rigid_body_weak_methods.yaml"
REPEATS = 3


def experiment(samples):
    return load(SPEC, "quick", ["estimators=[plain]", "prefixes=[1]", f"samples={samples}"])


def states(wanted):
    return [State(plan) for plan in plans(wanted)]


def ignore(number):
    """Nobody is told."""


def best(work):
    """The least wall-clock time of several."""
    found = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found)


def in_parts(wanted, count):
    """Wall clock of the longest of `count` parts, computed one after the other, and of merging them."""
    with tempfile.TemporaryDirectory() as folder:
        each = []
        for number in range(1, count + 1):
            began = time.perf_counter()
            shards.run_shard(wanted, Shard(number, count), folder, limits=Limits(1e9))
            each.append(time.perf_counter() - began)
        began = time.perf_counter()
        shards.merge(wanted, folder)
        return max(each), time.perf_counter() - began


def main():
    samples = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
    wanted = experiment(samples)
    cores = processors()
    use_threads(1)
    workers.advance_here(states(experiment(64)), ignore)
    one = best(lambda: workers.advance_here(states(wanted), ignore))
    chunks = sum(len(state.missing()) for state in states(wanted))
    print(f"{cores} processors, load {os.getloadavg()[0]:.1f}; {samples} paths in {chunks} chunks")
    print(f"1 thread                {one:8.2f} s")
    counts = [n for n in (2, 4, 8, 16) if n <= cores]
    for n in counts:
        use_threads(n)
        taken = best(lambda: workers.advance_here(states(wanted), ignore))
        print(f"{n} threads               {taken:8.2f} s  efficiency {one / taken / n:.2f}")
    use_threads(1)
    for n in (1, *counts):
        with workers.processes(n) as pool:
            pool.threads = 1
            workers.advance_with(pool, Source.of(experiment(64 * n)), states(experiment(64 * n)), ignore)
            taken = best(lambda: workers.advance_with(pool, Source.of(wanted), states(wanted), ignore))
        print(f"{n} worker processes      {taken:8.2f} s  efficiency {one / taken / n:.2f}")
    for n in (1, 2, 4):
        longest, merging = in_parts(wanted, n)
        print(
            f"{n} parts                 {longest:8.2f} s  efficiency {one / longest / n:.2f}, merging {merging:.2f} s"
        )
    size = tallies.CHUNK_WORK
    tallies.CHUNK_WORK = size // 64
    many = sum(len(state.missing()) for state in states(wanted))
    with workers.processes(1) as pool:
        pool.threads = 1
        workers.advance_with(pool, Source.of(experiment(64)), states(experiment(64)), ignore)
        taken = best(lambda: workers.advance_with(pool, Source.of(wanted), states(wanted), ignore))
    print(f"{many} chunks in place of {chunks}: {taken:.2f} s, {1e3 * (taken - one) / many:.1f} ms for each")


if __name__ == "__main__":
    main()
