"""From an experiment to its results file: the one path that the command line, Python users and the tests share."""

import contextlib
import json
import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import NUMBERS_DIGEST, __version__, specs, storage
from ..compiler import modules
from ..ensemble.loop import thread_count
from ..exact.work import Work
from ..kinds.plans import KernelCall, Plan, State
from ..models.delegation import undamped
from ..numerics.rng import STREAM_VERSION
from ..storage.records import Group, Results
from . import compiling
from .checkpoint import Checkpoint, Limits, Stopped, as_run, sums_path
from .finding import results_of
from .load import Source, headings, layers, load, load_any, plans, reports, sources
from .workers import Workers, advance_here, advance_with, finalise

__all__ = [
    "Cost",
    "Limits",
    "Progress",
    "Stopped",
    "Watch",
    "cost",
    "headings",
    "layers",
    "load",
    "load_any",
    "plans",
    "reports",
    "results_of",
    "results_path",
    "run",
    "sources",
    "sums_path",
]


class Cost(NamedTuple):
    """What an experiment would cost."""

    path_steps: float  #: steps of all paths, step sizes, schemes and cases together
    seconds: float  #: an estimate; NaN where nothing bounds the work
    megabytes: float
    at_most: bool  #: whether a target may be reached before


#: What a run takes before and after its study, once everything is compiled.
STARTING_SECONDS = 2.0


def cost_of(experiment: specs.Experiment, ready: Sequence[Plan]) -> Cost:
    """What the plans of an experiment would cost."""
    each = [plan.cost() for plan in ready]
    return Cost(
        path_steps=math.fsum(one.path_steps for one in each),
        seconds=STARTING_SECONDS + sum(one.seconds for one in each) / thread_count(),
        megabytes=max(one.bytes for one in each) / 1e6,
        at_most=any(getattr(case, "standard_error", None) is not None for case in experiment.cases),
    )


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
    work: Work | None = None  #: without paths that goes on


class Watch(NamedTuple):
    """Who is told what while a run lasts."""

    report: Callable[[Progress], None] = lambda progress: None  #: how far it is
    #: which kernel is compiled next, of which
    report_compiling: Callable[[compiling.Compiling], None] = lambda news: None
    tell: Callable[[str], None] = lambda news: None  #: what else a person should know
    #: what is about to be computed: its title, and what it would cost from the start
    report_beginning: Callable[[str, Cost], None] = lambda title, cost: None


NOBODY, USUAL = Watch(), Limits()


def run(
    experiment: specs.Experiment,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
    workers: Workers | None = None,
) -> Path:
    """Run an experiment, write its results file and return its path.

    What is known already is not computed again: of an unfinished run, of a finished one, or of parts of either that are
    the same in another spec of this name.  With `fresh` nothing earlier is looked at, and any results are replaced.
    `workers` are processes that compute; without them this one does, on all its threads.

    Raises StorageError if the results cannot be written or are those of another spec, Stopped if interrupted.
    """
    target = results_path(experiment, out)
    if not fresh and (stored := storage.finished(target, identity(experiment))) is not None:
        whose = f", which {storage.computed_by(stored)}" if stored.get("source_digest") != NUMBERS_DIGEST else ""
        watch.tell(f"{target} already has the results of this spec{whose}; use --fresh to recompute them")
        sums = sums_path(experiment, out)
        for path in (target, sums):  # of a run that was killed when its results were there
            storage.remove_leftovers(path)
        if sums.exists():
            with contextlib.suppress(OSError):
                storage.previous(sums).unlink()
        return target
    session = Session(experiment, out, fresh, watch, limits, sums_path(experiment, out))
    checkpoint = session.checkpoint
    if not fresh:
        checkpoint.resume()
    watch.report_beginning(experiment.title, cost_of(experiment, [state.plan for state in checkpoint.states]))
    with checkpoint.saved_at_the_end():
        if checkpoint.missing():
            session.compile()
        if workers is None:
            advance_here(checkpoint.states, session.tick)
        else:
            checkpoint.machines |= workers.machines()
            advance_with(workers, Source.of(experiment), checkpoint.states, session.tick)
            checkpoint.machines |= workers.machines()
        return session.finish()


def results_path(experiment: specs.Experiment, out: str | Path) -> Path:
    """Where the results of an experiment go: ``<out>/<name>.h5``, with profile and overrides in the name."""
    return Path(out) / f"{experiment.results_name}.h5"


