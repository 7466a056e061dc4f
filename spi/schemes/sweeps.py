"""A flow on all lanes of a block, as a whole or as a loop over tables; what steps add to the report."""

import functools

import numpy as np

from ..compiler.dispatch import INDICES, device, function_of, intrinsic, number
from ..compiler.instructions import floats_on_stack, load_each
from ..compiler.records import class_of, field, is_array, is_none
from ..compiler.vectors import WIDTH, load, store
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import (
    decayed,
    drift_tables,
    friction_after,
    friction_bend,
    friction_rate,
    friction_slope,
    friction_tables,
    friction_time,
    is_inlined,
    linear_friction,
    noise_tables,
    row_length,
    shape_angle,
    shape_flow,
    shape_slopes,
)
from ..ensemble.scheme_protocol import REPORT, lanes_in_use
from ..numerics.angles import by_size
from ..numerics.elementary import SMALL, bits, from_bits
from ..numerics.rng import LANES
from .stages import Drift, Noise, Together, angle, flow

# ---------------------------------------------------------------------------------------------------------------------
# What steps add to the report of :data:`~spi.ensemble.scheme_protocol.REPORT`.
# ---------------------------------------------------------------------------------------------------------------------

_SMALL_BITS, _INFINITE_BITS = int(bits(SMALL)), int(bits(np.inf))
_LARGEST_ANGLE, _LARGEST_RESIDUAL = REPORT.index("largest_angle"), REPORT.index("largest_residual")
_JUDGED = REPORT.index("noise_judged")


@device
def report_angle(largest, report):
    """Report the angle with these bits, if it is above pi/4."""
    if largest > _SMALL_BITS:
        report[_LARGEST_ANGLE] = max(report[_LARGEST_ANGLE], from_bits(min(largest, _INFINITE_BITS)))


@device
def report_solves(report, iterations, failures, residual):
    """Report that the equations of the lanes in use were solved, with so many iterations in each."""
    first, end = lanes_in_use(report)
    report_each_solve(report, end - first, (end - first) * iterations, failures, residual)


@device
def report_each_solve(report, solves, iterations, failures, residual):
    """Report that so many equations were solved, with so many iterations in all."""
    report[0] += solves
    report[1] += iterations
    report[2] += failures
    report[_LARGEST_RESIDUAL] = np.maximum(report[_LARGEST_RESIDUAL], residual)  # keeps NaN


@device
def report_judged(report, noises, noise, drifts, drift):
    """Report that so many noise flows and steps of the drift were judged, and how many of each were accepted."""
    report[_JUDGED] += noises
    report[_JUDGED + 1] += noise
    report[_JUDGED + 2] += drifts
    report[_JUDGED + 3] += drift


@device
def is_idle_above(largest, report):
    """Whether an angle with these bits is one to report, and perhaps of a lane that is not in use."""
    first, end = lanes_in_use(report)
    return largest > _SMALL_BITS and end - first < LANES


# ---------------------------------------------------------------------------------------------------------------------
# One flow on all lanes of a block, by sines for the largest of their angles.
# ---------------------------------------------------------------------------------------------------------------------


@device(by_type=True)
def sweep(part, index, model, y, t, report):
    """Flow number ``number(index)`` of a part for the time t, a number or one per lane, on all lanes.

    Returns the bits of the largest |angle| in it, of the lanes in use if that is one to report.
    """
    if table := table_of(part, index, model):
        return table_sweep(table)
    return _sweep if is_inlined(model) else _sweep_on_its_own


def _sweep(part, index, model, y, t, report):
    k = number(index)
    largest = 0
    for lane in range(LANES):
        largest = max(largest, bits(angle(part, model, k, time_of(part, t, lane), load_lane(model, y, lane))))
    in_use = angle_in_use(part, index, model, y, t, report) if is_idle_above(largest, report) else largest
    sweep_up_to(largest, part, index, model, y, t)
    return in_use


