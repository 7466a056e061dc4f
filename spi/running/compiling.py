"""Kernels that are not in the disk cache are compiled side by side, in as many processes as there are processors.

What is to be done lies in a temporary folder, from which this process and the workers take one kernel at a time: who
makes the file of its number first has it.  Nobody depends on a worker: what one does not finish, or cannot even
import, is compiled when it is needed.
"""

import contextlib
import importlib
import os
import pickle
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from .. import scratch_folder
from ..checks.compilable import explained
from ..compiler.inlining import is_compiled, types_of
from ..compiler.modules import is_foreign
from ..compiler.records import record_classes
from . import orphans

_JOBS = "jobs"  # file of the pickled jobs
#: What a worker runs, with the folder as argument; it imports from where this process does.
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

    label: str  #: what it is for, in messages
    module: str
    name: str
    arguments: tuple  #: of a call that has it compiled


def compile_missing(labelled_calls, report=lambda number, total, label: None):
    """Compile what has not been compiled of ``spi.kinds.plans.KernelCall``; `labelled_calls` are (label, call).

    Those that take longest should be first.  `report` is called before this process compiles job `number`, from 1 on,
    of `total`.  Other processes are started only if kernels with more than one label are missing.  Raises
    CompilationError if a model that is no part of this package cannot be compiled.
    """
    jobs = _missing(labelled_calls)
    if not jobs:
        return
    with scratch_folder() as folder, contextlib.ExitStack() as workers:
        if (count := min(len({job.label for job in jobs}), processors()) - 1) and _written(folder, jobs):
            started = [workers.enter_context(_worker(folder)) for _ in range(count)]
        else:
            started = []
        work(folder, jobs, lambda number: report(number, len(jobs), jobs[number - 1].label))
        for worker in started:
            worker.wait()
    for job in _missing(labelled_calls):  # what a worker began and could not finish
        _compile(job)


def processors():
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def physical_memory():
    """The bytes of memory of this machine; None where the system does not tell."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def work(folder, jobs, report=lambda number: None):
    """Compile the jobs that no other process has taken, one after the other; `report` is told their numbers."""
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


def _missing(labelled_calls):
    """The jobs for what has not been compiled, each once."""
    found = {}
    for label, call in labelled_calls:
        types = types_of(call.kernel, call.arguments)
        if types is not None and (call.kernel, types) not in found and not is_compiled(call.kernel, types):
            found[call.kernel, types] = Job(label, call.kernel.__module__, call.kernel.__name__, call.arguments)
    return list(found.values())


def _written(folder, jobs):
    """Write what workers need; False if the jobs hold what only this process knows."""
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
