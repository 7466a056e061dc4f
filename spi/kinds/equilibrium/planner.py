"""Which step size and which length of a run give means of a wanted accuracy, from what a run has found."""

import math
from collections.abc import Iterator

import numpy as np

from spi.printing.text import short

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
        h = step_for(found, f, wanted)
        time = rate / wanted**2
        each = max(time / reading.samples, LONG_ENOUGH * found.tau[i, f])
        step, known = (reading.h[i], "the smallest step here, no bias was fitted") if h is None else (h, "")
        which = f"h = {short(float(step))}" + (f" ({known})" if known else f" for a bias of {short(wanted)}")
        length = f"{reading.samples} paths of time {short(float(each))} behind the burn-in, {short(each / step)} steps"
        yield f"{reading.about.label}: {name}: {which}; {length} for a standard error of {short(wanted)}"


def step_for(found: Averages, f: int, wanted: float) -> float | None:
    """The step size at which the fitted bias of a function is `wanted`; None where none was fitted."""
    constant, order = found.constant[f], found.order[f].order
    if not (np.isfinite(constant) and np.isfinite(order) and order > 0 and constant != 0):
        return None
    return float((wanted / abs(constant)) ** (1 / order))
