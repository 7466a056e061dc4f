"""From an experiment to its results file: the one path that the command line, Python users and the tests share."""

import json
import math
from collections.abc import Callable, Sequence
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
from ..printing.text import short
from ..specs.naming import results_in
from ..storage.records import StoredResults
from ..storage.stored import gathered
from . import compiling, looks
from .checkpoint import Checkpoint, Limits, Shard, Stopped, note_path, remove_unneeded
from .finding import results_of
from .load import SpecSource, headings, layers, load, load_any, plans, sources
from .workers import Workers, advance_here, advance_with, perform_tasks

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
    "results_of",
    "results_path",
    "run",
    "sources",
]


class Cost(NamedTuple):
    """Cost of an experiment."""

    path_steps: float  #: steps of all paths, step sizes, schemes and cases together
    seconds: float  #: an estimate; NaN where nothing bounds the work
    megabytes: float
    at_most: bool  #: whether a target may be reached before


#: The time of a run before and after its study, once everything is compiled.
STARTING_SECONDS = 2.0
#: The memory of the program itself.
STARTING_BYTES = 220e6
_COPIES = 2  # of what is stored, while it is written


def cost(experiment: specs.Experiment, ready: Sequence[Plan] | None = None) -> Cost:
    """Cost of an experiment from the steps of its plans and typical times of one step."""
    costs = [plan.cost() for plan in ready or plans(experiment)]
    return Cost(
        path_steps=math.fsum(part.path_steps for part in costs),
        seconds=STARTING_SECONDS + sum(part.seconds for part in costs) / thread_count(),
        megabytes=_bytes(costs) / 1e6,
        at_most=any(part.at_most for part in costs),
    )


def _bytes(costs: Sequence[Any]) -> float:
    """Memory of a run: the program, what parts keep, and what one needs besides, or copies when it is written."""
    kept = sum(part.kept for part in costs)
    return STARTING_BYTES + kept + max(_COPIES * kept, *(part.bytes - part.kept for part in costs))


class Progress(NamedTuple):
    """Progress of a run, reported before the first and after every batch of paths."""

    case: str
    part: str  #: scheme, and estimator if there are several
    done: float  #: in paths, or in seconds of typical speed
    total: float
    seconds: float  #: wall clock spent on it, including earlier runs
    stderr: float  #: of the error at the largest step and the final time; NaN before there is one
    number: int  #: of this part among all parts of all cases, from 0
    parts: int
    work: Work | None = None  #: without paths that goes on

    @property
    def place(self) -> str:
        """Part among all, as in ``2/3 main splitting``."""
        return f"{self.number + 1}/{self.parts} {self.case} {self.part}"

    @property
    def precision(self) -> str:
        """Standard error in words; empty before there is one."""
        return "" if math.isnan(self.stderr) else f"standard error {short(self.stderr)}"


