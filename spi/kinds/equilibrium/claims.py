"""What a spec may expect of long times."""

from collections.abc import Iterable, Iterator

import numpy as np

from spi.statistics.claims import WIDEST, Quantity, each_step, lost_is_infinite

from .results import Equilibrium, Law


def quantities(readings: Iterable[Equilibrium]) -> Iterator[Quantity]:
    """For each step size how errors of the Casimirs grow, their bias per step, the worst, and how many paths diverged.

    Where the stationary law is known, the distance from it in each variable and the largest |z| of the means as well.
    """
    for one in readings:
        for c in range(one.casimir_count):
            yield from _growth(one, c)
            yield from each_step("bias", one.about, one.h, one.bias[:, c], one.bias_stderr[:, c])
            worst = lost_is_infinite(one.casimir_worst[:, :, c].max(axis=1))
            yield from each_step("casimir_worst", one.about, one.h, worst)
        if one.law:
            yield from _law(one, one.law)
        yield from each_step("nonfinite", one.about, one.h, one.nonfinite)


def _growth(one: Equilibrium, c: int) -> Iterator[Quantity]:
    ends = (values[:, c].tolist() for values in (one.growth, one.growth_low, one.growth_high))
    for h, value, low, high in zip(one.h.tolist(), *ends, strict=True):
        yield Quantity("growth", one.about, value, low, high, h=h, widest=WIDEST)


def _law(one: Equilibrium, law: Law) -> Iterator[Quantity]:
    for distance, stderr in zip(law.distance.T, law.distance_stderr.T, strict=True):
        yield from each_step("law_distance", one.about, one.h, distance, stderr)
    yield from each_step("mean_z", one.about, one.h, np.abs(law.z).max(axis=1))
