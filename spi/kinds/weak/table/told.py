"""What came out of weak errors, in words."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.printing.sentences import joined, orders, sentence, whose
from spi.storage.records import Order

from ..comparisons import agreement
from ..results import WeakErrors


def told(readings: Sequence[WeakErrors]) -> str:
    """What came out of a case, in one sentence: orders, and whether sampled and deterministic errors agree.

    Of several estimators the one with the narrowest interval tells the order.
    """
    best: dict[tuple[str, str], tuple[str, Order, float | None]] = {}
    for reading in readings:
        for function, order in zip(reading.functions, reading.orders, strict=True):
            key = reading.about.variant, function
            if key not in best or _width(order) < _width(best[key][1]):
                best[key] = whose(reading.about), order, reading.expected_order
    return sentence([orders("weak", best.values()), *_agreement(readings)])


def _width(order: Order) -> float:
    return np.inf if np.isnan(order.order) else order.high - order.low


def _agreement(readings: Sequence[WeakErrors]) -> Iterator[str]:
    far: dict[str, float] = {}
    for reading in readings:
        found = agreement(reading, readings)
        known = np.abs(found.deviation[np.isfinite(found.deviation)]) if found else np.empty(0)
        if known.size:
            label = whose(reading.about)
            far[label] = max(far.get(label, 0.0), float(known.max()))
    if far:
        each = [f"{most:.1f} for {label}" for label, most in far.items()]
        yield f"sampled and deterministic errors differ by at most so many standard errors: {joined(each)}"
