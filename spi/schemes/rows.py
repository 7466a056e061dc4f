"""Compositions of flows as data: rows of flows, each row all pieces of H, or all noises, in some order.

Everything that is known of a splitting scheme derives from its rows by :func:`flows_in_order`: its kernel, the backward
operators of ``spi.kolmogorov``, whether it needs coins, whether it has a reversed twin, and what a step costs.

The fraction of a row is a share of the step h.  Drift flows have the time fraction * h, which may be negative.  Noise
flows have increments of their own over the time fraction * h, independent of those of all other noise flows of the
step: the flows of one Wiener process use up its increments over consecutive parts of the step, in the order in which
they act.  Paths resolve a step into at most :data:`FINEST` equal sub-steps, so that each such part is a multiple of
h / FINEST.
"""

import math
from collections import Counter
from typing import NamedTuple

from numba import types

from ..dispatch import INDICES, class_of, field_type, word
from ..protocol import drift_angle, drift_flow, noise_angle, noise_flow, noise_indices, piece_indices

# The parts and orders of rows are records, so that the compiler knows them by their types.


@word
def flow(part, model, k, t, y, angles):
    """The flow number k of a part."""


@word
def angle(part, model, k, t, y):
    """The largest |angle| in it."""


class Drift(NamedTuple):
    """The flows of H_1, ..., H_p."""

    def flow(part, model, k, t, y, angles):
        return drift_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return drift_angle(model, k, t, y)


class Noise(NamedTuple):
    """The flows of Ĥ_1, ..., Ĥ_m; a noise that is off is left out."""

    def flow(part, model, k, t, y, angles):
        return noise_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return noise_angle(model, k, t, y)


class Forwards(NamedTuple):
    """1, ..., n."""

    def arranged(indices):
        """((k, share of the row's fraction), ...), the first to act first; the same for the other orders."""
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

PARTS = {"drift": Drift(), "noise": Noise()}
ORDERS = {"forwards": Forwards(), "backwards": Backwards(), "symmetric": Symmetric()}
_NAMES = {type(part): name for name, part in PARTS.items()}


class Flows(NamedTuple):
    """A row of a composition; made by :func:`flows`."""

    part: NamedTuple
    order: NamedTuple
    fraction: float
    coin: Coin | None
    length: NamedTuple  #: of noise: FINEST times the fraction as one of INDICES, which the compiler knows by its type


def flows(part, order="forwards", fraction=1.0, coin=False):
    """A row of a composition.

    `part` is "drift" or "noise", `order` one of :data:`ORDERS`, `fraction` the share of the step, and `coin` says
    whether the order is reversed for the paths whose coin is -1.  ValueError for words that are not known, for a coin
    where it would change nothing, and for noise over a part of the step that no sub-steps make up.
    """
    for what, name, known in (("part", part, PARTS), ("order", order, ORDERS)):
        if name not in known:
            raise ValueError(f"a row of flows has the {what} {name!r}, which is none of {', '.join(known)}")
    if coin and order == "symmetric":
        raise ValueError("a symmetric row of flows is its own reverse and has no use for a coin")
    length = _sub_steps(order, fraction) if part == "noise" else 0
    return Flows(PARTS[part], ORDERS[order], float(fraction), Coin() if coin else None, INDICES[length]())


def _sub_steps(order, fraction):
    """FINEST times the fraction of a row of noise flows; ValueError unless all its flows have whole sub-steps."""
    unit = 2 if order == "symmetric" else 1
    if fraction * FINEST not in range(unit, FINEST + 1, unit):
        multiples = f"must be a positive multiple of 1/{FINEST // unit}, at most 1"
        halves = ", as it is halved" if unit == 2 else ""
        what = f"a step is divided into at most {FINEST} sub-steps with increments of their own"
        raise ValueError(f"a noise fraction is {fraction:g} and {multiples}{halves}: {what}")
    return int(fraction * FINEST)


class _Row(NamedTuple):
    """What is known of a row by its type."""

    part: str
    order: type
    coin: bool
    length: int  #: of noise, in sub-steps of which a step has FINEST


def _rows(rows):
    """The rows by their types, of rows or of the Numba type of some."""
    compiling = isinstance(rows, types.Type)
    for row in rows.types if compiling else rows:
        part, order, coin, length = (
            class_of(field_type(row, name) if compiling else getattr(row, name))
            for name in ("part", "order", "coin", "length")
        )
        yield _Row(_NAMES[part], order, coin is Coin, INDICES.index(length))


