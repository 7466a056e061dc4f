"""Stochastic Runge-Kutta-Munthe-Kaas schemes: the state is moved by the coadjoint action of one exponential a step.

See docs/literature_schemes.md.
"""

from typing import NamedTuple

from ..compiler.dispatch import device, number, unrolled
from ..ensemble.fields import add_noise_bracket_gradient, add_scaled, noise_field, scaled, step_gradient
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.pairs import area_channels, area_count, area_indices
from ..ensemble.protocol import (
    dimension,
    noise_hessian,
    noise_indices,
    noise_structure,
    strengths,
    structure,
)
from ..numerics.rng import LANES
from .coadjoint import act, action_size


@unrolled(noise_indices)
def add_ito_hessians(index, model, value, h, y):
    """value + h/2 sum_k sigma_k^2 Hess Ĥ_k(y) f_k(y), where f_k = B grad Ĥ_k.

    With what is quadratic in the exponential, this turns the Stratonovich into the Itô drift.
    """
    k = number(index)
    sigma = strengths(model)[k]
    return add_scaled(value, 0.5 * h * sigma * sigma, noise_hessian(model, k, y, noise_field(model, k, y)))


def left_out_by_euler(model, k, y, v):
    """B(y) Hess Ĥ_k(y) v, the part of f_k'(y) v of which the Euler type takes no more than the mean."""
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
        areas = dW[len(dW) - area_count(model) * LANES :]  # as it stands, for an index that is surely not negative
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            v = gradient_with_areas(model, h, dW, areas, lane, state)
            quarter = add_scaled(state, 0.25, structure(model, state, v))
            x = add_scaled(state, 0.5, structure(model, quarter, v))
            store_lane(work, lane, gradient_with_areas(model, h, dW, areas, lane, x))
        act(model, work, y, report)
