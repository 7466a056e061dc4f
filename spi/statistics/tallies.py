"""Sums over paths that are equal to the last bit however the work was divided.

The blocks of a set of paths fall into **chunks** of fixed content.  Within a chunk the sum is made block after
block.  Chunks are then added in pairs, pairs of chunks in pairs and so on: a binary tree over the numbers of the
chunks.  The result depends neither on the order in which chunks are computed, nor on who computes them, nor on whether
more of them follow later.  Only the roots of the largest complete subtrees are kept, about log2(N) of them for N
chunks.

"To add" is what the sums themselves say, :meth:`Sums.plus`: most fields are added, of others the larger one is taken,
and states of paths are joined.
"""

import functools
import hashlib
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from ..numerics.rng import LANES

#: Paths * steps * dimension^2 of a chunk, at most: some two seconds of one thread.
CHUNK_WORK = 2**32

_CLOCK = "seconds"  # with which the names of those fields end that a clock decides


class Sums(Protocol):
    """What is known of some paths: a ``NamedTuple`` of arrays, numbers and texts, so that a file can hold it."""

    @property
    def paths(self) -> int:
        """Of how many paths everything is known."""

    @property
    def seconds(self) -> float:
        """Wall-clock time spent on them."""

    def plus(self, later: Self) -> Self:
        """These paths together with some that come later in the path set."""

    def _asdict(self) -> dict[str, Any]: ...


def sum_of_fields(one: Any, other: Any) -> Any:
    """The ``NamedTuple`` whose fields are the sums of those of two."""
    return type(one)(*(mine + its for mine, its in zip(one, other, strict=True)))


