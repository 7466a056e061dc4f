"""What a spec may expect of errors and times; not the times, which are others on every machine."""

from collections.abc import Iterable, Iterator

from spi.statistics.claims import Quantity, each_step, lost_is_infinite, order, quantity

from .results import WorkPrecision


def quantities(readings: Iterable[WorkPrecision]) -> Iterator[Quantity]:
    """The fitted order; for each step size the error and, where it is known, Casimir drift and diverged paths."""
    for one in readings:
        yield order(one.about, one.order, expected=one.expected_order)
        for h, error, half in zip(one.h.tolist(), one.error.tolist(), one.half.tolist(), strict=True):
            yield quantity("error", one.about, error, half, h=h)
        if one.largest_drift is not None:
            yield from each_step("casimir_drift", one.about, one.h, lost_is_infinite(one.largest_drift))
        if one.nonfinite is not None:
            yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