def _indices(model):
    return {"drift": piece_indices(model), "noise": noise_indices(model)}


def flows_in_order(rows, indices, coin=1):
    """((row, part, k, share of the row's fraction), ...) of a path with this coin, the first flow to act first.

    `indices` = {"drift": numbers of the pieces, "noise": numbers of the noises that are on}.
    """
    found = []
    for i, row in enumerate(_rows(rows)):
        arranged = row.order.arranged(indices[row.part])
        reverse = row.coin and coin == -1
        found += [(i, row.part, k, share) for k, share in (arranged[::-1] if reverse else arranged)]
    return tuple(found)


def compositions(rows, model):
    """A step as data: ((probability, flows), ...), where flows are ("drift" or "noise", k, share of the step), ...

    The flows stand in the order in which they act.  One composition, or two of probability 1/2 where coins are tossed.
    """
    coins = (1, -1) if needs_coins(rows) else (1,)
    return tuple(
        (
            1 / len(coins),
            tuple(
                (part, k, share * rows[i].fraction) for i, part, k, share in flows_in_order(rows, _indices(model), coin)
            ),
        )
        for coin in coins
    )


def needs_coins(rows):
    """Whether the order of a row depends on a coin."""
    return any(row.coin for row in _rows(rows))


def is_reversed_by_coin(rows):
    """Whether all flows of a step act in reversed order where the coin is turned, whatever the model."""
    indices = {"drift": (0, 1, 2), "noise": (0, 1, 2)}
    heads, tails = (
        [(part, k, share * rows[i].fraction) for i, part, k, share in flows_in_order(rows, indices, coin)]
        for coin in (1, -1)
    )
    return heads == tails[::-1]


def is_own_reverse(rows, model):
    """Whether a step on a model, coins included, is the same flows when these act in reversed order.

    Its backward operator P_h is then symmetric, P_(-h) P_h = 1 as formal series, so that the weak error has an
    expansion in every other power of h.
    """
    words = {flows for _, flows in compositions(rows, model)}
    return len(words) == 1 and all(flows == flows[::-1] for flows in words)


def substeps(rows):
    """Into how many sub-steps, 1, 2, 4 or 8, a step must be resolved so that each noise flow has some of them."""
    noise = [row for row in _rows(rows) if row.part == "noise"]
    lengths = [row.length // (2 if row.order is Symmetric else 1) for row in noise]
    return FINEST // math.gcd(FINEST, *lengths)


def _with_spans(flows, rows):
    """Flows as :func:`flows_in_order` gives them, each with the part of the step over which its increments are.

    The part is (first, end, n) as in :func:`sweeps`, with the least n that will do; None for drift.
    """
    lengths = [row.length for row in _rows(rows)]
    used = Counter()  # sub-steps of each Wiener process
    found = []
    for flow in flows:
        i, part, k, share = flow
        first = used[part, k]
        used[part, k] += int(share * lengths[i])
        found.append((*flow, _fewest(first, used[part, k]) if part == "noise" else None))
    return found


def _fewest(first, end):
    common = math.gcd(FINEST, first, end)
    return first // common, end // common, FINEST // common


def sweeps(rows, model):
    """((row, part, k, share of the row's fraction, coin, span), ...): flows on the lanes with that coin, or on all (0).

    The span is None for drift; for noise it is (first, end, n), the increments over the sub-steps from `first` to
    before `end` where a step has n of them.  It does not depend on the coin, which moves flows of different processes.

    Where the order of a row differs from lane to lane, all of 1, ..., n, ..., 1 are applied: those before n to the
    lanes with the coin 1, those after n to the others.
    """
    found, every = [], _with_spans(flows_in_order(rows, _indices(model)), rows)
    for i, row in enumerate(_rows(rows)):
        acting = [flow for flow in every if flow[0] == i]
        if row.coin:
            first, last = acting[:-1], acting[-1:]
            placed = [(f, 1) for f in first] + [(f, 0) for f in last] + [(f, -1) for f in reversed(first)]
        else:
            placed = [(f, 0) for f in acting]
        found += [(*flow, coin, span) for (*flow, span), coin in placed]
    return tuple(found)
