"""The sweeps of a step over its lanes: the flows of its stages one after the other, each with its time."""

import functools
import itertools
import math
from collections import Counter
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import INDICES, answers, device, intrinsic, number
from ..compiler.generated import function_of
from ..compiler.instructions import floats_on_stack, load_each, load_strided
from ..compiler.records import class_of, field, is_array, is_none
from ..compiler.vectors import WIDTH, load, store
from ..ensemble.lanes import aligned, load_lane, store_lane
from ..ensemble.protocol import (
    bracket_factors,
    drift_tables,
    friction_after,
    friction_rate,
    friction_tables,
    friction_time,
    is_inlined,
    noise_tables,
    noises,
    phases,
    row_length,
    shape_angle,
    shape_flow,
    shape_slopes,
)
from ..ensemble.scheme_protocol import REPORT
from ..numerics.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES, sin_versine
from ..numerics.elementary import REDUCIBLE, SMALL, TINY, bits, from_bits
from ..numerics.rng import LANES
from .stages import (
    FINEST,
    Drift,
    Noise,
    Together,
    angle,
    flow,
    flows_in_order,
    indices_of,
    noises_moving,
    phases_in,
    stages_known,
    turned,
)

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
    """Report that the equations of a block were solved, with so many iterations each."""
    report[0] += LANES
    report[1] += LANES * iterations
    report[2] += failures
    report[_LARGEST_RESIDUAL] = np.maximum(report[_LARGEST_RESIDUAL], residual)  # keeps NaN


@device
def report_judged(report, noises, noise, drifts, drift):
    """Report that so many noise flows and steps of the drift were judged, and how many of each were accepted."""
    report[_JUDGED] += noises
    report[_JUDGED + 1] += noise
    report[_JUDGED + 2] += drifts
    report[_JUDGED + 3] += drift


# ---------------------------------------------------------------------------------------------------------------------
# One flow on all lanes of a block, by sines for the largest of their angles.
# ---------------------------------------------------------------------------------------------------------------------


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
    """The time that the flow of noise number(index) acts in each lane in the place of friction for the time t."""
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
    """The times of the noises stand in t one behind the other, and last that of the piece if it is one `of_lanes`."""
    times = "".join(f"t[{place} * LANES + lane], " for place in range(count)) + "0.0, " * (most - count)
    time = f"t[{count} * LANES + lane]" if of_lanes else "part.time"
    return function_of(["def times_together(part, t, lane):", f"return {time}, ({times})"], {"LANES": LANES})


# ---------------------------------------------------------------------------------------------------------------------
# Long flows on all lanes: their angles, the sines of these, and the states from the sines, one after the other.
#
# The sines of a sweep stand in scratch memory.  A number is computed as by the flow as a whole, to the last bit.
# ---------------------------------------------------------------------------------------------------------------------


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
    """The sines of one lane, and then the versines, as a tuple."""
    return tuple(float(work[i * LANES + lane]) for i in range(2 * phases(model)))


@intrinsic(load_sines)
def _(model, work, lane):
    return load_strided(2 * phases(model), LANES, model, work, lane)


# ---------------------------------------------------------------------------------------------------------------------
# Flows on all lanes as loops over tables of components, see ``ensemble/protocol.py``.
#
# Functions that move the lanes are called, not inlined: they take long enough, and the code of a flow stays small.
# ---------------------------------------------------------------------------------------------------------------------

# Angles are compared by their bits: as integers, because a maximum of floats that respects NaN is not vectorised.
# The bits of a NaN exceed those of every number, so it takes the last road.
TINY_BITS, SMALL_BITS, REDUCIBLE_BITS = int(bits(TINY)), int(bits(SMALL)), int(bits(REDUCIBLE))

_TABLES = {Drift: drift_tables, Noise: noise_tables}


def table_of(part, index, model):
    """The table of a flow, () if there is none, given records or their Numba types."""
    tables = _TABLES[class_of(part)](model) if class_of(part) in _TABLES else ()
    k = number(class_of(index)())
    return tables[k] if k < len(tables) else ()


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
    durations, at = lanes_of(INDICES[1]()), places_in(size, rows, 0)
    for lane in range(LANES):
        slope, bend = shape_slopes(model, number(shape), load_at(model, at, y, lane))
        durations[lane] = friction_after(rate, t, slope, bend)
    copy_lanes(durations, 0, times, 0)


@device
def copy_lanes(source, begin, target, at):
    """The floats of all lanes from one place to another."""
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
    """The components of one lane that begin at these places, as a tuple with 0 behind them, see `row_length`."""
    return tuple(float(y[place + lane]) for place in at) + (0.0,) * (row_length(model) - len(at))


