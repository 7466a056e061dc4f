"""What a spec may expect of Lyapunov exponents: the largest, and their sum."""

import math
from collections.abc import Iterator, Sequence

from spi.statistics.claims import Quantity, quantity
from spi.storage.records import INTERVAL

from .results import Exponents


def quantities(readings: Sequence[Exponents]) -> Iterator[Quantity]:
    """At the last time."""
    for one in readings:
        largest = one.exponent[0, -1], INTERVAL * one.exponent_stderr[0, -1]
        yield quantity("largest_exponent", one.about, *largest)
        known = math.nan if one.total_known is None else one.total_known
        yield quantity("exponent_sum", one.about, one.total[-1], INTERVAL * one.total_stderr[-1], expected=known)
        if one.dimension_stderr is not None:
            yield quantity("dimension", one.about, one.dimension, INTERVAL * one.dimension_stderr)
