"""Files of sums whose bytes are damaged: a run goes on or begins anew, and has the numbers of one from nothing."""

import contextlib
import re
import shutil
import traceback
from pathlib import Path

from states import sums_files

from spi import storage
from spi.ensemble import loop
from spi.running import run as runner
from spi.running.run import Stopped, Watch, load
from spi.statistics import tallies

_BODY = """
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
samples: 192
seed: 1
"""
#: By kind an experiment whose sums are damaged; with more samples it is that which goes on from them.
SUMS = {
    "strong": """
final_time: 1
steps: 2^-4 .. 2^-6
reference_step: 2^-8
schemes: [splitting]
truncate_noise: true
""",
    "growth": """
step_count: 256
steps: [1/4, 1/8]
schemes: [splitting]
""",
    "equilibrium": """
final_time: 32
steps: [1/4, 1/8]
schemes: [splitting]
functions: {a: y1, b: y3^2}
""",
}


def experiment_of(folder, kind, samples=192):
    """The experiment of a kind."""
    folder.mkdir(parents=True, exist_ok=True)
    body = _BODY.replace("samples: 192\n", "" if kind == "answer" else f"samples: {samples}\n")
    Path(folder, "s.yaml").write_text(f"kind: {kind}{body}{SUMS[kind]}", encoding="utf-8")
    return load(Path(folder, "s.yaml"))


def unfinished(folder, kind="strong"):
    """(experiment, the files of its sums) of a run that was stopped half way."""
    experiment = experiment_of(folder, kind)

    def stop(progress):
        if progress.done >= progress.total / 2:
            raise KeyboardInterrupt

    with contextlib.suppress(Stopped):
        runner.run(experiment, folder, watch=Watch(report=stop))
    return experiment, sorted(sums_files(experiment, folder))


@contextlib.contextmanager
def small_chunks():
    """Within it sums are those of many chunks of few paths."""
    before = tallies.CHUNK_WORK, loop.BATCH_SECONDS
    tallies.CHUNK_WORK, loop.BATCH_SECONDS = 2**19, 0.0
    try:
        yield
    finally:
        tallies.CHUNK_WORK, loop.BATCH_SECONDS = before


def numbers_of(path):
    """The numbers in a file of results but those that clocks told."""
    groups = storage.read(path).groups
    arrays = {f"{group.name}/{name}": each for group in groups for name, each in group.arrays.items()}
    return {name: each.tobytes() for name, each in arrays.items() if not TIMED.search(name)}


TIMED = re.compile("seconds|ns_per_step")


def broken_main(draw, folder, count, kind, damages):
    """How many of so many files of sums, whose bytes are damaged, do not give the bits of a run from nothing.

    Every other is that of an unfinished run, the others are of a finished one with fewer samples.
    """
    wrong = 0
    with small_chunks():
        experiment, paths = unfinished(folder, kind)
        half = {path.name: path.read_bytes() for path in paths}
        runner.run(experiment, folder / "fewer")
        done = {path.name: path.read_bytes() for path in sums_files(experiment, folder / "fewer")}
        more = experiment_of(folder, kind, 320)
        right = [numbers_of(runner.run(one, folder / name)) for name, one in (("more", more), ("same", experiment))]
        for number in range(count):
            one, files = (experiment, half) if number % 2 else (more, done)
            damage, out = draw.choice(damages), folder / str(number)
            (out / "sums").mkdir(parents=True)
            for name, data in sorted(files.items()):
                (out / "sums" / name).write_bytes(damage(draw, data))
            try:
                err = "" if numbers_of(runner.run(one, out)) == right[number % 2] else "other numbers"
            except Exception:
                err = traceback.format_exc()
            wrong += bool(err)
            print(f"WRONG sums of {kind}, {damage.__name__}: {err}\n" if err else "", end="", flush=True)
            shutil.rmtree(out, ignore_errors=True)
    return wrong
