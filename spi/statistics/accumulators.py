"""Sums over paths, declared field by field: each with its axes and its reduction.

    class StrongSums(Sums):
        squares: Array = by_group("point")
        drift: Array = largest("level casimir")
        nonfinite: Array = counted("level")

A plan hands over the contributions of blocks of LANES paths, an array for each field with the axis of the blocks
first.  Sums over no paths, those with some more blocks, those of two sets of paths and the memory that a block needs
follow from the declaration.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from dataclasses import field as dataclass_field
from typing import Any, ClassVar, NamedTuple, Self, dataclass_transform

import numpy as np

from spi.ensemble.loop import add_reports
from spi.ensemble.scheme_protocol import REPORT
from spi.numerics.rng import LANES
from spi.numerics.types import Array

from .estimators import GROUPS, PARTS, ROUND, with_powers
from .tallies import Batch


class Reduction(NamedTuple):
    """Way in which contributions of blocks make a field of the sums."""

    axes: tuple[str, ...]  #: of the field; lengths are given by name when sums over no paths are made
    with_batch: Callable[[Array, Array, Batch], Array]  #: the field with contributions (blocks, ...) added
    plus: Callable[[Array, Array], Array] = np.add  #: the fields of two disjoint sets of paths as one
    dtype: type = float
    before: tuple[int, ...] = ()  #: sides of the field before the axes
    behind: tuple[int, ...] = ()  #: and behind them
    lanes: int = 1  #: numbers per block that a contribution has for each place along the axes


def _declared(axes: str, *how: Any, **sides: Any) -> Any:
    return dataclass_field(metadata={"reduction": Reduction(tuple(axes.split()), *how, **sides)})


def added(axes: str = "", dtype: type = float) -> Any:
    """Added up; contributions are (blocks, *axes)."""
    return _declared(axes, lambda total, rows, batch: total + rows.sum(axis=0, dtype=dtype), dtype=dtype)


def counted(axes: str = "") -> Any:
    """Number of paths of which something is true; contributions are (blocks, *axes, LANES), booleans."""

    def with_batch(total: Array, rows: Array, batch: Batch) -> Array:
        used = batch.counted.reshape(batch.blocks, *[1] * (rows.ndim - 2), LANES)
        counts: Array = total + (rows & used).sum(axis=(0, -1))
        return counts

    return _declared(axes, with_batch, dtype=np.int64, lanes=LANES)


def largest(axes: str = "") -> Any:
    """Largest, at least 0; contributions are (blocks, *axes)."""
    return _declared(axes, lambda total, rows, batch: np.maximum(total, rows.max(axis=0, initial=0.0)), np.maximum)


def joined(axes: str = "") -> Any:
    """Path by path along a last axis; contributions are (blocks, *axes, LANES)."""

    def with_batch(total: Array, rows: Array, batch: Batch) -> Array:
        paths = np.moveaxis(rows, 0, -2).reshape(*rows.shape[1:-1], len(rows) * LANES)
        return _joined(total, paths[..., : batch.end - batch.first_path])

    return _declared(axes, with_batch, _joined, behind=(0,), lanes=LANES)


def _joined(earlier: Array, later: Array) -> Array:
    return np.concatenate((earlier, later), axis=-1)


def of_first(axes: str = "", dtype: type = float) -> Any:
    """That of the first of two sets, as the number of steps done; set by the plan itself."""
    return _declared(axes, lambda total, rows, batch: rows, lambda earlier, later: earlier, dtype=dtype)


def by_group(axes: str = "") -> Any:
    """Added up by jackknife groups, (GROUPS, *axes); contributions are (blocks, *axes, PARTS)."""

    def with_batch(total: Array, rows: Array, batch: Batch) -> Array:
        by_round = total.reshape(ROUND, PARTS, *total.shape[1:]).copy()
        for block, row in enumerate(rows, batch.first):  # one by one, so that the bits do not depend on batches
            by_round[block % ROUND] += np.moveaxis(row, -1, 0)
        return by_round.reshape(total.shape)

    return _declared(axes, with_batch, before=(GROUPS,), lanes=PARTS)


def moments(axes: str, powers: int = 2) -> Any:
    """Powers 1, ..., `powers` added up by jackknife groups, (powers, *axes, GROUPS), as ``with_powers`` does.

    Contributions are (blocks, *axes, LANES).
    """

    def with_batch(total: Array, rows: Array, batch: Batch) -> Array:
        return with_powers(total, rows, batch)

    return _declared(axes, with_batch, before=(powers,), behind=(GROUPS,), lanes=(1 + powers) * LANES)


def reports(axes: str = "level") -> Any:
    """Reports of schemes on their steps, see ``spi.ensemble.loop.add_reports``; (blocks, *axes, columns)."""
    return _declared(
        axes,
        lambda total, rows, batch: add_reports(total, rows),
        lambda earlier, later: add_reports(earlier, later[np.newaxis]),
        behind=(len(REPORT),),
    )


@dataclass_transform(
    kw_only_default=True,
    frozen_default=True,
    field_specifiers=(added, counted, largest, joined, of_first, by_group, moments, reports),
)
@dataclass(frozen=True, kw_only=True, eq=False)
class Sums:
    """Sums over some paths; subclasses declare their fields, of which the classes are frozen dataclasses."""

    reductions: ClassVar[Mapping[str, Reduction]]

    paths: int  #: number of paths
    seconds: float  #: wall clock
    cpu_seconds: float

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True, eq=False)(cls)
        own: Any = cls  # mypy does not see that it is a dataclass by now
        cls.reductions = {f.name: f.metadata["reduction"] for f in fields(own) if "reduction" in f.metadata}

    def __post_init__(self) -> None:
        for name in self.reductions:  # NumPy makes numbers of arrays without axes
            object.__setattr__(self, name, np.asarray(getattr(self, name)))

    @classmethod
    def empty(cls, sizes: Mapping[str, int]) -> Self:
        """Sums over no paths; `sizes` are the lengths of the axes by name."""
        own: dict[str, Any] = {
            name: np.zeros((*r.before, *(sizes[axis] for axis in r.axes), *r.behind), r.dtype)
            for name, r in cls.reductions.items()
        }
        return cls(**({"paths": 0, "seconds": 0.0, "cpu_seconds": 0.0} | own))

    @classmethod
    def bytes_of_a_block(cls, sizes: Mapping[str, int]) -> int:
        """Memory that the contributions of a block need."""
        return sum(8 * r.lanes * int(np.prod([sizes[axis] for axis in r.axes])) for r in cls.reductions.values())

    def plus(self, later: Self) -> Self:
        """Sums over these paths and the `later` ones of the path set."""
        both: dict[str, Any] = {
            name: getattr(self, name) + getattr(later, name) for name in ("paths", "seconds", "cpu_seconds")
        }
        both |= {name: r.plus(getattr(self, name), getattr(later, name)) for name, r in self.reductions.items()}
        return type(self)(**both)

    def with_batch(self, contributions: Mapping[str, Array], batch: Batch) -> Self:
        """Sums with the contributions of a batch."""
        with np.errstate(all="ignore"):
            return self._replace(
                **{
                    name: self.reductions[name].with_batch(getattr(self, name), rows, batch)
                    for name, rows in contributions.items()
                }
            )

    def _replace(self, **changed: Any) -> Self:
        return type(self)(**(self._asdict() | changed))

    def _asdict(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self._fields}

    @property
    def _fields(self) -> tuple[str, ...]:
        own: Any = self  # mypy does not see that it is a dataclass
        return tuple(field.name for field in fields(own))

    def __iter__(self) -> Iterator[Any]:
        return iter(self._asdict().values())
