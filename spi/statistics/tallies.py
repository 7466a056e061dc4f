"""Sums over paths that are equal to the last bit however the work was divided.

The blocks of a set of paths fall into **chunks** of fixed content.  Within a chunk the sum is made block after
block.  Chunks are then added in pairs, pairs of chunks in pairs and so on: a binary tree over the numbers of the
chunks.  The result depends neither on the order in which chunks are computed, nor on who computes them, nor on whether
more of them follow later.  Only the roots of the largest complete subtrees are kept, about log2(N) of them for N
chunks.

The addition is :meth:`Addable.plus`: most fields are added, of others the larger one is taken, and states of paths are
joined.
"""

import functools
import hashlib
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from ..numerics.rng import LANES
from ..numerics.types import Array

#: Paths * steps * dimension^2 of a chunk, at most: some two seconds of one thread.
CHUNK_WORK = 2**32

_CLOCK = "seconds"  # with which the names of those fields end that a clock decides


class Addable(Protocol):
    """Sums over some paths: a ``NamedTuple`` of arrays, numbers and texts, so that a file can hold it."""

    @property
    def paths(self) -> int:
        """Number of paths that are summed completely."""

    @property
    def seconds(self) -> float:
        """Wall-clock time spent on them."""

    def plus(self, later: Self) -> Self:
        """Sums over these paths and the `later` ones of the path set."""

    def _asdict(self) -> dict[str, Any]: ...


class Batch(NamedTuple):
    """Consecutive blocks of the paths of one path set that are computed at once.

    Lane l of block b is path b LANES + l.  Paths from number `end` on are idle: they may move, and count nowhere.
    """

    path_set: int  #: the number of the path set within its part
    first: int  #: its first block
    blocks: int  #: number of its blocks
    end: int  #: the number of the path after the last one that counts

    @classmethod
    def of_first(cls, blocks: int, path_set: int = 0) -> "Batch":
        """First blocks of a path set, of which all paths count."""
        return cls(path_set, 0, blocks, blocks * LANES)

    @property
    def first_path(self) -> int:
        """Number of its first path."""
        return self.first * LANES

    @property
    def counted(self) -> Array:
        """(blocks, LANES): whether a path counts."""
        return (self.first_path + np.arange(self.blocks * LANES) < self.end).reshape(self.blocks, LANES)

    def part(self, first: int, blocks: int) -> "Batch":
        """Those `blocks` blocks of it that begin with block `first` of the path set."""
        return self._replace(first=first, blocks=blocks)


