"""Which scheme and step the results of a study recommend."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.plugins.comparisons.kinds.work_precision.results import (
    WorkPoint,
    WorkPrecision,
    cheapest,
    requested,
    step_text,
    work_for,
)
from spi.printing.text import duration, short

#: Casimir functions that change by less count as preserved.
PRESERVED = 1e-8


def advice(readings: Sequence[WorkPrecision]) -> Iterator[str]:
    """Sentences: for each requested error the cheapest scheme, and the cheapest of those that preserve all Casimirs."""
    labels = {one.about.variant: one.about.label for one in readings}
    conserve = {one.about.variant for one in readings if _preserves(one)}
    for target in reversed(requested(readings)):
        works = {one.about.variant: work_for(target, one.curve) for one in readings}
        best, _ = cheapest(works)
        if best is None:
            yield f"An error of {short(target, '.3g')}: no scheme reaches it at these steps."
            continue
        line = f"An error of {short(target, '.3g')}: {labels[best]}, {_way(works[best])}"
        kept, _ = cheapest({name: point for name, point in works.items() if name in conserve})
        if not conserve:
            yield f"{line}."
        elif best in conserve:
            yield f"{line}; it preserves the Casimir functions."
        elif kept is None:
            yield f"{line}; no scheme that preserves the Casimir functions reaches it."
        else:
            yield f"{line}; of the schemes that preserve the Casimir functions {labels[kept]}, {_way(works[kept])}."


def _way(point: WorkPoint | None) -> str:
    assert point is not None
    return f"h = {step_text(point.h)}, {'at most ' if point.at_most else ''}{duration(point.seconds)} a path"


def _preserves(one: WorkPrecision) -> bool:
    drift = one.casimir_drift
    return drift is not None and drift.size > 0 and bool(np.all(drift < PRESERVED))
