"""What a spec may expect of strong errors."""

from collections.abc import Iterable, Iterator

from spi.statistics.claims import Quantity, drifts, each_step, order

from .results import StrongErrors


def quantities(readings: Iterable[StrongErrors]) -> Iterator[Quantity]:
    """The fitted order; for each step size the error, the drift of the Casimirs and how many paths diverged."""
    for one in readings:
        yield order(one.about, one.order, expected=one.expected_order)
        yield from each_step("error", one.about, one.h, one.error, one.error_stderr)
        yield from drifts(one.about, one.h, one.casimir_drift)
        yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
