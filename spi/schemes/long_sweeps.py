"""Long flows on all lanes: their angles, the sines of these, and what is done with the sines, one after the other.

The sines of a sweep stand in scratch memory.  A number is computed as by the flow as a whole, to the last bit.
"""

from ..compiler.dispatch import device, intrinsic, number
from ..compiler.instructions import load_strided
from ..compiler.records import class_of, is_array
from ..ensemble.lanes import aligned, load_lane, store_lane
from ..ensemble.long_flows import phases
from ..numerics.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES, sin_versine
from ..numerics.elementary import REDUCIBLE, SMALL, TINY, from_bits
from ..numerics.rng import LANES
from .parts import Drift, Noise, phases_in, turned


def is_long(part, model):
    """Whether a flow of a part is divided, given records or their Numba types."""
    return phases(model) > 0 and class_of(part) in (Drift, Noise)


def long_sweep(largest, part, index, model, y, t):
    """One flow on all lanes, which take the times t, a number or an array; `largest`: the bits of the largest angle."""
    k = number(index)
    work = aligned(2 * phases(model) * LANES)
    for lane in range(LANES):
        store_lane(work, lane, phases_in(part, model, k, of_lane(t, lane), load_lane(model, y, lane)))
    take_sines(work, from_bits(largest))
    for lane in range(LANES):
        store_lane(y, lane, turned(part, model, k, load_sines(model, work, lane), load_lane(model, y, lane)))


@device(by_type=True)
def of_lane(t, lane):
    """t, or the entry of the lane if there is one for each."""
    return (lambda t, lane: t[lane]) if is_array(t) else (lambda t, lane: t)


@device(inline=False)
def take_sines(work, largest):
    """Sines in the place of the angles, which are no larger than this, and the versines behind them."""
    if largest <= TINY:
        sines_within(TINY_ANGLES, work)
    elif largest <= SMALL:
        sines_within(SMALL_ANGLES, work)
    elif largest <= REDUCIBLE:
        sines_within(REDUCED_ANGLES, work)
    else:
        sines_within(ANY_ANGLES, work)


@device
def sines_within(angles, work):
    half = len(work) // 2
    for i in range(half):
        work[i], work[half + i] = sin_versine(angles, work[i])


def load_sines(model, work, lane):
    """Those of one lane, and then the versines, as a tuple."""
    return tuple(float(work[i * LANES + lane]) for i in range(2 * phases(model)))


@intrinsic(load_sines)
def _(model, work, lane):
    return load_strided(2 * phases(model), LANES, model, work, lane)
