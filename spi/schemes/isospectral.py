"""The isospectral midpoint rule, in closed form where B(y) v = y x v; it needs truncated increments."""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import answers, device
from ..compiler.records import class_of
from ..ensemble.fields import add_noise_hessians, add_scaled, cross_product, dot, scaled, step_gradient
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import add_dissipation, dimension, drift_hessian, structure
from ..numerics.elementary import bits, from_bits
from ..numerics.rng import LANES
from .midpoint import ENOUGH
from .sweeps import report_solves


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
    """The derivative of the residual along e, where v = grad K(u) of the step's Hamiltonian K."""
    turned = add_noise_hessians(model, scaled(drift_hessian(model, u, e), h), dW, lane, u, e)
    field = add_scaled(structure(model, e, v), 1.0, structure(model, u, turned))
    along = add_scaled(scaled(turned, dot(v, u)), dot(turned, u) + dot(v, e), v)
    return add_scaled(add_scaled(e, -0.5, field), 0.25, along)


@device
def solve_3(a, b, c, r):
    """The solution of x a + y b + z c = r by Cramer's rule, for a matrix not far from the identity."""
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
def finish(model, h, dW, y, u, tolerance):
    """Replace y by y + M(v) u; return (lanes with a squared relative residual above `tolerance`, largest residual)."""
    failures = 0
    largest = 0
    for lane in range(LANES):
        state, middle = load_lane(model, y, lane), load_lane(model, u, lane)
        v = step_gradient(model, h, dW, lane, middle)
        left = residual(model, v, state, middle)
        size, square = dot(middle, middle), dot(left, left)
        failures += 0 if square <= tolerance * size else 1
        largest = max(largest, bits(abs(square / (size + 1e-300))))
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
        failures, largest = finish(model, h, dW, y, work, scheme.tolerance * scheme.tolerance)
        report_solves(report, iterations, failures, largest)
