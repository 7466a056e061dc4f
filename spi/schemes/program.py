"""Compositions of flows of array states as data, so that one compilation serves all of them.

A program is made once from the stages of a composition, whatever the model.  Each of its rows is a run over the pieces
of H, or over the groups of noises, in an order: a symmetric stage is three rows, all but the last, the last, and all
but the last in reversed order.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import FieldOf, answers, device
from ..compiler.records import class_of
from ..ensemble.protocol import (
    block_drift_flow,
    block_friction_flow,
    block_friction_times,
    block_noise_flow,
    in_place,
    noise_groups,
    pieces,
)
from .large import group_size, lanes_by_coin, large_work, parts_of_work, put, report_large_angle, take, take_times
from .stages import FINEST, Backwards, Symmetric, needs_coins, stages_known, substeps

#: What a row moves, and which of the pieces or groups.
DRIFT, NOISE, FRICTION = range(3)
ALL, BUT_LAST, LAST = range(3)


#: A row of a program: its kind; ALL, BUT_LAST or LAST; 1 forwards or -1 backwards; 1 where that is reversed for paths
#: whose coin is -1; the share of the step, of noise that of the increment; and the increment of noise: that over the
#: sub-steps from `first` to before `stop` where a step has n of them.
_INTEGERS = "kind", "piece", "order", "coin", "first", "stop", "n"
ROW_TYPE = np.dtype([*((name, np.int64) for name in _INTEGERS), ("share", np.float64)])


def program_of(stages):
    """The program of some stages: its rows, the first to act first."""
    rows, used = [], 0
    for stage, of in zip(stages, stages_known(stages), strict=True):
        kind = {"drift": DRIFT, "noise": NOISE, "friction": FRICTION}[of.part]
        order, half = -1 if of.order is Backwards else 1, of.length // 2
        parts = [(ALL, order, 1.0, 0, of.length)]
        if of.order is Symmetric and kind == FRICTION:
            parts = [(ALL, 1, 0.5, 0, 0), (ALL, -1, 0.5, 0, 0)]
        elif of.order is Symmetric:
            parts = [(BUT_LAST, 1, 0.5, 0, half), (LAST, 1, 1.0, 0, of.length), (BUT_LAST, -1, 0.5, half, of.length)]
        for piece, direction, share, begin, stop in parts:
            if kind != NOISE:
                times = 0, 0, 1, share * stage.fraction
            elif of.shared:
                times = 0, 1, 1, (stop - begin) / FINEST
            else:
                times = *_span(used + begin, used + stop), 1.0
            rows.append((kind, piece, direction, of.coin, *times))
        used += 0 if of.shared else of.length
    return np.array(rows, ROW_TYPE)


def _span(begin, stop):
    """The sub-steps from `begin` to before `stop` of FINEST as (first, stop, n), of as few sub-steps as possible."""
    n = FINEST
    while begin % 2 == 0 and stop % 2 == 0 and n > 1:
        begin, stop, n = begin // 2, stop // 2, n // 2
    return begin, stop, n


class LargeComposition(NamedTuple):
    """A composition of flows of array states: all have one type, hence one kernel for each model."""

    program: np.ndarray  #: rows of ROW_TYPE
    parts: int  #: sub-steps
    coins: bool  #: whether the order of a row depends on a coin

    tosses = True
    substeps = FieldOf("parts")

    @classmethod
    def of(cls, stages):
        """The composition with these stages."""
        return cls(program_of(stages), substeps(stages), needs_coins(stages))

    def work_size(scheme, model):
        return large_work(model)

    def advance_large(scheme, model, h, dW, coins, y, work, report):
        run_program(scheme, model, h, dW, coins, y, work, report)


@device(inline=False)
def run_program(scheme, model, h, dW, coins, y, work, report):
    """A step of a block, in place: groups of paths one after the other, all flows of a group."""
    largest, done, (mine, _, _, times, scratch) = 0.0, 0, parts_of_work(model, work)
    lanes, heads = lanes_by_coin(model, report, coins, scheme.coins)
    states = y[: len(mine)] if in_place(model) and not scheme.coins else mine
    copied = scheme.coins or not in_place(model)
    while done < len(lanes):
        end = heads if done < heads else len(lanes)
        count, width = group_size(model, end - done)
        some, tails = lanes[done : done + count], done >= heads
        if copied:
            take(y, some, width, states)
        for i in range(len(scheme.program)):
            angle = run_row(model, scheme.program[i], tails, h, dW, some, width, states, times, scratch)
            largest = max(largest, angle)
        if copied:
            put(y, some, width, states)
        done += count
    report_large_angle(largest, report)


@device
def run_row(model, row, tails, h, dW, lanes, width, states, times, work):
    """The flows of one row on some paths; returns the largest |angle|."""
    kind, share, largest = row["kind"], row["share"], 0.0
    backwards = (row["order"] < 0) != (tails and row["coin"] != 0)
    if kind == FRICTION and not is_along_noises(model):
        run_friction(model, backwards, share * h, width, states, work)
        return largest
    count = pieces(model) if kind == DRIFT else noise_groups(model)
    low = count - 1 if row["piece"] == LAST else 0
    high = count - 1 if row["piece"] == BUT_LAST else count
    if low < 0 or high <= low:  # there are no noises, or one group
        return largest
    if kind == NOISE:
        take_times(model, dW, lanes, width, row["first"], row["stop"], row["n"], share, times)
    elif kind == FRICTION:
        take_friction_times(model, share * h, width, states, times, work)
    for i in range(high - low):
        k = high - 1 - i if backwards else low + i
        if kind == DRIFT:
            largest = max(largest, block_drift_flow(model, k, share * h, width, states, work))
        else:
            largest = max(largest, block_noise_flow(model, k, times, width, states, work))
    return largest


@device(by_type=True)
def is_along_noises(model):
    """Whether flows of the noises replace friction."""
    along = answers(block_friction_times, class_of(model))
    return (lambda model: True) if along else (lambda model: False)


@device(by_type=True)
def take_friction_times(model, t, width, states, times, work):
    """Their times."""
    return block_friction_times if answers(block_friction_times, class_of(model)) else None


@device(by_type=True)
def run_friction(model, backwards, t, width, states, work):
    """Friction of a model that has flows of its own for it; nothing for any other."""
    if answers(block_friction_times, class_of(model)):  # the record hands on what its model need not answer
        return None
    return block_friction_flow if answers(block_friction_flow, class_of(model)) else None