@intrinsic(load_at)
def _(model, at, y, lane):
    return load_each(row_length(model), model, at, y)


class ShareOfWhole(NamedTuple):
    """The time of a noise flow that shares the increment of the whole step."""

    share: float


def _with_times(flows, stages, model):
    """The flows of :func:`flows_in_order`, each with its time as in :func:`sweeps`."""
    by_number = stages_known(stages)
    used = Counter()  # sub-steps of each Wiener process

    def time(i, k, share):
        length = share * by_number[i].length
        if by_number[i].shared:
            return ShareOfWhole(length / FINEST)
        used[k] += int(length)
        return _fewest(used[k] - int(length), used[k])

    timed = []
    for i, part, k, share in flows:
        times = tuple(None if j is None else (j, time(i, j, share)) for j in noises_moving(part, k, model))
        timed.append((i, part, k, share, times if part == "joint" else times[0][1] if times else None))
    return timed


def _fewest(first, end):
    common = math.gcd(FINEST, first, end)
    return first // common, end // common, FINEST // common


class Lacking(NamedTuple):
    """The area of a pair that the noise flows lack, see ``stages.py``."""

    noises: tuple[int, int]  #: (k, l), k < l
    pair: int  #: the number of the pair among those of which there are areas
    pairs: int  #: the number of such pairs
    number: int  #: among all pairs of noises
    before: float  #: p, the share of Y_k that acts before Y_l


class LoopTime(NamedTuple):
    """The time of a flow of a loop."""

    lacking: tuple[Lacking, ...]  #: the areas that the loop supplies; its flows are those of the first pair
    place: int  #: of the flow in the loop, from 0


def sweeps(stages, model):
    """((stage, part, k, share of its fraction, coin, time), ...): flows on the lanes with that coin, or on all (0).

    The time is None for drift; for noise it is (first, end, n), the increments over the sub-steps from `first` to
    before `end` where a step has n of them, with the least n that will do, or a :class:`ShareOfWhole`.  It does not
    depend on the coin, which moves flows of different processes.  Of a joint flow it is a tuple, (noise, time) for
    each of its noises, None for one that is off.  The flows of loops are noise flows with a
    :class:`LoopTime`.

    Where the order of a stage differs from lane to lane, all of 1, ..., n, ..., 1 are applied: those before n to the
    lanes with the coin 1, those after n to the others.
    """
    swept, every = [], _with_times(flows_in_order(stages, indices_of(model)), stages, model)
    for i, stage in enumerate(stages_known(stages)):
        acting = [flow for flow in every if flow[0] == i]
        if stage.part in ("loops", "areas"):
            lacking = _lacking([pair for _, _, pair, *_ in acting], _shares(every), model)
            is_one = stage.part == "areas" and len(lacking) > 1 and answers(bracket_factors, class_of(model))
            swept += _loops(i, [tuple(lacking)] if is_one else [(pair,) for pair in lacking])
            continue
        if stage.coin:
            first, last = acting[:-1], acting[-1:]
            placed = [(f, 1) for f in first] + [(f, 0) for f in last] + [(f, -1) for f in reversed(first)]
        else:
            placed = [(f, 0) for f in acting]
        swept += [(*flow, coin, time) for (*flow, time), coin in placed]
    return tuple(swept)


def _lacking(pairs, shares, model):
    """The areas that some pairs lack, given the shares of the noises in the whole step."""
    every = list(itertools.combinations(range(noises(model)), 2))
    return [Lacking(pair, p, len(pairs), every.index(pair), _before(shares, *pair)) for p, pair in enumerate(pairs)]


def _loops(i, groups):
    """The flows of the loops of stage i, one loop for each group of lacking areas."""
    return [
        (i, "noise", k, 1.0, 0, LoopTime(group, place))
        for group in groups
        for place, k in enumerate(2 * group[0].noises)
    ]


def _shares(every):
    """[(noise, its share of the increment of the step), ...] of all flows with their times."""
    shares = []
    for _, part, k, _, time in every:
        times = time if part == "joint" else ((k, time),) if time else ()
        shares += [(j, t.share if isinstance(t, ShareOfWhole) else 1.0) for j, t in filter(None, times)]
    return shares


def _before(shares, k, j):
    """The products of the shares of noise k and noise j, added up over all flows of k before one of j."""
    return sum(a * b for i, (n, a) in enumerate(shares) for m, b in shares[i + 1 :] if (n, m) == (k, j))
