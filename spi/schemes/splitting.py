"""Splitting schemes: compositions of the exact flows of H_1, ..., H_p and Ĥ_1, ..., Ĥ_m.

Each flow is one sweep over the lanes.  A sweep first looks at the largest angle of its lanes, so that sines of small
angles, which are nearly all, need no range reduction.
"""

from typing import NamedTuple

from numba.extending import overload

from ..dispatch import INLINED, inlined, means, number, unrolled, word
from ..elementary import REDUCIBLE, SMALL, TINY, bits
from ..lanes import load, store
from ..protocol import (
    ANY_ANGLES,
    REDUCED_ANGLES,
    SMALL_ANGLES,
    TINY_ANGLES,
    advance,
    drift_angle,
    drift_flow,
    noise_angle,
    noise_flow,
    noise_indices,
    piece_indices,
    strengths,
)
from ..rng import LANES

# Angles are compared by their bits: as integers, because a maximum of floats that respects NaN is not vectorised.
# The bits of a NaN exceed those of every number, so it takes the last road.
_TINY_BITS, _SMALL_BITS, _REDUCIBLE_BITS = int(bits(TINY)), int(bits(SMALL)), int(bits(REDUCIBLE))


class DriftFlows(NamedTuple):
    """The stage exp(c h Y_{H_p}) o ... o exp(c h Y_{H_1}), c = ``fraction``."""

    fraction: float = 1.0


class NoiseFlows(NamedTuple):
    """The stage exp(sigma_m dW_m Y_{Ĥ_m}) o ... o exp(sigma_1 dW_1 Y_{Ĥ_1}); a noise that is off is left out."""


class Splitting(NamedTuple):
    """A composition of exact flows, given as its stages, the first to act first; a stochastic Poisson integrator."""

    stages: tuple


#: The paper's eq. slpI.
LIE_TROTTER = Splitting((NoiseFlows(), DriftFlows()))
#: Its remark rem-xchange: the deterministic part acts first.
LIE_TROTTER_EXCHANGED = Splitting((DriftFlows(), NoiseFlows()))


@means(advance, Splitting)
def _(scheme, model, h, dW, y, work, report):
    run_stages(scheme.stages, model, h, dW, y)


def run_stages(stages, model, h, dW, y):
    """Apply the stages in order."""
    for stage in stages:
        run_stage(stage, model, h, dW, y)


@overload(run_stages, jit_options=INLINED)
def _(stages, model, h, dW, y):
    if len(stages) == 0:
        return lambda stages, model, h, dW, y: None

    def first_then_rest(stages, model, h, dW, y):
        run_stage(stages[0], model, h, dW, y)
        run_stages(stages[1:], model, h, dW, y)

    return first_then_rest


@word
def run_stage(stage, model, h, dW, y):
    """Apply one stage to the states `y` of a block, in place."""


@means(run_stage, DriftFlows)
def _(stage, model, h, dW, y):
    drift_sweeps(model, y, stage.fraction * h)


@means(run_stage, NoiseFlows)
def _(stage, model, h, dW, y):
    noise_sweeps(model, y, dW)


@unrolled(piece_indices)
def drift_sweeps(index, model, y, t):
    """exp(t Y_{H_k}) on all lanes."""
    k = number(index)
    largest = 0
    for lane in range(LANES):
        largest = max(largest, bits(drift_angle(model, k, t, load(model, y, lane))))
    if largest <= _TINY_BITS:
        drift_sweep(index, model, t, y, TINY_ANGLES)
    elif largest <= _SMALL_BITS:
        drift_sweep(index, model, t, y, SMALL_ANGLES)
    elif largest <= _REDUCIBLE_BITS:
        drift_sweep(index, model, t, y, REDUCED_ANGLES)
    else:
        drift_sweep(index, model, t, y, ANY_ANGLES)
    return y


@inlined
def drift_sweep(index, model, t, y, angles):
    for lane in range(LANES):
        store(y, lane, drift_flow(model, number(index), t, load(model, y, lane), angles))


@unrolled(noise_indices)
def noise_sweeps(index, model, y, dW):
    """exp(sigma_k dW_k Y_{Ĥ_k}) on all lanes."""
    k = number(index)
    sigma = strengths(model)[k]
    largest = 0
    for lane in range(LANES):
        largest = max(largest, bits(noise_angle(model, k, sigma * dW[k * LANES + lane], load(model, y, lane))))
    if largest <= _TINY_BITS:
        noise_sweep(index, model, sigma, dW, y, TINY_ANGLES)
    elif largest <= _SMALL_BITS:
        noise_sweep(index, model, sigma, dW, y, SMALL_ANGLES)
    elif largest <= _REDUCIBLE_BITS:
        noise_sweep(index, model, sigma, dW, y, REDUCED_ANGLES)
    else:
        noise_sweep(index, model, sigma, dW, y, ANY_ANGLES)
    return y


@inlined
def noise_sweep(index, model, sigma, dW, y, angles):
    k = number(index)
    for lane in range(LANES):
        store(y, lane, noise_flow(model, k, sigma * dW[k * LANES + lane], load(model, y, lane), angles))
