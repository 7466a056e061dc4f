"""What a spec may expect of errors and times; not the times, which are others on every machine."""

from collections.abc import Iterable, Iterator

from spi.statistics.claims import Quantity, at_steps, drifts, each_step, order

from .results import WorkPrecision


def quantities(readings: Iterable[WorkPrecision]) -> Iterator[Quantity]:
    """The fitted order; for each step size the error and, where it is known, Casimir drift and diverged paths."""
    for one in readings:
        yield order(one.about, one.order, expected=one.expected_order)
        yield from at_steps("error", one.about, one.h, one.error, one.half)
        if one.casimir_drift is not None:
            yield from drifts(one.about, one.h, one.casimir_drift)
        if one.nonfinite is not None:
            yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
