"""The implicit stochastic midpoint rule, the paper's second comparator; it needs truncated increments."""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, number, unrolled
from ..ensemble.fields import (
    add_scaled,
    dot,
    squared_distance,
    step_field,
    step_field_along,
    step_field_derivative,
    step_gradient,
    unit,
)
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import component_indices, dimension
from ..numerics.elementary import bits, from_bits
from ..numerics.rng import LANES
from .sweeps import report_solves

ENOUGH = 2.0**-60  # for squares


@device
def start(model, h, dW, y, x):
    """Replace x by y + F(y)/2."""
    for lane in range(LANES):
        state = load_lane(model, y, lane)
        store_lane(x, lane, add_scaled(state, 0.5, step_field(model, h, dW, lane, state)))


@device
def newton_system(model, h, dW, y, x, matrix):
    """Write I - F'(x)/2 and, as one more column, y + F(x)/2 - x; entry (i, j) of a lane at [(j d + i) LANES + lane]."""
    right = matrix[dimension(model) * dimension(model) * LANES :]
    for lane in range(LANES):
        middle = load_lane(model, x, lane)
        gradient = step_gradient(model, h, dW, lane, middle)
        newton_columns(model, matrix, h, dW, lane, middle, gradient)
        reached = add_scaled(load_lane(model, y, lane), 0.5, step_field_along(model, h, middle, gradient))
        store_lane(right, lane, add_scaled(reached, -1.0, middle))


@unrolled(component_indices)
def newton_columns(index, model, matrix, h, dW, lane, x, gradient):
    j = number(index)
    e = unit(component_indices(model), j)
    column = add_scaled(e, -0.5, step_field_derivative(model, h, dW, lane, x, gradient, e))
    store_lane(matrix[j * dimension(model) * LANES :], lane, column)
    return matrix


@device
def eliminate(model, matrix):
    """Solve the d x d systems of all lanes by elimination with partial pivoting; the solution replaces column d.

    Rows are exchanged lane by lane: the pivot row is compared with each row below it and keeps the larger entry.
    """
    d = dimension(model)
    swap = matrix[d * (d + 1) * LANES :]
    factor = matrix[(d * (d + 1) + 1) * LANES :]
    for c in range(d):
        for r in range(c + 1, d):
            p, q = matrix[(c * d + c) * LANES :], matrix[(c * d + r) * LANES :]
            for lane in range(LANES):
                a, b = p[lane], q[lane]
                exchange = abs(b) > abs(a)
                swap[lane] = 1.0 if exchange else 0.0
                top = b if exchange else a
                factor[lane] = (a if exchange else b) / (1.0 if top == 0.0 else top)  # no pivot in these two rows
            for j in range(c, d + 1):
                p, q = matrix[(j * d + c) * LANES :], matrix[(j * d + r) * LANES :]
                for lane in range(LANES):
                    a, b = p[lane], q[lane]
                    exchange = swap[lane] > 0.0
                    top = b if exchange else a
                    p[lane] = top
                    q[lane] = (a if exchange else b) - factor[lane] * top
    for r in range(d - 1, -1, -1):
        p = matrix[(d * d + r) * LANES :]
        for j in range(r + 1, d):
            q, solved = matrix[(j * d + r) * LANES :], matrix[(d * d + j) * LANES :]
            for lane in range(LANES):
                p[lane] -= q[lane] * solved[lane]
        q = matrix[(r * d + r) * LANES :]
        for lane in range(LANES):
            p[lane] /= q[lane]


@device
def correct(model, x, correction):
    """Add the corrections to x; return the number of finite lanes that need another iteration."""
    unfinished = 0
    for lane in range(LANES):
        change = load_lane(model, correction, lane)
        new = add_scaled(load_lane(model, x, lane), 1.0, change)
        store_lane(x, lane, new)
        unfinished += 1 if dot(change, change) > ENOUGH * dot(new, new) else 0
    return unfinished


@device
def finish(model, h, dW, y, x, tolerance):
    """Replace y by y + F(x); return (lanes with a squared relative residual above `tolerance`, largest residual).

    The largest is taken by its bits, so that the loop is vectorised and a NaN counts as the largest of all.
    """
    failures = 0
    largest = 0
    for lane in range(LANES):
        state, middle = load_lane(model, y, lane), load_lane(model, x, lane)
        change = step_field(model, h, dW, lane, middle)
        size = dot(middle, middle)
        residual = squared_distance(middle, add_scaled(state, 0.5, change))
        failures += 0 if residual <= tolerance * size else 1
        largest = max(largest, bits(abs(residual / (size + 1e-300))))
        store_lane(y, lane, add_scaled(state, 1.0, change))
    return failures, np.sqrt(from_bits(largest))


class Midpoint(NamedTuple):
    """z = y + F((y + z)/2) with F = B grad K, K = h H + sum_k sigma_k dW_k Ĥ_k; preserves quadratic Casimirs.

    Newton's method for the midpoint x = y + F(x)/2, started from y + F(y)/2, all lanes of a block together, until the
    correction of every lane is below 2^-30 |x|: the residual is of the order of its square.  The new state is y + F(x),
    so that the change of a quadratic Casimir is |F| times the residual.  A solve with
    |x - y - F(x)/2| > ``tolerance`` |x| counts as a failure.
    """

    tolerance: float = 1e-13
    most_iterations: int = 20

    def work_size(scheme, model):
        d = dimension(model)
        return LANES * (d + d * (d + 1) + 2)

    def advance(scheme, model, h, dW, coins, y, work, report):
        d = dimension(model)
        x = work[: d * LANES]
        matrix = work[d * LANES :]
        start(model, h, dW, y, x)
        iterations = 0
        unfinished = 1
        while unfinished > 0 and iterations < scheme.most_iterations:
            newton_system(model, h, dW, y, x, matrix)
            eliminate(model, matrix)
            unfinished = correct(model, x, matrix[d * d * LANES :])
            iterations += 1
        failures, residual = finish(model, h, dW, y, x, scheme.tolerance * scheme.tolerance)
        report_solves(report, iterations, failures, residual)
