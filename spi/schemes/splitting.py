"""Splitting schemes: compositions of the exact flows of H_1, ..., H_p and Ĥ_1, ..., Ĥ_m.

Each flow is one sweep over the lanes.  A sweep first looks at the largest angle of its lanes, so that sines of small
angles, which are nearly all, need no range reduction.
"""

from typing import NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from ..dispatch import INLINED, constant, field_type, inlined, means, number, record_class, unrolled, word
from ..elementary import REDUCIBLE, SMALL, TINY, bits, from_bits
from ..lanes import load, store
from ..protocol import (
    ANY_ANGLES,
    REDUCED_ANGLES,
    REPORT,
    SMALL_ANGLES,
    TINY_ANGLES,
    advance,
    drift_angle,
    drift_flow,
    noise_angle,
    noise_flow,
    noise_indices,
    piece_indices,
    pieces,
    strengths,
    work_size,
)
from ..rng import LANES

# Angles are compared by their bits: as integers, because a maximum of floats that respects NaN is not vectorised.
# The bits of a NaN exceed those of every number, so it takes the last road.
_TINY_BITS, _SMALL_BITS, _REDUCIBLE_BITS = int(bits(TINY)), int(bits(SMALL)), int(bits(REDUCIBLE))
_INFINITE_BITS = int(bits(np.inf))
_LARGEST_ANGLE = REPORT.index("largest_angle")


class DriftFlows(NamedTuple):
    """The stage exp(c h Y_{H_p}) o ... o exp(c h Y_{H_1}), c = ``fraction``."""

    fraction: float = 1.0


class StrangDriftFlows(NamedTuple):
    """The stage exp(c h/2 Y_{H_1}) o ... o exp(c h Y_{H_p}) o ... o exp(c h/2 Y_{H_1}), c = ``fraction``."""

    fraction: float = 1.0


class NoiseFlows(NamedTuple):
    """The stage exp(sigma_m dW_m Y_{Ĥ_m}) o ... o exp(sigma_1 dW_1 Y_{Ĥ_1}); a noise that is off is left out."""


class ShuffledNoiseFlows(NamedTuple):
    """The stage NoiseFlows where the coin of a path is 1, and the same flows in reversed order where it is -1."""


class Splitting(NamedTuple):
    """A composition of exact flows, given as its stages, the first to act first; a stochastic Poisson integrator."""

    stages: tuple


#: The paper's eq. slpI.
LIE_TROTTER = Splitting((NoiseFlows(), DriftFlows()))
#: Its remark rem-xchange: the deterministic part acts first.
LIE_TROTTER_EXCHANGED = Splitting((DriftFlows(), NoiseFlows()))
#: Its eq. order2, of weak order 2.
ORDER_2 = Splitting((StrangDriftFlows(0.5), ShuffledNoiseFlows(), StrangDriftFlows(0.5)))


def _tosses(scheme):
    if isinstance(scheme, types.Type):
        stages = [record_class(stage) for stage in field_type(scheme, "stages").types]
    else:
        stages = [type(stage) for stage in scheme.stages]
    return ShuffledNoiseFlows in stages


Splitting.tosses = staticmethod(_tosses)


def compositions(scheme, model):
    """A step as data: ((probability, flows), ...), where flows are ("drift" or "noise", k, fraction of h or 1), ...

    The flows stand in the order in which they act.  One composition, or two of probability 1/2 where coins are tossed.
    """
    pieces, noises = piece_indices(model), noise_indices(model)
    coins = (1, -1) if _tosses(scheme) else (1,)
    return tuple((1 / len(coins), tuple(_flows(scheme, coin, pieces, noises))) for coin in coins)