@dataclass(frozen=True)
class Chunk:
    """Consecutive blocks of the paths of one path set."""

    path_set: int  #: the number of the path set within its part
    index: int  #: the number of the chunk within its path set
    first: int  #: its first block
    end: int  #: the number of the path after its last one

    @classmethod
    def of(cls, path_set: int, index: int, size: int, paths: int) -> "Chunk":
        """Chunk number `index`, of so many paths, of a path set whose whole chunks have `size` blocks."""
        return cls(path_set, index, index * size, index * size * LANES + paths)

    @property
    def paths(self) -> int:
        """How many paths it has."""
        return self.end - self.first * LANES

    @property
    def blocks(self) -> int:
        """How many blocks it has, the last one perhaps partly idle."""
        return -(-self.end // LANES) - self.first


class PathSet(NamedTuple):
    """A set of paths 0, ..., samples - 1 that are summed up together."""

    samples: int
    chunk_blocks: int  #: how many blocks a whole chunk has

    @property
    def whole(self) -> int:
        """How many chunks have all their paths, which are the first ones."""
        return self.samples // (self.chunk_blocks * LANES)

    def chunks(self, number: int) -> list[Chunk]:
        """All chunks, in order; `number` is that of the path set within its part."""
        size = self.chunk_blocks * LANES
        count = -(-self.samples // size)
        return [Chunk.of(number, i, self.chunk_blocks, min(size, self.samples - i * size)) for i in range(count)]


def chunk_blocks(steps: int, dimension: int) -> int:
    """How many blocks a chunk has whose paths take so many steps, a power of two.

    The order of summation, so the last bits of results, depends on this rule, which therefore knows no times.
    """
    return 1 << max(0, (CHUNK_WORK // (LANES * max(steps, 1) * dimension**2)).bit_length() - 1)


class Tally(NamedTuple):
    """What is known of the chunks of one path set; methods return another one and leave this one as it is."""

    #: (height, number) -> the sums of the chunks number * 2^height, ..., (number + 1) * 2^height - 1
    nodes: dict[tuple[int, int], Any]
    #: index -> the sums of a chunk that is under way, or that ends a path set before it is whole
    short: dict[int, Any]

    @classmethod
    def empty(cls) -> "Tally":
        """Nothing is known."""
        return cls({}, {})

    def has(self, chunk: Chunk) -> bool:
        """Whether a chunk is done."""
        return self._covers(chunk.index) or (chunk.index in self.short and self.short[chunk.index].paths == chunk.paths)

    def known(self, chunk: Chunk) -> Any | None:
        """The sums from which a chunk that is not done can go on, or None."""
        sums = self.short.get(chunk.index)
        return sums if sums is not None and sums.paths < chunk.paths and sums.paths % LANES == 0 else None

    def with_chunk(self, chunk: Chunk, sums: Any, whole: bool) -> "Tally":
        """With what is now known of a chunk; `whole` says that it is done and as long as a chunk can be."""
        short = {i: known for i, known in self.short.items() if i != chunk.index}
        if whole:
            return self._with_node((0, chunk.index), sums, short)
        return Tally(self.nodes, short | {chunk.index: sums})

    def merged(self, other: "Tally") -> "Tally":
        """With what another tally of the same path set knows."""
        tally = self
        for node, sums in sorted(other.nodes.items(), reverse=True):
            if not tally._covers_node(node):
                tally = tally._with_node(node, sums, tally.short)
        short = dict(tally.short)
        for index, sums in other.short.items():
            if index not in short or sums.paths > short[index].paths:
                short[index] = sums
        return Tally(tally.nodes, {i: sums for i, sums in short.items() if not tally._covers(i)})

    def within(self, path_set: PathSet) -> "Tally":
        """Without what belongs to later paths than those of `path_set`, alone or in one sum with earlier ones."""
        nodes = {(k, n): sums for (k, n), sums in self.nodes.items() if (n + 1) << k <= path_set.whole}
        wanted = {chunk.index: chunk.paths for chunk in path_set.chunks(0)}
        return Tally(nodes, {i: sums for i, sums in self.short.items() if i in wanted and sums.paths <= wanted[i]})

    def total(self, path_set: PathSet) -> Any:
        """The sums of all paths of a path set; KeyError if something is missing."""
        found, first = [], 0
        for height in reversed(range(path_set.whole.bit_length())):
            if path_set.whole >> height & 1:
                found.append(self.nodes[height, first >> height])
                first += 1 << height
        if rest := path_set.samples - path_set.whole * path_set.chunk_blocks * LANES:
            if self.short[path_set.whole].paths != rest:
                raise KeyError(path_set.whole)
            found.append(self.short[path_set.whole])
        return _joined(found)

    def leading(self, path_set: PathSet) -> int:
        """How many of the first paths of a path set are known without a gap."""
        size, index, found = path_set.chunk_blocks * LANES, 0, True
        while found:
            found = False
            for height, number in self.nodes:
                if number << height <= index < (number + 1) << height:
                    index, found = (number + 1) << height, True
        short = self.short.get(index)
        return min(path_set.samples, index * size + (short.paths if short is not None else 0))

    def so_far(self) -> Any | None:
        """The sums of what is known, or None if that is nothing."""
        nodes = sorted(self.nodes.items(), key=lambda item: item[0][1] << item[0][0])
        return _joined([*(sums for _, sums in nodes), *(sums for _, sums in sorted(self.short.items()))])

    @property
    def each(self) -> list[Any]:
        """All sums that are kept, in no particular order."""
        return [*self.nodes.values(), *self.short.values()]

    @property
    def paths(self) -> int:
        """Of how many paths everything is known."""
        return sum(sums.paths for sums in self.each)

    @property
    def seconds(self) -> float:
        """Wall-clock time spent on all that is known."""
        return float(sum(sums.seconds for sums in self.each))

    def _with_node(self, node: tuple[int, int], sums: Any, short: dict[int, Any]) -> "Tally":
        height, number = node
        nodes = {(k, n): kept for (k, n), kept in self.nodes.items() if k > height or n >> (height - k) != number}
        while (other := nodes.pop((height, number ^ 1), None)) is not None:
            sums = other.plus(sums) if number & 1 else sums.plus(other)
            height, number = height + 1, number >> 1
        return Tally(nodes | {(height, number): sums}, short)

    def _covers(self, index: int) -> bool:
        return self._covers_node((0, index))

    def _covers_node(self, node: tuple[int, int]) -> bool:
        height, number = node
        return any(k >= height and number >> (k - height) == n for k, n in self.nodes)


def _joined(found: list[Any]) -> Any | None:
    """The sums one after the other, from the first paths on."""
    return functools.reduce(lambda earlier, later: earlier.plus(later), found) if found else None


def digest(sums: Sums) -> str:
    """A hash of all that is known of some paths but the time spent, of 32 characters."""
    found = hashlib.sha256()
    for name, value in sorted(sums._asdict().items()):
        if not name.endswith(_CLOCK):
            values = np.asarray(value)
            data = repr(value).encode() if values.dtype.kind == "U" else np.ascontiguousarray(values).tobytes()
            found.update(f"{name} {values.dtype} {values.shape} ".encode() + data)
    return found.hexdigest()[:32]
