"""Stored results, checked: chunks of paths computed again, and numbers derived again from sums over paths."""

import random
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from .. import NUMBERS_DIGEST, specs, storage
from ..kinds.plans import Plan, State, sums_of_chunk
from ..numerics.rng import STREAM_VERSION
from ..statistics.tallies import Chunk, PathSet, digest
from ..storage import StorageError
from ..storage.records import Group, Results
from .checkpoint import as_run
from .load import load_stored, name_of, plans
from .run import identity
from .workers import advance_here, finalise

#: Root attributes that say why numbers may differ in their last digits, and what to call them.
CAUSES = {
    "source_digest": "source code of spi",
    "stream_version": "version of the random numbers",
    "machine_instruction_set": "instruction set",
    "machine_fused_operations": "fused operations",
    "machine_processor": "processor",
    "machine_numba": "version of Numba",
    "machine_numpy": "version of NumPy",
    "machine_python": "version of Python",
}

Report = Callable[[int, int, str], None]  #: which of how many chunks comes next, and what it is called


class Which(NamedTuple):
    """A chunk of paths among those of all parts."""

    part: str  #: "case/scheme", ...
    path_set: int
    number: int  #: of the chunk within its path set
    paths: int

    @classmethod
    def of(cls, plan: Plan, chunk: Chunk) -> "Which":
        """A chunk of a plan."""
        return cls(name_of(plan), chunk.path_set, chunk.index, chunk.paths)


class Verification(NamedTuple):
    """What came out."""

    chunks: int  #: how many there are
    checked: tuple[str, ...]  #: those that were computed again: "case/part, paths from to"
    different: tuple[str, ...]  #: those among them that came out different
    wrong: tuple[str, ...]  #: what else is not as it should be, in one line each
    sums: Path | None  #: the file of sums over paths from which all numbers were derived again; None if there is none
    tied: int  #: how many chunks were computed again together with all those with which the file has them in one sum
    causes: tuple[str, ...]  #: what is not as it was when the results were computed

    @property
    def whole(self) -> bool:
        """Whether every chunk was computed again, and from them every number but times."""
        return len(self.checked) == self.chunks > 0

    @property
    def sound(self) -> bool:
        """Whether nothing was found."""
        return not (self.different or self.wrong)


def verify(
    path: str | Path,
    chunks: int | None,
    report: Report = lambda number, total, name: None,
    trust_code: bool = False,
) -> Verification:
    """Compute chunks of stored results again and compare their sums to the last bit: so many at random, None for all.

    All numbers are derived again and compared, from the sums over paths if their file lies beside the results, and but
    for times from the paths if all of them are computed.  `report` is told which of how many chunks comes next.

    Raises StorageError if the file is no results file, or if its spec now means something else.  Python code in the
    file is run only where :func:`load_stored` says so.
    """
    results = storage.read(path)
    experiment = load_stored(path, trust_code)
    if experiment.hash != results.attributes.get("spec_hash"):
        raise StorageError(f"{path}: its spec means something else to this version of spi; nothing can be compared")
    ready, listed = plans(experiment), _listed(results)
    every = {Which.of(plan, chunk): (plan, chunk) for plan in ready for chunk in _chunks(plan, listed)}
    wrong = [*_not_of_the_spec(experiment, results), *_not_listed(every, listed)]
    causes = _causes(results)
    rounding = _ROUNDING if causes else 0.0
    kept, states = _kept(Path(path), results, ready)
    if kept:
        wrong += [f"{name} does not follow from {kept}" for name in _differing(states, results, rounding, times=True)]
        others = [one for state in states for one, text in _digests(state) if listed.get(one) != text]
        wrong += [f"{kept} has other sums than the results over {_label(one)}" for one in others]
    if chunks is None or chunks >= len(every):
        again = _all_again(ready, len(every), report)
        found = {one: text for state in again for one, text in _digests(state)}
        names = _differing(again, results, rounding, times=False)
        wrong += [f"{name} does not follow from its paths" for name in names]
    else:
        found = _some_again(random.SystemRandom().sample(sorted(every), chunks), every, report)
    return Verification(
        chunks=len(every),
        checked=tuple(_label(one) for one in found),
        different=tuple(_label(one) for one, text in found.items() if listed.get(one, text) != text),
        wrong=tuple(wrong),
        sums=kept,
        tied=sum(_tied(state, found) for state in states),
        causes=causes,
    )