class Session:
    """An experiment that is computed: where its results go, and its checkpoint.

    StorageError if either could not be written, or if there are results of another spec and `fresh` does not say that
    they may be replaced.
    """

    def __init__(
        self, experiment: specs.Experiment, out: str | Path, fresh: bool, watch: Watch, limits: Limits, path: Path
    ) -> None:
        self.experiment, self.fresh, self.watch = experiment, fresh, watch
        self.target = results_path(experiment, out)
        storage.check_writable(self.target)
        self.checkpoint = Checkpoint(experiment, path, limits, watch.tell)
        if not fresh:
            self.check_replaceable()
        storage.check_writable(path)

    def check_replaceable(self) -> None:
        """StorageError if there are results that may not be replaced."""
        storage.check_replaceable(self.target, identity(self.experiment), self.checkpoint.sizes)

    def compile(self) -> None:
        """Compile what is missing of all kernels."""
        calls = kernel_calls([state.plan for state in self.checkpoint.states])
        compiling.compile_missing(calls, self.watch.report_compiling)

    def tick(self, number: int) -> None:
        """After each batch of a part: report, and keep what is done if it is time to."""
        self.watch.report(progress_of_part(self.checkpoint.states[number], number, len(self.checkpoint.states)))
        self.checkpoint.tick()

    def finish(self) -> Path:
        """Do what remains once all paths are there, write the results, and remove what they make superfluous."""
        experiment, checkpoint = self.experiment, self.checkpoint
        finalise(checkpoint.states, self.tick)
        replaced = storage.spec_and_sources(self.target)
        groups: list[Group] = []
        for number, state in enumerate(checkpoint.states):
            with state.working(partial(self.tick, number)):
                groups += state.groups()
        try:
            told = {"parts": json.dumps(checkpoint.sizes), "machines": tuple(sorted(checkpoint.machines))}
            attributes = root_attributes(experiment) | told
            # another run may have written there in the meantime
            check = (lambda: None) if self.fresh else self.check_replaceable
            storage.write(self.target, Results(attributes, tuple(groups), checkpoint.chunks()), check)
        except storage.StorageError:
            checkpoint.save(finished=True)  # so that nothing is computed again once this is mended
            raise
        try:
            checkpoint.save(finished=True)
        except storage.StorageError as error:
            self.watch.tell(f"warning: {error}; the results are complete, but more samples would begin anew")
            return self.target
        if replaced not in (None, (experiment.hash, NUMBERS_DIGEST)):
            checkpoint.remove_finished(*replaced)
        storage.previous(checkpoint.path).unlink(missing_ok=True)
        for file in checkpoint.shards().values():
            storage.remove_sums(file)
        return self.target


def kernel_calls(ready: Sequence[Plan]) -> list[tuple[str, KernelCall]]:
    """(name of a scheme, call) for all kernels; schemes first whose steps take long, as they do to compile as well."""

    def of_a_step(plan: Plan) -> float:
        cost = plan.cost()
        return float(np.nan_to_num(cost.seconds / max(cost.path_steps, 1)))

    dearest_first = sorted(ready, key=of_a_step, reverse=True)
    return [(plan.part.scheme, call) for plan in dearest_first for call in plan.kernel_calls()]


def to_compile(experiment: specs.Experiment) -> str:
    """Which kernels a run would have to compile and how long that takes, in words; empty if there are none."""
    jobs = compiling.missing(kernel_calls(plans(experiment)))
    return compiling.described(jobs, compiling.processes_for(jobs)) if jobs else ""


def progress_of_part(state: State, number: int, parts: int) -> Progress:
    """How far part `number` of so many is."""
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
        work=state.work,
    )


def identity(experiment: specs.Experiment) -> dict[str, Any]:
    """The root attributes that say of which spec results are."""
    return {
        "spec": experiment.text,
        "spec_hash": experiment.hash,
        "paths_hash": experiment.paths_hash,
        "samples": experiment.samples,
        "overrides": experiment.overrides,
        "model_sources": json.dumps(dict(experiment.files)) if experiment.files else None,
        "model_code": _code(experiment),
        "expect": experiment.expect,
        "profile": experiment.profile,
        "source_digest": NUMBERS_DIGEST,
    }


def _code(experiment: specs.Experiment) -> str | None:
    """What identifies the code of the models that are not built in, JSON of case and digest; None if there are none."""
    digests = {case.name: modules.digest(type(undamped(case.model))) for case in experiment.cases}
    foreign = {case: digest for case, digest in digests.items() if digest is not None}
    return json.dumps(foreign) if foreign else None


def _stored_modules(experiment: specs.Experiment) -> str | None:
    """The texts of the stored modules of the models, JSON of name and text; None if there are none."""
    classes = {type(undamped(case.model)) for case in experiment.cases}
    texts = {cls.__module__: modules.text_of(cls) for cls in classes if modules.is_stored(cls)}
    return json.dumps(texts, sort_keys=True) if texts else None


def root_attributes(experiment: specs.Experiment) -> dict[str, Any]:
    """All root attributes of the results of an experiment."""
    return {
        **as_run(experiment),
        **identity(experiment),
        "model_modules": _stored_modules(experiment),
        "asks": experiment.asks,
        "figure": experiment.figure,
        "seed": experiment.cases[0].seed,
        "stream_version": STREAM_VERSION,
        "spi_version": __version__,
        "complete": True,
        **storage.provenance(),
    }


def cost(experiment: specs.Experiment) -> Cost:
    """The cost of an experiment from the steps to be taken and typical times of one step."""
    return cost_of(experiment, plans(experiment))
