"""Files of sums that were edited, with right checksums and digests: a run goes on or begins anew, and ends well."""

import contextlib
import copy
import re
import shutil
import traceback
from pathlib import Path
from types import SimpleNamespace

import numpy as np

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
    "equilibrium": """
final_time: 32
steps: [1/4, 1/8]
schemes: [splitting]
functions: {a: y1, b: y3^2}
""",
    "statistics": """
final_time: 1
step: 2^-4
schemes: [splitting]
functions: {a: y1, b: y3^2}
statistics: [mean, variance, covariance, quantiles, histogram]
autocorrelation: {a: 1/2}
density: {of: [a, b], cells: 4}
""",
    "lyapunov": """
final_time: 2
step: 2^-4
schemes: [splitting]
pullback: {times: [1, 2], points: 200}
""",
    "answer": """
final_time: 1
schemes: [splitting_order2]
functions: {a: y1, b: y3^2}
accuracy: 5e-2
sampling: true
""",
}
INSTEAD = (
    *(None, -1, 0, 1.5, 2**62, 10**400, float("nan"), True, "x", "", [], {}, [[]], {"a": 1}, [1, 2, "x"]),
    *(np.zeros(0), np.zeros((2, 3)), np.zeros(10**6), np.array(["x"]), np.arange(3), np.full((3, 4), np.nan)),
)


def places_in(value, here=()):
    """The places of all that a structure of dicts and lists holds."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in inner:
        yield (*here, key)
        yield from places_in(one, (*here, key))


def edit_structure(draw, value):
    """Change something in a structure of dicts and lists."""
    place = draw.choice(list(places_in(value)))
    for key in place[:-1]:
        value = value[key]
    what = draw.choice(("value", "value", "remove", "repeat"))
    if what == "value":
        value[place[-1]] = draw.choice(INSTEAD)
    elif what == "remove":
        del value[place[-1]]
    else:
        value[f"{place[-1]}2" if isinstance(value, dict) else 0] = value[place[-1]]


def mend_digests(part):
    """Give sums the digests of what they are now, where that can be done."""
    with contextlib.suppress(Exception):
        for path_set in part["path_sets"]:
            for entry in (*path_set["nodes"], *path_set["short"]):
                entry[-1] = tallies.digest(SimpleNamespace(_asdict=lambda sums=entry[-2]: sums))
            alone = {n: told for height, n, _, told in path_set["nodes"] if height == 0}
            alone |= {n: told for n, _, told in path_set["short"]}
            path_set["digests"] = [[n, paths, alone.get(n, told)] for n, paths, told in path_set["digests"]]


def experiment_of(folder, kind, samples=192):
    """The experiment of a kind."""
    folder.mkdir(parents=True, exist_ok=True)
    body = _BODY.replace("samples: 192\n", "" if kind == "answer" else f"samples: {samples}\n")
    Path(folder, "s.yaml").write_text(f"kind: {kind}{body}{SUMS[kind]}", encoding="utf-8")
    return load(Path(folder, "s.yaml"))


def unfinished(folder, kind="strong"):
    """(experiment, the file of its sums) of a run that was stopped half way."""
    experiment = experiment_of(folder, kind)

    def stop(progress):
        if progress.done >= progress.total / 2:
            raise KeyboardInterrupt

    with contextlib.suppress(Stopped):
        runner.run(experiment, folder, watch=Watch(report=stop))
    return experiment, runner.sums_path(experiment, folder)


def sums_answer(draw, experiment, whole, folder):
    """(whether a run goes on from edited sums or begins anew, and comes to its end, what is wrong)."""
    about, parts = copy.deepcopy(whole)
    edit_structure(draw, about if draw.random() < 0.2 else parts)
    for part in parts.values() if isinstance(parts, dict) and draw.random() < 0.7 else ():
        mend_digests(part)
    path = runner.sums_path(experiment, folder)
    try:
        storage.write_sums(path, about, parts)
    except Exception:  # no file could say so
        return True, ""
    try:
        runner.run(experiment, folder)
    except Stopped as stopped:
        return False, str(stopped)
    except Exception:
        return False, traceback.format_exc()
    return True, ""


@contextlib.contextmanager
def small_chunks():
    """Within it sums are those of many chunks of few paths."""
    before = tallies.CHUNK_WORK, loop.BATCH_SECONDS
    tallies.CHUNK_WORK, loop.BATCH_SECONDS = 2**19, 0.0
    try:
        yield
    finally:
        tallies.CHUNK_WORK, loop.BATCH_SECONDS = before


def sums_main(draw, folder, count, kind="strong"):
    """How many of so many edited sums are not dealt with as they should be; says which."""
    wrong = 0
    with small_chunks():
        experiment, path = unfinished(folder, kind)
        whole = storage.read_sums(path)
        for number in range(count):
            out = folder / str(number)
            right, err = sums_answer(draw, experiment, whole, out)
            wrong += not right
            print("" if right else f"WRONG sums of {kind}: {err}\n", end="", flush=True)
            shutil.rmtree(out, ignore_errors=True)
    return wrong


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
        experiment, path = unfinished(folder, kind)
        half = path.read_bytes()
        runner.run(experiment, folder / "fewer")
        done = runner.sums_path(experiment, folder / "fewer").read_bytes()
        more = experiment_of(folder, kind, 320)
        right = [numbers_of(runner.run(one, folder / name)) for name, one in (("more", more), ("same", experiment))]
        for number in range(count):
            one, data = (experiment, half) if number % 2 else (more, done)
            damage, out = draw.choice(damages), folder / str(number)
            sums = runner.sums_path(one, out)
            sums.parent.mkdir(parents=True)
            sums.write_bytes(damage(draw, data))
            try:
                err = "" if numbers_of(runner.run(one, out)) == right[number % 2] else "other numbers"
            except Exception:
                err = traceback.format_exc()
            wrong += bool(err)
            print(f"WRONG sums of {kind}, {damage.__name__}: {err}\n" if err else "", end="", flush=True)
            shutil.rmtree(out, ignore_errors=True)
    return wrong
