"""The implicit midpoint rule for steps that are mostly small: simple iteration, and where that fails Newton's method.

Simple iteration asks for gradients alone, where Newton's method, as in ``midpoint.py``, asks for a Hessian matrix and
an elimination each time: for a dozen components that takes 40 times as long.
"""

from typing import NamedTuple

from ..compiler.dispatch import device
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
from ..numerics.rng import LANES
from .midpoint import correct, eliminate, finish, start
from .reporting import report_solves

_ENOUGH = 2.0**-100  # for squares: a few roundings, since what is left of the equation shrinks slowly


@device
def iterate(model, h, dW, y, x):
    """x becomes y + F(x)/2; how many lanes have changed by more than roundings (those that are not finite have not)."""
    unfinished = 0
    for lane in range(LANES):
        state, middle = load_lane(model, y, lane), load_lane(model, x, lane)
        new = add_scaled(state, 0.5, step_field(model, h, dW, lane, middle))
        store_lane(x, lane, new)
        unfinished += 1 if squared_distance(new, middle) > _ENOUGH * dot(new, new) else 0
    return unfinished


@device(inline=False)
def newton_system_by_columns(model, h, dW, y, x, matrix):
    """As ``midpoint.newton_system``, with a loop over the columns, which takes longer but is compiled sooner."""
    d = dimension(model)
    for j in range(d):
        column = matrix[j * d * LANES :]
        for lane in range(LANES):
            middle, e = load_lane(model, x, lane), unit(component_indices(model), j)
            gradient = step_gradient(model, h, dW, lane, middle)
            along = step_field_derivative(model, h, dW, lane, middle, gradient, e)
            store_lane(column, lane, add_scaled(e, -0.5, along))
    right = matrix[d * d * LANES :]
    for lane in range(LANES):
        middle = load_lane(model, x, lane)
        change = step_field_along(model, h, middle, step_gradient(model, h, dW, lane, middle))
        reached = add_scaled(load_lane(model, y, lane), 0.5, change)
        store_lane(right, lane, add_scaled(reached, -1.0, middle))


class InnerMidpoint(NamedTuple):
    """z = y + F((y + z)/2) as :class:`~.midpoint.Midpoint`, for equations that simple iteration mostly solves.

    All lanes of a block together, until no lane changes by more than roundings.  Where a lane does so still after
    ``most_simple`` iterations, Newton's method begins anew.
    """

    tolerance: float = 1e-13
    most_simple: int = 30
    most_iterations: int = 20

    def work_size(scheme, model):
        d = dimension(model)
        return LANES * (d + d * (d + 1) + 2)

    def advance(scheme, model, h, dW, coins, y, work, report):
        d = dimension(model)
        x = work[: d * LANES]
        matrix = work[d * LANES :]
        start(model, h, dW, y, x)
        iterations, unfinished = 0, 1
        while unfinished > 0 and iterations < scheme.most_simple:
            unfinished = iterate(model, h, dW, y, x)
            iterations += 1
        if unfinished > 0:
            start(model, h, dW, y, x)
            most = iterations + scheme.most_iterations
            while unfinished > 0 and iterations < most:
                newton_system_by_columns(model, h, dW, y, x, matrix)
                eliminate(model, matrix)
                unfinished = correct(model, x, matrix[d * d * LANES :])
                iterations += 1
        failures, residual = finish(model, h, dW, y, x, scheme.tolerance * scheme.tolerance)
        report_solves(report, iterations, failures, residual)
