"""The one path from a spec to results, shared by the command line, Python users, the Makefile and the tests."""

import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import __version__, compiling, engine, source_digest, spec, storage
from .checkpoint import Checkpoint, Limits, Slice, Stopped, sums_path
from .ensemble import thread_count
from .kinds.plans import KernelCall, Plan
from .kinds.state import State
from .loading import Source, layers, load, plans
from .records import Results
from .rng import STREAM_VERSION
from .workers import Workers

__all__ = [
    "Cost",
    "Limits",
    "Progress",
    "Slice",
    "Stopped",
    "cost",
    "layers",
    "load",
    "merge",
    "plans",
    "results_of",
    "results_path",
    "run",
    "run_slice",
    "sums_path",
]

#: What a run takes before and after its study, once everything is compiled.
STARTING_SECONDS = 2.0


class Progress(NamedTuple):
    """How far a run is; one is reported before the first and after every batch of paths."""

    case: str
    part: str  #: scheme, and estimator if there are several
    done: float  #: in paths, or in seconds of typical speed
    total: float
    seconds: float  #: wall clock spent on it, including earlier runs
    stderr: float  #: of the error at the largest step and the final time; NaN before there is one
    number: int  #: of this part among all parts of all cases, from 0
    parts: int


class Watch(NamedTuple):
    """Who is told what while a run lasts."""

    report: Callable[[Progress], None] = lambda progress: None  #: how far it is
    #: which of how many kernels is compiled next, and for which scheme
    report_compiling: Callable[[int, int, str], None] = lambda number, total, name: None
    tell: Callable[[str], None] = lambda news: None  #: what else a person should know


NOBODY, USUAL = Watch(), Limits()


def results_path(experiment: spec.Experiment, out: str | Path) -> Path:
    """Where the results of an experiment go: ``<out>/<name>.h5``."""
    return Path(out) / f"{experiment.name}.h5"


def run(
    experiment: spec.Experiment,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
    workers: Workers | None = None,
) -> Path:
    """Run an experiment, write its results file and return its path.

    What is known already is not computed again: of an unfinished run, of a finished one, or of one that differs in the
    number of samples only.  With `fresh` nothing earlier is looked at, and results of another spec are replaced.
    `workers` are processes that compute; without them this one does, on all its threads.

    Raises StorageError if the results cannot be written or are those of another spec, Stopped if interrupted.
    """
    target, checkpoint = _begun(experiment, out, fresh, watch, limits)
    if not fresh:
        if storage.is_finished(target, _identity(experiment)):
            watch.tell(f"{target} holds the results of this very spec; nothing is computed (--fresh does it anew)")
            return target
        checkpoint.resume()
    with checkpoint.kept():
        tick = _tick(checkpoint, watch)
        if checkpoint.missing():
            compiling.compile_missing(
                _kernel_calls([state.plan for state in checkpoint.states]), watch.report_compiling
            )
        if workers is None:
            engine.advance_here(checkpoint.states, tick)
        else:
            engine.advance_with(workers, Source.of(experiment), checkpoint.states, tick)
        engine.finish(checkpoint.states, tick)
        _write(target, checkpoint, fresh)
    return target


def run_slice(
    experiment: spec.Experiment,
    one: Slice,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
) -> Path:
    """Compute one of several parts of what an experiment wants for now, and return the path of the file it is kept in.

    :func:`merge` puts the parts together.  Raises as :func:`run` does.
    """
    _, whole = _begun(experiment, out, fresh, watch, limits)
    checkpoint = Checkpoint(experiment, sums_path(experiment, out, one), limits, watch.tell)
    if not fresh:
        whole.resume()
        checkpoint.take(whole.path)
    mine = set(_slices(checkpoint.states, one.count)[one.number - 1])
    if not fresh:
        checkpoint.take(checkpoint.path, with_more=False)
    with checkpoint.kept():
        if mine.intersection(checkpoint.missing()):
            compiling.compile_missing(
                _kernel_calls([state.plan for state in checkpoint.states]), watch.report_compiling
            )
        engine.advance_stage_here(
            checkpoint.states, _tick(checkpoint, watch), lambda number, chunk: (number, chunk) in mine
        )
        checkpoint.save()
    return checkpoint.path


