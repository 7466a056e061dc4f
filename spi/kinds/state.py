"""What is known so far of a part."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.exact.work import Work, told
from spi.numerics.rng import LANES
from spi.statistics.tallies import Chunk, PathSet, Sums, Tally, digest
from spi.storage.fitting import fits
from spi.storage.records import Group

if TYPE_CHECKING:
    from .plans import Plan

#: More than any machine computes: sums that ask for more were edited.
_MOST_CHUNKS = 10**7


class Nothing(NamedTuple):
    """What a plan knows besides its paths, where that is nothing."""

    seconds: float = 0.0


class State:
    """What is known so far of a part, enough to go on from."""

    def __init__(self, plan: "Plan") -> None:
        self.plan = plan
        #: what the plan knows besides sums over paths, a ``NamedTuple`` with `seconds`
        self.extra: Any = plan.initial_extra()
        self.tallies: dict[int, Tally] = {}  #: by the number of the path set
        #: of all chunks that were done, by path set and then (index, paths): the last chunk of a set may have grown
        self.digests: dict[int, dict[tuple[int, int], str]] = {}
        self.work: Work | None = None  #: without paths that goes on

    @contextlib.contextmanager
    def working(self, tick: Callable[[], None]) -> Iterator[None]:
        """Within the block :attr:`work` says what is done without paths, and `tick` is called whenever that changes."""

        def report(work: Work | None) -> None:
            self.work = work
            if work is not None:
                tick()

        try:
            with told(report):
                yield
        finally:
            self.work = None

    def of(self, plan: Any) -> "State":
        """The same sums as those of another plan, of fewer of these paths."""
        other = State(plan)
        other.extra, other.tallies = self.extra, dict(self.tallies)
        return other

    @property
    def path_sets(self) -> Sequence[PathSet]:
        """The paths that are wanted for now."""
        return self.plan.path_sets(self.extra)

    def tally(self, number: int = 0) -> Tally:
        """What is known of one path set."""
        return self.tallies.get(number) or Tally.empty()

    def total(self, number: int = 0) -> Any:
        """The sums over all paths of a path set; KeyError if some are missing."""
        return self.tally(number).total(self.path_sets[number])

    def so_far(self, number: int = 0) -> Any:
        """The sums over those paths of a path set that are known."""
        sums = self.tally(number).so_far()
        return self.plan.empty(number) if sums is None else sums

    def missing(self) -> list[Chunk]:
        """The chunks that are wanted and not done, path set by path set."""
        return [
            chunk
            for number, path_set in enumerate(self.path_sets)
            for chunk in path_set.chunks(number)
            if not self.tally(number).has(chunk)
        ]

    def put(self, chunk: Chunk, sums: Sums) -> None:
        """Keep what is now known of a chunk."""
        done = sums.paths == chunk.paths
        if done:
            self.digests.setdefault(chunk.path_set, {})[chunk.index, chunk.paths] = digest(sums)
        whole = done and chunk.index < self.path_sets[chunk.path_set].whole
        self.tallies[chunk.path_set] = self.tally(chunk.path_set).with_chunk(chunk, sums, whole)

    @property
    def seconds(self) -> float:
        """Wall-clock time spent so far."""
        return float(self.extra.seconds + sum(tally.seconds for tally in self.tallies.values()))

    def groups(self) -> list[Group]:
        """The results, of the final state."""
        return [one.group() for one in self.plan.all_results(self)]

    def plain(self) -> dict[str, Any]:
        """All that is known as dicts, lists, arrays, numbers and texts, for a file."""
        return {
            "extra": _plain(self.extra),
            "path_sets": [
                {
                    "number": number,
                    "nodes": [[*node, _plain(sums), digest(sums)] for node, sums in tally.nodes.items()],
                    "short": [[index, _plain(sums), digest(sums)] for index, sums in tally.short.items()],
                    "digests": [[*chunk, text] for chunk, text in self.digests.get(number, {}).items()],
                }
                for number, tally in self.tallies.items()
            ],
        }

    def merge(self, plain: dict[str, Any], with_extra: bool = True) -> None:
        """Add what another state of the same part knew, as :meth:`plain` told it.

        Sums of paths that are not wanted, or that cannot be told from those of unwanted paths, are left out.
        ValueError if it does not fit, or if sums are not those of which the digests are.
        """
        before, known = self.extra, dict(self.tallies)
        try:
            if with_extra and "extra" in plain:
                self.extra = _rebuilt(self.extra, plain["extra"])
            self._add(plain["path_sets"])
        except Exception:  # half of it is nothing
            self.extra, self.tallies = before, known
            raise

    def _add(self, others: list[dict[str, Any]]) -> None:
        """Add the sums over path sets that :meth:`plain` told."""
        path_sets = self.path_sets
        if sum(path_set.samples / path_set.chunk_blocks for path_set in path_sets) > _MOST_CHUNKS * LANES:
            raise ValueError("more paths than can be computed")
        for other in others:
            number = other["number"]
            if 0 <= number < len(path_sets):
                empty = self.plan.empty(number)
                digests = {(index, paths): text for index, paths, text in other["digests"]}
                nodes = {(height, n): _checked(empty, *sums) for height, n, *sums in other["nodes"]}
                short = {index: _checked(empty, *sums) for index, *sums in other["short"]}
                nodes, short = self._adopted(number, nodes), self._adopted(number, short)
                tally = Tally(nodes, short).within(path_sets[number])
                _check_chunks(tally, digests, path_sets[number])
                self.tallies[number] = self.tally(number).merged(tally)
                self.digests.setdefault(number, {}).update(digests)

    def _adopted(self, number: int, sums: dict[Any, Any]) -> dict[Any, Any]:
        """Those of the sums over paths of a path set, by any key, with which the plan can go on."""
        adopted = {key: self.plan.adopted(number, one) for key, one in sums.items()}
        return {key: one for key, one in adopted.items() if one is not None}


def _checked(like: Any, plain: dict[str, Any], told: str) -> Any:
    """The sums that :func:`_plain` told; ValueError if their digest is not the one that was `told`."""
    sums = _rebuilt(like, plain)
    if digest(sums) != told:
        raise ValueError("sums that are not those of their digest")
    return sums


def _check_chunks(tally: Tally, digests: dict[tuple[int, int], str], path_set: PathSet) -> None:
    """ValueError if a chunk that is done has no digest, or the sums over it alone have another one."""
    whole = path_set.chunk_blocks * LANES
    done = {(index, whole) for k, n in tally.nodes for index in range(n << k, (n + 1) << k)}
    alone = {(n, whole): sums for (k, n), sums in tally.nodes.items() if k == 0}
    alone |= {(i, sums.paths): sums for i, sums in tally.short.items() if sums.paths == path_set.samples - i * whole}
    if not done <= digests.keys() or any(digests.get(chunk) != digest(sums) for chunk, sums in alone.items()):
        raise ValueError("digests that are not those of the chunks")


def _plain(record: Any) -> dict[str, Any]:
    """The fields of a NamedTuple, and of those within it."""
    return {name: _plain(value) if hasattr(value, "_asdict") else value for name, value in record._asdict().items()}


def _rebuilt(like: Any, plain: dict[str, Any]) -> Any:
    """A NamedTuple like this one from what :func:`_plain` told; ValueError if the fields differ."""
    if set(plain) != set(like._fields):
        raise ValueError(f"fields {sorted(plain)} in place of {sorted(like._fields)}")
    values = like._asdict()
    return type(like)(
        **{
            name: _rebuilt(values[name], value) if hasattr(values[name], "_asdict") else _fitting(values[name], value)
            for name, value in plain.items()
        }
    )


def _fitting(like: Any, value: Any) -> Any:
    """The value, if it is of the type and shape of one like it, else ValueError; sides of arrays may grow from 0."""
    if isinstance(like, np.ndarray):
        fit = isinstance(value, np.ndarray) and value.dtype == like.dtype and value.ndim == like.ndim
        fit = fit and all(m == n or 0 in (m, n) for m, n in zip(like.shape, value.shape, strict=True))
    else:
        fit = fits(value, float if isinstance(like, float) else type(like))
    if not fit:
        raise ValueError(f"{type(value).__name__} {getattr(value, 'shape', '')} in place of {type(like).__name__}")
    return value
