"""What is said about weak errors of schemes for the multiscale system at several eps."""

import math
from collections.abc import Iterator, Sequence

from spi.printing.text import INTERVAL, order_found, power_of_two, short, with_interval

from ..comparisons import comparable_sweeps, largest_over_eps
from ..results import WeakErrors


def over_eps(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """The largest errors over eps of each scheme and estimator with several eps: their order, and what they are."""
    for members in comparable_sweeps(readings).values():
        first, names = members[0], members[0].functions
        for f, name in enumerate(names):
            top = largest_over_eps(members, f)
            told = ", ".join([first.about.scheme_label, first.about.estimator, *[name] * (len(names) > 1)])
            order, low, high, _ = top.order
            yield f"{told}, largest over eps: {order_found(order, low, high, first.expected_order)}"
            points = zip(first.h, top.value, top.stderr, top.which, strict=True)
            yield f"    {', '.join(_point(h, value, stderr, members[i].about.eps) for h, value, stderr, i in points)}"


def _point(h: float, value: float, stderr: float, eps: float) -> str:
    return f"{power_of_two(h)}: {with_interval(value, INTERVAL * stderr)} (eps = {eps:g})"


def limits_shown(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """For which eps a reference does not resolve the fast processes, and what it shows then."""
    told: dict[tuple, set] = {}
    for reading in readings:
        if reading.reference_shows_limit:
            told.setdefault((reading.reference_step, reading.reference_scheme), set()).add(reading.about.eps)
    for (reference, scheme), small in told.items():
        few = ", ".join(f"{eps:g}" for eps in sorted(small, reverse=True))
        whose = f"the limit of {scheme}" if scheme else "the scheme's own limit"
        edge = f"eps < sqrt(h_ref) = {short(math.sqrt(reference), '.2g')}"
        yield f"{edge} (eps = {few}): the reference shows {whose}"
