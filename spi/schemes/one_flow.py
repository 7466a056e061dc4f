"""One flow on all lanes of a block, by sines for the largest of their angles."""

import functools

from ..compiler.dispatch import device, number
from ..compiler.generated import function_of
from ..compiler.records import class_of, field, is_array, is_none
from ..ensemble.friction import friction_time
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.table_flows import friction_tables, is_inlined
from ..numerics.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES
from ..numerics.elementary import bits
from ..numerics.rng import LANES
from .long_sweeps import is_long, long_sweep
from .parts import Together, angle, flow
from .table_sweeps import REDUCIBLE_BITS, SMALL_BITS, TINY_BITS, table_friction, table_of, table_sweep


@device(by_type=True)
def sweep(part, index, model, y, t):
    """The flow number ``number(index)`` of a part for the time t, a number or one per lane, on all lanes.

    Returns the bits of the largest |angle| in it.
    """
    if table := table_of(part, index, model):
        return table_sweep(table)
    return _sweep if is_inlined(model) else _called_sweep


def _called_sweep(part, index, model, y, t):
    return _sweep_on_its_own(part, index, model, y, t)


def _sweep(part, index, model, y, t):
    k = number(index)
    largest = 0
    for lane in range(LANES):
        largest = max(largest, bits(angle(part, model, k, time_of(part, t, lane), load_lane(model, y, lane))))
    sweep_up_to(largest, part, index, model, y, t)
    return largest


_sweep_on_its_own = device(inline=False)(_sweep)


@device(by_type=True)
def sweep_up_to(largest, part, index, model, y, t):
    """The same, given these bits."""
    return long_sweep if is_long(part, model) else _sweep_up_to


def _sweep_up_to(largest, part, index, model, y, t):
    if largest <= TINY_BITS:
        sweep_within(TINY_ANGLES, part, index, model, y, t)
    elif largest <= SMALL_BITS:
        sweep_within(SMALL_ANGLES, part, index, model, y, t)
    elif largest <= REDUCIBLE_BITS:
        sweep_within(REDUCED_ANGLES, part, index, model, y, t)
    else:
        sweep_within(ANY_ANGLES, part, index, model, y, t)


@device
def sweep_within(angles, part, index, model, y, t):
    for lane in range(LANES):
        store_lane(y, lane, flow(part, model, number(index), time_of(part, t, lane), load_lane(model, y, lane), angles))


@device(by_type=True)
def friction_times(index, model, t, y, times):
    """How long the flow of noise number(index) acts in each lane in the place of friction for the time t."""
    if tables := friction_tables(model):
        return table_friction(*tables[number(class_of(index)())])
    return _friction_times if is_inlined(model) else _called_friction


def _called_friction(index, model, t, y, times):
    _friction_on_its_own(index, model, t, y, times)


def _friction_times(index, model, t, y, times):
    for lane in range(LANES):
        times[lane] = friction_time(model, number(index), t, load_lane(model, y, lane))


_friction_on_its_own = device(inline=False)(_friction_times)


@device(by_type=True)
def time_of(part, t, lane):
    """t, or the entry of the lane if there is one for each; of a joint flow (time, times of noises)."""
    if class_of(part) is Together:
        return _times_together(number(field(part, "count")), number(field(part, "most")), is_none(field(part, "time")))
    return (lambda part, t, lane: t[lane]) if is_array(t) else (lambda part, t, lane: t)


@functools.lru_cache
def _times_together(count, most, of_lanes):
    """Those of the noises stand in t one behind the other, and last that of the piece if it is one `of_lanes`."""
    times = "".join(f"t[{place} * LANES + lane], " for place in range(count)) + "0.0, " * (most - count)
    time = f"t[{count} * LANES + lane]" if of_lanes else "part.time"
    return function_of(["def times_together(part, t, lane):", f"return {time}, ({times})"], {"LANES": LANES})
