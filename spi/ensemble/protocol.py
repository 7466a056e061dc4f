"""What a model is asked; for schemes see ``scheme_protocol.py``, for models with arrays as states ``array_states.py``,
for flows that are not known in closed form ``inexact.py``, for flows that are one with others ``joint.py``.

Read this file first.

The problem (the paper's eq. prob): a stochastic Poisson system in Stratonovich form,

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) ∘ dW_k(t),      H = H_1 + ... + H_p,

with independent Wiener processes W_1, ..., W_m.  In the program indices start at 0.

A **model** is a NamedTuple of parameters with a field ``sigma`` (one entry per noise; None = that noise is off and is
neither drawn nor applied).  In its class body stand its traits (``dimension = 3``) and the methods below
(``def drift_flow(model, k, t, y, angles)``).  A **scheme** is a NamedTuple of options with the methods of schemes; its
orders and what it preserves stand in ``schemes.SCHEMES``.

A class must implement what is marked ``@method``; for ``@method(default=True)`` it need not, and
``@method(optional=True)`` says what only some models can.  A ``@trait`` is required unless it has a default.
``registration.py`` checks classes against this file.

A state y is a tuple of d floats, of an array-state model an array.  In kernels LANES paths travel together: their
states are one array of d * LANES floats, component i of lane l at [i * LANES + l] (see ``lanes.py``).
"""

import itertools
from typing import Annotated

import annotated_types

from ..compiler import instructions
from ..compiler.dispatch import intrinsic, method, trait
from ..compiler.records import field, is_array, is_none

#: What the fields of a record may hold, checked when a spec file is read.
Positive = Annotated[float, annotated_types.Gt(0)]
NonNegative = Annotated[float, annotated_types.Ge(0)]

# ---------------------------------------------------------------------------------------------------------------------
# Traits of a model: constants in compiled code
# ---------------------------------------------------------------------------------------------------------------------


@trait(int)
def dimension(model):
    """d, the number of components of the state."""


@trait(int)
def pieces(model):
    """p, the number of pieces H_1, ..., H_p into which the Hamiltonian is split."""


@trait(int)
def noises(model):
    """m, the number of Wiener processes, those with sigma_k = None included."""


@trait(int)
def conserved(model):
    """The number of Casimir functions."""


@trait(tuple, default=())
def casimir_degrees(model):
    """The degrees k of the Casimir functions where all are homogeneous, C(c y) = c^k C(y); otherwise empty."""


@trait(bool, default=True)
def exact_flows(model):
    """Whether the flows are exact; if not, what is known of splitting schemes does not hold."""


@trait(bool, default=False)
def squared_length_is_casimir(model):
    """Whether the first Casimir function is |y|^2."""


@trait(bool, default=False)
def structure_is_cross_product(model):
    """Whether B(y) v = y x v; also so of every model that answers ``axis_inertias``."""


@trait(bool, default=False)
def populations(model):
    """Whether the components are to stay positive."""


@trait(float, default=0.0)
def flow_ns(model):
    """Nanoseconds of one flow per path, on a processor with AVX-512 at about 4 GHz, for estimates of run time.

    0: not stated; then 0.15 for each component, see ``schemes/costs.py``.
    """


@trait(tuple, default=())
def commuting_noises(model):
    """Pairs (k, l), k < l, of noises whose flows are known to commute; schemes need no Lévy areas of theirs."""


@trait(bool, default=False)
def large(model):
    """Whether states are arrays, of any length, and flows move whole blocks; see the methods of such a model below."""


def piece_indices(model):
    """(0, ..., p-1)."""
    return tuple(range(pieces(model)))


@trait
def component_indices(model):
    """(0, ..., d-1)."""
    return tuple(range(dimension(model)))


def casimir_indices(model):
    """The numbers of the Casimir functions, from 0."""
    return tuple(range(conserved(model)))


def noise_indices(model):
    """The noises that are on, those whose sigma_k is not None; all of an array-state model."""
    if large(model):
        return tuple(range(noises(model)))
    return tuple(k for k, sigma in enumerate(field(model, "sigma")) if not is_none(sigma))


piece_indices.count, component_indices.count = pieces, dimension
casimir_indices.count, noise_indices.count = conserved, noises


def area_pairs(model):
    """((k, l), ...), k < l: the pairs of noises that are on and do not commute, whose Lévy areas schemes may need.

    None of an array-state model, for which no scheme has areas.
    """
    if large(model):
        return ()
    commuting = commuting_noises(model)
    return tuple(pair for pair in itertools.combinations(noise_indices(model), 2) if pair not in commuting)


