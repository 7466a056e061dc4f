"""Records that lie in memory: what compiled code reads from them is what it reads from records handed on by value."""

import sys
from typing import NamedTuple

import numpy as np
from helpers import COMPILED

from spi.compiler.dispatch import device, kernel
from spi.compiler.pointers import in_memory


class Inner(NamedTuple):
    rows: np.ndarray
    factor: float


class Outer(NamedTuple):
    inner: Inner
    pairs: tuple[tuple[float, int], tuple[float, int]]
    weights: np.ndarray
    count: int
    on: bool

    large = True


class Small(Outer):
    large = False


@device(inline=False)
def summed(record, out):
    total = 0.0
    for i in range(record.count):
        for j in range(record.inner.rows.shape[1]):
            total += record.inner.rows[i, j] * record.weights[j]
    for value, n in record.pairs:
        total += n * value
    record.weights[0] += 1.0  # arrays are those of the caller
    out[0] += record.inner.factor * total if record.on else 0.0


@kernel
def ask(record, out):
    told = in_memory(record)
    summed(in_memory(told), out)  # twice is once
    return told.count + told.inner.rows.shape[0]


def expected(record):
    total = (record.inner.rows[: record.count] @ record.weights).sum() + sum(n * x for x, n in record.pairs)
    return record.inner.factor * total * record.on


def test_fields_of_records_in_memory():
    """Numbers, tuples of tuples, strided arrays, a record within; other values in the next call are read anew."""
    rng = np.random.default_rng(1)
    for cls in (Outer, Small):
        for n in range(4):
            rows, weights = rng.normal(size=(5, 6))[:, ::2], rng.normal(size=3)
            record = cls(Inner(rows, 0.5 + n), ((1.5, n), (-0.25, 7)), weights, 2 + n // 2, n != 1)
            before, right = weights[0], expected(record)
            counts, out = (sys.getrefcount(rows), sys.getrefcount(weights)), np.zeros(1)
            assert ask(record, out) == record.count + 5
            assert abs(out[0] - right) < 1e-14 * (1 + abs(right)) and weights[0] == before + 1.0
            assert (sys.getrefcount(rows), sys.getrefcount(weights)) == counts
    if COMPILED:
        assert len(ask.signatures) == 2
