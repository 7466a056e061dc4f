"""Plans that a study hands to the run, one for each part, with the base of all plans of sampled paths.

A part is computed in three steps.  Its paths belong to path sets, which fall into chunks of fixed content
(``spi.statistics.tallies``); a chunk can be computed by any process, and the sums over its paths are added in a
fixed order.  Once all chunks are in, the plan may request further paths, its **next allocation**, as a multilevel
estimator does.  When there are none, its **tasks** are done, work without paths whose answers the state keeps: it
measures times, or solves for expectations.  Results only follow from sums and answers.
"""

import contextlib
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import draw_paths
from spi.ensemble.loop import TimeGrid, arguments_of, grid, integrate, nested_grid, thread_count
from spi.ensemble.observer import casimirs_of_states, empty_invariants, invariants
from spi.ensemble.protocol import casimirs, in_kernels, large, strengths
from spi.ensemble.random_states import RandomState, first_states
from spi.exact.work import Work, reporting_to
from spi.expressions import as_numpy
from spi.models.delegation import depends_on_time
from spi.numerics.rng import LANES
from spi.schemes import Scheme
from spi.specs.noise import parts_of, stream_of
from spi.statistics.tallies import Addable, Chunk, PathSet, Tally, digest
from spi.storage.records import Part
from spi.storage.stored import Description, Stored

# ---------------------------------------------------------------------------------------------------------------------
# The state of a part: the sums that are computed so far.
# ---------------------------------------------------------------------------------------------------------------------


class Nothing(NamedTuple):
    """`extra` of a plan that has no results besides sums over paths."""

    seconds: float = 0.0


class Task(NamedTuple):
    """Work without paths."""

    name: str  #: among those of its part
    run: Callable[[], dict[str, Any]]  #: its answer: arrays, numbers and texts by name


