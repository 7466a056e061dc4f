"""Compositions of flows as data: rows of flows, each row all pieces of H, or all noises, in some order.

Everything that is known of a splitting scheme derives from its rows by :func:`flows_in_order`: its kernel, the backward
operators of ``spi.kolmogorov``, whether it needs coins, whether it has a reversed twin, and what a step costs.

The fraction of a row is a share of the step h.  Drift flows have the time fraction * h; noise flows have increments of
their own over the time fraction * h, independent of those of all other noise flows of the step.
"""

from typing import NamedTuple

from numba import types

from ..dispatch import class_of, field_type, word
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


PARTS = {"drift": Drift(), "noise": Noise()}
ORDERS = {"forwards": Forwards(), "backwards": Backwards(), "symmetric": Symmetric()}
_NAMES = {type(part): name for name, part in PARTS.items()}


class Flows(NamedTuple):
    """A row of a composition; made by :func:`flows`."""

    part: NamedTuple
    order: NamedTuple
    fraction: float
    coin: Coin | None


def flows(part, order="forwards", fraction=1.0, coin=False):
    """A row of a composition.

    `part` is "drift" or "noise", `order` one of :data:`ORDERS`, `fraction` the share of the step, and `coin` says
    whether the order is reversed for the paths whose coin is -1.  ValueError for words that are not known, and for a
    coin where it would change nothing.
    """
    for what, name, known in (("part", part, PARTS), ("order", order, ORDERS)):
        if name not in known:
            raise ValueError(f"a row of flows has the {what} {name!r}, which is none of {', '.join(known)}")
    if coin and order == "symmetric":
        raise ValueError("a symmetric row of flows is its own reverse and has no use for a coin")
    return Flows(PARTS[part], ORDERS[order], float(fraction), Coin() if coin else None)


class _Row(NamedTuple):
    """What is known of a row by its type."""

    part: str
    order: type
    coin: bool


def _rows(rows):
    """The rows by their types, of rows or of the Numba type of some."""
    compiling = isinstance(rows, types.Type)
    for row in rows.types if compiling else rows:
        part, order, coin = (
            class_of(field_type(row, name) if compiling else getattr(row, name)) for name in ("part", "order", "coin")
        )
        yield _Row(_NAMES[part], order, coin is Coin)


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


def sweeps(rows, model):
    """((row, part, k, share of the row's fraction, coin), ...): flows, each on the lanes with that coin, or on all (0).

    Where the order of a row differs from lane to lane, all of 1, ..., n, ..., 1 are applied: those before n to the
    lanes with the coin 1, those after n to the others.
    """
    found, every = [], flows_in_order(rows, _indices(model))
    for i, row in enumerate(_rows(rows)):
        acting = [flow for flow in every if flow[0] == i]
        if row.coin:
            first, last = acting[:-1], acting[-1:]
            found += [(*f, 1) for f in first] + [(*f, 0) for f in last] + [(*f, -1) for f in reversed(first)]
        else:
            found += [(*f, 0) for f in acting]
    return tuple(found)
