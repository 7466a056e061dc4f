"""Compositions of flows as data: stages, each of them all pieces of H, or all noises, in some order, or loops.

All properties of a splitting scheme derive from its stages by :func:`flows_in_order`: its kernel, the backward
operators of solvers, whether it needs coins, whether it has antithetic paths, and the cost of a step.

The fraction of a stage is a share of the step h.  Drift flows have the time fraction * h, which may be negative.  Noise
flows have increments of their own over the time fraction * h, independent of those of all other noise flows of the
step: the flows of one Wiener process use up its increments over consecutive parts of the step, in the order in which
they act.  Paths resolve a step into at most :data:`FINEST` equal sub-steps, so that each such part is a multiple of
h / FINEST.  Flows that **share** the increment dW of the step have the time fraction * dW instead, with the same dW in
all of them.  A stage of **joint** flows is one of drift and one of noise at once: a piece of H and the noises that
are of one family with it move together, see ``protocol.joint_noises``; the noises joined to no piece come last.

A stage of **loops** supplies the terms of order h that are missing in the noise flows.  Let p be the product of the
shares of dW_k and dW_l added up over all pairs of flows of Y_k before Y_l.  The equation has J_kl = dW_k dW_l / 2 +
A_kl for "first k, then l" and dW_k dW_l - J_kl for the reverse, the flows p dW_k dW_l and (1 - p) dW_k dW_l.  So the
missing term is, as an operator, sigma_k sigma_l (A_kl + (1/2 - p) dW_k dW_l) [Y_k, Y_l]; p is 1 where all Y_k act
before Y_l, 0 in the reverse order, and 1/2 where the same flows act there and back.  The loop exp(a Y_k), exp(b Y_l),
exp(-a Y_k), exp(-b Y_l), acting in this order, is 1 + a b [Y_k, Y_l] + ..., hence a b is that factor, with |a| = |b|; a
coin decides the sign of both, so that the terms of order h^(3/2), odd in (a, b), have the mean 0.  Noises that commute
need no loops.

A stage of **areas** supplies the same by fewer flows where the model says so.  [Y_k, Y_l] is the field of the bracket
{Ĥ_l, Ĥ_k}: where these brackets are multiples of one function, ``protocol.bracket_factors``, one loop has the sum of
all.
"""

import itertools
import math
from collections import Counter
from typing import NamedTuple

from ..compiler.dispatch import INDICES, answers, calling, method
from ..compiler.records import class_of, field
from ..ensemble.protocol import (
    area_pairs,
    bracket_factors,
    drift_angle,
    drift_flow,
    has_friction,
    joined_noises,
    joint_angle,
    joint_flow,
    joint_parts,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noises,
    piece_gradient,
    piece_hessian,
    piece_indices,
    pieces,
)

# ---------------------------------------------------------------------------------------------------------------------
# The parts and orders of the stages of a composition: records, so that the compiler knows them by their types.
# ---------------------------------------------------------------------------------------------------------------------


@method
def flow(part, model, k, t, y, angles):
    """Flow number k of a part."""


@method
def angle(part, model, k, t, y):
    """Largest |angle| of the flow number k of a part."""


@method
def gradient(part, model, k, y):
    """Gradient of Hamiltonian number k of a part, one without an exact flow."""


@method
def hessian(part, model, k, y, v):
    """Hessian of that Hamiltonian times v."""


class Drift(NamedTuple):
    """Flows of H_1, ..., H_p."""

    flow, angle = calling(drift_flow, "part"), calling(drift_angle, "part")
    gradient, hessian = calling(piece_gradient, "part"), calling(piece_hessian, "part")


class Noise(NamedTuple):
    """Flows of Ĥ_1, ..., Ĥ_m; a noise that is off is left out."""

    flow, angle = calling(noise_flow, "part"), calling(noise_angle, "part")
    gradient, hessian = calling(noise_gradient, "part"), calling(noise_hessian, "part")


class Joint(NamedTuple):
    """Flows of H_1, ..., H_p, each together with those of the noises of its family."""


