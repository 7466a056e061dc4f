"""Schemes from the literature: stochastic Heun, also moved back to |y|, and Milstein for noises that commute."""

import math
from typing import NamedTuple

from spi.compiler.dispatch import device, number, unrolled
from spi.ensemble.fields import add_noise_fields, add_scaled, dot, drift_field, noise_field_derivative, step_field
from spi.ensemble.lanes import load_lane, store_lane
from spi.ensemble.protocol import noise_indices, strengths
from spi.numerics.rng import LANES


@device
def heun(model, h, dW, lane, y):
    """y + (F(y) + F(y + F(y))) / 2."""
    first = step_field(model, h, dW, lane, y)
    second = step_field(model, h, dW, lane, add_scaled(y, 1.0, first))
    return add_scaled(add_scaled(y, 0.5, first), 0.5, second)


class Heun(NamedTuple):
    """z = y + (F(y) + F(y + F(y))) / 2, F(y) = h f(y) + sum_k sigma_k dW_k f_k(y)"""

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            store_lane(y, lane, heun(model, h, dW, lane, load_lane(model, y, lane)))


@unrolled(noise_indices)
def add_products(index, model, value, dW, lane, y, direction):
    """value + sum_k sigma_k dW_k f_k'(y) v / 2 with v = `direction`."""
    k = number(index)
    factor = 0.5 * strengths(model)[k] * dW[k * LANES + lane]
    return add_scaled(value, factor, noise_field_derivative(model, k, y, direction))


class Milstein(NamedTuple):
    """z = y + h f + sum_k sigma_k dW_k f_k + sum_kl sigma_k sigma_l dW_k dW_l f_k' f_l / 2, all at y"""

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            moved = add_noise_fields(model, add_scaled(state, h, drift_field(model, state)), dW, lane, state)
            # sum_l sigma_l dW_l f_l, which is what the noises add to y
            noise = add_scaled(add_noise_fields(model, state, dW, lane, state), -1.0, state)
            store_lane(y, lane, add_products(model, moved, dW, lane, state, noise))


class NormalisedHeun(NamedTuple):
    """|y| z / |z| with the z of Heun"""

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            moved = heun(model, h, dW, lane, state)
            stretch = math.sqrt(dot(state, state) / dot(moved, moved))
            store_lane(y, lane, add_scaled(moved, stretch - 1.0, moved))