def _listed(results: Results) -> dict[Which, str]:
    """The digests of chunks that a file has; StorageError if they cannot be read."""
    try:
        each = [line.rsplit(" ", 4) for line in results.chunks]
        return {Which(part, *map(int, numbers)): text for part, *numbers, text in each}
    except (TypeError, ValueError):
        raise StorageError("the digests of chunks in the results file are damaged; run the experiment again") from None


def _chunks(plan: Plan, listed: dict[Which, str]) -> Iterator[Chunk]:
    """All chunks that a part must have; where it chose its number of paths, as many as are listed."""
    paths = Counter[int]()
    for one in listed:
        paths[one.path_set] += one.paths * (one.part == name_of(plan))
    for number, least in enumerate(plan.path_sets(plan.initial_extra())):
        yield from PathSet(max(least.samples, paths[number]), least.chunk_blocks).chunks(number)


def _not_listed(every: dict[Which, Any], listed: dict[Which, str]) -> Iterator[str]:
    """What is wrong with the list of chunks, part by part."""
    wanted = Counter(one.part for one in every)
    for part, count in Counter(one.part for one in every if one not in listed).items():
        yield f"{part}: {count} of its {wanted[part]} chunks have no digest"
    for part, count in Counter(one.part for one in listed if one not in every).items():
        yield f"{part}: {count} digests are of no chunk that it has"


def _not_of_the_spec(experiment: specs.Experiment, results: Results) -> Iterator[str]:
    """What the file states of the spec and is not so."""
    told = identity(experiment) | as_run(experiment)
    stated = told | {"seed": experiment.cases[0].seed, "asks": experiment.asks, "figure": experiment.figure}
    for name in ("kind", "seed", "samples", "expect", "title", "asks", "figure", "paths_hash"):
        if stated[name] != results.attributes.get(name):
            yield f"{name} is {results.attributes.get(name)!r}, and by the spec {stated[name]!r}"


def _kept(path: Path, results: Results, ready: Sequence[Plan]) -> tuple[Path | None, list[State]]:
    """The file of sums over the paths of results, beside them, and the states that it knows; None if there is none."""
    of_results = {name: results.attributes.get(name) for name in ("spec_hash", "source_digest")}
    for file in sorted((path.parent / "sums").glob("*.npz")):
        about = storage.about_sums(file)
        if about is None or {name: about.get(name) for name in of_results} != of_results or not about["finished"]:
            continue
        read, states = storage.read_sums(file), [State(plan) for plan in ready]
        try:
            for state in states:
                state.merge((read or ({}, {}))[1][name_of(state.plan)])
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError):
            continue
        if not any(state.missing() for state in states):
            return file, states
    return None, []


def _differing(states: Sequence[State], results: Results, rounding: float, times: bool) -> list[str]:
    """The names of what is otherwise in a file than the results of the same plans from states."""
    return differing([group for state in states for group in state.groups()], results.groups, times, rounding)


def _digests(state: State) -> Iterator[tuple[Which, str]]:
    """The chunks of a state that is complete, with their digests."""
    for number, path_set in enumerate(state.path_sets):
        for chunk in path_set.chunks(number):
            yield Which.of(state.plan, chunk), state.digests[number][chunk.index, chunk.paths]


def _all_again(ready: Sequence[Plan], total: int, report: Report) -> list[State]:
    """All that a run computes, computed again."""
    states = [State(plan) for plan in ready]

    def tick(number: int) -> None:
        done = sum(len(digests) for state in states for digests in state.digests.values())
        report(min(done + 1, total), total, name_of(ready[number]))

    advance_here(states, tick)
    finalise(states, tick)
    return states