def _flows(scheme, coin, pieces, noises):
    for stage in scheme.stages:
        if isinstance(stage, DriftFlows):
            yield from (("drift", k, stage.fraction) for k in pieces)
        elif isinstance(stage, StrangDriftFlows):
            *first, last = pieces
            yield from (("drift", k, stage.fraction / 2) for k in first)
            yield "drift", last, stage.fraction
            yield from (("drift", k, stage.fraction / 2) for k in reversed(first))
        else:
            backwards = isinstance(stage, ShuffledNoiseFlows) and coin == -1
            yield from (("noise", k, 1.0) for k in (reversed(noises) if backwards else noises))


@means(work_size, Splitting)
def _(scheme, model):
    return LANES


@means(advance, Splitting)
def _(scheme, model, h, dW, coins, y, work, report):
    run_stages(scheme.stages, model, h, dW, coins, y, work, report)


def run_stages(stages, model, h, dW, coins, y, work, report):
    """Apply the stages in order; `work` has LANES floats."""
    largest = 0
    for stage in stages:
        largest = run_stage(stage, model, largest, h, dW, coins, y, work)
    report_angle(largest, report)


@overload(run_stages, jit_options=INLINED)
def _(stages, model, h, dW, coins, y, work, report):
    calls = "0"
    for i in range(len(stages)):
        calls = f"run_stage(stages[{i}], model, {calls}, h, dW, coins, y, work)"
    source = f"lambda stages, model, h, dW, coins, y, work, report: report_angle({calls}, report)"
    return eval(source, {"run_stage": run_stage, "report_angle": report_angle})


@inlined
def report_angle(largest, report):
    """Report the angle with these bits, if it is above pi/4."""
    if largest > _SMALL_BITS:
        report[_LARGEST_ANGLE] = max(report[_LARGEST_ANGLE], from_bits(min(largest, _INFINITE_BITS)))


# What follows acts on the states `y` of a block in place.  Its value is the bits of the largest |angle| met, those of
# `largest` included: handed on in a register, since a store in every sweep would cost 5 % of the speed.


@word
def run_stage(stage, model, largest, h, dW, coins, y, work):
    """Apply one stage."""


@means(run_stage, DriftFlows)
def _(stage, model, largest, h, dW, coins, y, work):
    return drift_sweeps(model, largest, y, stage.fraction * h)


@means(run_stage, StrangDriftFlows)
def _(stage, model, largest, h, dW, coins, y, work):
    largest = drift_sweeps_up(model, largest, y, stage.fraction * h)
    return drift_sweeps_down(model, largest, y, 0.5 * stage.fraction * h)


@means(run_stage, NoiseFlows)
def _(stage, model, largest, h, dW, coins, y, work):
    return noise_sweeps(model, largest, y, dW, work)


@means(run_stage, ShuffledNoiseFlows)
def _(stage, model, largest, h, dW, coins, y, work):
    largest = noise_sweeps_up(model, largest, y, dW, coins, work)
    return noise_sweeps_down(model, largest, y, dW, coins, work)


def _reversed_but_last(indices):
    return lambda model: indices(model)[-2::-1]


@unrolled(piece_indices)
def drift_sweeps(index, model, largest, y, t):
    """exp(t Y_{H_k}) for k = 1, ..., p."""
    return max(largest, sweep(Drift(), index, model, y, t))


@unrolled(piece_indices)
def drift_sweeps_up(index, model, largest, y, t):
    """exp(t/2 Y_{H_k}) for k = 1, ..., p - 1, then exp(t Y_{H_p})."""
    return max(largest, sweep(Drift(), index, model, y, t if number(index) == pieces(model) - 1 else 0.5 * t))


@unrolled(_reversed_but_last(piece_indices))
def drift_sweeps_down(index, model, largest, y, t):
    """exp(t Y_{H_k}) for k = p - 1, ..., 1."""
    return max(largest, sweep(Drift(), index, model, y, t))


@unrolled(noise_indices)
def noise_sweeps(index, model, largest, y, dW, t):
    """exp(sigma_k dW_k Y_{Ĥ_k}) for all noises in turn; `t` is scratch for one."""
    k = number(index)
    sigma = strengths(model)[k]
    for lane in range(LANES):
        t[lane] = sigma * dW[k * LANES + lane]
    return max(largest, sweep(Noise(), index, model, y, t))