class State:
    """All that is computed so far of a part, enough to go on from."""

    def __init__(self, plan: "Plan") -> None:
        self.plan = plan
        #: results of the plan besides sums over paths, a ``NamedTuple`` with `seconds`
        self.extra: Any = plan.initial_extra()
        #: of the tasks that are done, by their names; each also has `seconds` and `cpu_seconds`
        self.answers: dict[str, dict[str, Any]] = {}
        self.tallies: dict[int, Tally] = {}  #: by the number of the path set
        self.spare: dict[int, Tally] = {}  #: the same, of paths that are stored and not wanted for now
        #: the same, stored ones over all paths that some run wanted, the latest first
        self.former: dict[int, list[Tally]] = defaultdict(list)
        #: by the number of a path set those of other states that have the same sums
        self.alike: dict[int, list[tuple[State, int]]] = {}
        #: of all chunks that were done, by path set and then (index, paths): the last chunk of a set may have grown
        self.digests: dict[int, dict[tuple[int, int], str]] = defaultdict(dict)
        self.work: Work | None = None  #: work without paths that is under way

    @contextlib.contextmanager
    def working(self, tick: Callable[[], None]) -> Iterator[None]:
        """Within the block :attr:`work` is the work without paths under way; `tick` is called whenever it changes."""

        def report(work: Work | None) -> None:
            self.work = work
            if work is not None:
                tick()

        try:
            with reporting_to(report):
                yield
        finally:
            self.work = None

    @property
    def path_sets(self) -> Sequence[PathSet]:
        """Paths that are wanted for now."""
        return self.plan.path_sets(self.extra)

    def tally(self, number: int = 0) -> Tally:
        """Sums over one path set."""
        return self.tallies.get(number) or Tally.empty()

    def total(self, number: int = 0) -> Any:
        """Sums over all paths of a path set; KeyError if some are missing."""
        return self.tally(number).total(self.path_sets[number])

    def so_far(self, number: int = 0) -> Any:
        """Sums over those paths of a path set that are computed."""
        sums = self.tally(number).so_far()
        return self.plan.empty(number) if sums is None else sums

    def missing(self) -> list[Chunk]:
        """Chunks that are wanted and not done, path set by path set."""
        missing = self._missing()
        for number in {chunk.path_set for chunk in missing} & self.alike.keys():
            for state, its in self.alike[number]:
                self._use(number, state.tally(its))
                self.digests[number].update(state.digests[its])
        return self._missing() if missing and self.alike else missing

    def _missing(self) -> list[Chunk]:
        return [
            chunk
            for number, path_set in enumerate(self.path_sets)
            for chunk in path_set.chunks(number)
            if not self.tally(number).has(chunk)
        ]

    def put(self, chunk: Chunk, sums: Addable) -> None:
        """Store the sums over a chunk, so far as it is computed."""
        done = sums.paths == chunk.paths
        if done:
            self.digests[chunk.path_set][chunk.index, chunk.paths] = digest(sums)
        whole = done and chunk.index < self.path_sets[chunk.path_set].whole
        self.tallies[chunk.path_set] = self.tally(chunk.path_set).with_chunk(chunk, sums, whole)

    @property
    def seconds(self) -> float:
        """Wall-clock time spent so far."""
        answers = sum(answer["seconds"] for answer in self.answers.values())
        return float(self.extra.seconds + sum(tally.seconds for tally in self.tallies.values()) + answers)

    def open_tasks(self) -> list[Task]:
        """Tasks that are not done, once all paths are."""
        return [task for task in self.plan.tasks(self) if task.name not in self.answers]

    def perform(self, task: Task) -> None:
        """Do a task and store its answer."""
        began, cpu_began = time.perf_counter(), time.process_time()
        answer = task.run()
        spent = {"seconds": time.perf_counter() - began, "cpu_seconds": time.process_time() - cpu_began}
        self.answers = {**self.answers, task.name: answer | spent}

    def decide(self, extra: Any) -> None:
        """Go on with another `extra`, and with those of the stored sums that are wanted now."""
        self.extra = extra
        for number in tuple(self.spare):
            self._take(number)

    def plain(self, number: int | None) -> dict[str, Any]:
        """Sums of a path set, or for None all else, as dicts, lists, arrays, numbers and texts, for a file."""
        if number is None:
            return {"extra": _plain(self.extra), "answers": self.answers}
        own = self.tally(number)
        whole = not any(chunk.path_set == number for chunk in self._missing())
        former = [tally for tally in self.former[number] if tally.places != own.places][: 1 if whole else 2]
        spare = self.spare.get(number, Tally.empty()).beyond(own)
        tallies = [
            {
                "whole": is_whole,
                "nodes": [[*node, _plain(sums)] for node, sums in tally.nodes.items()],
                "short": [[index, _plain(sums)] for index, sums in tally.short.items()],
            }
            for tally, is_whole in ((own, whole), *((tally, True) for tally in former), (spare, False))
        ]
        return {"tallies": tallies, "digests": [[*chunk, text] for chunk, text in self.digests[number].items()]}

    def merge(self, number: int | None, plain: dict[str, Any]) -> bool:
        """Add what another state of such a part knew, in the form of :meth:`plain`; whether any of it is of use now.

        Sums that include paths that are not wanted are kept for later.  ValueError where some have other shapes.
        """
        if number is None:
            _check_shapes(self.extra, plain["extra"])
            self.answers = {**self.answers, **plain["answers"]}
            self.decide(_rebuilt(self.extra, plain["extra"]))
            return True
        empty = self.plan.empty(number)
        for tally in plain["tallies"]:
            for *_, sums in (*tally["nodes"], *tally["short"]):
                _check_shapes(empty, sums)
        self.digests[number].update({(index, paths): text for index, paths, text in plain["digests"]})
        taken = False
        for tally in plain["tallies"]:
            nodes = {(height, n): _rebuilt(empty, sums) for height, n, sums in tally["nodes"]}
            short = {index: _rebuilt(empty, sums) for index, sums in tally["short"]}
            stored = Tally(nodes, short)
            if tally["whole"]:
                self.former[number].append(stored)
            self.spare[number] = stored.beside(self.spare.get(number, Tally.empty()))
            taken |= self._take(number)
        return taken

    def _take(self, number: int) -> bool:
        """Move stored sums over paths that are wanted to the others; whether there are any."""
        any_used = self._use(number, self.spare[number])
        self.spare[number] = self.spare[number].beyond(self.tally(number))
        return any_used

    def _use(self, number: int, tally: Tally) -> bool:
        """Add those sums over paths of a path set that are wanted; whether there are any."""
        wanted = Tally(self._adopted(number, tally.nodes), self._adopted(number, tally.short))
        wanted = wanted.within(self.path_sets[number])
        if wanted.each:
            self.tallies[number] = self.tally(number).merged(wanted)
        return bool(wanted.each)

    def _adopted(self, number: int, sums: dict[Any, Any]) -> dict[Any, Any]:
        """Sums over paths of a path set, by any key, without those with which the plan cannot go on."""
        adopted = {key: self.plan.adopted(number, value) for key, value in sums.items()}
        return {key: value for key, value in adopted.items() if value is not None}