def _some_again(chosen: Sequence[Which], every: dict[Which, tuple[Plan, Chunk]], report: Report) -> dict[Which, str]:
    """The digests of some chunks, computed again."""
    found = {}
    for number, one in enumerate(sorted(chosen), 1):
        report(number, len(chosen), _label(one))
        found[one] = digest(sums_of_chunk(*every[one]))
    return found


def _tied(state: State, found: dict[Which, str]) -> int:
    """Of how many chunks all are `found` that a state has in one sum."""
    tied, part = 0, name_of(state.plan)
    for number, path_set in enumerate(state.path_sets):
        whole = {one.number for one in found if (one.part, one.path_set) == (part, number)}
        nodes = [range(n << k, (n + 1) << k) for k, n in state.tally(number).nodes]
        nodes += [range(index, index + 1) for index in state.tally(number).short if index >= path_set.whole]
        tied += sum(len(node) for node in nodes if whole.issuperset(node))
    return tied


def _label(one: Which) -> str:
    return f"{one.part}, {one.paths} paths of chunk {one.number} of path set {one.path_set}"


def _causes(results: Results) -> tuple[str, ...]:
    """What is not as it was."""
    now = {**storage.provenance(), "source_digest": NUMBERS_DIGEST, "stream_version": STREAM_VERSION}
    machines = results.attributes.get("machines") or ()
    others = [one for one in machines if one != storage.machine()] if len(machines) > 1 else []
    found = [
        f"{label}: {results.attributes.get(name)} then, {now[name]} now"
        for name, label in CAUSES.items()
        if results.attributes.get(name) != now[name]
    ]
    return (*found, *(f"one of {len(machines)} machines: {one}" for one in others))


#: What the names of those numbers contain that a clock decides, or the machine at hand.
TIMES = ("seconds", "ns_per_step", "cost_rate")

#: Relative difference of numbers from equal sums where a processor or a version is another, see docs/long_runs.md; else
#: they are equal to the last bit.
_ROUNDING = 1e-9

#: Threads are those of the process that derives.
_OF_ITS_RUN = ("threads",)


def differing(derived: Sequence[Group], stored: Sequence[Group], times: bool, rounding: float = 0.0) -> list[str]:
    """The names of all that is not the same in `stored` as in what was `derived`, times only if they are wanted.

    Numbers may differ by `rounding` times their size.
    """
    mine, theirs = ({group.name: group for group in groups} for groups in (_as_read(derived), stored))
    found = [name for name in (mine | theirs) if name not in mine or name not in theirs]
    for name in mine.keys() & theirs.keys():
        one, other = _plain(mine[name]), _plain(theirs[name])
        keys = [key for key in (one | other) if times or not any(word in key for word in TIMES)]
        found += [f"{name}: {key}" for key in keys if not _same(one.get(key), other.get(key), rounding)]
    return sorted(found)


def _as_read(groups: Sequence[Group]) -> tuple[Group, ...]:
    """Groups as a file gives them back."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "derived.h5"
        storage.write(path, Results({}, tuple(groups)))
        return storage.read(path).groups


def _plain(group: Group) -> dict[str, Any]:
    """All that a group has, by name: (axes, array)."""
    arrays = {name: ((name,), values) for name, values in group.coordinates.items()} | group.variables
    facts = {name: ((), value) for name, value in group.attributes.items() if name not in _OF_ITS_RUN}
    return {f"attribute {name}" if name in arrays else name: fact for name, fact in facts.items()} | arrays


def _same(one: Any, other: Any, rounding: float) -> bool:
    """Whether two entries are the same, numbers but for `rounding` times their size."""
    if one is None or other is None or one[0] != other[0]:
        return one is other
    a, b = (np.asarray(entry[1]) for entry in (one, other))
    if a.shape != b.shape or (a.dtype.kind in "if") != (b.dtype.kind in "if"):
        return False
    if a.dtype.kind not in "if":
        return bool(np.array_equal(a, b))
    return bool(np.allclose(a, b, rtol=rounding, atol=0.0, equal_nan=True))
