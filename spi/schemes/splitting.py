"""Splitting schemes: compositions of the exact flows of H_1, ..., H_p and Ĥ_1, ..., Ĥ_m.

Each flow is one sweep over the lanes.  A sweep first looks at the largest angle of its lanes, so that sines of small
angles, which are nearly all, need no range reduction.
"""

import functools
import itertools
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import INDICES, device, function_of
from ..compiler.records import field
from ..ensemble.protocol import (
    bracket_factors,
    decayed,
    friction_bend,
    friction_rate,
    inexact_noises,
    inexact_pieces,
    linear_friction,
    most_joined,
    noises,
    strengths,
)
from ..numerics.elementary import exp
from ..numerics.rng import LANES
from .midpoint import inner_size, inner_sweep
from .program import LargeComposition
from .stages import (
    PARTS,
    LoopTime,
    ShareOfWhole,
    Symmetric,
    Together,
    flows,
    has_joint,
    has_loops,
    is_reversed_by_coin,
    needs_coins,
    substeps,
    sweeps,
)
from .sweeps import friction_times, report_angle, sweep


class Splitting(NamedTuple):
    """A composition of exact flows, given as its stages, the first to act first; a stochastic Poisson integrator."""

    stages: tuple

    def tosses(scheme):
        return needs_coins(field(scheme, "stages"))

    def substeps(scheme):
        return substeps(field(scheme, "stages"))

    def needs_areas(scheme):
        return has_loops(field(scheme, "stages"))

    def work_size(scheme, model):
        return stages_work(model)

    def compile_size(scheme, model):
        return len(sweeps(scheme.stages, model)), 0

    def of_arrays(scheme, model):
        within = not (has_loops(scheme.stages) or has_joint(scheme.stages))
        return LargeComposition.of(scheme.stages, model) if within else scheme

    def advance(scheme, model, h, dW, coins, y, work, report):
        run_stages(scheme.stages, model, h, dW, coins, y, work, report)


def splitting(*stages):
    """Scheme with these stages of :func:`~.stages.flows`.

    ValueError unless drift and noise get the whole step, for a noise with increments of its own beside shares of the
    whole one, and for loops except where they are proved to supply the missing terms of the noise.
    """
    of = {part: [stage for stage in stages if type(stage.part) is type(record)] for part, record in PARTS.items()}
    noise = [*of["noise"], *of["joint"]]
    for part in ("drift", "noise", *["friction"] * bool(of["friction"])):
        total = sum(stage.fraction for stage in (*of[part], *(() if part == "friction" else of["joint"])))
        if abs(total - 1.0) > 1e-12:
            raise ValueError(f"the fractions of the {part} add up to {total:g} and not to 1")
    if len({stage.shared is None for stage in noise}) > 1:
        raise ValueError("some of the noise is shared and some is not; write shared in all of its stages, or in none")
    if of["loops"] or of["areas"]:
        _check_loops([*of["loops"], *of["areas"]], noise)
    return Splitting(stages)


def _check_loops(loops, noise):
    """ValueError for loops except where they are proved to supply the missing terms of the noise."""
    if len(loops) > 1:
        raise ValueError("the loops or areas stand there twice; they supply all that is lacking at once")
    whole = len(noise) == 1 and type(noise[0].order) is not Symmetric
    if any(stage.coin is not None for stage in noise) or not (whole or noise[0].shared is not None):
        right = "the noise in one stage, noise 1 or noise 1 backwards, or shared in all of them, and without a coin"
        raise ValueError(f"loops and areas need {right}")


#: The paper's eq. (18).
LIE_TROTTER = splitting(flows("noise"), flows("drift"))
#: Its remark 2: the deterministic part acts first.
LIE_TROTTER_EXCHANGED = splitting(flows("drift"), flows("noise"))
#: With the Lévy areas: of strong order 1 whether or not the noises commute.
LIE_TROTTER_AREAS = splitting(flows("noise"), flows("loops"), flows("drift"))
#: The pieces of H together with the noises of their families, once, and there and back with halves of one increment.
JOINT_LIE = splitting(flows("joint"))
JOINT = splitting(flows("joint", "symmetric", shared=True))
#: With the areas in the middle, where only they themselves are missing: of strong order 1.
JOINT_AREAS = splitting(
    flows("joint", fraction=1 / 2, shared=True),
    flows("areas"),
    flows("joint", "backwards", 1 / 2, shared=True),
)
#: The paper's eq. (19), of weak order 2.
ORDER_2 = splitting(flows("drift", "symmetric", 1 / 2), flows("noise", coin=True), flows("drift", "symmetric", 1 / 2))
#: A palindrome: a step is its own reverse in law, since the half increments of a noise are independent.
SYMMETRIC = splitting(flows("drift", fraction=1 / 2), flows("noise", "symmetric"), flows("drift", "backwards", 1 / 2))