class Watch(NamedTuple):
    """Callbacks during a run."""

    report: Callable[[Progress], None] = lambda progress: None  #: the progress of a part
    #: the kernel that is compiled next
    report_compiling: Callable[[compiling.Compiling], None] = lambda news: None
    tell: Callable[[str], None] = lambda news: None  #: all else that a person should know
    #: at the beginning: the title, and the cost from the start
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

    Where only looks or claims of the spec were edited, nothing is computed.  Sums that are there already are not
    computed again, whichever run computed them.  Results of this name of another spec, as before it was edited, or by
    other sources are kept once, see :func:`spi.storage.former`.  With `fresh` nothing earlier is looked at.  `workers`
    are processes that compute; without them this one does, on all its threads.

    Raises StorageError if the results cannot be written, Stopped if interrupted.
    """
    target = results_path(experiment, out)
    if not fresh and (stored := storage.finished(target, identity(experiment))) is not None:
        whose = f", which {storage.computed_by(stored)}" if stored.get("source_digest") != NUMBERS_DIGEST else ""
        watch.tell(f"{target} already has the results of this spec{whose}; use --fresh to recompute them")
        storage.remove_leftovers(target)  # of a run that was killed when its results were there
        storage.remove_leftovers(target.parent / "sums")
        note_path(experiment, out).unlink(missing_ok=True)
        return target
    if not fresh and _only_relooked(experiment, target):
        watch.tell(f"{target} has the numbers of this spec; it now has its title, panels and claims too")
        return target
    session = Session(experiment, out, fresh, watch, limits)
    if not fresh:
        session.resume()
    watch.report_beginning(experiment.title, cost(experiment, [state.plan for state in session.states]))
    with session.saved_at_the_end():
        if session.missing():
            session.compile()
        if workers is None:
            advance_here(session.states, session.batch_done)
        else:
            workers.machines = session.machines  # which are saved with the sums
            advance_with(workers, SpecSource.of(experiment), session.states, session.batch_done)
        return session.finish()


def _only_relooked(experiment: specs.Experiment, target: Path) -> bool:
    """Whether results have all numbers of an experiment; they are then given its looks and claims."""
    new = looks.attributes(experiment)
    if storage.finished(target, {name: it for name, it in identity(experiment).items() if name not in new}) is None:
        return False
    results = storage.read(target)
    if results.attributes.get("source_digest") != NUMBERS_DIGEST:
        return False
    storage.write(target, looks.relooked(results, experiment))
    return True


def results_path(experiment: specs.Experiment, out: str | Path) -> Path:
    """Results file of an experiment: ``<out>/<name>.h5``, see :mod:`spi.specs.naming`.

    SpecError for a name that is that of former results of another.
    """
    if experiment.name.endswith(storage.FORMER):
        called = f"{experiment.name}{experiment.path.suffix}"
        raise specs.SpecError(f"{called}: names that end with {storage.FORMER} are those of former results; rename it")
    return results_in(out, experiment.name, experiment.profile, experiment.overrides)


class Session(Checkpoint):
    """An experiment, or a shard of it, that is computed, and its results file.

    StorageError if a file could not be written, or if the results would replace something else and `fresh` does not
    say that they may.
    """

    def __init__(
        self,
        experiment: specs.Experiment,
        out: str | Path,
        fresh: bool,
        watch: Watch,
        limits: Limits,
        shard: Shard | None = None,
    ) -> None:
        self.fresh, self.watch = fresh, watch
        self.target = results_path(experiment, out)
        storage.check_writable(self.target)
        if not fresh:
            storage.finished(self.target, {})  # no other file is replaced
        super().__init__(experiment, out, limits, watch.tell, shard)
        storage.check_writable(self.note)
        self.replaced: set[str] | None = None  #: the keys of the sums of results that are there no more

    def compile(self) -> None:
        """Compile all kernels that are missing."""
        compiling.compile_missing(kernel_calls([state.plan for state in self.states]), self.watch.report_compiling)

    def batch_done(self, number: int) -> None:
        """After each batch of a part: report, and save what is done if it is time to."""
        self.watch.report(progress_of_part(self.states[number], number, len(self.states)))
        self.tick()

    def finish(self) -> Path:
        """Do what remains once all paths are there, write the results, and remove what they make superfluous."""
        perform_tasks(self.states, self.batch_done)
        records = [state.plan.results(state) for state in self.states]
        try:
            own = {"sums": json.dumps(self.keys_by_part), "machines": tuple(sorted(self.machines))}
            groups = tuple(record.group() for record in gathered(records))
            results = StoredResults(root_attributes(self.experiment) | own, groups, self.chunks())
            storage.write(self.target, results, self.make_room)
        except storage.StorageError:
            self.save()  # so that nothing is computed again once this is mended
            raise
        try:
            self.save(finished=True)
        except storage.StorageError as error:
            self.tell(f"warning: {error}; the results are complete, but more samples would begin anew")
            return self.target
        self.note.unlink(missing_ok=True)
        self.remove_shards()
        if self.replaced is not None:
            self.tell(f"{self.target} is written anew; the former results are in {storage.former(self.target)}")
            remove_unneeded(self.target, self.replaced)
        return self.target

    def make_room(self) -> None:
        """Keep results of another spec, which another run may have written in the meantime."""
        self.replaced = storage.make_room(self.target, identity(self.experiment), self.fresh)


def kernel_calls(ready: Sequence[Plan]) -> list[tuple[str, KernelCall]]:
    """(name of a scheme, call) for all kernels; schemes first whose steps take long, as they do to compile as well."""

    def of_a_step(plan: Plan) -> float:
        cost = plan.cost()
        return float(np.nan_to_num(cost.seconds / max(cost.path_steps, 1)))

    dearest_first = sorted(ready, key=of_a_step, reverse=True)
    return [(plan.part.scheme, call) for plan in dearest_first for call in plan.kernel_calls()]


def to_compile(experiment: specs.Experiment) -> str:
    """Kernels that a run would have to compile, and the time for that, in words; empty if there are none."""
    jobs = compiling.missing(kernel_calls(plans(experiment)))
    return compiling.described(jobs, compiling.processes_for(jobs)) if jobs else ""


def progress_of_part(state: State, number: int, parts: int) -> Progress:
    """Progress of part `number` of so many."""
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
    """Root attributes that identify the spec of results."""
    return {
        **looks.attributes(experiment),
        "spec_hash": experiment.hash,
        "samples": experiment.samples,
        "model_code": _code(experiment),
        "source_digest": NUMBERS_DIGEST,
    }


def _code(experiment: specs.Experiment) -> str | None:
    """Digests of the code of the models that are not built in, JSON of case and digest; None if there are none."""
    digests = {case.name: modules.digest(type(undamped(case.model))) for case in experiment.cases}
    foreign = {case: digest for case, digest in digests.items() if digest is not None}
    return json.dumps(foreign) if foreign else None


def root_attributes(experiment: specs.Experiment) -> dict[str, Any]:
    """All root attributes of the results of an experiment."""
    classes = {type(undamped(case.model)) for case in experiment.cases}
    texts = {cls.__module__: modules.text_of(cls) for cls in classes if modules.is_stored(cls)}
    return {
        **identity(experiment),
        "model_modules": json.dumps(texts, sort_keys=True) if texts else None,
        "seed": experiment.cases[0].seed,
        "stream_version": STREAM_VERSION,
        "spi_version": __version__,
        "complete": True,
        **storage.provenance(),
    }
