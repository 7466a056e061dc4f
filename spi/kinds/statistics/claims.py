"""What a spec may expect of statistics: what they are at the last time, and deviations from what is known."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.statistics.claims import Quantity, quantity

from .results import Quantiles, Statistics


def quantities(readings: Sequence[Statistics]) -> Iterator[Quantity]:
    """For each function what is known at the last time, and the largest deviation in standard errors."""
    for one in readings:
        deviation = one.deviation
        for f, name in enumerate(one.functions):
            for quantity_name in ("mean", "variance", "autocorrelation", "difference"):
                values, errors = getattr(one, quantity_name), getattr(one, f"{quantity_name}_stderr")
                known = one.reference[f, -1] if quantity_name == "mean" and one.reference is not None else np.nan
                if values is not None and not np.isnan(values[f, -1]):
                    half = one.interval * errors[f, -1] if errors[f, -1] else 0.0
                    found = quantity(quantity_name, one.about, values[f, -1], half, name, expected=known)
                    is_mean = quantity_name == "mean" and np.isfinite(found.value)
                    low, high = (float(end[f, -1]) for end in one.mean_ends)
                    yield found._replace(low=low, high=high) if is_mean else found
            if deviation is not None and np.isfinite(deviation[f]).any():
                yield quantity("deviation", one.about, np.nanmax(np.abs(deviation[f])), 0.0, name)
            if one.quantiles:
                yield from _quantiles(one, one.quantiles, f)


def _quantiles(one: Statistics, known: Quantiles, f: int) -> Iterator[Quantity]:
    """The quantiles of a function at the last time, each as that of ``function, level``."""
    for i, level in enumerate(known.level.tolist()):
        value, low, high = (float(each[f, -1, i]) for each in (known.quantile, known.quantile_low, known.quantile_high))
        yield Quantity("quantile", one.about, value, low, high, f"{one.functions[f]}, {level:g}-quantile")
