"""Implicit midpoint rules, which need truncated increments, and the inner steps for which compositions use them.

The implicit stochastic midpoint rule is the paper's second comparator.  The isospectral one is in closed form where
B(y) v = y x v.

The inner step replaces the flow of a piece or a noise that is not known in closed form: exp(t Y_K) y is replaced by
one step of size t, positive or negative, of a scheme for y' = B(y) grad K(y).  With ``inner = "midpoint"`` that is the
implicit midpoint rule, where B(y) v = y x v the isospectral one, and with "munthe_kaas" the explicit midpoint rule of
Munthe-Kaas.  All are of order 2 in t, so that a noise, with t = sigma_k dW_k, lacks terms of the size dW_k^3, of mean
0, and of mean h^2: strong orders do not change, and the weak order is at most 1.
"""

from typing import Any, NamedTuple

import numpy as np

from ..compiler.dispatch import answers, device, number, unrolled
from ..compiler.records import class_of, field
from ..ensemble.fields import (
    add_noise_hessians,
    add_scaled,
    cross_product,
    dot,
    scaled,
    squared_distance,
    step_field,
    step_field_along,
    step_field_derivative,
    step_gradient,
    unit,
)
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import (
    INNER_METHODS,
    add_dissipation,
    component_indices,
    dimension,
    drift_hessian,
    flows_lacking,
    inner,
    structure,
    structure_derivative,
    structure_is_kept,
)
from ..ensemble.scheme_protocol import advance, lanes_in_use, work_size
from ..numerics.elementary import bits, from_bits
from ..numerics.rng import LANES
from .large import midpoint_group, size_or, step_by_groups
from .munthe_kaas import MuntheKaasMidpoint
from .stages import gradient, hessian
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
def finish(model, h, dW, y, x, tolerance, report):
    """Replace y by y + F(x); return (lanes with a squared relative residual above `tolerance`, largest residual).

    Of the lanes in use alone.  The largest is taken by its bits, so that the loop is vectorised and a NaN counts as the
    largest of all.
    """
    first, end = lanes_in_use(report)
    failures = 0
    largest = 0
    for lane in range(LANES):
        state, middle = load_lane(model, y, lane), load_lane(model, x, lane)
        change = step_field(model, h, dW, lane, middle)
        size = dot(middle, middle)
        residual = squared_distance(middle, add_scaled(state, 0.5, change))
        in_use = first <= lane and lane < end
        failures += 1 if in_use and not residual <= tolerance * size else 0
        largest = max(largest, bits(abs(residual / (size + 1e-300))) if in_use else 0)
        store_lane(y, lane, add_scaled(state, 1.0, change))
    return failures, np.sqrt(from_bits(largest))


IN_NEWTON = 3  #: times as much code as for one derivative of the field, of schemes that solve equations


class Midpoint(NamedTuple):
    """z = y + F((y + z)/2) with F = B grad K, K = h H + sum_k sigma_k dW_k Ĥ_k; preserves quadratic Casimirs.

    Newton's method for the midpoint x = y + F(x)/2, started from y + F(y)/2, all lanes of a block together, until the
    correction of every lane is below 2^-30 |x|: the residual is of the order of its square.  The new state is y + F(x),
    so that the change of a quadratic Casimir is |F| times the residual.  A solve with
    |x - y - F(x)/2| > ``tolerance`` |x| counts as a failure.  States that are arrays iterate x = y + F(x)/2 instead.
    """

    tolerance: float = 1e-13
    most_iterations: int = 20

    def work_size(scheme, model):
        d = dimension(model)
        return size_or(LANES * (d + d * (d + 1) + 2), model)

    def compile_size(scheme, model):
        return 0, IN_NEWTON

    def advance_large(scheme, model, h, dW, coins, y, work, report):
        step_by_groups(scheme, model, h, dW, 0.5, y, work, report)

    def move_group(scheme, model, h, width, count, states, x, new, times, work, report):
        most = 10 * scheme.most_iterations  # which converge more slowly than those of Newton's method
        midpoint_group(model, h, width, count, states, x, new, times, work, report, scheme.tolerance, most)
        return states

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
        failures, residual = finish(model, h, dW, y, x, scheme.tolerance * scheme.tolerance, report)
        report_solves(report, iterations, failures, residual)


# ---------------------------------------------------------------------------------------------------------------------
# The isospectral midpoint rule.
# ---------------------------------------------------------------------------------------------------------------------


@device
def quarter(v, u):
    """(v . u) v / 4."""
    return scaled(v, 0.25 * dot(v, u))


@device
def residual(model, v, y, u):
    """u - M(v) u / 2 + (v . u) v / 4 - y."""
    return add_scaled(add_scaled(add_scaled(u, -0.5, structure(model, u, v)), 1.0, quarter(v, u)), -1.0, y)


@device
def residual_derivative(model, h, dW, lane, v, u, e):
    """Derivative of the residual along e, where v = grad K(u) of the step's Hamiltonian K."""
    turned = add_noise_hessians(model, scaled(drift_hessian(model, u, e), h), dW, lane, u, e)
    field = add_scaled(structure(model, e, v), 1.0, structure(model, u, turned))
    along = add_scaled(scaled(turned, dot(v, u)), dot(turned, u) + dot(v, e), v)
    return add_scaled(add_scaled(e, -0.5, field), 0.25, along)


@device
def solve_3(a, b, c, r):
    """Solution of x a + y b + z c = r by Cramer's rule, for a matrix not far from the identity."""
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    return scaled((dot(r, bc), dot(r, ca), dot(r, ab)), 1.0 / dot(a, bc))


