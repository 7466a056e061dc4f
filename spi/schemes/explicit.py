"""Explicit schemes of vector fields: Euler-Maruyama and Heun, with their lengths corrected, and Rößler's RS2.

Euler-Maruyama is the paper's first comparator.  RS2 is of weak order 2 for Stratonovich equations with any noises, see
docs/literature_schemes.md.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, number, unrolled
from ..ensemble.fields import (
    add_ito_correction,
    add_noise_fields,
    add_scaled,
    dot,
    drift_field,
    noise_field,
    scaled,
    step_field,
)
from ..ensemble.increments import first_lane
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import dimension, noise_indices, strengths
from ..numerics.rng import LANES
from .large import euler_group, heun_group, size_or, step_by_groups


@device
def euler_step(model, h, dW, lane, y):
    """One step of one lane."""
    new = add_scaled(y, h, drift_field(model, y))
    new = add_ito_correction(model, new, h, y)
    return add_noise_fields(model, new, dW, lane, y)


class EulerMaruyama(NamedTuple):
    """y + h (f(y) + 1/2 sum_k sigma_k^2 f_k'(y) f_k(y)) + sum_k sigma_k dW_k f_k(y), the system in its Itô form.

    Here f = B grad H and f_k = B grad Ĥ_k.
    """

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            store_lane(y, lane, euler_step(model, h, dW, lane, load_lane(model, y, lane)))

    def advance_large(scheme, model, h, dW, coins, y, work, report):
        step_by_groups(scheme, model, h, dW, 1.0, y, work, report)

    def move_group(scheme, model, h, width, count, states, x, new, times, work, report):
        euler_group(model, h, width, states, new, times, work)
        return new

    def work_size(scheme, model):
        return size_or(0, model)


class RenormalisedEulerMaruyama(NamedTuple):
    """A step z of Euler-Maruyama scaled back to the length of y, |y| z / |z|, where |y|^2 is a Casimir function.

    It stays on the sphere, and no more: it is no composition of Poisson maps.
    """

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            new = euler_step(model, h, dW, lane, state)
            store_lane(y, lane, scaled(new, np.sqrt(dot(state, state) / dot(new, new))))


class RenormalisedHeun(NamedTuple):
    """Heun's z = y + (F(y) + F(y + F(y))) / 2, F = h f + sum_k sigma_k dW_k f_k, scaled back to spheres.

    That is |y| z / |z| where |y|^2 is a Casimir function, and each site by itself of a lattice.
    """

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            field = step_field(model, h, dW, lane, state)
            second = step_field(model, h, dW, lane, add_scaled(state, 1.0, field))
            new = add_scaled(add_scaled(state, 0.5, field), 0.5, second)
            store_lane(y, lane, scaled(new, np.sqrt(dot(state, state) / dot(new, new))))

    def advance_large(scheme, model, h, dW, coins, y, work, report):
        step_by_groups(scheme, model, h, dW, 0.5, y, work, report)

    def move_group(scheme, model, h, width, count, states, x, new, times, work, report):
        heun_group(model, h, width, states, new, times, work)
        return new

    def work_size(scheme, model):
        return size_or(0, model)


# ---------------------------------------------------------------------------------------------------------------------
# The stochastic Runge-Kutta scheme RS2.
# ---------------------------------------------------------------------------------------------------------------------

_THIRD = 1.0 / 3.0
_HALF_ROOT = 0.7071067811865476  # 2^(-1/2)


@device
def half_difference(model, k, dW, lane):
    """Increment over the first half of a step minus that over the second, which is independent of their sum."""
    return dW[first_lane(model, k, 2, 0) + lane] - dW[first_lane(model, k, 2, 1) + lane]


@unrolled(noise_indices)
def add_stages(index, model, value, dW, lane, y):
    """value + sum_k c_k (f_k(y)/4 + 3/4 f_k(y + 2/3 c_k f_k(y))), c_k = sigma_k dW_k."""
    k = number(index)
    c = strengths(model)[k] * dW[k * LANES + lane]
    f = noise_field(model, k, y)
    second = noise_field(model, k, add_scaled(y, 2.0 * _THIRD * c, f))
    return add_scaled(add_scaled(value, 0.25 * c, f), 0.75 * c, second)


@unrolled(noise_indices)
def add_differences(index, model, value, dW, lane, y):
    """value + sum_k sigma_k D_k f_k(y)."""
    k = number(index)
    return add_scaled(value, strengths(model)[k] * half_difference(model, k, dW, lane), noise_field(model, k, y))


@unrolled(noise_indices)
def add_noise(index, model, y, root, dW, begin, middle, along, across):
    """Add the terms of noise k to y, all lanes; `middle` is y + h f(y) plus the second stages of all noises."""
    k = number(index)
    sigma = strengths(model)[k]
    for lane in range(LANES):
        state = load_lane(model, begin, lane)
        c = sigma * dW[k * LANES + lane]
        f1 = noise_field(model, k, state)
        f2 = noise_field(model, k, add_scaled(state, 2.0 * _THIRD * c, f1))
        others = add_scaled(add_scaled(load_lane(model, middle, lane), -0.25 * c, f1), -0.75 * c, f2)
        f3 = noise_field(model, k, add_scaled(add_scaled(others, 0.25 * _THIRD * c, f1), 0.25 * c, f2))
        last = add_scaled(add_scaled(add_scaled(others, -1.25 * c, f1), 0.25 * c, f2), 2.0 * c, f3)
        f4 = noise_field(model, k, last)
        new = add_scaled(add_scaled(load_lane(model, y, lane), 0.125 * c, f1), 0.375 * c, f2)
        new = add_scaled(add_scaled(new, 0.375 * c, f3), 0.125 * c, f4)
        spread = load_lane(model, along, lane), load_lane(model, across, lane)
        area = scaled(spread[0], half_difference(model, k, dW, lane) / root)
        area = add_scaled(area, -dW[k * LANES + lane] / root, spread[1])
        new = add_scaled(new, -0.25 * sigma * root, noise_field(model, k, add_scaled(state, _HALF_ROOT, area)))
        last = noise_field(model, k, add_scaled(state, -_HALF_ROOT, area))
        store_lane(y, lane, add_scaled(new, 0.25 * sigma * root, last))
    return y


class RoesslerRS2(NamedTuple):
    """RS2 with Gaussian increments, and areas from the halves of a step.

    With c_k = sigma_k dW_k, y_k = y + 2/3 c_k f_k(y), N_k = c_k (f_k(y) + 3 f_k(y_k)) / 4 and N = sum_k N_k

        u = y + 2/3 h f(y),  v = y + h (f(y) + 3 f(u)) / 6 + N,
        v_k = y + h f(y) + N - N_k + c_k (f_k(y) + 3 f_k(y_k)) / 12,
        w_k = y + h f(y) + N - N_k + c_k (-5/4 f_k(y) + f_k(y_k) / 4 + 2 f_k(v_k)),
        z = y + h (f(y) + f(u) + 2 f(v)) / 4
          + sum_k c_k (f_k(y) + 3 f_k(y_k) + 3 f_k(v_k) + f_k(w_k)) / 8
          - sum_k sigma_k h^(1/2) (f_k(y + G_k) - f_k(y - G_k)) / 4,
        G_k = (2 h)^(-1/2) sum_l sigma_l (D_k dW_l - dW_k D_l) f_l(y).

    D_k, the increment over the first half of the step minus that over the second, is independent of dW_k.  Where Rößler
    has dW_l times a two-point variable for l < k, and the negative of that for l > k, any numbers are
    admissible that are antisymmetric in (k, l), have the variance h^2, are uncorrelated, and odd in variables
    independent of the increments.  Here (D_k dW_l - dW_k D_l) / 2^(1/2), the sign of which is that of the Lévy area to
    be expected, so that neighbouring step sizes stay close.
    """

    substeps = 2

    def work_size(scheme, model):
        return 4 * LANES * dimension(model)

    def advance(scheme, model, h, dW, coins, y, work, report):
        size = LANES * dimension(model)
        begin, middle = work[:size], work[size : 2 * size]
        along, across = work[2 * size : 3 * size], work[3 * size : 4 * size]
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            nothing = scaled(state, 0.0)
            store_lane(along, lane, add_noise_fields(model, nothing, dW, lane, state))
            store_lane(across, lane, add_differences(model, nothing, dW, lane, state))
            f1 = drift_field(model, state)
            f2 = drift_field(model, add_scaled(state, 2.0 * _THIRD * h, f1))
            stages = add_stages(model, state, dW, lane, state)
            f3 = drift_field(model, add_scaled(add_scaled(stages, 0.5 * _THIRD * h, f1), 0.5 * h, f2))
            store_lane(begin, lane, state)
            store_lane(middle, lane, add_scaled(stages, h, f1))
            new = add_scaled(add_scaled(state, 0.25 * h, f1), 0.25 * h, f2)
            store_lane(y, lane, add_scaled(new, 0.5 * h, f3))
        add_noise(model, y, np.sqrt(h), dW, begin, middle, along, across)
