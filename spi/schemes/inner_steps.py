"""The inner step: what moves by a piece or a noise whose flow is not known in closed form, in place of the flow.

exp(t Y_K) y is replaced by one step of size t, positive or negative, of a scheme for y' = B(y) grad K(y): with
``inner = "midpoint"`` the implicit midpoint rule, where B(y) v = y x v the isospectral one, and with "munthe_kaas" the
explicit midpoint rule of Munthe-Kaas.  All are of order 2 in t, so that a noise, with t = sigma_k dW_k, lacks terms of
the size dW_k^3, of mean 0, and of mean h^2: strong orders stay what they are, and the weak order is at most 1.
"""

from typing import Any, NamedTuple

from ..compiler.dispatch import device, number
from ..compiler.records import field
from ..ensemble.fields import cross_product, unit
from ..ensemble.inexact import INNER_METHODS, flows_lacking, inner, structure_is_kept
from ..ensemble.protocol import component_indices, dimension
from ..ensemble.scheme_protocol import advance, work_size
from ..numerics.rng import LANES
from .inner_midpoint import InnerMidpoint
from .isospectral import IsospectralMidpoint
from .munthe_kaas import MuntheKaasMidpoint
from .parts import gradient, hessian, structure_along, structure_derivative_along

_SCHEMES = dict(zip(INNER_METHODS, (InnerMidpoint(), MuntheKaasMidpoint()), strict=True))


class Alone(NamedTuple):
    """One piece or noise of a model as a model: the only noise of one without a drift, with sigma = 1."""

    model: Any
    part: Any  #: of :data:`~.parts.PARTS`
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
    """Whether all steps by pieces and noises are flows, or are undone in law by those of the time -t.

    Those of the implicit rules by pieces are.  By a noise they are undone on each path, but not their mean over dW.
    """
    lacking = flows_lacking(model)
    return not lacking or (inner(model) == "midpoint" and all(part == "pieces" for part, _ in lacking))


def preserved(model):
    """What a composition with inner steps preserves, in the words of the table of schemes."""
    if inner(model) == "midpoint":
        keeps = cross_product(model) or structure_is_kept(model)
        return "Casimirs, Poisson structure" if keeps else "quadratic Casimirs"
    return "Casimirs"


@device(by_type=True)
def inner_size(model):
    """How many floats of scratch an inner step needs."""
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
    """As ``splitting.sweep``, by an inner step."""
    inner_step(Alone(model, part, index, (1.0,)), coins, y, work, report)