def has_antithetic_path(scheme):
    """Whether a step with its increments in reversed order and its coin turned is the step with all flows reversed."""
    return isinstance(scheme, Splitting) and is_reversed_by_coin(scheme.stages)


# ---------------------------------------------------------------------------------------------------------------------
# A step: one sweep after the other
# ---------------------------------------------------------------------------------------------------------------------


@device(by_type=True)
def run_stages(stages, model, h, dW, coins, y, work, report):
    """Apply the stages in order to the states `y` of a block, in place; `work` has :func:`stages_work` floats."""
    inexact = ("drift", inexact_pieces(model)), ("noise", inexact_noises(model))
    return _step(sweeps(stages, model), inexact, most_joined(model), linear_friction(model))


@device
def stages_work(model):
    """Floats of scratch for stages: the times of a sweep, a and b of a loop, and scratch of inner steps.

    A sweep of joint flows has a time for each noise joined to the piece, and perhaps one for the piece.
    """
    return max(3, 1 + most_joined(model)) * LANES + inner_size(model)


#: What the text of a step may name, besides the parts and the numbers of flows.
_NAMES = {"LANES": LANES, "np": np} | {
    function.__name__: function
    for function in (
        *(strengths, noises, sweep, inner_sweep, report_angle, friction_times, Together, bracket_factors),
        *(friction_rate, friction_bend, decayed, exp),
    )
}
#: The time of a drift flow, as source text.
_DRIFT_TIME = "{share} * (stages[{stage}].fraction * h)"
#: The time in a lane, as source text: in all lanes, in those with the coin 1, in those with the coin -1.
_OF_LANES = {0: "{}", 1: "{} if coins[lane] > 0.0 else 0.0", -1: "0.0 if coins[lane] > 0.0 else {}"}


@functools.lru_cache
def _step(sweeps, inexact, most, linear=()):
    """Python function ``run_stages`` for a sequence of sweeps, written out: every k is a constant from the start.

    `inexact` = ((part, numbers without an exact flow), ...) are replaced by inner steps; `most` is the largest number
    of noises joined to one piece of the model, `linear` are the noises of linear friction.  The bits of the largest
    |angle| stay in a variable: a store in every sweep would cost 5 % of the speed.
    """
    lines = ["def step(stages, model, h, dW, coins, y, work, report):", "largest = 0"]
    scales = dict(_scales(sweeps, linear))
    for n, of in enumerate(sweeps):
        part, k, coin, time = of.part, of.k, of.coin, of.time
        lines += scales.get(n, [])
        scale = f"scale_{k} * " if n in scales else ""
        drift = _DRIFT_TIME.format(stage=of.stage, share=of.share)
        if part == "friction":
            lines.append(f"friction_times(index_{k}, model, {drift}, y, work)")
            if _are_one_flow(*sweeps[n : n + 2]):
                continue
            part, time = "noise", "work"
        elif isinstance(time, LoopTime):
            lines += _loop_time(time)
            time = "work"
        elif part == "joint":
            for place, moved in enumerate(time):
                lines += _in_lanes(place, coin, _noise_time(*moved) if moved else "0.0")
            lines += _in_lanes(len(time), coin, drift) if coin else []
            part = f"Together({None if coin else drift}, index_{len(time)}, index_{most})"
            time = "work"
        elif part == "noise" or coin or k in dict(inexact)[part]:
            friction = "work[lane] + " if n and _are_one_flow(*sweeps[n - 1 : n + 1]) else ""
            lines += _in_lanes(0, coin, friction + (scale + _noise_time(k, time) if time else drift))
            time = "work"
        else:
            time = drift
        if k in dict(inexact).get(part, ()):
            lines.append(f"inner_sweep({part}, index_{k}, model, coins, y, work, report)")
        else:
            lines.append(f"largest = max(largest, sweep({part}, index_{k}, model, y, {time}, report))")
    lines.append("report_angle(largest, report)")
    names = {f"index_{k}": index() for k, index in enumerate(INDICES)}
    return function_of(lines, _NAMES | PARTS | names)


def _are_one_flow(sweep, after=None):
    """Whether friction and the flow after it move along the field of one noise, so that their times add up."""
    if sweep.part != "friction" or after is None:
        return False
    return (after.part, after.k, after.coin) == ("noise", sweep.k, 0) and not isinstance(after.time, LoopTime)