def _check_shapes(like: Any, plain: dict[str, Any]) -> None:
    """ValueError unless the fields of a record have the shapes of those of `like`, where these are not empty."""
    fields = like._asdict()
    if fields.keys() != plain.keys():
        raise ValueError("other fields")
    for name, value in fields.items():
        if hasattr(value, "_asdict"):
            _check_shapes(value, plain[name])
            continue
        own, other = np.asarray(value), np.asarray(plain[name])
        lengths = zip(own.shape, other.shape, strict=False)
        if own.ndim != other.ndim or any(length not in (0, there) for length, there in lengths):
            raise ValueError(f"other shapes of {name}")
        if own.dtype.kind in "biuf" and other.dtype.kind not in "biuf":
            raise ValueError(f"no numbers in {name}")


def _plain(record: Any) -> dict[str, Any]:
    """Fields of a NamedTuple, and of those within it."""
    return {name: _plain(value) if hasattr(value, "_asdict") else value for name, value in record._asdict().items()}


def _rebuilt(like: Any, plain: dict[str, Any]) -> Any:
    """A NamedTuple like `like`, from the form of :func:`_plain`."""
    inner = {name: _rebuilt(value, plain[name]) for name, value in like._asdict().items() if hasattr(value, "_asdict")}
    return type(like)(**(plain | inner))


class PartCost(NamedTuple):
    """Cost of a part."""

    path_steps: int  #: steps of all paths and step sizes
    seconds: float  #: of one thread at typical speed; NaN where nothing bounds the work
    bytes: int  #: of memory
    kept: int = 0  #: those of them that are needed until all parts are written
    at_most: bool = False  #: whether a target may be reached before


class Done(NamedTuple):
    """Progress of a part."""

    done: float  #: in paths, or in seconds of typical speed
    total: float
    stderr: float  #: standard error of the first error that the study estimates; NaN before there is one


class KernelCall(NamedTuple):
    """A call that makes the compiler compile a kernel, if it has not yet."""

    kernel: Callable  #: a function of a module
    arguments: tuple