def strengths(model):
    """(sigma_0, ..., sigma_{m-1}) as floats, 0 for a noise that is off; an array of an array-state model."""
    return model.sigma if is_array(model.sigma) else tuple(0.0 if sigma is None else sigma for sigma in model.sigma)


@intrinsic(strengths)
def _(model):
    return instructions.floats(model, "sigma")


# ---------------------------------------------------------------------------------------------------------------------
# Methods of a model
# ---------------------------------------------------------------------------------------------------------------------


@method
def drift_flow(model, k, t, y, angles):
    """exp(t Y_{H_k})(y), the exact flow of y' = B(y) grad H_k(y); `angles` is passed on to ``angles.sin_versine``."""


@method
def noise_flow(model, k, t, y, angles):
    """exp(t Y_{Ĥ_k})(y), the exact flow of y' = B(y) grad Ĥ_k(y), for any real t (sigma_k is not included)."""


@method(default=True)
def drift_angle(model, k, t, y):
    """The largest |angle| whose sine ``drift_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""
    return 0.0


@method(default=True)
def noise_angle(model, k, t, y):
    """The largest |angle| whose sine ``noise_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""
    return 0.0


@method
def structure(model, y, v):
    """B(y) v."""


@method(default=True)
def structure_derivative(model, y, u, v):
    """(DB(y)[u]) v, the derivative of B at y along u, applied to v.

    The default holds for Lie-Poisson systems, where B is linear in y.
    """
    return structure(model, u, v)


@method(default=True)
def noise_structure(model, k, y, v):
    """B(y) v for a v that is 0 wherever grad Ĥ_k always is: a model may leave out what vanishes."""
    return structure(model, y, v)


@method(default=True)
def noise_structure_derivative(model, k, y, u, v):
    """(DB(y)[u]) v for such a v."""
    return structure_derivative(model, y, u, v)


@method
def hamiltonian(model, y):
    """H(y)."""


@method
def drift_gradient(model, y):
    """grad H(y)."""


@method
def drift_hessian(model, y, v):
    """Hess H(y) v."""


@method
def noise_gradient(model, k, y):
    """grad Ĥ_k(y)."""


@method
def noise_hessian(model, k, y, v):
    """Hess Ĥ_k(y) v."""


@method
def casimirs(model, y):
    """The Casimir functions at y, a tuple (empty if there are none)."""


@method(default=True)
def add_dissipation(model, value, h, y):
    """value + h g(y), where g, a linear function, is what the drift has beside B(y) grad H(y)."""
    return value


@method(default=True)
def decay_rates(model):
    """The rates at which the Casimir functions decay; empty where they are preserved.  Asked in Python only."""
    return ()


@method(default=True)
def in_kernels(model):
    """The record that kernels are given; of an array-state model one with its tables, a class with the methods below.

    Asked in Python only.
    """
    return model


@method(default=True)
def fault(model):
    """(key, what is wrong with it, what would be right) of the parameters, or None.  Asked in Python only."""
    return None


@method(optional=True)
def lie_bracket(model, v, w):
    """[v, w] where B is linear in y: the gradient of w . B(y) v, a function that is linear in y.

    ``fields.add_lie_bracket`` finds it component by component where a model does not answer this, which takes longer.
    """


@method(optional=True)
def noise_bracket_gradient(model, j, k, y):
    """The gradient of {Ĥ_j, Ĥ_k} = grad Ĥ_j . B grad Ĥ_k at y, j > k.

    ``fields.add_noise_bracket_gradient`` finds it from Hessians and the bracket above, which takes longer.
    """


@method(optional=True)
def axis_inertias(model):
    """((I_1, I_2, I_3), (Î_1, Î_2, Î_3)) where B(y) v = y x v, H_k = y_k^2 / (2 I_k) and Ĥ_k = y_k^2 / (2 Î_k).

    The flows turn y about axis k, at the rates y_k / I_k and y_k / Î_k: rotations of spheres.  An inertia may be
    infinite.  These and not their inverses, so that no rate is rounded twice.
    """


@method(optional=True)
def rotation_shear_rates(model):
    """((a, c), (â, ĉ)) where B(y) v = (y2 v3 - y3 v2, y3 v1, -y2 v1), H_1 = a y1^2 / 2, H_2 = c y3, hats alike.

    The flows of H_1 turn (y2, y3) by the angle -a t y1, those of H_2 move y1 by c t y2: motions of cylinders.
    """