def merge(
    experiment: spec.Experiment,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
) -> Path:
    """Put the parts that :func:`run_slice` computed together, write the results file and return its path.

    Raises StorageError as :func:`run` does, or if there are no parts; Stopped if some are missing, or if a multilevel
    estimator, now that it knows the variances, wants further paths: then the parts are to be run again.
    """
    target, checkpoint = _begun(experiment, out, fresh, watch, limits)
    checkpoint.resume()
    pattern = f"{checkpoint.path.stem}.part-*-of-*.npz"
    files = {
        Slice(*map(int, file.name.removesuffix(".npz").rsplit(".part-", 1)[1].split("-of-"))): file
        for file in checkpoint.path.parent.glob(pattern)
    }
    for file in files.values():
        checkpoint.take(file, with_more=False)
    with checkpoint.kept():
        _need_all(checkpoint, files, experiment)
        for state in checkpoint.states:
            while not state.missing() and engine.settle(state):
                pass
        if checkpoint.missing():
            checkpoint.save()
            _remove(files.values())
            raise Stopped(
                f"all parts of this round are in, and {len(checkpoint.missing())} further chunks are wanted: "
                f"run all parts of {experiment.path} again, then `spi merge`"
            )
        engine.finish(checkpoint.states, _tick(checkpoint, watch))
        _write(target, checkpoint, fresh)
    _remove(files.values())
    return target


def _need_all(checkpoint: Checkpoint, files: dict[Slice, Path], experiment: spec.Experiment) -> None:
    """Raise Stopped, with the names of the parts to which missing chunks belong, if there are any."""
    missing = set(checkpoint.missing())
    if not missing:
        return
    if not files:
        raise storage.StorageError(
            f"{checkpoint.path.parent}: no parts of {experiment.path} here; `spi run {experiment.path} --part 1/4` "
            "computes the first of four"
        )
    count = max(one.count for one in files)
    lacking = []
    for number, chunks in enumerate(_slices(checkpoint.states, count), 1):
        if left := missing.intersection(chunks):
            state = "unfinished" if Slice(number, count) in files else "missing"
            lacking.append(f"part {number} of {count} is {state} ({len(left)} of its {len(chunks)} chunks)")
    raise Stopped(f"{'; '.join(lacking)}: run it, then `spi merge` again")


def _slices(states: Sequence[State], count: int) -> list[list[tuple[int, Any]]]:
    """The chunks that are wanted for now, in `count` slices of about equal work: (number of a part, chunk)."""
    tasks, work = [], []
    for number, state in enumerate(states):
        for i, stream in enumerate(state.streams):
            for chunk in stream.chunks(i):
                tasks.append((number, chunk))
                work.append(chunk.blocks / stream.chunk_blocks)
    middles = np.cumsum(work) - np.array(work) / 2
    of_task = np.minimum((middles / max(sum(work), 1e-300) * count).astype(int), count - 1)
    return [[task for task, slice_ in zip(tasks, of_task, strict=True) if slice_ == i] for i in range(count)]


def _remove(files: Iterable[Path]) -> None:
    for file in files:
        storage.remove_sums(file)


def _begun(
    experiment: spec.Experiment, out: str | Path, fresh: bool, watch: Watch, limits: Limits
) -> tuple[Path, Checkpoint]:
    """Where the results go, and the checkpoint of the whole; StorageError if either could not be written."""
    target = results_path(experiment, out)
    storage.check_writable(target)
    if not fresh:
        storage.check_replaceable(target, _identity(experiment))
    checkpoint = Checkpoint(experiment, sums_path(experiment, out), limits, watch.tell)
    storage.check_writable(checkpoint.path)
    return target, checkpoint


