"""Runs that are killed at random moments, and commands that are asked to stop: the means of test_kills.py."""

import contextlib
import os
import time
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from states import sums_files

from spi import storage
from spi.running import run as runner
from spi.running.checkpoint import Shard
from spi.running.run import Limits, Stopped, Watch, load

EXPERIMENTS = Path(__file__).parents[1] / "experiments"

#: Kind -> (experiment, overrides): half a second of work or so in many batches.
RUNS = {
    "strong": ("rigid_body_strong", ("samples=6000", "schemes=[splitting, euler_maruyama]")),
    "weak": ("maxwell_bloch_weak2", ("samples=20000", "seconds=0.3", "estimators=[plain, multilevel]")),
    "trajectory": ("rigid_body_qualitative", ()),
    "work_precision": ("maxwell_bloch_work_precision", ("samples=2000",)),
    "stability": ("stability_positivity", ("samples=1000",)),
    "growth": ("stability_long_time", ("step_count=2^16",)),
    "statistics": ("rigid_body_statistics", ("samples=20000",)),
    "lyapunov": ("rigid_body_pullback", ("samples=512", "every=32", "pullback={times: [4, 16, 64], points: 20000}")),
    "answer": ("rigid_body_weak", ("accuracy=3e-3", "sampling=true")),
}
TIMES = ("seconds", "ns_per_step", "level_cost_rate", "threads", "notes")

#: From one checkpoint to the next, at least.
CHECKPOINT_SECONDS = 0.05


def experiment(kind):
    """The experiment of a kind."""
    name, overrides = RUNS[kind]
    path, of_kind = EXPERIMENTS / f"{name}.yaml", load
    if kind == "answer":
        from spi.plugins.answers.running import load_answer as of_kind
    return of_kind(path, "quick", overrides)


def numbers(path):
    """Every number of a results file that no clock decides."""
    found = {}
    for group in storage.read(path).groups:
        for variable, (axes, values) in group.variables.items():
            if not any(time in variable for time in TIMES):
                key = group.case, group.variant, group.estimator, variable
                found[key] = axes, values.shape, np.ascontiguousarray(values).tobytes()
    return found


def run(kind, out, log=None):
    """Run the experiment of a kind with small batches, and write how far it is to a file after each of them."""
    from spi.ensemble import loop
    from spi.running import checkpoint
    from spi.statistics import tallies

    loop.BATCH_SECONDS, tallies.CHUNK_WORK, checkpoint._SHARE = 0.0, 2**23, 1e9
    with open(log or os.devnull, "a", buffering=1) as file:
        watch = Watch(report=lambda progress: file.write(f"{time.time()} {progress.number} {progress.done}\n"))
        runner.run(experiment(kind), out, watch=watch, limits=Limits(checkpoint_seconds=CHECKPOINT_SECONDS))


def killed(kind, out, kills, generator, context):
    """Run an experiment of a kind, killed `kills` times, to its end; how many kills met it at work.

    The first comes as soon as it computes, the others up to 0.3 s later.
    """
    met = 0
    for number in range(kills):
        process = context.Process(target=run, args=(kind, out, Path(out, "log")))
        process.start()
        log = Path(out, "log")
        begun = log.stat().st_size if log.exists() else 0
        deadline = time.monotonic() + 60
        while process.is_alive() and time.monotonic() < deadline and not (log.exists() and log.stat().st_size > begun):
            time.sleep(0.002)  # until it computes
        time.sleep(generator.uniform(0.0, 0.3) if number else 0.0)
        met += process.is_alive()
        process.kill()
        process.join()
        if runner.results_path(experiment(kind), out).exists():
            break
    process = context.Process(target=run, args=(kind, out))
    process.start()
    process.join()
    assert process.exitcode == 0
    return met


def forks():
    """Processes that begin where everything has been imported."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["spi.running.run", *(f"spi.kinds.{kind}.study" for kind in RUNS)])
    return context


def stray(kind, out):
    """Files in a folder that should not be there."""
    wanted = {runner.results_path(experiment(kind), out), *sums_files(experiment(kind), out), Path(out, "log")}
    return sorted({path for path in Path(out).rglob("*") if path.is_file()} - wanted)


class Interruptions:
    """Interrupts a run after every few reports of something new."""

    def __init__(self, after):
        self.after, self.seen = after, set()

    def __call__(self, progress):
        place = progress.case, progress.part, progress.done
        if place not in self.seen:
            self.seen.add(place)
            if len(self.seen) % self.after == 0:
                raise KeyboardInterrupt


def interrupted(experiment, out):
    """The results file of a run that is interrupted again and again."""
    stops = Interruptions(7)
    while True:
        with contextlib.suppress(Stopped):
            return runner.run(experiment, out, watch=Watch(report=stops))


def in_shards(experiment, out):
    """The results file of three shards that are merged, as often as it takes."""
    from spi.plugins.clusters.running import shards

    while True:
        for number in (3, 1, 2):
            shards.run_shard(experiment, Shard(number, 3), out)
        with contextlib.suppress(Stopped):
            return shards.merge(experiment, out)
