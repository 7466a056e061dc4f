"""The inner step, which replaces the flow of a piece or a noise that is not known in closed form.

exp(t Y_K) y is replaced by one step of size t, positive or negative, of a scheme for y' = B(y) grad K(y): with
``inner = "midpoint"`` the implicit midpoint rule, where B(y) v = y x v the isospectral one, and with "munthe_kaas" the
explicit midpoint rule of Munthe-Kaas.  All are of order 2 in t, so that a noise, with t = sigma_k dW_k, lacks terms of
the size dW_k^3, of mean 0, and of mean h^2: strong orders do not change, and the weak order is at most 1.
"""

from typing import Any, NamedTuple

from ..compiler.dispatch import device, number
from ..compiler.records import field
from ..ensemble.fields import (
    add_scaled,
    cross_product,
    dot,
    squared_distance,
    step_field,
    step_field_along,
    step_field_derivative,
    step_gradient,
    unit,
)
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import INNER_METHODS, component_indices, dimension, flows_lacking, inner, structure_is_kept
from ..ensemble.scheme_protocol import advance, work_size
from ..numerics.rng import LANES
from .isospectral import IsospectralMidpoint
from .midpoint import correct, eliminate, finish, start
from .munthe_kaas import MuntheKaasMidpoint
from .stages import gradient, hessian, structure_along, structure_derivative_along
from .sweeps import report_solves

# ---------------------------------------------------------------------------------------------------------------------
# The implicit midpoint rule for steps that are mostly small: simple iteration, and where that fails Newton's method.
#
# Simple iteration needs gradients alone, where Newton's method, as in ``midpoint.py``, needs a Hessian matrix and an
# elimination each time: for a dozen components that takes 40 times as long.
# ---------------------------------------------------------------------------------------------------------------------

_ENOUGH = 2.0**-100  # for squares: a few roundings, since the residual shrinks slowly


@device
def iterate(model, h, dW, y, x):
    """Replace x by y + F(x)/2; return the number of finite lanes that changed by more than roundings."""
    unfinished = 0
    for lane in range(LANES):
        state, middle = load_lane(model, y, lane), load_lane(model, x, lane)
        new = add_scaled(state, 0.5, step_field(model, h, dW, lane, middle))
        store_lane(x, lane, new)
        unfinished += 1 if squared_distance(new, middle) > _ENOUGH * dot(new, new) else 0
    return unfinished


@device(inline=False)
def newton_system_by_columns(model, h, dW, y, x, matrix):
    """As ``midpoint.newton_system``, with a loop over the columns, which is slower but takes less time to compile."""
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

    All lanes of a block together, until no lane changes by more than roundings.  If one still does after
    ``most_simple`` iterations, Newton's method starts afresh.
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


_SCHEMES = dict(zip(INNER_METHODS, (InnerMidpoint(), MuntheKaasMidpoint()), strict=True))


class Alone(NamedTuple):
    """One piece or noise of a model as a model: the only noise of one without a drift, with sigma = 1."""

    model: Any
    part: Any  #: one of :data:`~.stages.PARTS`
    index: Any  #: its number, as one of ``dispatch.INDICES``
    sigma: tuple = (1.0,)

    pieces = 0
    noises = 1

    def dimension(model):
        return dimension(field(model, "model"))

    def structure_is_cross_product(model):
        return cross_product(field(model, "model"))

    def structure(model, y, v):
        return structure_along(model.part, model.model, number(model.index), y, v)

    def structure_derivative(model, y, u, v):
        return structure_derivative_along(model.part, model.model, number(model.index), y, u, v)

    def drift_gradient(model, y):
        return unit(component_indices(model), -1)

    def drift_hessian(model, y, v):
        return unit(component_indices(model), -1)

    def noise_gradient(model, k, y):
        return gradient(model.part, model.model, number(model.index), y)

    def noise_hessian(model, k, y, v):
        return hessian(model.part, model.model, number(model.index), y, v)


def inner_scheme(model):
    """The record of the scheme that makes inner steps of a model, or of the Numba type of one."""
    isospectral = inner(model) == "midpoint" and cross_product(model)
    return IsospectralMidpoint() if isospectral else _SCHEMES[inner(model)]


def is_reversible(model):
    """Whether all steps by pieces and noises are flows, or are inverted in law by those of the time -t.

    Steps of the implicit rules by pieces are.  Steps by a noise are inverted on each path, but not in the mean over dW.
    """
    lacking = flows_lacking(model)
    return not lacking or (inner(model) == "midpoint" and all(part == "pieces" for part, _ in lacking))


def preserved(model):
    """The properties that a composition with inner steps preserves, in the words of the table of schemes."""
    if inner(model) == "midpoint":
        keeps = cross_product(model) or structure_is_kept(model)
        return "Casimirs, Poisson structure" if keeps else "quadratic Casimirs"
    return "Casimirs"


@device(by_type=True)
def inner_size(model):
    """The floats of scratch for an inner step."""
    if not flows_lacking(model):
        return lambda model: 0
    scheme = inner_scheme(model)
    return lambda model: work_size(scheme, model)


@device(by_type=True)
def inner_step(alone, coins, y, work, report):
    """A step of a block of paths by one piece or noise, of the size work[lane] in each; scratch lies behind these."""
    scheme = inner_scheme(field(alone, "model"))
    return lambda alone, coins, y, work, report: advance(scheme, alone, 0.0, work, coins, y, work[3 * LANES :], report)


@device(inline=False)
def inner_sweep(part, index, model, coins, y, work, report):
    """An inner step in place of ``sweeps.sweep``."""
    inner_step(Alone(model, part, index, (1.0,)), coins, y, work, report)
