"""Stored results, checked: chunks of paths computed again, and numbers derived again from sums over paths."""

import json
import random
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spi import NUMBERS_DIGEST, specs, storage
from spi.kinds.plans import Nothing, Plan, State, sums_of_chunk
from spi.numerics.rng import STREAM_VERSION
from spi.running.checkpoint import digests_of, label_of
from spi.running.load import load_stored, name_of, plans
from spi.running.run import root_attributes
from spi.running.workers import advance_here, perform_tasks
from spi.statistics.tallies import Chunk, PathSet, digest
from spi.storage import StorageError
from spi.storage.records import Group, StoredResults
from spi.storage.stored import gathered

#: Root attributes that say why numbers may differ in their last digits, and what to call them.
CAUSES = {
    "source_digest": "source code of spi",
    "stream_version": "version of the random numbers",
    "machine_instruction_set": "instruction set",
    "machine_fused_operations": "fused operations",
    "machine_without": "parts of Numba that are left out",
    "machine_processor": "processor",
    "machine_numba": "version of Numba",
    "machine_numpy": "version of NumPy",
    "machine_python": "version of Python",
}

ReportChunk = Callable[[int, int, str], None]  #: the number of the next chunk, that of all, and its name


class Verification(NamedTuple):
    """Outcome."""

    chunks: int  #: number of all chunks
    checked: tuple[str, ...]  #: those that were computed again: "case/part, paths of chunk ... of path set ..."
    different: tuple[str, ...]  #: those among them that came out different
    wrong: tuple[str, ...]  #: all else that is not as it should be, in one line each
    sums: Path | None  #: the folder of the sums from which all numbers were derived again; None if some are missing
    causes: tuple[str, ...]  #: all that is not as it was when the results were computed

    @property
    def whole(self) -> bool:
        """Whether every chunk was computed again, and from them every number but times."""
        return len(self.checked) == self.chunks

    @property
    def sound(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.different or self.wrong)


def _at_random(every: Mapping[str, tuple[Plan, Chunk]], count: int, report: ReportChunk) -> dict[str, str]:
    """Digests of the sums of so many chunks, computed again."""
    computed = {}
    for number, label in enumerate(sorted(random.SystemRandom().sample(sorted(every), count)), 1):
        report(number, count, _in_words(label))
        computed[label] = digest(sums_of_chunk(*every[label]))
    return computed


def verify(
    path: str | Path,
    chunks: int | None,
    report: ReportChunk = lambda number, total, name: None,
    trust_code: bool = False,
) -> Verification:
    """Compute chunks of stored results again and compare their sums to the last bit: so many at random, None for all.

    All numbers are derived again and compared, from the sums over paths if these lie beside the results, and but
    for times from the paths if all of them are computed.  `report` is called with the chunk that comes next.

    Raises StorageError if the file is no results file, or if its spec now means something else.  Python code in the
    file is run only where :func:`load_stored` says so.
    """
    results = storage.read(path)
    experiment = load_stored(path, trust_code)
    if experiment.hash != results.attributes.get("spec_hash"):
        raise StorageError(f"{path}: its spec means something else to this version of spi; nothing can be compared")
    ready, listed = plans(experiment), _listed(results)
    every = {label_of(plan, chunk): (plan, chunk) for plan in ready for chunk in _chunks(plan, listed)}
    wrong = [*_not_of_the_spec(experiment, results), *_not_listed(every, listed)]
    causes = _causes(results)
    rounding = _ROUNDING if causes else 0.0
    sums, states = _sums_of(Path(path), results, ready)
    if sums:
        names = _not_of_sums(states, results, rounding)
        wrong += [f"{name} does not follow from the sums in {sums}" for name in names]
    if chunks is None or chunks >= len(every):
        again = _all_again(ready, len(every), report)
        computed = dict(chain.from_iterable(digests_of(state).items() for state in again))
        names = _differing(again, results, rounding, times=False)
        wrong += [f"{name} does not follow from its paths" for name in names]
    else:
        computed = _at_random(every, chunks, report)
    return Verification(
        chunks=len(every),
        checked=tuple(map(_in_words, computed)),
        different=tuple(_in_words(label) for label, text in computed.items() if listed.get(label, text) != text),
        wrong=tuple(wrong),
        sums=sums,
        causes=causes,
    )


def _not_of_sums(states: Sequence[State], results: StoredResults, rounding: float) -> list[str]:
    """Numbers that do not follow from stored sums, whose times are those of the run unless another one made them."""
    names = _differing(states, results, rounding, times=True)
    if any(name.endswith("wall_seconds") for name in names):  # the same sums, computed again by another run
        names = _differing(states, results, rounding, times=False)
    return names


def _listed(results: StoredResults) -> dict[str, str]:
    """Digests of chunks in a file, by their names; StorageError if they cannot be read."""
    if not all(re.fullmatch(r".* \d{1,18} \d{1,18} \d{1,18} \w+", line) for line in results.chunks):
        raise StorageError("the digests of chunks in the results file are damaged; run the experiment again")
    return {label: text for label, _, text in (line.rpartition(" ") for line in results.chunks)}


def _chunks(plan: Plan, listed: dict[str, str]) -> Iterator[Chunk]:
    """All chunks that a part must have; where it chose its number of paths, as many as are listed."""
    paths = Counter[str]()
    for label in listed:
        path_set, _, count = label.rsplit(" ", 2)
        paths[path_set] += int(count)
    for number, least in enumerate(plan.path_sets(plan.initial_extra())):
        samples = max(least.samples, paths[f"{name_of(plan)} {number}"])
        yield from PathSet(samples, least.chunk_blocks).chunks(number)


