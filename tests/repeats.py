"""Every experiment in every way in which it can be computed: one set of numbers.

    python tests/repeats.py [SPEC ...]

runs the quick profile of the experiments (all of them), with many small chunks, straight and then

    with one thread; with batches of one block, and with large ones; interrupted after every few batches; in three
    shards that are merged; by two processes, of which one is killed; by two workers of Dask, of which one is killed;
    and extended from a third of the samples, where there are samples,

and prints for each a digest of all numbers that no clock decides.  The exit code is 1 if an experiment has two.
"""

import hashlib
import os
import signal
import sys
import tempfile
from pathlib import Path

from kills import numbers

from spi.ensemble import loop
from spi.running import clusters, shards, workers
from spi.running import run as runner
from spi.running.checkpoint import Shard
from spi.running.run import Stopped, Watch, load
from spi.statistics import tallies

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


class Interruptions:
    """Interrupts a run after every few reports of something new."""

    def __init__(self, after):
        self.after, self.known = after, set()

    def __call__(self, progress):
        place = progress.case, progress.part, progress.done
        if place not in self.known:
            self.known.add(place)
            if len(self.known) % self.after == 0:
                raise KeyboardInterrupt


class Killer:
    """Kills the first of some processes once something is done."""

    def __init__(self, victims):
        self.victims, self.killed = victims, False

    def __call__(self, progress):
        if progress.done and not self.killed:
            self.killed = True
            os.kill(self.victims()[0], signal.SIGKILL)


def straight(experiment, out):
    return runner.run(experiment, out)


def one_thread(experiment, out):
    with loop.limited_threads(1):
        return runner.run(experiment, out)


def with_batches(seconds):
    def run(experiment, out):
        before, loop.BATCH_SECONDS = loop.BATCH_SECONDS, seconds
        try:
            return runner.run(experiment, out)
        finally:
            loop.BATCH_SECONDS = before

    return run


def interrupted(experiment, out):
    stops = Interruptions(7)
    while True:
        try:
            return runner.run(experiment, out, watch=Watch(report=stops))
        except Stopped:
            pass


def in_shards(experiment, out):
    while True:
        for number in (3, 1, 2):
            shards.run_shard(experiment, Shard(number, 3), out)
        try:
            return shards.merge(experiment, out)
        except Stopped:
            pass


def by_processes(experiment, out):
    with workers.processes(2) as pool:
        killer = Killer(lambda: [process.pid for process in pool.processes])
        return runner.run(experiment, out, watch=Watch(report=killer), workers=pool)


def by_dask(experiment, out):
    with clusters.connected("local:2") as pool:
        killer = Killer(lambda: list(pool.client.run(os.getpid).values()))
        return runner.run(experiment, out, watch=Watch(report=killer), workers=pool)


def extended(experiment, out):
    if not any(experiment.samples):
        return None
    prefixes = [number for case in experiment.cases for number in getattr(case, "prefixes", None) or ()]
    few = max([1, min(filter(None, experiment.samples)) // 3, *prefixes])
    runner.run(load(experiment.path, "quick", [f"samples={few}"]), out)
    return runner.run(experiment, out)


WAYS = {
    "straight": straight,
    "1 thread": one_thread,
    "small batches": with_batches(0.0),
    "large batches": with_batches(10.0),
    "interrupted": interrupted,
    "3 shards": in_shards,
    "2 processes": by_processes,
    "Dask": by_dask,
    "extended": extended,
}


def main():
    tallies.CHUNK_WORK = 2**25
    wrong = 0
    for path in map(Path, sys.argv[1:]) if len(sys.argv) > 1 else sorted(EXPERIMENTS.glob("*.yaml")):
        experiment, found = load(path, "quick"), {}
        plans = runner.plans(experiment)
        chunks = sum(len(p.chunks(0)) for plan in plans for p in plan.path_sets(plan.initial_extra()))
        for way, run in WAYS.items():
            with tempfile.TemporaryDirectory() as folder:
                results = run(experiment, Path(folder))
                if results is not None:
                    found[way] = hashlib.sha256(repr(sorted(numbers(results).items())).encode()).hexdigest()[:12]
        wrong += len(set(found.values())) > 1
        told = found["straight"] if len(set(found.values())) == 1 else found
        print(f"{path.stem:32} {chunks:5} chunks, {len(found)} ways: {told}", flush=True)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
