"""Stochastic Runge-Kutta-Munthe-Kaas schemes: the state is moved by the coadjoint action of one exponential a step.

See docs/literature_schemes.md.
"""

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, number, unrolled
from ..ensemble.areas import area_channels, area_count, area_indices
from ..ensemble.fields import (
    add_noise_bracket_gradient,
    add_scaled,
    cross_product,
    dot,
    noise_field,
    scaled,
    step_gradient,
)
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import (
    dimension,
    noise_hessian,
    noise_indices,
    noise_structure,
    strengths,
    structure,
)
from ..ensemble.scheme_protocol import lanes_in_use
from ..numerics.angles import by_size, sinc_versinc
from ..numerics.elementary import SMALL, bits, from_bits
from ..numerics.rng import LANES
from .sweeps import report_angle

# ---------------------------------------------------------------------------------------------------------------------
# The coadjoint action of an exponential: exp(M(v)) y, where M(v) y = B(y) v and B is linear in y.
#
# M(v) y is the field of the Hamiltonian v . y, so that its flow keeps every Casimir function, whatever v is.  Where
# B(y) v = y x v it is a rotation, by Rodrigues' formula; otherwise the exponential series is summed up to rounding.
# ---------------------------------------------------------------------------------------------------------------------

_INFINITE_BITS = int(bits(np.inf))
_REPORTED_BITS = int(bits(0.5 * SMALL * SMALL))  # of squares of angles that may have to be reported

_NEGLIGIBLE = 2.0**-140  # for squares of lengths; well below rounding, since some components may be small
_FEW, _MOST = 5, 6  # times four terms, enough for |M(v)| = 0.7 and 1.3
_MOST_PARTS = 2**10
# 1/j, and its part beyond double precision: a rounding that is the same in every step would make Casimirs drift.
_INVERSE = tuple(1.0 / j for j in range(1, 4 * _MOST + 1))
_INVERSE_REST = tuple(float(Fraction(1, j) - Fraction(1.0 / j)) for j in range(1, 4 * _MOST + 1))


@device
def action_size(model):
    """Floats of scratch for :func:`act`, those of v included."""
    return (2 + _MOST) * dimension(model) * LANES


@device(by_type=True)
def act(model, work, y, report):
    """Replace y by exp(M(v)) y, in each lane of a block; `work` begins with the states v."""
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
    turn_up_to(largest, model, work, y)
    if largest > _REPORTED_BITS:
        largest, (first, end) = 0, lanes_in_use(report)
        for lane in range(first, end):
            axis = load_lane(model, work, lane)
            largest = max(largest, bits(abs(dot(axis, axis))))
        report_angle(bits(np.sqrt(from_bits(min(largest, _INFINITE_BITS)))), report)


@device
def turn_within(angles, model, work, y):
    """Rodrigues' formula, y + (sin a / a) M y + ((1 - cos a) / a^2) M^2 y with a = |v|."""
    for lane in range(LANES):
        state, axis = load_lane(model, y, lane), load_lane(model, work, lane)
        first = structure(model, state, axis)
        second = structure(model, first, axis)
        sinc, versinc = sinc_versinc(angles, dot(axis, axis))
        change = add_scaled(first, 1.0, add_scaled(scaled(second, versinc), sinc, first))
        store_lane(y, lane, add_scaled(state, 1.0, change))


turn_up_to = device(by_size(turn_within, squares=True))


# ---------------------------------------------------------------------------------------------------------------------
# All other algebras
# ---------------------------------------------------------------------------------------------------------------------


def add_series(model, work, y, report):
    """Series of exp(M(v) / n), n times, with n = 1, 2, 4, ... so large that no lane needs many terms.

    Series with few terms have small ones, so that no digits are lost.  A lane for which even the largest n is too
    small becomes NaN.
    """
    parts, done = 1, 0
    while done < parts:
        first_try = done == 0 and parts < _MOST_PARTS
        unfinished, fours = sum_series(model, 1.0 / parts, work, y, _FEW if first_try else _MOST)
        if first_try and unfinished > 0:
            parts *= 2
        else:
            add_sums(model, fours, work, y)
            done += 1


@device
def sum_series(model, share, work, y, most):
    """Sum up exp(share M(v)) y - y, four terms at a time, at most `most` times.

    Returns (number of finite lanes that need more terms, number of sums).
    """
    size = dimension(model) * LANES
    term = size
    for lane in range(LANES):
        store_lane(work, term + lane, load_lane(model, y, lane))
    fours, unfinished = 0, 1
    while unfinished > 0 and fours < most:
        j, sum_ = 4 * fours, (2 + fours) * size
        a, b, c, d = share * _INVERSE[j], share * _INVERSE[j + 1], share * _INVERSE[j + 2], share * _INVERSE[j + 3]
        a_rest, b_rest = share * _INVERSE_REST[j], share * _INVERSE_REST[j + 1]
        c_rest, d_rest = share * _INVERSE_REST[j + 2], share * _INVERSE_REST[j + 3]
        unfinished = 0
        for lane in range(LANES):
            state, v = load_lane(model, y, lane), load_lane(model, work, lane)
            first = next_term(model, load_lane(model, work, term + lane), v, a, a_rest)
            second = next_term(model, first, v, b, b_rest)
            third = next_term(model, second, v, c, c_rest)
            fourth = next_term(model, third, v, d, d_rest)
            store_lane(work, term + lane, fourth)
            four = add_scaled(first, 1.0, add_scaled(second, 1.0, add_scaled(third, 1.0, fourth)))
            store_lane(work, sum_ + lane, four)
            unfinished += 1 if dot(fourth, fourth) > _NEGLIGIBLE * dot(state, state) else 0
        fours += 1
    return unfinished, fours


