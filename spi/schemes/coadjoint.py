"""The coadjoint action of an exponential: exp(M(v)) y, where M(v) y = B(y) v and B is linear in y.

M(v) y is the field of the Hamiltonian v . y, so that its flow keeps every Casimir function, whatever v is.  Where
B(y) v = y x v it is a rotation, by Rodrigues' formula; otherwise the exponential series is summed up to rounding.
"""

from fractions import Fraction

import numpy as np
from numba.extending import overload

from ..angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES, sinc_versinc
from ..dispatch import INLINED, inlined
from ..elementary import REDUCIBLE, SMALL, TINY, bits, from_bits
from ..fields import add_scaled, dot, scaled
from ..lanes import load_lane, store_lane
from ..protocol import cross_product, dimension, structure
from ..rng import LANES
from .splitting import report_angle

# Squares of angles, by their bits as in splitting.py.
_TINY_BITS, _SMALL_BITS, _REDUCIBLE_BITS = (int(bits(angle * angle)) for angle in (TINY, SMALL, REDUCIBLE))
_INFINITE_BITS = int(bits(np.inf))

_NEGLIGIBLE = 2.0**-112  # for squares
_MOST_TERMS = 40
_MOST_PARTS = 2**12
# 1/j, and what it has beyond double precision: a rounding that is the same in every step would make Casimirs drift.
_INVERSE = tuple(1.0 / j for j in range(1, _MOST_TERMS + 1))
_INVERSE_REST = tuple(float(Fraction(1, j) - Fraction(1.0 / j)) for j in range(1, _MOST_TERMS + 1))


@inlined
def action_size(model):
    """How many floats of scratch :func:`act` needs, those of v included."""
    return 3 * dimension(model) * LANES


def act(model, work, y, report):
    """y becomes exp(M(v)) y, in each lane of a block; `work` begins with the states v."""
    (turn if cross_product(model) else add_series)(model, work, y, report)


@overload(act, jit_options=INLINED)
def _(model, work, y, report):
    return turn if cross_product(model) else add_series


# ---------------------------------------------------------------------------------------------------------------------
# Rotations
# ---------------------------------------------------------------------------------------------------------------------


def turn(model, work, y, report):
    """For B(y) v = y x v: turn y about v by the angle -|v|."""
    largest = 0
    for lane in range(LANES):
        axis = load_lane(model, work, lane)
        largest = max(largest, bits(abs(dot(axis, axis))))
    if largest <= _TINY_BITS:
        turn_within(TINY_ANGLES, model, work, y)
    elif largest <= _SMALL_BITS:
        turn_within(SMALL_ANGLES, model, work, y)
    elif largest <= _REDUCIBLE_BITS:
        turn_within(REDUCED_ANGLES, model, work, y)
    else:
        turn_within(ANY_ANGLES, model, work, y)
    report_angle(bits(np.sqrt(from_bits(min(largest, _INFINITE_BITS)))), report)


@inlined
def turn_within(angles, model, work, y):
    """Rodrigues' formula, y + (sin a / a) M y + ((1 - cos a) / a^2) M^2 y with a = |v|."""
    for lane in range(LANES):
        state, axis = load_lane(model, y, lane), load_lane(model, work, lane)
        first = structure(model, state, axis)
        second = structure(model, first, axis)
        sinc, versinc = sinc_versinc(angles, dot(axis, axis))
        change = add_scaled(first, 1.0, add_scaled(scaled(second, versinc), sinc, first))
        store_lane(y, lane, add_scaled(state, 1.0, change))


# ---------------------------------------------------------------------------------------------------------------------
# All other algebras
# ---------------------------------------------------------------------------------------------------------------------


def add_series(model, work, y, report):
    """The series of exp(M(v) / n), n times, with n = 1, 2, 4, ... so large that no term is longer than the state.

    So no digits are lost.  A lane whose series does not converge even with the largest n becomes NaN.
    """
    parts = 1
    while sum_series(model, 1.0 / parts, work, y, 1.0 if parts < _MOST_PARTS else np.inf):
        parts *= 2
    add_change(model, work, y)
    for _ in range(1, parts):
        sum_series(model, 1.0 / parts, work, y, np.inf)
        add_change(model, work, y)


@inlined
def sum_series(model, share, work, y, longest):
    """Sum up exp(share M(v)) y - y; whether there was a term `longest` times as long as the state."""
    term = dimension(model) * LANES
    change = 2 * term
    for lane in range(LANES):
        state = load_lane(model, y, lane)
        store_lane(work, term + lane, state)
        store_lane(work, change + lane, scaled(state, 0.0))
    terms, unfinished, too_long = 0, 1, 0
    while unfinished > 0 and too_long == 0 and terms < _MOST_TERMS:
        a, a_rest = share * _INVERSE[terms], share * _INVERSE_REST[terms]
        b, b_rest = share * _INVERSE[terms + 1], share * _INVERSE_REST[terms + 1]
        c, c_rest = share * _INVERSE[terms + 2], share * _INVERSE_REST[terms + 2]
        d, d_rest = share * _INVERSE[terms + 3], share * _INVERSE_REST[terms + 3]
        unfinished = 0
        for lane in range(LANES):
            state, v = load_lane(model, y, lane), load_lane(model, work, lane)
            first = next_term(model, load_lane(model, work, term + lane), v, a, a_rest)
            second = next_term(model, first, v, b, b_rest)
            third = next_term(model, second, v, c, c_rest)
            fourth = next_term(model, third, v, d, d_rest)
            store_lane(work, term + lane, fourth)
            four = add_scaled(first, 1.0, add_scaled(second, 1.0, add_scaled(third, 1.0, fourth)))
            store_lane(work, change + lane, add_scaled(load_lane(model, work, change + lane), 1.0, four))
            length, whole = dot(fourth, fourth), dot(state, state)
            unfinished += 1 if length > _NEGLIGIBLE * whole else 0
            too_long += 1 if length + dot(first, first) > longest * whole else 0
        terms += 4
    return too_long > 0


@inlined
def next_term(model, term, v, inverse, rest):
    """M(v) term / j, given 1/j in two parts."""
    moved = structure(model, term, v)
    return add_scaled(scaled(moved, inverse), rest, moved)


@inlined
def add_change(model, work, y):
    """Add what a series sums up to, or NaN in lanes where its last term was not small."""
    term = dimension(model) * LANES
    change = 2 * term
    for lane in range(LANES):
        state, last = load_lane(model, y, lane), load_lane(model, work, term + lane)
        converged = dot(last, last) <= _NEGLIGIBLE * dot(state, state)
        moved = load_lane(model, work, change + lane)
        store_lane(y, lane, add_scaled(state, 1.0 if converged else np.nan, moved))