class Together(NamedTuple):
    """Flows of the lanes in a stage of joint flows; t = (time of the piece, times of its noises)."""

    time: float | None  #: of the piece; None where it differs from lane to lane
    count: NamedTuple  #: the number of noises joined to the piece, as one of INDICES
    most: NamedTuple  #: the largest such number of any piece, likewise

    def flow(part, model, k, t, y, angles):
        return joint_flow(model, k, t[0], t[1], y, angles)

    def angle(part, model, k, t, y):
        return joint_angle(model, k, t[0], t[1], y)


class Friction(NamedTuple):
    """Friction along the noises, see ``ensemble/protocol.py``; nothing for a model without a temperature."""


class Loops(NamedTuple):
    """Loops of flows of pairs of noises that do not commute, see the head of this file."""


class Areas(NamedTuple):
    """The same terms by as few flows as possible, see the head of this file."""


class Forwards(NamedTuple):
    """1, ..., n."""

    def arranged(indices):
        """((k, share of the stage's fraction), ...), the first to act first; the same for the other orders."""
        return tuple((k, 1.0) for k in indices)


class Backwards(NamedTuple):
    """n, ..., 1."""

    def arranged(indices):
        return Forwards.arranged(indices)[::-1]


class Symmetric(NamedTuple):
    """1, ..., n - 1 with half the fraction, n, and n - 1, ..., 1 with half the fraction again."""

    def arranged(indices):
        halves = tuple((k, 0.5) for k in indices[:-1])
        return (*halves, *Forwards.arranged(indices[-1:]), *halves[::-1])


class Coin(NamedTuple):
    """The order is reversed for the paths whose coin is -1."""


class Shared(NamedTuple):
    """The noise flows have shares of the increment of the whole step."""


PARTS = {"drift": Drift(), "noise": Noise(), "friction": Friction(), "joint": Joint()}
PARTS |= {"loops": Loops(), "areas": Areas()}
ORDERS = {"forwards": Forwards(), "backwards": Backwards(), "symmetric": Symmetric()}


#: The largest number of sub-steps of a step with increments of their own; a power of two.
FINEST = 8

_NAMES = {type(part): name for name, part in PARTS.items()}


class Flows(NamedTuple):
    """A stage of a composition; made by :func:`flows`."""

    part: NamedTuple
    order: NamedTuple
    fraction: float
    coin: Coin | None
    shared: Shared | None
    length: NamedTuple  #: of noise: FINEST times the fraction as one of INDICES, a constant by its type


def flows(part, order="forwards", fraction=1.0, coin=False, shared=False):
    """A stage of a composition.

    `part` is one of :data:`PARTS`, `order` one of :data:`ORDERS`, `fraction` the share of the step, `coin` says whether
    the order is reversed for the paths whose coin is -1, and `shared` whether noise flows have their shares of the
    increment of the whole step in place of increments of their own.  ValueError for unknown words, for a
    coin or `shared` where they would change nothing, for noise over a part of the step that no sub-steps make up, and
    for loops with any further argument.
    """
    for kind, name, table in (("part", part, PARTS), ("order", order, ORDERS)):
        if name not in table:
            raise ValueError(f"{name!r} is not a known {kind}; known: {', '.join(table)}")
    if coin and order == "symmetric":
        raise ValueError("a symmetric stage is its own reverse and has no use for a coin")
    if part in ("loops", "areas") and (order, fraction, coin, shared) != ("forwards", 1.0, False, False):
        raise ValueError(f"{part} have neither a fraction nor an order nor a word; each loop has one coin already")
    if part == "drift" and shared:
        raise ValueError("the drift has no increments that flows could share")
    if part == "friction" and (coin or shared):
        raise ValueError("friction has neither a coin nor increments that flows could share")
    length = _eighths(order, fraction, shared) if part in ("noise", "joint") else 0
    words = Coin() if coin else None, Shared() if shared else None
    return Flows(PARTS[part], ORDERS[order], float(fraction), *words, INDICES[length]())


