"""Kernels that are not in the disk cache are compiled side by side, in as many processes as there are processors.

The jobs lie in a temporary folder, from which this process and the workers take one kernel at a time: who makes the
file of its number first has it.  Nobody depends on a worker: a kernel that one does not finish, or cannot even import,
is compiled when it is needed.
"""

import contextlib
import importlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from .. import scratch_folder
from ..checks.compilable import explained
from ..compiler.inlining import is_compiled, types_of
from ..compiler.modules import is_foreign
from ..compiler.records import record_classes
from ..ensemble.protocol import dimension, drift_tables, large
from ..ensemble.scheme_protocol import compile_size
from ..printing.text import human_time
from . import orphans

# ---------------------------------------------------------------------------------------------------------------------
# The time to compile a kernel, from its size: processor seconds of a quiet core, within a factor of 2.
#
# The rule is a sum with few coefficients, fitted to what `tests/running/test_compile_seconds.py` records.  A flow of a
# composition is one sweep over the lanes; other schemes write out the field of the whole step in all components.
# ---------------------------------------------------------------------------------------------------------------------

STARTING = 2.0  #: of the first kernel of a process, which loads the compiler
_LOOP = 1.9  # the loop over time, with increments and sums
_SWEEP, _COMPONENT = 0.35, 0.03  # a sweep, and each of its components
_SQUARE = 0.01  # of the field of a step, for the square of the number of components
_ARRAYS = 5.0  # a step of an array-state model, whose flows are loops over arrays
_OTHER = 0.4  # a kernel that takes no steps
_ROW = 4  # components that a sweep with tables counts for, however many rows it has


class Size(NamedTuple):
    """Size of the code of a step."""

    sweeps: int  #: flows of a composition
    components: int  #: of a sweep
    entries: int = 0  #: of the derivative of a field, thrice where it is solved for
    arrays: bool = False  #: whether it is that of an array-state model, where all compositions are one kernel


def seconds_of(kernel: Callable, arguments: tuple) -> float:
    """Processor seconds for a kernel, given the arguments of a call, which for steps begin with scheme and model."""
    return steps_seconds(size_of(*arguments[:2])) if kernel.__name__ == "integrate" else _OTHER


def steps_seconds(size: Size) -> float:
    """Processor seconds for the kernel of a step of this size."""
    flows = size.sweeps * (_SWEEP + _COMPONENT * size.components) + _ARRAYS * size.arrays
    return _LOOP + flows + _SQUARE * size.entries


def size_of(scheme: Any, model: Any) -> Size:
    """:class:`Size` of a step."""
    if large(model):
        return Size(0, 0, arrays=True)
    flows, fields = compile_size(scheme, model)
    if fields:
        return Size(0, 0, fields * dimension(model) ** 2)
    return Size(flows, min(dimension(model), _ROW) if drift_tables(model) else dimension(model))


_JOBS = "jobs"  # file of the pickled jobs
#: The program of a worker, with the folder as argument; it imports from where this process does.
_WORKER = f"""
import pickle, sys
with open(sys.argv[1] + "/{_JOBS}", "rb") as file:
    sys.path[:] = pickle.load(file)
    import {orphans.__name__}, {__name__}
    {orphans.__name__}.end_with(sys.stdin.fileno())
    {__name__}.work(sys.argv[1], pickle.load(file))
"""


class Job(NamedTuple):
    """A kernel to be compiled."""

    label: str  #: its scheme, in messages
    module: str
    name: str
    arguments: tuple  #: of a call that has it compiled
    seconds: float  #: predicted from its size

    @property
    def title(self):
        """Name of the kernel: that of the scheme for its steps, of the function for all others."""
        return self.label if self.name == "integrate" else self.name


class Compiling(NamedTuple):
    """The report before a kernel is compiled."""

    number: int  #: of the kernel, from 1 on
    jobs: tuple[Job, ...]  #: all that were missing at the beginning
    processes: int  #: that compile

    @property
    def title(self):
        return self.jobs[self.number - 1].title

    @property
    def described(self):
        """All kernels with their number and time."""
        return described(self.jobs, self.processes)