def _write(target: Path, checkpoint: Checkpoint, fresh: bool) -> None:
    """Keep the sums, write the results, and remove the sums of those results that are replaced."""
    experiment = checkpoint.experiment
    checkpoint.save(finished=True)
    replaced = storage.replaced_hash(target)
    if not fresh:  # another run may have written there in the meantime
        storage.check_replaceable(target, _identity(experiment))
    groups = tuple(state.plan.group(state) for state in checkpoint.states)
    storage.write(target, Results(_attributes(experiment), groups, checkpoint.chunks()))
    if replaced not in (None, experiment.hash):
        old = checkpoint.path.with_name(f"{experiment.name}-{replaced[:12]}.npz")
        if (storage.about_sums(old) or {}).get("finished"):
            storage.remove_sums(old)
    storage.previous(checkpoint.path).unlink(missing_ok=True)


def _compile(checkpoint: Checkpoint, watch: Watch) -> None:
    """Compile what is missing of all kernels."""
    calls = _kernel_calls([state.plan for state in checkpoint.states])
    compiling.compile_missing(calls, watch.report_compiling)


def _tick(checkpoint: Checkpoint, watch: Watch) -> engine.Tick:
    def tick(number: int) -> None:
        watch.report(_progress(checkpoint.states[number], number, len(checkpoint.states)))
        checkpoint.tick()

    return tick


def results_of(spec_path: str | Path, out: str | Path = "results") -> Path:
    """The results file of a spec file; StorageError if there is none or if it was made from another spec.

    Results of a profile or with overrides count as those of the spec file.
    """
    path = Path(out) / f"{Path(spec_path).stem}.h5"
    attributes = storage.read(path).attributes
    if attributes["spec"] != Path(spec_path).read_text(encoding="utf-8"):
        profile = attributes["profile"]
        if load(spec_path, profile).hash != attributes["spec_hash"]:
            raise storage.StorageError(
                f"{path}: holds results of another spec than {spec_path}; run `spi run {spec_path}` first"
            )
    return path


class Cost(NamedTuple):
    """What an experiment would cost."""

    path_steps: float  #: steps of all paths, step sizes, schemes and cases together
    seconds: float  #: an estimate; NaN where nothing bounds the work
    megabytes: float
    at_most: bool  #: whether a target may be reached before


def cost(experiment: spec.Experiment) -> Cost:
    """The cost of an experiment from the steps to be taken and typical times of one step."""
    each = [plan.cost() for plan in plans(experiment)]
    at_most = any(getattr(case, "standard_error", None) is not None for case in experiment.cases)
    return Cost(
        path_steps=math.fsum(one.path_steps for one in each),
        seconds=STARTING_SECONDS + sum(one.seconds for one in each) / thread_count(),
        megabytes=max(one.bytes for one in each) / 1e6,
        at_most=at_most,
    )


def _kernel_calls(ready: Sequence[Plan]) -> list[tuple[str, KernelCall]]:
    """(name of a scheme, call) for all kernels; schemes first whose steps take long, as they do to compile as well."""

    def of_a_step(plan: Plan) -> float:
        cost = plan.cost()
        return float(np.nan_to_num(cost.seconds / max(cost.path_steps, 1)))

    dearest_first = sorted(ready, key=of_a_step, reverse=True)
    return [(plan.part.scheme, call) for plan in dearest_first for call in plan.kernel_calls()]


def _progress(state: State, number: int, parts: int) -> Progress:
    plan, done = state.plan, state.plan.progress(state)
    return Progress(
        case=plan.case.name,
        part=plan.part.name,
        done=done.done,
        total=done.total,
        seconds=state.seconds,
        stderr=done.stderr,
        number=number,
        parts=parts,
    )


def _identity(experiment: spec.Experiment) -> dict[str, Any]:
    """The root attributes that say of which spec results are."""
    return {
        "spec": experiment.text,
        "spec_hash": experiment.hash,
        "paths_hash": experiment.paths_hash,
        "samples": experiment.samples,
        "overrides": experiment.overrides,
        "expect": experiment.expect,
        "profile": experiment.profile,
        "source_digest": source_digest(),
    }


def _attributes(experiment: spec.Experiment) -> dict[str, Any]:
    return {
        **_identity(experiment),
        "kind": experiment.kind,
        "title": experiment.title,
        "figure": experiment.figure,
        "seed": experiment.cases[0].seed,
        "stream_version": STREAM_VERSION,
        "spi_version": __version__,
        "complete": True,
        **storage.provenance(),
    }