def _eighths(order, fraction, shared):
    """FINEST times the fraction of a stage of noise flows; ValueError unless all its flows have whole sub-steps."""
    unit = 2 if order == "symmetric" else 1
    if fraction * FINEST not in range(unit, FINEST + 1, unit):
        multiples = f"must be a positive multiple of 1/{FINEST // unit}, at most 1"
        halves = ", as it is halved" if unit == 2 else ""
        limit = "" if shared else f": a step is divided into at most {FINEST} sub-steps with increments of their own"
        raise ValueError(f"a noise fraction is {fraction:g} and {multiples}{halves}{limit}")
    return int(fraction * FINEST)


class _StageType(NamedTuple):
    """Properties of a stage that its Numba type determines."""

    part: str
    order: type
    coin: bool
    shared: bool
    length: int  #: of noise, in sub-steps of which a step has FINEST


def stages_known(stages):
    """`_StageType` of each of some stages, given these or their Numba type."""
    types = []
    for stage in stages:
        part, order, coin, shared, length = (
            class_of(field(stage, name)) for name in ("part", "order", "coin", "shared", "length")
        )
        types.append(_StageType(_NAMES[part], order, coin is Coin, shared is Shared, INDICES.index(length)))
    return tuple(types)


def indices_of(model):
    """Indices of the flows of each part."""
    return {
        "drift": piece_indices(model),
        "noise": noise_indices(model),
        "friction": noise_indices(model) if has_friction(model) else (),
        "joint": joint_parts(model),
        "loops": area_pairs(model),
        "areas": area_pairs(model),
    }


class Sweep(NamedTuple):
    """A flow of a step."""

    stage: int  #: the number of its stage
    part: str
    k: int
    share: float  #: of the fraction of the stage
    coin: int = 0  #: that of the lanes on which it acts, 0 for all
    time: object = None  #: as :func:`sweeps` says


def flows_in_order(stages, indices, coin=1):
    """:class:`Sweep` of each flow of a path with this coin, without times, the first flow to act first.

    `indices` = {"drift": numbers of the pieces, "noise": numbers of the noises that are on, "joint": those of both with
    their parts, "loops" and "areas": pairs of noises}, and k is one of them.
    """
    ordered = []
    for i, stage in enumerate(stages_known(stages)):
        acting = indices[stage.part] if stage.part == "joint" else [(stage.part, k) for k in indices[stage.part]]
        arranged = stage.order.arranged(tuple(acting))
        reverse = stage.coin and coin == -1
        ordered += [Sweep(i, *flow, share) for flow, share in (arranged[::-1] if reverse else arranged)]
    return tuple(ordered)


def flow_counts(stages, model):
    """[(part, flows), ...] of the stages of a step on an array-state model, as :func:`sweeps` would list them.

    Counted and not listed, since a lattice has millions of noises.
    """
    many = {"drift": pieces(model), "noise": noises(model), "friction": noises(model) if has_friction(model) else 0}
    counts = []
    for stage in stages_known(stages):
        count = many.get(stage.part, 0)
        for twice in (stage.order is Symmetric, stage.coin):
            count = max(0, 2 * count - 1) if twice else count
        counts.append((stage.part, count))
    return counts


def noises_moving(part, k, model):
    """Noises whose flow, or joint flow, number k of a part is; None in the place of one that is off."""
    if part == "joint":
        on = noise_indices(model)
        return tuple(j if j in on else None for j in joined_noises(model, k))
    return (k,) if part == "noise" else ()


def compositions(stages, model):
    """A step as data: ((probability, flows), ...), where flows are ("drift" or "noise", k, share of the step), ...

    The flows stand in the order in which they act, each noise flow with an increment of its own.  One composition, or
    two of probability 1/2 where coins are tossed.  ValueError for stages with loops, whose times are no shares of the
    step, and for a noise that acts more than once with one increment.
    """
    if has_loops(stages):
        raise ValueError("the flows of loops have no shares of the step")
    if repeats_increments(stages, model):
        raise ValueError("flows that share an increment are not independent")
    coins = (1, -1) if needs_coins(stages) else (1,)
    return tuple((1 / len(coins), apart(acting_flows(stages, indices_of(model), coin), model)) for coin in coins)