def compile_missing(labelled_calls, report=lambda news: None):
    """Compile the kernels of ``spi.kinds.plans.KernelCall`` that are missing; `labelled_calls` are (label, call).

    Those that take longest are first.  `report` is given a :class:`Compiling` before this process compiles a kernel.
    Other processes are started only if kernels with more than one label are missing.  Raises
    CompilationError if a model that is no part of this package cannot be compiled.
    """
    jobs = missing(labelled_calls)
    if not jobs:
        return
    with scratch_folder() as folder, contextlib.ExitStack() as workers:
        if (count := processes_for(jobs) - 1) and _written(folder, jobs):
            started = [workers.enter_context(_worker(folder)) for _ in range(count)]
        else:
            started = []
        work(folder, jobs, lambda number: report(Compiling(number, jobs, 1 + len(started))))
        for worker in started:
            worker.wait()
    for job in missing(labelled_calls):  # those that a worker began and could not finish
        _compile(job)


def processors():
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def physical_memory():
    """Bytes of memory of this machine; None where the system does not tell."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def work(folder, jobs, report=lambda number: None):
    """Compile the jobs that no other process has taken, one after the other, and `report` their numbers."""
    for number, job in enumerate(jobs, 1):
        try:
            Path(folder, str(number)).touch(exist_ok=False)
        except FileExistsError:
            continue
        report(number)
        _compile(job)


def _compile(job):
    """Have one kernel compiled; CompilationError if it fails because of a class that is no part of this package."""
    try:
        getattr(importlib.import_module(job.module), job.name)(*job.arguments)
    except Exception as error:
        types = types_of(getattr(importlib.import_module(job.module), job.name), job.arguments)
        if foreign := [cls for cls in set().union(*map(record_classes, types or ())) if is_foreign(cls)]:
            raise explained(error, foreign) from error
        raise


def processes_for(jobs):
    """Number of processes that compile these: one for each label, at most as many as there are processors."""
    return min(len({job.label for job in jobs}), processors())


def described(jobs, processes):
    """``3 kernels, about 25 s on 2 processors: splitting (25 s), midpoint (9 s), invariants (1 s)``."""
    seconds: dict[str, list[float]] = {}
    for job in jobs:
        seconds.setdefault(job.title, []).append(job.seconds)
    each = [
        f"{title} ({f'{len(s)} kernels, ' if len(s) > 1 else ''}{_rounded(sum(s))})" for title, s in seconds.items()
    ]
    longest, together = max(job.seconds for job in jobs), sum(job.seconds for job in jobs) / processes
    where = f" on {processes} processors" if processes > 1 else ""
    kernels = f"{len(jobs)} kernel{'s' if len(jobs) > 1 else ''}"
    return f"{kernels}, about {_rounded(STARTING + max(longest, together))}{where}: {', '.join(each)}"


def _rounded(seconds):
    return human_time(max(1, round(seconds)))


def missing(labelled_calls):
    """Jobs for all that is not compiled, each once, those that take longest first."""
    jobs = {}
    for label, (kernel, arguments) in labelled_calls:
        types = types_of(kernel, arguments)
        if types is not None and (kernel, types) not in jobs and not is_compiled(kernel, types):
            seconds = seconds_of(kernel, arguments)
            jobs[kernel, types] = Job(label, kernel.__module__, kernel.__name__, arguments, seconds)
    return tuple(sorted(jobs.values(), key=lambda job: -job.seconds))


def _written(folder, jobs):
    """Write the jobs for workers; False if they hold objects of this process alone."""
    with open(Path(folder, _JOBS), "wb") as file:
        try:
            pickle.dump(sys.path, file)
            pickle.dump(jobs, file)
        except (pickle.PicklingError, AttributeError, TypeError):
            return False
    return True


@contextlib.contextmanager
def _worker(folder):
    """A process that compiles; it ends with the block at the latest."""
    silent: dict = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, "-c", _WORKER, folder], **silent) as process:
        try:
            yield process
        finally:
            process.terminate()
