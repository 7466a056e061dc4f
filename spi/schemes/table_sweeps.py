"""Flows on all lanes as loops over tables of components, see ``ensemble/table_flows.py``.

What moves the lanes is called, not inlined: it takes long enough, and what is compiled for a flow stays small.
"""

import functools

import numpy as np

from ..compiler.dispatch import INDICES, device, intrinsic, number
from ..compiler.generated import function_of
from ..compiler.instructions import floats_on_stack, load_each
from ..compiler.records import class_of
from ..compiler.vectors import WIDTH, load, store
from ..ensemble.friction import friction_after, friction_rate
from ..ensemble.lanes import store_lane
from ..ensemble.table_flows import (
    drift_tables,
    noise_tables,
    row_length,
    shape_angle,
    shape_flow,
    shape_slopes,
)
from ..numerics.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES
from ..numerics.elementary import REDUCIBLE, SMALL, TINY, bits
from ..numerics.rng import LANES
from .long_sweeps import of_lane
from .parts import Drift, Noise

# Angles are compared by their bits: as integers, because a maximum of floats that respects NaN is not vectorised.
# The bits of a NaN exceed those of every number, so it takes the last road.
TINY_BITS, SMALL_BITS, REDUCIBLE_BITS = int(bits(TINY)), int(bits(SMALL)), int(bits(REDUCIBLE))

_TABLES = {Drift: drift_tables, Noise: noise_tables}


def table_of(part, index, model):
    """The table of a flow, () if there is none, given records or their Numba types."""
    found = _TABLES[class_of(part)](model) if class_of(part) in _TABLES else ()
    k = number(class_of(index)())
    return found[k] if k < len(found) else ()


def places(rows):
    """Where the rows of components begin in the array of a block."""
    return np.array(rows, np.int64) * LANES


@functools.lru_cache
def table_sweep(table):
    """The function that takes the place of ``one_flow.sweep`` for the flow with this table."""
    lines, names = ["def in_rows(part, index, model, y, t):", "largest = 0"], {}
    turning = []
    for n, (shape, count, rows) in enumerate(table):
        sizes = {f"shape_{n}": shape, f"size_{n}": len(rows[0]), f"count_{n}": count}
        names |= {name: INDICES[value]() for name, value in sizes.items()} | {f"rows_{n}": places(rows)}
        lines.append(f"largest = max(largest, angle_in_rows(shape_{n}, size_{n}, model, y, t, rows_{n}))")
        turning.append(f"turn_rows(largest, shape_{n}, size_{n}, count_{n}, model, y, t, rows_{n})")
    names |= {"angle_in_rows": angle_in_rows, "turn_rows": turn_rows}
    return function_of([*lines, *turning, "return largest"], names)


@device(inline=False)
def angle_in_rows(shape, size, model, y, t, rows):
    """The bits of the largest |angle| of a shape in some rows."""
    largest = 0
    for row in range(rows.shape[0]):
        at = places_in(size, rows, row)
        for lane in range(LANES):
            state = load_at(model, at, y, lane)
            largest = max(largest, bits(shape_angle(model, number(shape), of_lane(t, lane), state)))
    return largest


@device(inline=False)
def turn_rows(largest, shape, size, count, model, y, t, rows):
    """The flow of a shape in some rows, where this is the largest of all angles."""
    moved = lanes_of(count)
    if largest <= TINY_BITS:
        turn_rows_within(TINY_ANGLES, shape, size, count, model, y, t, rows, moved)
    elif largest <= SMALL_BITS:
        turn_rows_within(SMALL_ANGLES, shape, size, count, model, y, t, rows, moved)
    elif largest <= REDUCIBLE_BITS:
        turn_rows_within(REDUCED_ANGLES, shape, size, count, model, y, t, rows, moved)
    else:
        turn_rows_within(ANY_ANGLES, shape, size, count, model, y, t, rows, moved)


@device
def turn_rows_within(angles, shape, size, count, model, y, t, rows, moved):
    for row in range(rows.shape[0]):
        at = places_in(size, rows, row)
        for lane in range(LANES):
            state = load_at(model, at, y, lane)
            turned = shape_flow(model, number(shape), of_lane(t, lane), state, angles)
            store_lane(moved, lane, first_of(count, turned))
        for part in range(number(count)):
            copy_lanes(moved, part * LANES, y, rows[row, part])


@functools.lru_cache
def table_friction(shape, row):
    """The function that takes the place of ``one_flow.friction_times`` for the noise with this shape and row."""
    names = {"shape": INDICES[shape](), "size": INDICES[len(row)](), "rows": places([row])}
    names |= {"friction_in_rows": friction_in_rows, "friction_rate": friction_rate, "number": number}
    call = "friction_in_rows(shape, size, model, friction_rate(model, number(index)), t, y, times, rows)"
    return function_of(["def friction(index, model, t, y, times):", call], names)


@device(inline=False)
def friction_in_rows(shape, size, model, rate, t, y, times, rows):
    """The times of a noise of which the friction has this rate."""
    found, at = lanes_of(INDICES[1]()), places_in(size, rows, 0)
    for lane in range(LANES):
        slope, bend = shape_slopes(model, number(shape), load_at(model, at, y, lane))
        found[lane] = friction_after(rate, t, slope, bend)
    copy_lanes(found, 0, times, 0)


@device
def copy_lanes(source, begin, target, at):
    """The floats of all lanes from one place to another."""
    for lane in range(0, LANES, WIDTH):
        store(target, at + lane, load(source, begin + lane))


def lanes_of(count):
    """Room for number(count) floats in each lane, until the function that asks for it returns."""
    return np.empty(number(count) * LANES)


@intrinsic(lanes_of)
def _(count):
    return floats_on_stack(number(class_of(count)()) * LANES, count)


@device(by_type=True)
def places_in(size, rows, row):
    """A row of a table, of which the length is number(size), as a tuple."""
    return _first("rows[row, {}]", "size, rows, row", number(class_of(size)()))


@device(by_type=True)
def first_of(count, state):
    """The first number(count) floats of a tuple."""
    return _first("state[{}]", "count, state", number(class_of(count)()))


@functools.cache
def _first(entry, parameters, count):
    entries = "".join(f"{entry.format(n)}, " for n in range(count))
    return function_of([f"def first({parameters}):", f"return ({entries})"], {})


def load_at(model, at, y, lane):
    """The components of one lane that begin at these places, as a tuple with 0 behind them, see `row_length`."""
    return tuple(float(y[place + lane]) for place in at) + (0.0,) * (row_length(model) - len(at))


@intrinsic(load_at)
def _(model, at, y, lane):
    return load_each(row_length(model), model, at, y)