@dataclass(frozen=True, kw_only=True)
class Plan:
    """One part of an experiment, ready to run; the kinds implement the methods that are not implemented here."""

    record: ClassVar[type[Stored]]  #: what the plan computes in the end

    case: Any  #: the keys of the case, a subclass of ``spi.specs.cases.BaseCase``
    part: Part

    @classmethod
    def of(cls, case: Any, part: Part) -> Self:
        """Plan for one part of a case."""
        return cls(case=case, part=part)

    def cost(self) -> PartCost:
        """The cost of the part, before it is run."""
        raise NotImplementedError

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """Paths that are wanted for now; `extra` are the results so far besides sums over paths."""
        raise NotImplementedError

    def empty(self, number: int) -> Addable:
        """Sums over no paths of a path set."""
        raise NotImplementedError

    def advance(self, chunks: Sequence[Chunk], started: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set; `started`: the sums over the first paths of the first, or None.

        Yields after each batch of about half a second the chunks that it added to, with their sums so far.
        """
        raise NotImplementedError

    def progress(self, state: State) -> Done:
        """Progress of a state."""
        raise NotImplementedError

    def estimates(self, sums: Any) -> dict[str, Any]:
        """Fields of the record that follow from the sums over all paths of the only path set."""
        raise NotImplementedError

    def results(self, state: State) -> Stored:
        """Results, from the final state, whose sums and answers of tasks are all that they need."""
        return self.record(**(self.whole(state) | self.estimates(state.total())))

    @property
    def model(self) -> Any:
        """Record of the model, as kernels are given it."""
        return in_kernels(self.case.model)

    @property
    def initial(self) -> Any:
        """y_0, a tuple of floats or of a large model an array; or a ``RandomState``."""
        given = self.case.initial
        return np.array(given) if large(self.model) and not isinstance(given, RandomState) else given

    @property
    def is_random(self) -> bool:
        """Whether paths differ: by noise, or by their initial states."""
        return isinstance(self.initial, RandomState) or self.is_noisy

    @property
    def is_noisy(self) -> bool:
        """Whether there is noise of some strength at any time."""
        if depends_on_time(self.model) and not large(self.model):
            return any(sigma is not None for sigma in self.model.sigma)  # a strength such as sin t begins with 0
        return bool(np.any(strengths(self.model)))

    def initial_states(self, first: int, blocks: int) -> np.ndarray:
        """(d, 1), or (d, paths): y_0 of the paths of some blocks, of which each has its own where that is random."""
        return first_states(self.initial, self.stream, first, blocks)

    def initial_casimirs(self, first: int, blocks: int) -> np.ndarray:
        """(C, 1), or (C, paths): the Casimir functions of the initial states."""
        if isinstance(self.initial, RandomState):
            return casimirs_of_states(self.model, self.initial_states(first, blocks))
        return np.array(casimirs(self.model, self.initial))[:, np.newaxis]

    @property
    def phis(self) -> list[Callable]:
        """Test functions of arrays of states."""
        return [as_numpy(tree) for tree in self.case.expressions]

    @property
    def row(self) -> Scheme:
        """Row of the scheme in the table of schemes, with the eps of the part in its record."""
        return self.case.row(self.part.scheme, self.part.eps)

    @property
    def scheme(self) -> Any:
        """Record of the scheme."""
        return self.row.record

    @property
    def of_paths(self) -> "Plan":
        """Plan whose paths these are, see ``spi.running.tracing``: itself, or one that it has for them."""
        return self

    @cached_property
    def stream(self) -> Any:
        """Increments of the paths of the case's seed: a ``RandomStream``, or what a driver has in its place."""
        return stream_of(self.case)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """All that determines the sums over the paths of a path set, except the number of paths, as plain data.

        For None all that determines the other results of the part.  Sums are used again wherever this is the same: the
        keys of the case that affect paths, with those of its compositions that the part uses, and the part.
        """
        used = {self.part.scheme, getattr(self.case, "reference_scheme", None)}
        rows = self.case.model_dump(include={"compositions"}).get("compositions", {})
        own: dict[str, Any] = {"compositions": [[name, rows[name]] for name in sorted(used & rows.keys())]}
        if self.case.noise is not None:
            own["parts"] = parts_of(self.case)
        if self.case.in_parts:  # which the number of paths and other schemes decide, and has random numbers of its own
            own["in_parts"] = True
        return {
            "plan": type(self).__name__,
            "part": self.part,
            "path_set": number,
            **self.case.model_dump(exclude=self.case.neutral),
            **own,
        }

    def paths_on(self) -> list[tuple[TimeGrid, Any]]:
        """Times and increments of the paths of each path set, so far as they are paths of the scheme from y_0 on."""
        return []

    def sizes(self) -> list[int]:
        """Sizes of the part: the paths of each path set at first, or the steps of the only path."""
        return [path_set.samples for path_set in self.path_sets(self.initial_extra())]

    def adopted(self, number: int, sums: Addable) -> Addable | None:
        """Sums over paths of a path set, by this part or a similar one, as this part goes on with them; None if not."""
        return sums

    def description(self) -> Description:
        """Description of the system and scheme that are integrated."""
        return Description.describe(self.case, self.row, self.part)

    def whole(self, state: State) -> dict[str, Any]:
        """Fields that do not follow from sums: description, times, threads, and facts that are keys of the case."""
        keys = [fact for fact in self.record.facts() if fact in type(self.case).model_fields]
        facts = {key: getattr(self.case, key) for key in keys}
        return facts | {"about": self.description(), "wall_seconds": state.seconds, "threads": thread_count()}

    def kernel_calls(self) -> list[KernelCall]:
        """Calls of kernels that the plan makes, with arguments of the very same types but as little work as can be.

        They are made before the plan is run, several at a time, so that nothing needs to be compiled later.  Other
        kernels are compiled when they are needed.
        """
        return []

    def calls_of_a_step(self, times: TimeGrid, stream: Any) -> list[KernelCall]:
        """Kernels of the scheme and the model, which are the same for all kinds of experiments."""
        shortest = times._replace(reference_steps=1 << int(times.doublings[0]))  # a step of each size
        initial = np.array(self.initial)
        step = arguments_of(self.scheme, self.model, initial, shortest, stream.for_a_trial, 0, 1, LANES)
        calls = [KernelCall(integrate, step), KernelCall(invariants, (self.model, *empty_invariants(self.model, 1)))]
        drawing = KernelCall(draw_paths, (stream.keys, 1.0, 0, 0, np.empty((1, 1, 1))))
        return [*calls, drawing] if isinstance(self.initial, RandomState) else calls

    def initial_extra(self) -> Any:
        """The results besides sums over paths before anything is computed: a ``NamedTuple`` with `seconds`."""
        return Nothing()

    def next_allocation(self, state: State) -> Any | None:
        """Once all chunks are in, the new `extra` if it requests further paths; None if nothing is left to compute."""
        return None

    def tasks(self, state: State) -> Sequence[Task]:
        """Work without paths that is done when all paths are, in the calling process alone."""
        return ()


def sums_of_chunk(plan: Plan, chunk: Chunk) -> Addable:
    """Sums over one chunk, computed from its first path on."""
    for added in plan.advance([chunk], None):  # each time with more of its paths
        ((_, sums),) = added
    return sums


def each_scheme(case: Any) -> list[Part]:
    """Parts of a case that are computed one after the other: each scheme, with each eps that it has."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def reference_grid(case: Any, part: Part, steps: Sequence[float], areas: bool = True) -> TimeGrid:
    """Times of a case's paths with steps of these sizes and of that of the reference, all on the same noise.

    Without `areas` the areas of larger steps are those that the increments of the reference make.
    """
    reference = case.reference_record(part.eps)
    schemes = [case.row(part.scheme, part.eps).record, reference]
    terms = fourier_terms(case.model, schemes, case.reference_step, min(case.steps), case.areas) if areas else 0
    return nested_grid(case.final_time, case.reference_step, steps, case.clipping, reference, terms)


def path_grid(case: Any, part: Part, h: float, doublings: Sequence[int] = (0,)) -> TimeGrid:
    """Times of a case's paths with steps of size h, and how its scheme's areas are drawn for them."""
    terms = fourier_terms(case.model, [case.row(part.scheme, part.eps).record], h, areas=case.areas)
    return grid(h, round(case.final_time / h), doublings, truncate=case.clipping, area_terms=terms)
