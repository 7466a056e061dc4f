"""Experiments run from Python, by the same path as from the command line."""

import contextlib
from collections.abc import Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from .. import scratch_folder
from ..ensemble.loop import limited_threads, thread_count
from ..running import run as runs
from ..running.workers import workers_of
from ..specs import SpecError
from .progress import ProgressDisplay
from .results import Results, load
from .specs import experiment_of, in_python, whole


def run(
    what: str | Path | Mapping[str, Any],
    *,
    name: str | None = None,
    profile: str | None = None,
    out: str | Path | None = "results",
    fresh: bool = False,
    threads: int | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    progress: bool | None = None,
    trust_code: bool = False,
    **overrides: Any,
) -> Results:
    """Run an experiment and return its results.

    `what` is a spec file, the name of an experiment that comes with spi (see :func:`spi.experiments`), a results file,
    whose spec, profile and overrides then count, or a mapping with the keys of a spec file.  Values are Python data:
    numbers, texts such as "2^-5 .. 2^-13", lists, mappings, NumPy arrays; ``model`` may also be the name, the class or
    a record of a model.

    Further keywords override keys of the spec, as ``--set`` does: ``samples=1000``, ``schemes=["splitting"]``.  A
    mapping overrides only what it names: ``model={"sigma": [1, 0, 0]}`` keeps the other parameters, and
    ``cases={"strong": {"seed": 7}}`` changes one case.

    Finished results are not recomputed, and the results are written to ``<out>/<name>.h5``; a profile and overrides
    are added to the name, as in ``<name>.quick.e70e6b.h5`` (see :mod:`spi.specs.naming`), and choose the same file for
    ``spi.load``.  By default `name` is that of the spec file; a mapping has none and needs one.  With ``out=None``
    nothing is left on disk.  `fresh` recomputes from scratch.  `threads` is the number of threads; `workers` the number
    of processes on this machine.  `executor`, any of ``concurrent.futures``, computes instead, also on other machines.
    `progress` shows a progress line; by default in a notebook only.

    Python code in a results file is run only if a file at the same path has the same text, or with `trust_code`.

    Raises SpecError if anything is wrong with the spec, StorageError if the results cannot be written or are those of
    another spec; RuntimeError if the executor loses its workers, KeyboardInterrupt if interrupted; progress is then
    saved, and the same call resumes.
    """
    if isinstance(what, Mapping) and name is None and out is not None:
        raise SpecError("spec: name: missing; add name='...' for the results file, or out=None to write none")
    experiment = experiment_of(what, name, profile, overrides, trust_code)
    asked = _workers(workers, executor)
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(scratch_folder()) if out is None else out
        if threads is not None:
            stack.enter_context(limited_threads(whole("threads", threads, 1, thread_count())))
        pool = stack.enter_context(workers_of(asked))
        line = stack.enter_context(ProgressDisplay(experiment.name, progress))
        stack.enter_context(in_python())
        try:
            path = runs.run(experiment, folder, fresh, line.watch, workers=pool)
        except runs.Stopped as stopped:
            message = str(stopped).replace("command", "call") if out is not None else "stopped; nothing is saved"
            raise KeyboardInterrupt(message) from None
        results = load(path)
    return results if out is not None else Results(results.stored)


def _workers(workers: Any, executor: Any) -> int | Executor | None:
    """The one of both that is given, once it is seen to be right."""
    if workers is not None and executor is not None:
        raise SpecError("workers and executor exclude one another; give one of them")
    if executor is None or isinstance(executor, Executor):
        return executor if workers is None else whole("workers", workers, 1)
    kind = type(executor).__name__
    raise SpecError(f"executor: is of type {kind}; must be one of concurrent.futures, such as client.get_executor()")
