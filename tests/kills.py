"""Runs that are killed at random moments, again and again, until they come to their end.

    python tests/kills.py [KILLS]

kills runs of every kind of experiment so many times in all (100), and says for each kind whether the results are those
of a run that nobody disturbed, how much work was done more than once, and whether a file was left behind.
"""

import os
import random
import sys
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from spi import storage
from spi.running import runs as runner
from spi.running.runs import Limits, Watch, load

EXPERIMENTS = Path(__file__).parents[1] / "experiments"

#: Kind -> (experiment, overrides): half a second of work or so in many batches.
RUNS = {
    "strong": ("rigid_body_strong", ("samples=6000", "schemes=[splitting, euler_maruyama]")),
    "weak": ("maxwell_bloch_weak2", ("samples=20000", "seconds=0.3", "estimators=[plain, multilevel]")),
    "trajectory": ("rigid_body_qualitative", ()),
    "work_precision": ("maxwell_bloch_work_precision", ("samples=2000",)),
    "stability": ("stability_positivity", ("samples=1000",)),
    "long_time": ("stability_long_time", ()),
}
TIMES = ("seconds", "ns_per_step", "level_cost_rate", "threads", "notes")

#: From one checkpoint to the next, at least.
CHECKPOINT_SECONDS = 0.05


def experiment(kind):
    """The experiment of a kind."""
    name, overrides = RUNS[kind]
    return load(EXPERIMENTS / f"{name}.yaml", "quick", overrides)


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
    """Run an experiment of a kind, killed `kills` times, to its end; how many kills met it at work."""
    met = 0
    for _ in range(kills):
        process = context.Process(target=run, args=(kind, out, Path(out, "log")))
        process.start()
        log = Path(out, "log")
        begun = log.stat().st_size if log.exists() else 0
        deadline = time.monotonic() + 60
        while process.is_alive() and time.monotonic() < deadline and not (log.exists() and log.stat().st_size > begun):
            time.sleep(0.002)  # until it computes
        time.sleep(generator.uniform(0.0, 0.3))
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


def repeated(log):
    """The most seconds of work, between two reports of progress, that were lost by a kill and done again."""
    lines = [line.split() for line in log.read_text().splitlines()]
    lines = [
        (float(when), (int(number), float(done))) for when, number, done in (line for line in lines if len(line) == 3)
    ]
    most = 0.0
    for i, (_, where) in enumerate(lines[1:], 1):
        if where < lines[i - 1][1]:  # a new process, which goes on from an earlier place
            kept = [when for when, place in lines[:i] if place <= where]
            most = max(most, lines[i - 1][0] - max(kept, default=lines[0][0]))
    return most


def forks():
    """Processes that begin where everything has been imported."""
    context = get_context("forkserver")
    context.set_forkserver_preload(["spi.running.runs", *(f"spi.kinds.{kind}.study" for kind in RUNS)])
    return context


def stray(kind, out):
    """Files in a folder that should not be there."""
    wanted = {runner.results_path(experiment(kind), out), runner.sums_path(experiment(kind), out), Path(out, "log")}
    return sorted({path for path in Path(out).rglob("*") if path.is_file()} - wanted)


def main():
    kills = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    context, generator, total = forks(), random.Random(1), 0
    while total < kills:
        for kind in RUNS:
            with tempfile.TemporaryDirectory() as folder:
                whole, out = Path(folder, "whole"), Path(folder, "killed")
                out.mkdir()
                run(kind, whole)
                met = killed(kind, out, 5, generator, context)
                total += met
                path = runner.results_path(experiment(kind), out)
                same = numbers(path) == numbers(runner.results_path(experiment(kind), whole))
                left = stray(kind, out)
                again, verdict = repeated(out / "log"), "the same numbers" if same else "OTHER NUMBERS"
                print(
                    f"{kind:16} killed {met} times, {verdict}, at most {again:.2f} s done again, left: {left}",
                    flush=True,
                )
    print(f"{total} kills")


if __name__ == "__main__":
    main()