@device(inline=False)
def angle_in_use(part, index, model, y, t, report):
    """Bits of the largest |angle| of the lanes in use: of few steps, so that the others need no mask."""
    largest, (first, end) = 0, lanes_in_use(report)
    for lane in range(first, end):
        state = load_lane(model, y, lane)
        largest = max(largest, bits(angle(part, model, number(index), time_of(part, t, lane), state)))
    return largest


_sweep_on_its_own = device(inline=False)(_sweep)


@device
def sweep_within(angles, part, index, model, y, t):
    for lane in range(LANES):
        store_lane(y, lane, flow(part, model, number(index), time_of(part, t, lane), load_lane(model, y, lane), angles))


#: The same, where the first argument has these bits.
sweep_up_to = device(by_size(sweep_within))


@device(by_type=True)
def friction_times(index, model, t, y, times):
    """Friction along noise number(index) over the time t as a time s of its flow in each lane: exp(s X_k) y."""
    k = number(class_of(index)())
    if tables := friction_tables(model):
        return table_friction(*tables[k], k in linear_friction(model))
    if k in linear_friction(model):
        return _linear_friction_times
    return _friction_times if is_inlined(model) else _friction_on_its_own


def _friction_times(index, model, t, y, times):
    for lane in range(LANES):
        times[lane] = friction_time(model, number(index), t, load_lane(model, y, lane))


@device
def _linear_friction_times(index, model, t, y, times):
    share = linear_share(index, model, t)
    for lane in range(LANES):
        times[lane] = -share * friction_slope(model, number(index), load_lane(model, y, lane))


@device
def linear_share(index, model, t):
    """-s(t) / (X_k H)(y) of linear friction, c_k t (1 - exp(-q)) / q with q = c_k t X_k X_k H."""
    ct = friction_rate(model, number(index)) * t
    return ct * decayed(ct * friction_bend(model, number(index)))


_friction_on_its_own = device(inline=False)(_friction_times)


@device(by_type=True)
def time_of(part, t, lane):
    """t, or the entry of the lane if there is one for each; of a joint flow (time, times of noises)."""
    if class_of(part) is Together:
        return _times_together(number(field(part, "count")), number(field(part, "most")), is_none(field(part, "time")))
    return lambda part, t, lane: of_lane(t, lane)


@device(by_type=True)
def of_lane(t, lane):
    """t, or the entry of the lane if there is one for each."""
    return (lambda t, lane: t[lane]) if is_array(t) else (lambda t, lane: t)


@functools.lru_cache
def _times_together(count, most, of_lanes):
    """The times of the noises stand in t one behind the other, and last that of the piece if it is one `of_lanes`."""
    times = "".join(f"t[{place} * LANES + lane], " for place in range(count)) + "0.0, " * (most - count)
    time = f"t[{count} * LANES + lane]" if of_lanes else "part.time"
    return function_of(["def times_together(part, t, lane):", f"return {time}, ({times})"], {"LANES": LANES})


# ---------------------------------------------------------------------------------------------------------------------
# Flows on all lanes as loops over tables of components, see ``ensemble/protocol.py``.
#
# Functions that move the lanes are called, not inlined: they take long enough, and the code of a flow stays small.
# ---------------------------------------------------------------------------------------------------------------------

_TABLES = {Drift: drift_tables, Noise: noise_tables}


def table_of(part, index, model):
    """Table of a flow, () if there is none, given records or their Numba types."""
    tables = _TABLES[class_of(part)](model) if class_of(part) in _TABLES else ()
    k = number(class_of(index)())
    return tables[k] if k < len(tables) else ()


def places(rows):
    """Where the rows of components begin in the array of a block."""
    return np.array(rows, np.int64) * LANES


