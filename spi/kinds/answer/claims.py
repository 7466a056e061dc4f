"""What a spec may expect of answers."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.statistics.claims import Quantity, quantity

from .results import Answer


def quantities(readings: Sequence[Answer]) -> Iterator[Quantity]:
    """The value of each function with its interval, and half the width of that."""
    for one in readings:
        for name, value, half in zip(one.functions, one.value, one.half, strict=True):
            yield quantity("value", one.about, value, half, name)
            lost = "" if np.isfinite(value) else "of a value that is not finite"
            yield quantity("interval", one.about, half, 0.0, name, lost=lost)
