"""Compositions of flows of array states as data, so that one compilation serves all of them.

The flows of a program are those of the sweeps of paths in registers, in the same order; only who runs them differs.
One large lattice, whose parts threads share, runs the same programs.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import FieldOf, answers, device, trait
from ..compiler.records import class_of
from ..ensemble.protocol import (
    block_drift_flow,
    block_friction_flow,
    block_friction_times,
    block_noise_flow,
    frictions,
    in_place,
    noise_groups,
    pieces,
)
from ..ensemble.scheme_protocol import DRIFT, FLOW, FRICTION, NOISE
from .large import group_size, lanes_by_coin, large_work, parts_of_work, put, report_large_angle, take, take_times
from .stages import ShareOfWhole, Symmetric, flows, flows_in_order, needs_coins, stages_known, substeps, with_times

_KINDS = {"drift": DRIFT, "noise": NOISE, "friction": FRICTION}


def program_of(stages, counts):
    """Program of some stages for a model with so many (pieces, groups of noises, flows of friction)."""
    stages = tuple(half for stage in stages for half in _there_and_back(stage))
    indices = dict(zip(_KINDS, map(range, counts), strict=True))
    coins = (1, -1) if needs_coins(stages) else (1,)
    return np.array([_flows(with_times(flows_in_order(stages, indices, coin), stages), stages) for coin in coins], FLOW)


def _there_and_back(stage):
    """Symmetric friction as two stages, because the times of all its flows are taken at once."""
    (of,) = stages_known((stage,))
    if of.part != "friction" or of.order is not Symmetric:
        return (stage,)
    return tuple(flows("friction", order, stage.fraction / 2) for order in ("forwards", "backwards"))


def _flows(sweeps, stages):
    """Rows of some sweeps."""
    rows, before = [], None
    for of in sweeps:
        span, share = (0, 1, 1), of.share * stages[of.stage].fraction
        if of.part == "noise":
            span, share = (span, of.time.share) if isinstance(of.time, ShareOfWhole) else (of.time, 1.0)
        times = None if of.part == "drift" else (of.stage, span, share)
        rows.append((_KINDS[of.part], of.k, *span, times != before, share))
        before = times
    return rows


class LargeComposition(NamedTuple):
    """A composition of flows of array states: all have one type, hence one kernel for each model."""

    program: np.ndarray  #: as :func:`~spi.ensemble.scheme_protocol.of_arrays` says
    parts: int  #: sub-steps

    tosses = True
    substeps = FieldOf("parts")

    @classmethod
    def of(cls, stages, model):
        """Composition with these stages, for a model."""
        of_friction = noise_groups(model) if is_along_noises(model) else frictions(model)
        return cls(program_of(stages, (pieces(model), noise_groups(model), of_friction)), substeps(stages))

    def work_size(scheme, model):
        return large_work(model)

    def advance_large(scheme, model, h, dW, coins, y, work, report):
        run_program(scheme.program, model, h, dW, coins, y, work, report)


@device(inline=False)
def run_program(program, model, h, dW, coins, y, work, report):
    """A step of a block, in place: groups of paths one after the other, all flows of a group."""
    largest, done, (mine, _, _, times, scratch) = 0.0, 0, parts_of_work(model, work)
    tossed = len(program) > 1
    lanes, heads = lanes_by_coin(model, report, coins, tossed)
    states = y[: len(mine)] if in_place(model) and not tossed else mine
    copied = tossed or not in_place(model)
    while done < len(lanes):
        side, end = (0, heads) if done < heads else (1, len(lanes))
        count, width = group_size(model, end - done)
        some = lanes[done : done + count]
        if copied:
            take(y, some, width, states)
        for i in range(program.shape[1]):
            angle = run_flow(model, program[side, i], h, dW, some, width, states, times, scratch)
            largest = max(largest, angle)
        if copied:
            put(y, some, width, states)
        done += count
    report_large_angle(largest, report)


@device
def run_flow(model, flow, h, dW, lanes, width, states, times, work):
    """One flow on some paths; returns the largest |angle|."""
    kind, k, t = flow["kind"], flow["k"], flow["share"] * h
    if kind == DRIFT:
        return block_drift_flow(model, k, t, width, states, work)
    if kind == FRICTION and not is_along_noises(model):
        block_friction_flow(model, k, t, width, states, work)
        return 0.0
    if flow["takes"]:
        if kind == NOISE:
            take_times(model, dW, lanes, width, flow["first"], flow["stop"], flow["n"], flow["share"], times)
        else:
            block_friction_times(model, t, width, states, times, work)
    return block_noise_flow(model, k, times, width, states, work)


@trait
def is_along_noises(model):
    """Whether flows of the noises replace friction."""
    return answers(block_friction_times, class_of(model))
