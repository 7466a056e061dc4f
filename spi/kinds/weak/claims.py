"""What a spec may expect of weak errors."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.statistics.claims import Quantity, at_steps, each_step, lost_among, order, quantity

from .comparisons import agreement, comparable_sweeps, largest_over_eps
from .results import WeakErrors


def quantities(readings: Sequence[WeakErrors]) -> Iterator[Quantity]:
    """For each test function its order, errors without their sign, their distances from others, and expectations.

    The distances from deterministic errors (``agreement``) are in standard errors.  ``uniform_order`` is that of the
    largest error over eps.
    """
    for one in readings:
        for f, function in enumerate(one.functions):
            yield order(one.about, one.orders[f], function=function, expected=one.expected_order)
            yield from at_steps("error", one.about, one.h, np.abs(one.error[f]), one.half[f], function)
            limit = one.unsampled.limit[f] if one.unsampled else np.nan  # which a solver knows
            for i, h in enumerate(one.h.tolist()):
                told = one.expectation[f, i], one.expectation_half[f, i], function, h, limit
                yield quantity("expectation", one.about, *told)
        if near := agreement(one, readings):
            exact = np.zeros(len(one.h))
            for f, function in enumerate(one.functions):
                yield from at_steps("agreement", one.about, one.h, np.abs(near.deviation[f]), exact, function)
        if one.nonfinite is not None:
            yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
    for members in comparable_sweeps(readings).values():
        about = members[0].about._replace(eps=None, variant=members[0].about.scheme)
        for f, function in enumerate(members[0].functions):
            largest = largest_over_eps(members, f)
            found = order(about, largest.order, "uniform_order", function)
            yield found._replace(lost=lost_among(largest.value + largest.stderr, "errors"))
