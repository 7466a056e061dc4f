"""Compositions of flows as data: stages, each of them all pieces of H, or all noises, in some order, or loops.

Everything that is known of a splitting scheme derives from its stages by :func:`flows_in_order`: its kernel, the
backward operators of ``spi.exact.kolmogorov``, whether it needs coins, whether it has antithetic paths, and what a
step costs.

The fraction of a stage is a share of the step h.  Drift flows have the time fraction * h, which may be negative.  Noise
flows have increments of their own over the time fraction * h, independent of those of all other noise flows of the
step: the flows of one Wiener process use up its increments over consecutive parts of the step, in the order in which
they act.  Paths resolve a step into at most :data:`FINEST` equal sub-steps, so that each such part is a multiple of
h / FINEST.

A stage of **loops** supplies what the noise flows lack at order h.  Where Y_k acts before Y_l for k < l, that is, as an
operator, -sigma_k sigma_l J_lk [Y_k, Y_l], with the iterated integral J_lk = dW_k dW_l / 2 - A_kl of dW_l, then dW_k.
The loop exp(a Y_k), exp(b Y_l), exp(-a Y_k), exp(-b Y_l), acting in this order, is 1 + a b [Y_k, Y_l] + ..., hence
a b = -sigma_k sigma_l J_lk with |a| = |b|; a coin decides the sign of both, so that the terms of order h^(3/2), odd in
(a, b), have the mean 0.  Noises that commute need no loops.
"""

import math
from typing import NamedTuple

from ..compiler.dispatch import INDICES, method
from ..compiler.records import class_of, field
from ..ensemble.inexact import piece_gradient, piece_hessian
from ..ensemble.protocol import (
    area_pairs,
    drift_angle,
    drift_flow,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noise_structure,
    noise_structure_derivative,
    piece_indices,
    structure,
    structure_derivative,
)

# The parts and orders of stages are records, so that the compiler knows them by their types.


@method
def flow(part, model, k, t, y, angles):
    """The flow number k of a part."""


@method
def angle(part, model, k, t, y):
    """The largest |angle| in it."""


@method
def gradient(part, model, k, y):
    """The gradient of the Hamiltonian of this flow, one without an exact flow."""


@method
def hessian(part, model, k, y, v):
    """Its Hessian times v."""


@method
def structure_along(part, model, k, y, v):
    """B(y) v for a v that is 0 wherever this gradient always is."""


@method
def structure_derivative_along(part, model, k, y, u, v):
    """(DB(y)[u]) v for such a v."""


class Drift(NamedTuple):
    """The flows of H_1, ..., H_p."""

    def flow(part, model, k, t, y, angles):
        return drift_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return drift_angle(model, k, t, y)

    def gradient(part, model, k, y):
        return piece_gradient(model, k, y)

    def hessian(part, model, k, y, v):
        return piece_hessian(model, k, y, v)

    def structure_along(part, model, k, y, v):
        return structure(model, y, v)

    def structure_derivative_along(part, model, k, y, u, v):
        return structure_derivative(model, y, u, v)


class Noise(NamedTuple):
    """The flows of Ĥ_1, ..., Ĥ_m; a noise that is off is left out."""

    def flow(part, model, k, t, y, angles):
        return noise_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return noise_angle(model, k, t, y)

    def gradient(part, model, k, y):
        return noise_gradient(model, k, y)

    def hessian(part, model, k, y, v):
        return noise_hessian(model, k, y, v)

    def structure_along(part, model, k, y, v):
        return noise_structure(model, k, y, v)

    def structure_derivative_along(part, model, k, y, u, v):
        return noise_structure_derivative(model, k, y, u, v)


class Loops(NamedTuple):
    """The loops of flows of pairs of noises that do not commute, see the head of this file."""


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


#: The most sub-steps for which a step can have increments of their own; a power of two.
FINEST = 8

PARTS = {"drift": Drift(), "noise": Noise(), "loops": Loops()}
ORDERS = {"forwards": Forwards(), "backwards": Backwards(), "symmetric": Symmetric()}
_NAMES = {type(part): name for name, part in PARTS.items()}


class Flows(NamedTuple):
    """A stage of a composition; made by :func:`flows`."""

    part: NamedTuple
    order: NamedTuple
    fraction: float
    coin: Coin | None
    length: NamedTuple  #: of noise: FINEST times the fraction as one of INDICES, which the compiler knows by its type