# Where the order of the noises differs from lane to lane, all of 1, ..., m, ..., 1 are applied: those up to m - 1 with
# time 0 where the coin is -1, those after m with time 0 where it is 1.


@constant
def last_noise(model):
    """The last noise that is on, or -1."""
    return (-1, *noise_indices(model))[-1]


@unrolled(noise_indices)
def noise_sweeps_up(index, model, largest, y, dW, coins, t):
    """exp(sigma_k dW_k Y_{Ĥ_k}) for k = 1, ..., m - 1 where the coin is 1, then for k = m in all lanes."""
    k = number(index)
    sigma = strengths(model)[k]
    if k == last_noise(model):
        for lane in range(LANES):
            t[lane] = sigma * dW[k * LANES + lane]
    else:
        for lane in range(LANES):
            t[lane] = sigma * dW[k * LANES + lane] if coins[lane] > 0.0 else 0.0
    return max(largest, sweep(Noise(), index, model, y, t))


@unrolled(_reversed_but_last(noise_indices))
def noise_sweeps_down(index, model, largest, y, dW, coins, t):
    """exp(sigma_k dW_k Y_{Ĥ_k}) for k = m - 1, ..., 1 where the coin is -1."""
    k = number(index)
    sigma = strengths(model)[k]
    for lane in range(LANES):
        t[lane] = 0.0 if coins[lane] > 0.0 else sigma * dW[k * LANES + lane]
    return max(largest, sweep(Noise(), index, model, y, t))


# ---------------------------------------------------------------------------------------------------------------------
# One flow on all lanes
# ---------------------------------------------------------------------------------------------------------------------


class Drift(NamedTuple):
    """The flows of H_k."""


class Noise(NamedTuple):
    """The flows of Ĥ_k."""


@word
def flow(part, model, k, t, y, angles):
    """The flow of one part."""


@word
def angle(part, model, k, t, y):
    """The largest |angle| in it."""


@means(flow, Drift)
def _(part, model, k, t, y, angles):
    return drift_flow(model, k, t, y, angles)


@means(flow, Noise)
def _(part, model, k, t, y, angles):
    return noise_flow(model, k, t, y, angles)


@means(angle, Drift)
def _(part, model, k, t, y):
    return drift_angle(model, k, t, y)


@means(angle, Noise)
def _(part, model, k, t, y):
    return noise_angle(model, k, t, y)


@inlined
def sweep(part, index, model, y, t):
    """The flow number ``number(index)`` of a part for the time t, a number or one per lane, on all lanes.

    Returns the bits of the largest |angle| in it.
    """
    k = number(index)
    largest = 0
    for lane in range(LANES):
        largest = max(largest, bits(angle(part, model, k, of_lane(t, lane), load(model, y, lane))))
    if largest <= _TINY_BITS:
        sweep_within(TINY_ANGLES, part, index, model, y, t)
    elif largest <= _SMALL_BITS:
        sweep_within(SMALL_ANGLES, part, index, model, y, t)
    elif largest <= _REDUCIBLE_BITS:
        sweep_within(REDUCED_ANGLES, part, index, model, y, t)
    else:
        sweep_within(ANY_ANGLES, part, index, model, y, t)
    return largest


@inlined
def sweep_within(angles, part, index, model, y, t):
    for lane in range(LANES):
        store(y, lane, flow(part, model, number(index), of_lane(t, lane), load(model, y, lane), angles))


def of_lane(t, lane):
    """t, or the entry of the lane if there is one for each."""
    return t[lane] if np.ndim(t) else t


@overload(of_lane, jit_options=INLINED)
def _(t, lane):
    return (lambda t, lane: t[lane]) if isinstance(t, types.Array) else (lambda t, lane: t)
