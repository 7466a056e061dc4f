"""What a spec may expect of Lyapunov exponents: the largest, their sum and the dimension."""

import math
from collections.abc import Iterator, Sequence

from spi.statistics.claims import Quantity, lost_among, quantity
from spi.storage.records import INTERVAL

from .results import Exponents


def quantities(readings: Sequence[Exponents]) -> Iterator[Quantity]:
    """At the last time, and how many paths diverged."""
    for one in readings:
        yield quantity("nonfinite", one.about, one.nonfinite)
        largest = one.exponent[0, -1], INTERVAL * one.exponent_stderr[0, -1]
        yield quantity("largest_exponent", one.about, *largest)
        known = math.nan if one.total_known is None else one.total_known
        yield quantity("exponent_sum", one.about, one.total[-1], INTERVAL * one.total_stderr[-1], expected=known)
        if one.dimension_stderr is not None:
            lost = lost_among(one.exponent[:, -1], "exponents")
            yield quantity("dimension", one.about, one.dimension, INTERVAL * one.dimension_stderr, lost=lost)