def acting_flows(stages, indices, coin=1):
    """((part, k, share of the step), ...) of a path with this coin, whatever the increments; see `flows_in_order`."""
    return tuple((of.part, of.k, of.share * stages[of.stage].fraction) for of in flows_in_order(stages, indices, coin))


def apart(flows, model):
    """Flows (part, k, share), each joint one replaced by those of the piece and of its noises, which commute."""
    separate = []
    for part, k, share in flows:
        separate.append(("drift" if part == "joint" else part, k, share))
        if part == "joint":
            separate += [("noise", j, share) for j in noises_moving(part, k, model) if j is not None]
    return tuple(separate)


def repeats_increments(stages, model):
    """Whether a noise acts more than once in a step with shares of one increment."""
    noise = [k for part, k, _ in apart(acting_flows(stages, indices_of(model)), model) if part == "noise"]
    return has_shared(stages) and len(set(noise)) < len(noise)


def needs_coins(stages):
    """Whether the order of a stage depends on a coin."""
    return any(stage.coin for stage in stages_known(stages))


def has_loops(stages):
    """Whether a step has loops, or areas in their place."""
    return any(stage.part in ("loops", "areas") for stage in stages_known(stages))


def has_joint(stages):
    """Whether a step has stages of joint flows."""
    return any(stage.part == "joint" for stage in stages_known(stages))


def has_shared(stages):
    """Whether noise flows have shares of the increment of the whole step."""
    return any(stage.shared for stage in stages_known(stages))


def is_reversed_by_coin(stages):
    """Whether all flows of a step act in reversed order where the coin is turned, whatever the model."""
    if has_loops(stages):
        return False
    indices = dict.fromkeys(("drift", "noise", "friction"), (0, 1, 2)) | {
        "joint": tuple(("joint", k) for k in range(3))
    }
    heads, tails = (acting_flows(stages, indices, coin) for coin in (1, -1))
    return heads == tails[::-1]


def is_own_reverse(stages, model):
    """Whether a step on a model, coins included, is the same flows when these act in reversed order.

    Its backward operator P_h is then symmetric, P_(-h) P_h = 1 as formal series, so that the weak error has an
    expansion in every other power of h.
    """
    if has_loops(stages) or repeats_increments(stages, model):
        return False
    words = {acting_flows(stages, indices_of(model), coin) for coin in (1, -1)}
    return len(words) == 1 and all(flows == flows[::-1] for flows in words)


def with_friction(stages):
    """Stages with friction, unchanged if they have some.

    Friction acts before the noise; where the coin reverses the order of all flows, half before and half after it.
    """
    parts = [stage.part for stage in stages_known(stages)]
    noise = [i for i, part in enumerate(parts) if part in ("noise", "joint")]
    if "friction" in parts or not noise:
        return stages
    first, end = noise[0], noise[-1] + 1
    if not is_reversed_by_coin(stages):
        return (*stages[:first], flows("friction", "backwards"), *stages[first:])
    halves = flows("friction", "backwards", 1 / 2), flows("friction", "forwards", 1 / 2)
    return (*stages[:first], halves[0], *stages[first:end], halves[1], *stages[end:])


