"""What a spec may expect of stability."""

from collections.abc import Iterable, Iterator

from spi.statistics.claims import Quantity, each_step, lost_is_infinite

from .results import Stability

#: Where a result has each quantity, with its standard error if it has one.
_FIELDS = {
    "finite": "finite",
    "largest_norm": "largest_norm",
    "positive": "positive",
    "casimir_worst": "casimirs.largest_worst",
    "casimir_median": "casimirs.largest_median",
    "failing_fraction": "solver.failing_fraction",
    "error": "error",
    "law_distance": "law.distance",
}


def quantities(readings: Iterable[Stability]) -> Iterator[Quantity]:
    """For each step size and value of the sweep what :class:`~.results.Stability` has; NaN is infinite but of laws."""
    for one in readings:
        for name, field in _FIELDS.items():
            if (values := one.known(field)) is None:
                continue
            values = values if name == "law_distance" else lost_is_infinite(values)
            stderr = one.known(f"{field}_stderr")
            for i, value in enumerate(one.values.tolist()):
                for found in each_step(name, one.about, one.h, values[i], None if stderr is None else stderr[i]):
                    yield found._replace(swept=(one.word, value))