@dataclass(frozen=True)
class Chunk:
    """Consecutive blocks of the paths of one path set."""

    path_set: int  #: the number of the path set within its part
    index: int  #: the number of the chunk within its path set
    first: int  #: its first block
    end: int  #: the number of the path after its last one

    @classmethod
    def of(cls, path_set: int, index: int, size: int, paths: int) -> "Chunk":
        """Chunk number `index`, with `paths` paths, of a path set whose whole chunks have `size` blocks."""
        return cls(path_set, index, index * size, index * size * LANES + paths)

    @property
    def paths(self) -> int:
        """Number of its paths."""
        return self.end - self.first * LANES

    @property
    def blocks(self) -> int:
        """Number of its blocks, the last one perhaps partly idle."""
        return -(-self.end // LANES) - self.first

    @property
    def batch(self) -> Batch:
        """All of it at once."""
        return Batch(self.path_set, self.first, self.blocks, self.end)


class PathSet(NamedTuple):
    """A set of paths 0, ..., samples - 1 that are summed up together."""

    samples: int
    chunk_blocks: int  #: number of blocks of a whole chunk

    @property
    def whole(self) -> int:
        """Number of whole chunks, which come first."""
        return self.samples // (self.chunk_blocks * LANES)

    def chunks(self, number: int) -> list[Chunk]:
        """All chunks, in order; `number` is that of the path set within its part."""
        size = self.chunk_blocks * LANES
        count = -(-self.samples // size)
        return [Chunk.of(number, i, self.chunk_blocks, min(size, self.samples - i * size)) for i in range(count)]


def chunk_blocks(steps: int, dimension: int) -> int:
    """Number of blocks of a chunk whose paths take `steps` steps each, a power of two.

    The order of summation, so the last bits of results, depends on this rule, which therefore depends on no times.
    """
    return 1 << max(0, (CHUNK_WORK // (LANES * max(steps, 1) * dimension**2)).bit_length() - 1)


def _is_of(sums: Any, paths: int) -> bool:
    """Whether sums under way are those of a chunk of so many paths; sums of whole paths are of a chunk of any number.

    A field `wanted` of the sums says of how many paths they are, 0 once they are whole.
    """
    return int(getattr(sums, "wanted", 0)) in (0, paths)


class Tally(NamedTuple):
    """Sums over the computed chunks of one path set; immutable, its methods return a new tally."""

    #: (height, number) -> the sums of the chunks number * 2^height, ..., (number + 1) * 2^height - 1
    nodes: dict[tuple[int, int], Any]
    #: index -> the sums of a chunk that is under way, or that ends a path set before it is whole
    short: dict[int, Any]

    @classmethod
    def empty(cls) -> "Tally":
        """Tally without any sums."""
        return cls({}, {})

    def has(self, chunk: Chunk) -> bool:
        """Whether a chunk is done."""
        return self._covers(chunk.index) or (chunk.index in self.short and self.short[chunk.index].paths == chunk.paths)

    def known(self, chunk: Chunk) -> Any | None:
        """Sums from which a chunk that is not done can go on, or None."""
        sums = self.short.get(chunk.index)
        may = sums is not None and sums.paths < chunk.paths and sums.paths % LANES == 0
        return sums if may and _is_of(sums, chunk.paths) else None

    def with_chunk(self, chunk: Chunk, sums: Any, whole: bool) -> "Tally":
        """Tally with new sums of a chunk; `whole` if it is done and as long as a chunk can be."""
        short = {i: others for i, others in self.short.items() if i != chunk.index}
        if whole:
            return self._with_node((0, chunk.index), sums, short)
        return Tally(self.nodes, short | {chunk.index: sums})

    def merged(self, other: "Tally") -> "Tally":
        """Tally with the sums of another tally of the same path set."""
        tally = self
        for node, sums in sorted(other.nodes.items(), reverse=True):
            if not tally._covers_node(node):
                tally = tally._with_node(node, sums, tally.short)
        short = dict(tally.short)
        for index, sums in other.short.items():
            if index not in short or sums.paths > short[index].paths:
                short[index] = sums
        return Tally(tally.nodes, {i: sums for i, sums in short.items() if not tally._covers(i)})

    def beside(self, others: "Tally") -> "Tally":
        """All sums of both, though some may have paths in common, and of a chunk under way those over more paths."""
        short = {i: sums for i, sums in others.short.items() if i not in self.short or sums.paths > self.short[i].paths}
        return Tally(self.nodes | others.nodes, self.short | short)

    def beyond(self, others: "Tally") -> "Tally":
        """Those sums that have paths which another tally has not."""
        nodes = {node: sums for node, sums in self.nodes.items() if not others._covers_node(node)}
        short = {i: sums for i, sums in self.short.items() if sums.paths > others._paths_under_way(i)}
        return Tally(nodes, {i: sums for i, sums in short.items() if not others._covers(i)})

    def within(self, path_set: PathSet) -> "Tally":
        """Tally without sums that include later paths than those of `path_set`."""
        nodes = {(k, n): sums for (k, n), sums in self.nodes.items() if (n + 1) << k <= path_set.whole}
        wanted = {chunk.index: chunk.paths for chunk in path_set.chunks(0)}
        short = {i: sums for i, sums in self.short.items() if i in wanted and sums.paths <= wanted[i]}
        return Tally(nodes, {i: sums for i, sums in short.items() if _is_of(sums, wanted[i])})

    def total(self, path_set: PathSet) -> Any:
        """Sums of all paths of a path set; KeyError if something is missing."""
        parts, first = [], 0
        for height in reversed(range(path_set.whole.bit_length())):
            if path_set.whole >> height & 1:
                parts.append(self.nodes[height, first >> height])
                first += 1 << height
        if rest := path_set.samples - path_set.whole * path_set.chunk_blocks * LANES:
            if self.short[path_set.whole].paths != rest:
                raise KeyError(path_set.whole)
            parts.append(self.short[path_set.whole])
        return _joined(parts)

    def so_far(self) -> Any | None:
        """Sums over all computed paths, or None if there are none."""
        nodes = sorted(self.nodes.items(), key=lambda item: item[0][1] << item[0][0])
        return _joined([*(sums for _, sums in nodes), *(sums for _, sums in sorted(self.short.items()))])

    @property
    def each(self) -> list[Any]:
        """All stored sums, in no particular order."""
        return [*self.nodes.values(), *self.short.values()]

    @property
    def places(self) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
        """Which chunks its sums are of: the nodes, and the chunks under way with their paths."""
        return set(self.nodes), {(index, int(sums.paths)) for index, sums in self.short.items()}

    @property
    def paths(self) -> int:
        """Number of computed paths."""
        return sum(sums.paths for sums in self.each)

    @property
    def seconds(self) -> float:
        """Wall-clock time spent on all computed paths."""
        return float(sum(sums.seconds for sums in self.each))

    def _with_node(self, node: tuple[int, int], sums: Any, short: dict[int, Any]) -> "Tally":
        height, number = node
        nodes = {(k, n): total for (k, n), total in self.nodes.items() if k > height or n >> (height - k) != number}
        while (other := nodes.pop((height, number ^ 1), None)) is not None:
            sums = other.plus(sums) if number & 1 else sums.plus(other)
            height, number = height + 1, number >> 1
        return Tally(nodes | {(height, number): sums}, short)

    def _paths_under_way(self, index: int) -> int:
        return int(self.short[index].paths) if index in self.short else -1

    def _covers(self, index: int) -> bool:
        return self._covers_node((0, index))

    def _covers_node(self, node: tuple[int, int]) -> bool:
        height, number = node
        return any(k >= height and number >> (k - height) == n for k, n in self.nodes)


def _joined(parts: list[Any]) -> Any | None:
    """Sum of `parts`, added from the first paths on; None if there are none."""
    return functools.reduce(lambda earlier, later: earlier.plus(later), parts) if parts else None


def digest(sums: Addable) -> str:
    """A hash, of 32 characters, of all sums over some paths except the time spent."""
    hasher = hashlib.sha256()
    for name, value in sorted(sums._asdict().items()):
        if not name.endswith(_CLOCK):
            values = np.asarray(value)
            hasher.update(f"{name} {values.dtype} {values.shape} ".encode())
            hasher.update(repr(value).encode() if values.dtype.kind == "U" else np.ascontiguousarray(values).data)
    return hasher.hexdigest()[:32]