def flows(part, order="forwards", fraction=1.0, coin=False):
    """A stage of a composition.

    `part` is "drift", "noise" or "loops", `order` one of :data:`ORDERS`, `fraction` the share of the step, and `coin`
    says whether the order is reversed for the paths whose coin is -1.  ValueError for words that are not known, for a
    coin where it would change nothing, for noise over a part of the step that no sub-steps make up, and for loops that
    are given anything besides.
    """
    for what, name, known in (("part", part, PARTS), ("order", order, ORDERS)):
        if name not in known:
            raise ValueError(f"{name!r} is not a known {what}; known: {', '.join(known)}")
    if coin and order == "symmetric":
        raise ValueError("a symmetric stage is its own reverse and has no use for a coin")
    if part == "loops" and (order, fraction, coin) != ("forwards", 1.0, False):
        raise ValueError("loops have neither a fraction nor an order nor a word; each has one coin already")
    length = _sub_steps(order, fraction) if part == "noise" else 0
    return Flows(PARTS[part], ORDERS[order], float(fraction), Coin() if coin else None, INDICES[length]())


def _sub_steps(order, fraction):
    """FINEST times the fraction of a stage of noise flows; ValueError unless all its flows have whole sub-steps."""
    unit = 2 if order == "symmetric" else 1
    if fraction * FINEST not in range(unit, FINEST + 1, unit):
        multiples = f"must be a positive multiple of 1/{FINEST // unit}, at most 1"
        halves = ", as it is halved" if unit == 2 else ""
        what = f"a step is divided into at most {FINEST} sub-steps with increments of their own"
        raise ValueError(f"a noise fraction is {fraction:g} and {multiples}{halves}: {what}")
    return int(fraction * FINEST)


class _Known(NamedTuple):
    """What is known of a stage by its type."""

    part: str
    order: type
    coin: bool
    length: int  #: of noise, in sub-steps of which a step has FINEST


def stages_known(stages):
    """What is known by their types of stages, or of the Numba type of some: a tuple of `_Known`."""
    found = []
    for stage in stages:
        part, order, coin, length = (class_of(field(stage, name)) for name in ("part", "order", "coin", "length"))
        found.append(_Known(_NAMES[part], order, coin is Coin, INDICES.index(length)))
    return tuple(found)


def indices_of(model):
    """The indices of the flows of each part."""
    return {"drift": piece_indices(model), "noise": noise_indices(model), "loops": area_pairs(model)}


def flows_in_order(stages, indices, coin=1):
    """((stage, part, k, share of the stage's fraction), ...) of a path with this coin, the first flow to act first.

    `indices` = {"drift": numbers of the pieces, "noise": numbers of the noises that are on, "loops": pairs of noises},
    and k is one of them.
    """
    found = []
    for i, stage in enumerate(stages_known(stages)):
        arranged = stage.order.arranged(indices[stage.part])
        reverse = stage.coin and coin == -1
        found += [(i, stage.part, k, share) for k, share in (arranged[::-1] if reverse else arranged)]
    return tuple(found)


def compositions(stages, model):
    """A step as data: ((probability, flows), ...), where flows are ("drift" or "noise", k, share of the step), ...

    The flows stand in the order in which they act.  One composition, or two of probability 1/2 where coins are tossed.
    ValueError for stages with loops, whose times are no shares of the step.
    """
    if has_loops(stages):
        raise ValueError("the flows of loops have no shares of the step")
    coins = (1, -1) if needs_coins(stages) else (1,)
    return tuple(
        (
            1 / len(coins),
            tuple(
                (part, k, share * stages[i].fraction)
                for i, part, k, share in flows_in_order(stages, indices_of(model), coin)
            ),
        )
        for coin in coins
    )


def needs_coins(stages):
    """Whether the order of a stage depends on a coin."""
    return any(stage.coin for stage in stages_known(stages))


def has_loops(stages):
    """Whether a step has loops."""
    return any(stage.part == "loops" for stage in stages_known(stages))


def is_reversed_by_coin(stages):
    """Whether all flows of a step act in reversed order where the coin is turned, whatever the model."""
    if has_loops(stages):
        return False
    indices = {"drift": (0, 1, 2), "noise": (0, 1, 2)}
    heads, tails = (
        [(part, k, share * stages[i].fraction) for i, part, k, share in flows_in_order(stages, indices, coin)]
        for coin in (1, -1)
    )
    return heads == tails[::-1]


def is_own_reverse(stages, model):
    """Whether a step on a model, coins included, is the same flows when these act in reversed order.

    Its backward operator P_h is then symmetric, P_(-h) P_h = 1 as formal series, so that the weak error has an
    expansion in every other power of h.
    """
    if has_loops(stages):
        return False
    words = {flows for _, flows in compositions(stages, model)}
    return len(words) == 1 and all(flows == flows[::-1] for flows in words)


def substeps(stages):
    """Into how many sub-steps, 1, 2, 4 or 8, a step must be resolved so that each noise flow has some of them."""
    noise = [stage for stage in stages_known(stages) if stage.part == "noise"]
    lengths = [stage.length // (2 if stage.order is Symmetric else 1) for stage in noise]
    return FINEST // math.gcd(FINEST, *lengths)