@device
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@device
def improve(model, h, dW, y, u):
    """Make an iteration of Newton's method; return the number of finite lanes that need another one."""
    unfinished = 0
    for lane in range(LANES):
        middle = load_lane(model, u, lane)
        v = step_gradient(model, h, dW, lane, middle)
        a = residual_derivative(model, h, dW, lane, v, middle, (1.0, 0.0, 0.0))
        b = residual_derivative(model, h, dW, lane, v, middle, (0.0, 1.0, 0.0))
        c = residual_derivative(model, h, dW, lane, v, middle, (0.0, 0.0, 1.0))
        change = solve_3(a, b, c, residual(model, v, load_lane(model, y, lane), middle))
        new = add_scaled(middle, -1.0, change)
        store_lane(u, lane, new)
        unfinished += 1 if dot(change, change) > ENOUGH * dot(new, new) else 0
    return unfinished


@device
def finish_turn(model, h, dW, y, u, tolerance, report):
    """Replace y by y + M(v) u; return the failures and the largest residual as :func:`finish`."""
    first, end = lanes_in_use(report)
    failures = 0
    largest = 0
    for lane in range(LANES):
        state, middle = load_lane(model, y, lane), load_lane(model, u, lane)
        v = step_gradient(model, h, dW, lane, middle)
        left = residual(model, v, state, middle)
        size, square = dot(middle, middle), dot(left, left)
        in_use = first <= lane and lane < end
        failures += 1 if in_use and not square <= tolerance * size else 0
        largest = max(largest, bits(abs(square / (size + 1e-300))) if in_use else 0)
        store_lane(y, lane, add_scaled(state, 1.0, structure(model, middle, v)))
    return failures, np.sqrt(from_bits(largest))


def turns_alone(model):
    """Whether B(y) v = y x v, and the drift is B grad H alone."""
    return cross_product(model) and not answers(add_dissipation, class_of(model))


class IsospectralMidpoint(NamedTuple):
    """y = u - M u / 2 + (v . u) v / 4, z = u + M u / 2 + (v . u) v / 4 with v = grad K(u) and M u = u x v.

    K = h H + sum_k sigma_k dW_k Ĥ_k.  In matrices, W' being the commutator [W, v]:
    W(y) = (1 + v/2) W(u) (1 - v/2) and W(z) = (1 - v/2) W(u) (1 + v/2), which is W(y) conjugated by a Cayley transform.

    Newton's method for u, started from y + M y / 2, all lanes of a block together, until the correction of every lane
    is below 2^-30 |u|.  The new state is y + M u, so that the Casimir function changes by |M u| times the residual.  A
    solve with a residual above ``tolerance`` |u| counts as a failure.
    """

    tolerance: float = 1e-13
    most_iterations: int = 20

    def work_size(scheme, model):
        return LANES * dimension(model)

    def compile_size(scheme, model):
        return 0, IN_NEWTON

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            v = step_gradient(model, h, dW, lane, state)
            store_lane(work, lane, add_scaled(state, 0.5, structure(model, state, v)))
        iterations = 0
        unfinished = 1
        while unfinished > 0 and iterations < scheme.most_iterations:
            unfinished = improve(model, h, dW, y, work)
            iterations += 1
        failures, largest = finish_turn(model, h, dW, y, work, scheme.tolerance * scheme.tolerance, report)
        report_solves(report, iterations, failures, largest)


# ---------------------------------------------------------------------------------------------------------------------
# The implicit midpoint rule for steps that are mostly small: simple iteration, and where that fails Newton's method.
#
# Simple iteration needs gradients alone, where Newton's method, as above, needs a Hessian matrix and an
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
    """As :func:`newton_system`, with a loop over the columns, which is slower but takes less time to compile."""
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
    """z = y + F((y + z)/2) as :class:`Midpoint`, for equations that simple iteration mostly solves.

    All lanes of a block together, until no lane changes by more than roundings.  If one still does after
    ``most_simple`` iterations, Newton's method starts afresh.
    """

    tolerance: float = 1e-13
    most_simple: int = 30
    most_iterations: int = 20

    work_size = Midpoint.work_size

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
        failures, residual = finish(model, h, dW, y, x, scheme.tolerance * scheme.tolerance, report)
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
        return structure(model.model, y, v)

    def structure_derivative(model, y, u, v):
        return structure_derivative(model.model, y, u, v)

    def drift_gradient(model, y):
        return unit(component_indices(model), -1)

    def drift_hessian(model, y, v):
        return unit(component_indices(model), -1)

    def noise_gradient(model, k, y):
        return gradient(model.part, model.model, number(model.index), y)

    def noise_hessian(model, k, y, v):
        return hessian(model.part, model.model, number(model.index), y, v)


def inner_scheme(model):
    """Record of the scheme that makes inner steps of a model, or of the Numba type of one."""
    isospectral = inner(model) == "midpoint" and cross_product(model)
    return IsospectralMidpoint() if isospectral else _SCHEMES[inner(model)]


def is_reversible(model):
    """Whether all steps by pieces and noises are flows, or are inverted in law by those of the time -t.

    Steps of the implicit rules by pieces are.  Steps by a noise are inverted on each path, but not in the mean over dW.
    """
    lacking = flows_lacking(model)
    return not lacking or (inner(model) == "midpoint" and all(part == "pieces" for part, _ in lacking))


def preserved(model):
    """Properties that a composition with inner steps preserves, in the words of the table of schemes."""
    if inner(model) == "midpoint":
        keeps = cross_product(model) or structure_is_kept(model)
        return "Casimirs, Poisson structure" if keeps else "quadratic Casimirs"
    return "Casimirs"


@device(by_type=True)
def inner_size(model):
    """Floats of scratch for an inner step."""
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
