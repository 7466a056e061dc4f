"""What a spec may expect of long times."""

from collections.abc import Iterable, Iterator

import numpy as np

from spi.statistics.claims import WIDEST, Quantity, at_steps, each_step, lost_is_infinite, order
from spi.storage.records import INTERVAL, Description

from .results import Averages, Equilibrium, Law


def quantities(readings: Iterable[Equilibrium]) -> Iterator[Quantity]:
    """For each step size how errors of the Casimirs grow, their bias per step, the worst, and how many paths diverged.

    Where the stationary law is known, the distance from it in each variable and the largest |z| of the means as well;
    of functions their means, and how far these are from what is known.
    """
    for one in readings:
        for c in range(one.casimir_count):
            yield from _growth(one, c)
            yield from each_step("bias", one.about, one.h, one.bias[:, c], one.bias_stderr[:, c])
            worst = lost_is_infinite(one.casimir_worst[:, :, c].max(axis=1))
            yield from each_step("casimir_worst", one.about, one.h, worst)
        if one.law:
            yield from _law(one, one.law)
        if one.averages:
            yield from _averages(one, one.averages)
        yield from each_step("nonfinite", one.about, one.h, one.nonfinite)


def _growth(one: Equilibrium, c: int) -> Iterator[Quantity]:
    ends = (values[:, c].tolist() for values in (one.growth, one.growth_low, one.growth_high))
    for h, value, low, high in zip(one.h.tolist(), *ends, strict=True):
        yield Quantity("growth", one.about, value, low, high, h=h, widest=WIDEST)


def _law(one: Equilibrium, law: Law) -> Iterator[Quantity]:
    for distance, stderr in zip(law.distance.T, law.distance_stderr.T, strict=True):
        yield from each_step("law_distance", one.about, one.h, distance, stderr)
    yield from each_step("mean_z", one.about, one.h, np.abs(law.z).max(axis=1))


def _averages(one: Equilibrium, found: Averages) -> Iterator[Quantity]:
    for f, name in enumerate(found.functions):
        at, (response, factor) = (one.about, one.h, name), found.response(f)
        yield from of_function("average", *at, found.average[:, f], found.average_half[:, f], found.reference[f])
        yield from of_function("tau", *at, found.tau[:, f], INTERVAL * found.tau_stderr[:, f])
        yield from of_function("halves", *at, np.abs(found.halves[:, f]))
        if np.isfinite(found.reference[f]):
            own = found.bias[:, f] == 0  # where the reference is the mean itself, which is no deviation
            steps, values = one.h[~own], np.abs(found.deviation[~own, f])
            yield from of_function("deviation", one.about, steps, name, values)
        if np.isfinite(factor):
            values, half = factor * found.variance[:, f], INTERVAL * abs(factor) * found.variance_stderr[:, f]
            yield from of_function(response.replace(" ", "_"), *at, values, half, factor * found.reference_variance[f])
        yield order(one.about, found.order[f], function=name)


def of_function(
    name: str,
    about: Description,
    h: np.ndarray,
    function: str,
    values: np.ndarray,
    halves: np.ndarray | float = 0.0,
    expected: float = np.nan,
) -> Iterator[Quantity]:
    """A quantity of a function at each step size in `h` (S,), with half the widths of intervals."""
    for one in at_steps(name, about, h, values, np.broadcast_to(halves, len(h)), function):
        yield one._replace(expected=float(expected))
