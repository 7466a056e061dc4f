"""Files of sums that were edited, their checksums and digests being right: a run goes on or begins anew, and ends well.

``damage.py`` tries as many as it is told; ``test_damage.py`` does the same with few.
"""

import contextlib
import copy
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

_SUMS = """
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-4 .. 2^-6
reference_step: 2^-8
schemes: [splitting]
truncate_noise: true
samples: 192
seed: 1
"""
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


def unfinished(folder):
    """(experiment, the file of its sums) of a run that was stopped half way."""
    Path(folder, "s.yaml").write_text(_SUMS, encoding="utf-8")
    experiment = load(Path(folder, "s.yaml"))

    def stop(progress):
        if progress.done >= 128:
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


def sums_main(draw, folder, count):
    """How many of so many edited sums are not dealt with as they should be; says which."""
    with_small_chunks = tallies.CHUNK_WORK, loop.BATCH_SECONDS
    tallies.CHUNK_WORK, loop.BATCH_SECONDS, wrong = 2**19, 0.0, 0
    try:
        experiment, path = unfinished(folder)
        whole = storage.read_sums(path)
        for number in range(count):
            out = folder / str(number)
            right, err = sums_answer(draw, experiment, whole, out)
            wrong += not right
            print("" if right else f"WRONG sums: {err}\n", end="", flush=True)
            shutil.rmtree(out, ignore_errors=True)
    finally:
        tallies.CHUNK_WORK, loop.BATCH_SECONDS = with_small_chunks
    return wrong