def substeps(stages):
    """Number of sub-steps, 1, 2, 4 or 8, into which a step is resolved so that each noise flow has whole ones."""
    noise = [stage for stage in stages_known(stages) if stage.length and not stage.shared]
    lengths = [stage.length // (2 if stage.order is Symmetric else 1) for stage in noise]
    return FINEST // math.gcd(FINEST, *lengths)


# ---------------------------------------------------------------------------------------------------------------------
# The flows of a step as sweeps over its lanes, one after the other, each with its time.
# ---------------------------------------------------------------------------------------------------------------------


class ShareOfWhole(NamedTuple):
    """Time of a noise flow that shares the increment of the whole step."""

    share: float


def with_times(flows, stages, model=None):
    """Flows of :func:`flows_in_order` with their times; without joint flows they need no model."""
    by_number = stages_known(stages)
    used = Counter()  # sub-steps of each Wiener process

    def time(of, k):
        length = of.share * by_number[of.stage].length
        if by_number[of.stage].shared:
            return ShareOfWhole(length / FINEST)
        first, end = used[k], used[k] + int(length)
        used[k], common = end, math.gcd(FINEST, first, end)
        return first // common, end // common, FINEST // common

    timed = []
    for of in flows:
        times = tuple(None if j is None else (j, time(of, j)) for j in noises_moving(of.part, of.k, model))
        timed.append(of._replace(time=times if of.part == "joint" else times[0][1] if times else None))
    return timed


class Lacking(NamedTuple):
    """Area of a pair that the noise flows lack, see the head of this file."""

    noises: tuple[int, int]  #: (k, l), k < l
    pair: int  #: the number of the pair among those of which there are areas
    pairs: int  #: the number of such pairs
    number: int  #: among all pairs of noises
    before: float  #: p, the share of Y_k that acts before Y_l


class LoopTime(NamedTuple):
    """Time of a flow of a loop."""

    lacking: tuple[Lacking, ...]  #: the areas that the loop supplies; its flows are those of the first pair
    place: int  #: of the flow in the loop, from 0


def sweeps(stages, model):
    """:class:`Sweep` of each flow of a step, those of a coin on the lanes with it.

    The time is None for drift; for noise it is (first, end, n), the increments over the sub-steps from `first` to
    before `end` where a step has n of them, with the least n that will do, or a :class:`ShareOfWhole`.  It does not
    depend on the coin, which moves flows of different processes.  Of a joint flow it is a tuple, (noise, time) for
    each of its noises, None for one that is off.  The flows of loops are noise flows with a
    :class:`LoopTime`.

    Where the order of a stage differs from lane to lane, all of 1, ..., n, ..., 1 are applied: those before n to the
    lanes with the coin 1, those after n to the others.
    """
    swept, every = [], with_times(flows_in_order(stages, indices_of(model)), stages, model)
    for i, stage in enumerate(stages_known(stages)):
        acting = [flow for flow in every if flow.stage == i]
        if stage.part in ("loops", "areas"):
            lacking = _lacking([flow.k for flow in acting], _shares(every), model)
            is_one = stage.part == "areas" and len(lacking) > 1 and answers(bracket_factors, class_of(model))
            swept += _loops(i, [tuple(lacking)] if is_one else [(pair,) for pair in lacking])
            continue
        first = acting[:-1] if stage.coin else []
        of_heads, of_tails = ([flow._replace(coin=coin) for flow in first] for coin in (1, -1))
        swept += [*of_heads, *acting[len(first) :], *of_tails[::-1]]
    return tuple(swept)


def _lacking(pairs, shares, model):
    """Areas that some pairs lack, given the shares of the noises in the whole step."""
    every = list(itertools.combinations(range(noises(model)), 2))
    return [Lacking(pair, p, len(pairs), every.index(pair), _before(shares, *pair)) for p, pair in enumerate(pairs)]


def _loops(i, groups):
    """Flows of the loops of stage i, one loop for each group of lacking areas."""
    return [
        Sweep(i, "noise", k, 1.0, 0, LoopTime(group, place))
        for group in groups
        for place, k in enumerate(2 * group[0].noises)
    ]


def _shares(every):
    """[(noise, its share of the increment of the step), ...] of all flows with their times."""
    shares = []
    for of in every:
        times = of.time if of.part == "joint" else ((of.k, of.time),) if of.time else ()
        shares += [(j, t.share if isinstance(t, ShareOfWhole) else 1.0) for j, t in filter(None, times)]
    return shares


def _before(shares, k, j):
    """Products of the shares of noise k and noise j, added up over all flows of k before one of j."""
    return sum(a * b for i, (n, a) in enumerate(shares) for m, b in shares[i + 1 :] if (n, m) == (k, j))
