"""Whether this installation works: its versions, its folder of compiled kernels, and a small run."""

import os
import shutil
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .. import CACHE_PROBLEM, __version__, kernels_folder, modules_folder, scratch_folder, storage
from ..checks.compilable import CompilationError
from ..compiler import private, processor
from ..ensemble.loop import thread_count
from ..running.compiling import processors
from ..running.run import NOBODY, Watch, load, run
from ..schemes import typical_ns
from ..storage.records import Group

#: The quick profile of the experiment rigid_body_strong for one scheme, and its strong errors, which depend on the
#: processor in their last bits only, where it has no fused operations.
_SPEC = """\
title: a small run whose numbers are known
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-4 .. 2^-7
reference_step: 2^-10
schemes: [splitting]
truncate_noise: true
samples: 64
seed: 1
"""
_TIMED = "samples=32768"  #: of another run, since starting the kernels takes longer than 64 paths
_ERRORS = (0.0476422936517553, 0.03143293830482381, 0.02082162363269886, 0.013498335308160655)
_TOLERANCE = 1e-9  #: relative
_DRIFT = 1e-12  #: of the Casimir function, which the scheme keeps but for rounding

_SLOWER = 1.5  #: from which factor on predicted times are worth a word
_SLOW = 5.0  #: how many times longer than typical a step may take before that is worth a warning
_LEAST_ROOM = 1e9  #: bytes on the disk of the cache


class Finding(NamedTuple):
    """A fact about the installation, and the remedy if it is a problem; printed as one line."""

    subject: str
    fact: str
    remedy: str = ""  #: nothing if all is well
    sound: bool = True  #: whether the program can be used all the same

    def __str__(self) -> str:
        verdict = "ok" if not self.remedy else "warning" if self.sound else "wrong"
        return f"{verdict:<8} {self.subject:<9} {self.fact}" + (f": {self.remedy}" if self.remedy else "")


def findings(watch: Watch = NOBODY) -> Iterator[Finding]:
    """Facts about this installation, the quick ones first; `watch` follows the small run."""
    about = storage.provenance()
    yield Finding("spi", f"{__version__}, Python {about['machine_python']} on {about['machine_platform']}")
    yield Finding("packages", ", ".join(f"{name} {about[f'machine_{name}']}" for name in ("numba", "numpy", "h5py")))
    yield _vectors(about["machine_processor"])
    yield from _parts()
    yield _threads()
    yield _cache()
    yield from _small_run(watch)


def _vectors(name: str) -> Finding:
    """Vectors for which kernels are compiled, and whether results are those of other processors."""
    fact = f"{name}, {processor.instruction_set()}: {processor.vectors()}"
    remedy = (
        "" if processor.is_fused() else "it has no fused operations, so that last digits differ from other machines"
    )
    return Finding("processor", fact, remedy)


def _parts() -> Iterator[Finding]:
    """Parts of Numba that are left out, each with what is lost."""
    for part in private.left_out():
        missing = ", ".join(private.missing(part))
        fact = f"without {part}, " + (f"as Numba has no {missing}" if missing else f"by {private.VARIABLE}")
        yield Finding("compiler", fact, private.LOST[part])


def _threads() -> Finding:
    threads, count = thread_count(), processors()
    remedy = "" if threads == count else "NUMBA_NUM_THREADS in the environment says how many are used"
    return Finding("threads", f"{threads}, for {count} processors", remedy)


def _cache() -> Finding:
    """Folder and number of compiled kernels, and whether there is room for more."""
    if CACHE_PROBLEM:
        remedy = "every run compiles anew; set SPI_CACHE_DIR to a folder that you can write to"
        return Finding("kernels", CACHE_PROBLEM, remedy)
    kernels = len(list(kernels_folder().rglob("*.nbc")))
    folder = modules_folder().parent
    size, free = sum(path.stat().st_size for path in folder.rglob("*")), shutil.disk_usage(folder).free
    fact = f"{kernels} compiled; {folder} has {size / 1e6:.0f} MB and room for {free / 1e9:.1f} GB"
    return Finding("kernels", fact, "" if free >= _LEAST_ROOM else "free some, or set SPI_CACHE_DIR to another folder")


def _small_run(watch: Watch) -> Iterator[Finding]:
    """Whether a strong study gives the numbers that it should, and the time of a step."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        yield Finding("compiler", "off, by NUMBA_DISABLE_JIT", "unset it, or runs take hundreds of times as long")
        return
    experiment, timed = load("doctor", text=_SPEC), load("doctor", text=_SPEC, overrides=[_TIMED])
    try:
        with scratch_folder() as folder:
            (group,) = storage.read(run(experiment, folder, watch=watch)).groups
            (longer,) = storage.read(run(timed, folder, fresh=True)).groups
    except (CompilationError, OSError, storage.StorageError) as error:
        yield Finding("numbers", f"the small run failed ({error})", "install spi again, in a new environment", False)
        return
    yield _numbers(group)
    (case,) = experiment.cases
    yield _speed(float(np.min(longer.arrays["ns_per_step"])), typical_ns(case.row("splitting"), case.model))


def _numbers(group: Group) -> Finding:
    """Whether the results of the small run are right."""
    off = float(np.max(np.abs(group.arrays["error"] / np.array(_ERRORS) - 1)))
    drift = float(np.max(group.arrays["casimir_drift"]))
    right = off < _TOLERANCE and drift < _DRIFT
    near = f"to {off:.0e}" if off else "to the last bit"
    fact = f"strong errors as known, {near}; Casimir drift {drift:.0e}"
    return Finding("numbers", fact, "" if right else "too much, so do not trust what spi computes here", sound=right)


def _speed(ns: float, typical: float) -> Finding:
    fact = f"{ns:.3g} ns a step and path; {typical:.2g} ns with vectors of 8 at 4 GHz"
    if ns > _SLOWER * typical:
        fact += f", so that runs take about {ns / typical:.1f} times as long as predicted"
    return Finding("speed", fact, "" if ns < _SLOW * typical else "other programs are busy, or vectors are narrow")
