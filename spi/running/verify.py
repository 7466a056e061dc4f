"""Stored results, checked by computing some of their paths again."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from .. import NUMBERS_DIGEST, storage
from ..kinds.plans import Plan, sums_of_chunk
from ..numerics.rng import STREAM_VERSION
from ..statistics.tallies import Chunk, digest
from ..storage import StorageError
from ..storage.records import Results
from .load import load_stored, name_of, plans

#: Root attributes that say why numbers may differ in their last digits, and what to call them.
CAUSES = {
    "source_digest": "source code of spi",
    "stream_version": "version of the random numbers",
    "machine_instruction_set": "instruction set",
    "machine_processor": "processor",
    "machine_numba": "version of Numba",
    "machine_numpy": "version of NumPy",
    "machine_python": "version of Python",
}


class Verification(NamedTuple):
    """What came out."""

    chunks: int  #: how many there are
    checked: tuple[str, ...]  #: those that were computed again: "case/part, paths from to"
    different: tuple[str, ...]  #: those among them that came out different
    causes: tuple[str, ...]  #: what is not as it was when the results were computed


def verify(
    path: str | Path,
    chunks: int,
    report: Callable[[int, int, str], None] = lambda number, total, name: None,
    trust_code: bool = False,
) -> Verification:
    """Compute so many chunks of stored results again, chosen at random, and compare their sums to the last bit.

    `report` is told which of how many comes next.  Raises StorageError if the file is no results file, or if its spec
    now means something else.  Python code in the file is run only where :func:`load_stored` says so.
    """
    results = storage.read(path)
    experiment = load_stored(path, trust_code)
    if experiment.hash != results.attributes.get("spec_hash"):
        raise StorageError(f"{path}: its spec means something else to this version of spi; nothing can be compared")
    by_name = {name_of(plan): plan for plan in plans(experiment)}
    chosen = random.SystemRandom().sample(results.chunks, min(chunks, len(results.chunks)))
    checked, different = [], []
    for number, line in enumerate(sorted(chosen), 1):
        name, path_set, index, paths, expected = line.rsplit(" ", 4)
        chunk = _chunk(by_name[name], int(path_set), int(index), int(paths))
        label = f"{name}, paths {chunk.end - chunk.paths} to {chunk.end - 1} of path set {path_set}"
        report(number, len(chosen), label)
        checked.append(label)
        if digest(sums_of_chunk(by_name[name], chunk)) != expected:
            different.append(label)
    return Verification(len(results.chunks), tuple(checked), tuple(different), _causes(results))


def _chunk(plan: Plan, path_set: int, index: int, paths: int) -> Chunk:
    """The chunk of so many paths; a path set may have grown since the plan began."""
    size = plan.path_sets(plan.initial_extra())[path_set].chunk_blocks
    return Chunk.of(path_set, index, size, paths)


def _causes(results: Results) -> tuple[str, ...]:
    """What is not as it was."""
    now = {**storage.provenance(), "source_digest": NUMBERS_DIGEST, "stream_version": STREAM_VERSION}
    return tuple(
        f"{label}: {results.attributes.get(name)} then, {now[name]} now"
        for name, label in CAUSES.items()
        if results.attributes.get(name) != now[name]
    )
