"""Vector fields, Itô correction and Newton matrix, derived from B, gradients and Hessian products for every model.

All functions act on one state, a tuple of d floats, and are inlined into the loops over lanes.
"""

from ..compiler.dispatch import answers, device, number, trait, unrolled
from ..compiler.records import class_of, is_array
from ..numerics.rng import LANES
from .protocol import (
    add_dissipation,
    axis_inertias,
    component_indices,
    drift_gradient,
    drift_hessian,
    lie_bracket,
    noise_bracket_gradient,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noise_structure,
    noise_structure_derivative,
    strengths,
    structure,
    structure_derivative,
    structure_is_cross_product,
)


@trait
def lie_poisson(model):
    """Whether B is linear in y, that is, whether a model has the default ``structure_derivative``."""
    stated = getattr(class_of(model), "lie_poisson", None)  # of a model around another
    return stated(model) if stated else not answers(structure_derivative, class_of(model))


@trait
def cross_product(model):
    """Whether B(y) v = y x v."""
    return structure_is_cross_product(model) or answers(axis_inertias, class_of(model))


@unrolled(each="a[i] + c * b[i]")
def add_scaled(a, c, b):
    """a + c b."""


@unrolled(each="c * b[i]")
def scaled(b, c):
    """c b."""


@unrolled(total="a[i] * b[i]")
def dot(a, b):
    """sum_i a_i b_i."""


@unrolled(total="(a[i] - b[i]) * (a[i] - b[i])")
def squared_distance(a, b):
    """|a - b|^2."""


@unrolled(total="(c * b[i]) * (c * b[i])")
def scaled_square(b, c):
    """|c b|^2."""


@device(by_type=True)
def smallest_component(b):
    """min_i b_i."""
    return (lambda b: b.min()) if is_array(b) else (lambda b: min(b))


@unrolled(each="1.0 if indices[i] == j else 0.0")
def unit(indices, j):
    """Unit vector e_j, given (0, ..., d-1)."""


@device
def drift_field(model, y):
    """Drift: B(y) grad H(y) plus the dissipation."""
    return add_dissipation(model, structure(model, y, drift_gradient(model, y)), 1.0, y)


@device
def noise_field(model, k, y):
    """f_k(y) = B(y) grad Ĥ_k(y)."""
    return noise_structure(model, k, y, noise_gradient(model, k, y))


@device
def noise_field_derivative(model, k, y, v):
    """f_k'(y) v = (DB(y)[v]) grad Ĥ_k(y) + B(y) Hess Ĥ_k(y) v."""
    turned = noise_structure_derivative(model, k, y, v, noise_gradient(model, k, y))
    return add_scaled(turned, 1.0, noise_structure(model, k, y, noise_hessian(model, k, y, v)))


@unrolled(noise_indices)
def add_ito_correction(index, model, value, h, y):
    """value + h/2 sum_k sigma_k^2 f_k'(y) f_k(y), the Itô correction of the Stratonovich drift."""
    k = number(index)
    sigma = strengths(model)[k]
    correction = noise_field_derivative(model, k, y, noise_field(model, k, y))
    return add_scaled(value, 0.5 * h * sigma * sigma, correction)


@unrolled(noise_indices)
def add_noise_fields(index, model, value, dW, lane, y):
    """value + sum_k sigma_k dW_k f_k(y), with the increments of one lane of a block."""
    k = number(index)
    return add_scaled(value, strengths(model)[k] * dW[k * LANES + lane], noise_field(model, k, y))


@unrolled(noise_indices)
def add_noise_gradients(index, model, value, dW, lane, y):
    """value + sum_k sigma_k dW_k grad Ĥ_k(y)."""
    k = number(index)
    return add_scaled(value, strengths(model)[k] * dW[k * LANES + lane], noise_gradient(model, k, y))


@unrolled(noise_indices)
def add_noise_hessians(index, model, value, dW, lane, y, v):
    """value + sum_k sigma_k dW_k Hess Ĥ_k(y) v."""
    k = number(index)
    return add_scaled(value, strengths(model)[k] * dW[k * LANES + lane], noise_hessian(model, k, y, v))


@device(by_type=True)
def add_lie_bracket(model, value, c, v, w):
    """value + c [v, w], where [v, w] is the gradient of w . B(y) v and B is linear in y."""
    if answers(lie_bracket, class_of(model)):
        return lambda model, value, c, v, w: add_scaled(value, c, lie_bracket(model, v, w))
    return add_bracket_component


@unrolled(component_indices)
def add_bracket_component(index, model, value, c, v, w):
    """value + c [v, w]_i e_i, where [v, w]_i = w . B(e_i) v."""
    e = unit(component_indices(model), number(index))
    return add_scaled(value, c * dot(w, structure(model, e, v)), e)


@device(by_type=True)
def add_noise_bracket_gradient(model, value, c, j, k, y):
    """value + c grad {Ĥ_j, Ĥ_k}(y), where {F, G} = grad F . B grad G and B is linear in y."""
    return _stated_bracket_gradient if answers(noise_bracket_gradient, class_of(model)) else _bracket_gradient


def _stated_bracket_gradient(model, value, c, j, k, y):
    return add_scaled(value, c, noise_bracket_gradient(model, j, k, y))


def _bracket_gradient(model, value, c, j, k, y):
    """With grad {Ĥ_j, Ĥ_k} = Hess Ĥ_j f_k - Hess Ĥ_k f_j + [grad Ĥ_k, grad Ĥ_j]."""
    value = add_scaled(value, c, noise_hessian(model, j, y, noise_field(model, k, y)))
    value = add_scaled(value, -c, noise_hessian(model, k, y, noise_field(model, j, y)))
    return add_lie_bracket(model, value, c, noise_gradient(model, k, y), noise_gradient(model, j, y))


@device
def step_gradient(model, h, dW, lane, y):
    """grad K(y) of the Hamiltonian K = h H + sum_k sigma_k dW_k Ĥ_k of one step of one lane."""
    return add_noise_gradients(model, scaled(drift_gradient(model, y), h), dW, lane, y)


@device
def step_field(model, h, dW, lane, y):
    """F(y) = B(y) grad K(y), plus h times the dissipation."""
    return step_field_along(model, h, y, step_gradient(model, h, dW, lane, y))


@device
def step_field_along(model, h, y, gradient):
    """F(y), given gradient = grad K(y)."""
    return add_dissipation(model, structure(model, y, gradient), h, y)


@device
def step_field_derivative(model, h, dW, lane, y, gradient, v):
    """F'(y) v, given gradient = grad K(y)."""
    hessian = add_noise_hessians(model, scaled(drift_hessian(model, y, v), h), dW, lane, y, v)
    turned = add_scaled(structure_derivative(model, y, v, gradient), 1.0, structure(model, y, hessian))
    return add_dissipation(model, turned, h, v)