@functools.lru_cache
def table_sweep(table):
    """Function that takes the place of ``sweep`` for the flow with this table."""
    lines, names = ["def in_rows(part, index, model, y, t, report):", "largest = 0"], {}
    turning, in_use = [], []
    for n, (shape, count, rows) in enumerate(table):
        sizes = {f"shape_{n}": shape, f"size_{n}": len(rows[0]), f"count_{n}": count}
        names |= {name: INDICES[value]() for name, value in sizes.items()} | {f"rows_{n}": places(rows)}
        angle = f"angle_in_rows(shape_{n}, size_{n}, model, y, t, rows_{n}, {{}}))"
        lines.append("largest = max(largest, " + angle.format("0, LANES"))
        in_use.append("    found = max(found, " + angle.format("first, end"))
        turning.append(f"turn_rows(largest, shape_{n}, size_{n}, count_{n}, model, y, t, rows_{n})")
    names |= {"angle_in_rows": angle_in_rows, "turn_rows": turn_rows, "LANES": LANES}
    names |= {"is_idle_above": is_idle_above, "lanes_in_use": lanes_in_use}
    idle = [
        "found = largest",
        "if is_idle_above(largest, report):",
        "    found, (first, end) = 0, lanes_in_use(report)",
    ]
    return function_of([*lines, *idle, *in_use, *turning, "return found"], names)


@device(inline=False)
def angle_in_rows(shape, size, model, y, t, rows, first, end):
    """Bits of the largest |angle| of a shape in some rows, in the lanes from `first` to before `end`."""
    largest = 0
    for row in range(rows.shape[0]):
        at = places_in(size, rows, row)
        for lane in range(first, end):
            state = load_at(model, at, y, lane)
            largest = max(largest, bits(shape_angle(model, number(shape), of_lane(t, lane), state)))
    return largest


@device
def turn_rows_within(angles, shape, size, count, model, y, t, rows):
    moved = lanes_of(count)
    for row in range(rows.shape[0]):
        at = places_in(size, rows, row)
        for lane in range(LANES):
            state = load_at(model, at, y, lane)
            turned = shape_flow(model, number(shape), of_lane(t, lane), state, angles)
            store_lane(moved, lane, first_of(count, turned))
        for part in range(number(count)):
            copy_lanes(moved, part * LANES, y, rows[row, part])


#: The flow of a shape in some rows, where the first argument has the bits of the largest of all angles.
turn_rows = device(inline=False)(by_size(turn_rows_within))


def table_friction(shape, row, is_linear):
    """Function that takes the place of ``friction_times`` for the noise with this shape and row."""
    shape, size, rows = INDICES[shape](), INDICES[len(row)](), places([row])
    if is_linear:
        return lambda index, model, t, y, times: friction_in_rows(
            shape, size, model, linear_share(index, model, t), None, y, times, rows
        )
    return lambda index, model, t, y, times: friction_in_rows(
        shape, size, model, friction_rate(model, number(index)), t, y, times, rows
    )


@device(inline=False)
def friction_in_rows(shape, size, model, rate, t, y, times, rows):
    """Times of a noise of which the friction has this rate, or where t is None this :func:`linear_share`."""
    durations, at = lanes_of(INDICES[1]()), places_in(size, rows, 0)
    for lane in range(LANES):
        slope, bend = shape_slopes(model, number(shape), load_at(model, at, y, lane))
        durations[lane] = time_along(rate, t, slope, bend)
    copy_lanes(durations, 0, times, 0)


@device(by_type=True)
def time_along(rate, t, slope, bend):
    return (lambda rate, t, slope, bend: -rate * slope) if is_none(t) else friction_after


@device
def copy_lanes(source, begin, target, at):
    """Floats of all lanes from one place to another."""
    for lane in range(0, LANES, WIDTH):
        store(target, at + lane, load(source, begin + lane))


def lanes_of(count):
    """Room for number(count) floats in each lane, until the function that calls this returns."""
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
    """Components of one lane that begin at these places, as a tuple with 0 behind them, see `row_length`."""
    return tuple(float(y[place + lane]) for place in at) + (0.0,) * (row_length(model) - len(at))


@intrinsic(load_at)
def _(model, at, y, lane):
    return load_each(row_length(model), model, at, y)