@device
def next_term(model, term, v, inverse, rest):
    """M(v) term / j, given 1/j in two parts."""
    moved = structure(model, term, v)
    return add_scaled(scaled(moved, inverse), rest, moved)


@device
def add_sums(model, fours, work, y):
    """Add the sums to y, or NaN in lanes where the last term was not small.

    The last sum comes first: added to a larger one it would be lost by a rounding that is the same in every step.
    """
    size = dimension(model) * LANES
    for n in range(fours - 1, 0, -1):
        small, large = (2 + n) * size, (1 + n) * size
        for lane in range(LANES):
            store_lane(
                work,
                large + lane,
                add_scaled(load_lane(model, work, large + lane), 1.0, load_lane(model, work, small + lane)),
            )
    for lane in range(LANES):
        state, last = load_lane(model, y, lane), load_lane(model, work, size + lane)
        converged = dot(last, last) <= _NEGLIGIBLE * dot(state, state)
        change = load_lane(model, work, 2 * size + lane)
        store_lane(y, lane, add_scaled(state, 1.0 if converged else np.nan, change))


@unrolled(noise_indices)
def add_ito_hessians(index, model, value, h, y):
    """value + h/2 sum_k sigma_k^2 Hess Ĥ_k(y) f_k(y), where f_k = B grad Ĥ_k.

    Together with the quadratic term of the exponential this is the Itô correction of the Stratonovich drift.
    """
    k = number(index)
    sigma = strengths(model)[k]
    return add_scaled(value, 0.5 * h * sigma * sigma, noise_hessian(model, k, y, noise_field(model, k, y)))


def left_out_by_euler(model, k, y, v):
    """B(y) Hess Ĥ_k(y) v, the part of f_k'(y) v of which the Euler type has the mean only."""
    return noise_structure(model, k, y, noise_hessian(model, k, y, v))


@unrolled(area_indices)
def add_area_gradients(index, model, value, areas, lane, y):
    """value + sum_{k < l} sigma_k sigma_l A_kl grad {Ĥ_l, Ĥ_k}(y), with the areas of one lane of a block."""
    p = number(index)
    k, j = area_channels(model)[2 * p], area_channels(model)[2 * p + 1]
    strength = strengths(model)[k] * strengths(model)[j]
    return add_noise_bracket_gradient(model, value, strength * areas[p * LANES + lane], j, k, y)


@device
def gradient_with_areas(model, h, dW, areas, lane, y):
    """grad K(y) of the Hamiltonian of one step of one lane, areas included."""
    return add_area_gradients(model, step_gradient(model, h, dW, lane, y), areas, lane, y)


class MuntheKaasEuler(NamedTuple):
    """z = exp(M(v)) y, v = h (grad H + 1/2 sum_k sigma_k^2 Hess Ĥ_k f_k) + sum_k sigma_k dW_k grad Ĥ_k at y."""

    def work_size(scheme, model):
        return action_size(model)

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            store_lane(work, lane, add_ito_hessians(model, step_gradient(model, h, dW, lane, state), h, state))
        act(model, work, y, report)


class MuntheKaasMidpoint(NamedTuple):
    """z = exp(M(v(x))) y, x = exp(M(v(y)) / 2) y, v = h grad H + sum_k sigma_k dW_k grad Ĥ_k."""

    def work_size(scheme, model):
        return action_size(model) + dimension(model) * LANES

    def advance(scheme, model, h, dW, coins, y, work, report):
        x = work[action_size(model) :]
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            store_lane(x, lane, state)
            store_lane(work, lane, scaled(step_gradient(model, h, dW, lane, state), 0.5))
        act(model, work, x, report)
        for lane in range(LANES):
            store_lane(work, lane, step_gradient(model, h, dW, lane, load_lane(model, x, lane)))
        act(model, work, y, report)


class MuntheKaasAreas(NamedTuple):
    """z = exp(M(v(x))) y, x = y + M(v) y / 2 + M(v)^2 y / 8 with v = v(y), with the areas in v.

    v = h grad H + sum_k sigma_k dW_k grad Ĥ_k + sum_{k < l} sigma_k sigma_l A_kl grad {Ĥ_l, Ĥ_k}.
    """

    needs_areas = True

    def work_size(scheme, model):
        return action_size(model)

    def advance(scheme, model, h, dW, coins, y, work, report):
        areas = dW[len(dW) - area_count(model) * LANES :]  # written out, so that the index is known not to be negative
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            v = gradient_with_areas(model, h, dW, areas, lane, state)
            quarter = add_scaled(state, 0.25, structure(model, state, v))
            x = add_scaled(state, 0.5, structure(model, quarter, v))
            store_lane(work, lane, gradient_with_areas(model, h, dW, areas, lane, x))
        act(model, work, y, report)