def _scales(sweeps, linear):
    """(number of a noise sweep, lines that say scale_k) where noise k and its linear friction are one exact flow.

    Friction and noise without drift in between move along X_k by s' = -c (g' + g'' s) + sigma dW/dt.  Over the share f
    of the step s has the variance sigma^2 f h (1 - exp(-2 q)) / (2 q), q = c g'' f h.  The noise flows before friction
    over a share a of the step have lost exp(-c g'' a h) by the end, so that their increments, of the shares w of the
    step, are multiplied by the root of (f (1 - exp(-2 q)) / (2 q)) / sum w exp(-2 q a/f).
    """
    acting = [n for n, of in enumerate(sweeps) if of.part in ("noise", "friction")]
    runs = [[n for _, n in run] for _, run in itertools.groupby(enumerate(acting), lambda pair: pair[1] - pair[0])]
    for run, k in itertools.product(runs, linear):
        own = {n: sweeps[n] for n in run if sweeps[n].k == k}
        moving = [n for n, of in own.items() if of.part == "noise"]
        friction = {n: f"{of.share} * stages[{of.stage}].fraction" for n, of in own.items() if of.part == "friction"}
        if not (friction and moving) or any(isinstance(own[n].time, LoopTime | ShareOfWhole) for n in moving):
            continue
        left = []
        for n in (n for n in moving if own[n].coin >= 0):
            first, end, parts = own[n].time
            after = " + ".join(text for m, text in friction.items() if m > n) or "0.0"
            left.append(((end - first) / parts, after))
        total, share = " + ".join(friction.values()), sum(w for w, _ in left)
        lost = " + ".join(f"{w!r} * exp(-2.0 * rate * ({after}))" for w, after in left)
        exact = f"np.sqrt({share!r} * decayed(2.0 * rate * {share!r}) / ({lost}))"
        lines = [
            f"rate = h * friction_rate(model, {k}) * friction_bend(model, {k})",
            f"scale_{k} = {exact} if abs({total} - {share!r}) < 1e-12 else 1.0",
        ]
        yield from ((n, lines if n == moving[0] else []) for n in moving)


def _in_lanes(place, coin, time):
    """Lines that put a time, which may differ from lane to lane, into `work`; 0 in lanes with the other coin."""
    at = f"{place} * LANES + lane" if place else "lane"
    return ["for lane in range(LANES):", f"    work[{at}] = " + _OF_LANES[coin].format(time)]


def _noise_time(k, time):
    """sigma_k times the increment of a noise of :func:`.stages.sweeps`, as source text.

    For the places of increments over sub-steps see ``increments.first_lane``.
    """
    if isinstance(time, ShareOfWhole):
        increment = f"({time.share!r} * dW[{k} * LANES + lane])"
    else:
        first, end, n = time
        rows = [f"({n - 1 + part} * noises(model) + {k})" if n > 1 else f"{k}" for part in range(first, end)]
        increment = " + ".join(f"dW[{row} * LANES + lane]" for row in rows)
        increment = f"({increment})" if n > 1 else increment
    return f"strengths(model)[{k}] * {increment}"


def _lacking_time(of):
    """Term of a pair of noises that is missing in the noise flows, as source text."""
    (k, j), lacking = of.noises, f"dW[len(dW) - {of.pairs - of.pair} * LANES + lane]"
    if of.before != 0.5:
        lacking = f"({0.5 - of.before!r} * dW[{k} * LANES + lane] * dW[{j} * LANES + lane] + {lacking})"
    return f"strengths(model)[{k}] * strengths(model)[{j}] * {lacking}"


def _loop_time(of):
    """Lines that put the time of a flow of a loop into `work`, and before the first one a and b behind it."""
    lines = ["for lane in range(LANES):"]
    if of.place == 0:
        first, *others = of.lacking
        product = _lacking_time(first)
        for pair in others:
            factor = f"bracket_factors(model)[{pair.number}] / bracket_factors(model)[{first.number}]"
            product += f" + {factor} * ({_lacking_time(pair)})"
        lines += [
            f"    product = {product}",
            "    root = coins[lane] * np.sqrt(abs(product))",
            "    work[LANES + lane], work[2 * LANES + lane] = root, root if product > 0.0 else -root",
        ]
    time = ("work[LANES + lane]", "work[2 * LANES + lane]", "-work[LANES + lane]", "-work[2 * LANES + lane]")[of.place]
    return [*lines, f"    work[lane] = {time}"]
