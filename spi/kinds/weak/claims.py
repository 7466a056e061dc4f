"""What a spec may expect of weak errors."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.claims import Quantity, order, quantity

from .reading import WeakErrors
from .reading.comparisons import agreement, comparable_sweeps, largest_over_eps


def quantities(readings: Sequence[WeakErrors]) -> Iterator[Quantity]:
    """For each test function its order, errors without their sign and their distances from deterministic ones.

    The distances (``agreement``) are in standard errors.  ``uniform_order`` is that of the largest error over eps.
    """
    for one in readings:
        for f, function in enumerate(one.functions):
            yield order(one.about, one.orders[f], function=function)
            yield from _each("error", one, function, np.abs(one.error[f]), one.half[f])
        if found := agreement(one, readings):
            for f, function in enumerate(one.functions):
                yield from _each("agreement", one, function, np.abs(found.deviation[f]), np.zeros(len(one.h)))
        if one.nonfinite is not None:
            yield from _each("nonfinite", one, "", one.nonfinite, np.zeros(len(one.h)))
    for members in comparable_sweeps(readings).values():
        about = members[0].about._replace(eps=None, variant=members[0].about.scheme)
        for f, function in enumerate(members[0].functions):
            yield order(about, largest_over_eps(members, f).order, "uniform_order", function)


def _each(name: str, one: WeakErrors, function: str, values: np.ndarray, halves: np.ndarray) -> Iterator[Quantity]:
    """A quantity for each step size."""
    for h, value, half in zip(one.h.tolist(), values.tolist(), halves.tolist(), strict=True):
        yield quantity(name, one.about, value, half, function, h)
