"""What a spec may expect of Lyapunov exponents: the largest, their sum and the dimension."""

import math
from collections.abc import Iterator, Sequence

from spi.statistics.claims import Quantity, lost_among, quantity

from .results import Exponents


def quantities(readings: Sequence[Exponents]) -> Iterator[Quantity]:
    """At the last time, and how many paths diverged."""
    for one in readings:
        yield quantity("nonfinite", one.about, one.nonfinite)
        yield quantity("largest_exponent", one.about, one.exponent[0, -1], one.exponent_half[0, -1])
        known = math.nan if one.total_known is None else one.total_known
        yield quantity("exponent_sum", one.about, one.total[-1], one.total_half[-1], expected=known)
        if one.dimension_half is not None:
            lost = lost_among(one.exponent[:, -1], "exponents")
            yield quantity("dimension", one.about, one.dimension, one.dimension_half, lost=lost)
