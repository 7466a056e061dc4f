"""Which step size and which length of a run give means of a wanted accuracy, from what a run has found."""

import math
from collections.abc import Iterator

import numpy as np

from spi.printing.text import INTERVAL, short

from .results import LONG_ENOUGH, Averages, Equilibrium


def planned(reading: Equilibrium, found: Averages) -> Iterator[str]:
    """For each function the time for a standard error s, and with an accuracy that is wanted the numbers for it.

    A mean over the time t of all paths has the variance 2 tau Var / t; the bias is C h^p, where that was fitted.
    """
    for f, name in enumerate(found.functions):
        i = len(reading.h) - 1
        rate = 2 * found.tau[i, f] * found.variance[i, f]
        if not math.isfinite(rate) or rate <= 0:
            continue
        wanted = reading.accuracy
        if wanted is None:
            needed = f"{short(float(rate))}/s^2 of time in all paths"
            yield f"{reading.about.label}: a standard error s of {name} takes {needed}"
            continue
        step, why = step_for(reading, found, f, wanted)
        time = rate / wanted**2
        each = max(time / reading.samples, LONG_ENOUGH * found.tau[i, f])
        length = f"{reading.samples} paths of time {short(float(each))} behind the burn-in, {short(each / step)} steps"
        which = f"{reading.about.label}, {name}: h = {short(step)} ({why})"
        yield f"{which} and {length}, for an accuracy of {short(wanted)}"


def step_for(reading: Equilibrium, found: Averages, f: int, wanted: float) -> tuple[float, str]:
    """A step size at which the bias of a function is at most `wanted`, and how that is known.

    By the fitted bias, or else the largest one at which mean and reference are that close; or none is known.
    """
    constant, order = found.constant[f], found.order[f].order
    if np.isfinite(constant) and np.isfinite(order) and order > 0 and constant != 0:
        return float((wanted / abs(constant)) ** (1 / order)), "by the fitted bias"
    near = np.abs(found.bias[:, f]) + INTERVAL * found.bias_stderr[:, f] <= wanted  # false for NaN
    if near.any():
        return float(reading.h[near].max()), "no bias is seen there"
    return float(reading.h[-1]), "the smallest here, its bias is not known"
