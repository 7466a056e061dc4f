"""Noise of one step, as the loop over time hands it to a scheme: for whoever makes that step again in Python."""

from typing import Any, NamedTuple

import numpy as np

from ..compiler.inlining import uncompiled
from ..compiler.records import field
from ..numerics.rng import LANES
from .increments import coins_length, kept_of_steps, row_length
from .loop import integrated
from .protocol import dimension
from .scheme_protocol import judges, needs_areas, substeps, tosses


class NoiseRecorder(NamedTuple):
    """No scheme: a step puts the noise that `scheme` would be given behind the states, as the last floats of a row."""

    scheme: Any

    def tosses(scheme):
        return tosses(field(scheme, "scheme"))

    def judges(scheme):
        return judges(field(scheme, "scheme"))

    def substeps(scheme):
        return substeps(field(scheme, "scheme"))

    def needs_areas(scheme):
        return needs_areas(field(scheme, "scheme"))

    def advance(scheme, model, h, dW, coins, y, work, report):
        first = len(y) - len(dW) - len(coins)
        for i in range(len(dW)):
            y[first + i] = dW[i]
        for i in range(len(coins)):
            y[first + len(dW) + i] = coins[i]

    advance_large = advance


def noise_of_step(scheme, model, times, stream, block, n):
    """(dW, coins) of a block in step n of the only path of the grid `times`; steps count from 0, of its own size.

    They are those that ``scheme_protocol.advance`` gets, to the last bit: joined, clipped, and with coins turned.
    """
    reference, step = times.reference_scheme, NoiseRecorder(scheme)
    reference = None if reference is None else NoiseRecorder(reference)
    with uncompiled():
        layout = kept_of_steps(reference, step, model)
        sizes = row_length(layout, model), coins_length(layout.coins, model)
    times = times._replace(reference_scheme=reference, reference_steps=(n + 1) << int(times.doublings[0]))
    states = np.zeros((1, 1, dimension(model) * LANES + sum(sizes)))
    row = integrated(step, model, states, times, stream, block, 1, (block + 1) * LANES)[0][0, 0]
    return np.split(row[-sum(sizes) :], sizes[:1])