def _not_listed(every: Collection[str], listed: Collection[str]) -> Iterator[str]:
    """Mistakes in the list of chunks, part by part."""

    def count(labels: Iterable[str]) -> Counter[str]:
        return Counter(label.rsplit(" ", 3)[0] for label in labels)

    wanted = count(every)
    for part, missing in count(label for label in every if label not in listed).items():
        yield f"{part}: {missing} of its {wanted[part]} chunks have no digest"
    for part, others in count(label for label in listed if label not in every).items():
        yield f"{part}: {others} digests are of no chunk that it has"


def _not_of_the_spec(experiment: specs.Experiment, results: StoredResults) -> Iterator[str]:
    """Attributes of the file that are not those of its spec."""
    expected = root_attributes(experiment)
    for name in ("kind", "seed", "samples", "expect", "title", "asks", "figure"):
        if expected[name] != results.attributes.get(name):
            yield f"{name} is {results.attributes.get(name)!r}, and by the spec {expected[name]!r}"


def _sums_of(path: Path, results: StoredResults, ready: Sequence[Plan]) -> tuple[Path | None, list[State]]:
    """Folder with the sums over the paths of results, and the states in it; None if any are missing."""
    store, states = storage.Store(path.parent / "sums"), [State(plan) for plan in ready]
    try:
        keys = json.loads(results.attributes["sums"])
        for state in states:
            none, *of_sets = keys[name_of(state.plan)]
            for number, key in [(None, none), *enumerate(of_sets)]:
                if (plain := store.read(key)) is not None:
                    plain.pop("machines")
                    state.merge(number, plain)
                elif number is None and not isinstance(state.extra, Nothing):
                    return None, []
    except (StorageError, KeyError, TypeError, ValueError, AttributeError):
        return None, []
    return (None, []) if any(state.missing() or state.open_tasks() for state in states) else (store.folder, states)


def _differing(states: Sequence[State], results: StoredResults, rounding: float, times: bool) -> list[str]:
    """Names of all that is otherwise in a file than the results of the same plans from states."""
    records = gathered(state.plan.results(state) for state in states)
    return differing([record.group() for record in records], results.groups, times, rounding)


def _all_again(ready: Sequence[Plan], total: int, report: ReportChunk) -> list[State]:
    """All that a run computes, computed again."""
    states = [State(plan) for plan in ready]

    def tick(number: int) -> None:
        done = sum(len(digests) for state in states for digests in state.digests.values())
        report(min(done + 1, total), total, name_of(ready[number]))

    advance_here(states, tick)
    perform_tasks(states, tick)
    return states


def _in_words(label: str) -> str:
    part, path_set, number, paths = label.rsplit(" ", 3)
    return f"{part}, {paths} paths of chunk {number} of path set {path_set}"


def _causes(results: StoredResults) -> tuple[str, ...]:
    """All that is not as it was."""
    now = {**storage.provenance(), "source_digest": NUMBERS_DIGEST, "stream_version": STREAM_VERSION}
    then = results.attributes
    machines = then.get("machines") or ()
    others = [machine for machine in machines if machine != storage.machine()] if len(machines) > 1 else []
    return (
        *(
            f"{label}: {then.get(name)} then, {now.get(name)} now"
            for name, label in CAUSES.items()
            if then.get(name) != now.get(name)
        ),
        *(f"one of {len(machines)} machines: {machine}" for machine in others),
    )


#: Parts of the names of those numbers that a clock decides, or the machine at hand.
TIMES = ("seconds", "ns_per_step", "cost_rate")

#: Relative difference of numbers from equal sums where a processor or a version is another, see docs/long_runs.md; else
#: they are equal to the last bit.
_ROUNDING = 1e-9


_OF_ITS_RUN = ("threads",)


def differing(derived: Sequence[Group], stored: Sequence[Group], times: bool, rounding: float = 0.0) -> list[str]:
    """Names of all that is not the same in `stored` as in what was `derived`, times only if they are wanted.

    Numbers may differ by `rounding` times their size.
    """
    with tempfile.TemporaryDirectory() as folder:  # groups as a file gives them back
        path = Path(folder) / "derived.h5"
        storage.write(path, StoredResults({}, tuple(derived)))
        groups = storage.read(path).groups
    mine, theirs = ({group.name: _entries(group) for group in each} for each in (groups, stored))
    names = [name for name in (mine | theirs) if name not in mine or name not in theirs]
    for name in mine.keys() & theirs.keys():
        a, b = mine[name], theirs[name]
        keys = [key for key in (a | b) if times or not any(word in key for word in TIMES)]
        names += [f"{name}: {key}" for key in keys if not _same(a.get(key), b.get(key), rounding)]
    return sorted(names)


def _entries(group: Group) -> dict[str, Any]:
    """All that a group has, by name: (axes, array)."""
    arrays = {name: ((name,), values) for name, values in group.coordinates.items()} | group.variables
    facts = {name: ((), value) for name, value in group.attributes.items() if name not in _OF_ITS_RUN}
    return {f"attribute {name}" if name in arrays else name: fact for name, fact in facts.items()} | arrays


def _same(entry: Any, other: Any, rounding: float) -> bool:
    """Whether two entries are the same, numbers but for `rounding` times their size."""
    if entry is None or other is None or entry[0] != other[0]:
        return entry is other
    a, b = np.asarray(entry[1]), np.asarray(other[1])
    if a.shape != b.shape or (a.dtype.kind in "if") != (b.dtype.kind in "if"):
        return False
    if a.dtype.kind not in "if":
        return bool(np.array_equal(a, b))
    return bool(np.allclose(a, b, rtol=rounding, atol=0.0, equal_nan=True))
