"""The words of the program: what a model, a scheme and an observer are asked.  Read this file first.

The problem (the paper's eq. prob): a stochastic Poisson system in Stratonovich form,

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) ∘ dW_k(t),      H = H_1 + ... + H_p,

with independent Wiener processes W_1, ..., W_m.  In the program indices start at 0.

A **model** is a NamedTuple of parameters with a field ``sigma`` (one entry per noise; None = that noise is off and is
neither drawn nor applied) and four class attributes: ``dimension`` d, ``pieces`` p, ``noises`` m, and ``conserved``,
the number of Casimir functions; where it applies also ``exact_flows = False``, ``sphere = True`` (the first Casimir
function is |y|^2), ``populations = True`` (components are to stay positive) and ``surface``, the Casimir surface on
which ``spi.kolmogorov`` works.  A **scheme** is a NamedTuple of options; its orders and what it preserves stand in
``schemes.SCHEMES``.  An **observer** is a NamedTuple of arrays into which a study collects what it needs.

A state y is a tuple of d floats.  In kernels LANES paths travel together: their states are one array of d * LANES
floats, component i of lane l at [i * LANES + l] (see ``lanes.py``).
"""

from typing import Annotated, NamedTuple

import annotated_types
from numba import types
from numba.extending import overload

from .dispatch import INLINED, constant, field_type, means, record_class, word, word_with_default
from .elementary import sin_versine as _sin_versine
from .elementary import sin_versine_huge as _sin_versine_huge
from .elementary import sin_versine_small as _sin_versine_small
from .elementary import sin_versine_tiny as _sin_versine_tiny

#: What the fields of a record may hold, checked when a spec file is read.
Positive = Annotated[float, annotated_types.Gt(0)]
NonNegative = Annotated[float, annotated_types.Ge(0)]

# ---------------------------------------------------------------------------------------------------------------------
# Counts: properties of the record's type, constants in compiled code
# ---------------------------------------------------------------------------------------------------------------------


def _class(model):
    return record_class(model) if isinstance(model, types.Type) else type(model)


@constant
def dimension(model):
    """d, the number of components of the state."""
    return _class(model).dimension


@constant
def pieces(model):
    """p, the number of pieces H_1, ..., H_p into which the Hamiltonian is split."""
    return _class(model).pieces


@constant
def noises(model):
    """m, the number of Wiener processes, those with sigma_k = None included."""
    return _class(model).noises


def piece_indices(model):
    """(0, ..., p-1)."""
    return tuple(range(_class(model).pieces))


@constant
def component_indices(model):
    """(0, ..., d-1)."""
    return tuple(range(_class(model).dimension))


def casimir_indices(model):
    """The numbers of the Casimir functions, from 0."""
    return tuple(range(_class(model).conserved))


def noise_indices(model):
    """The noises that are on, those whose sigma_k is not None."""
    if isinstance(model, types.Type):
        off = [t == types.none for t in field_type(model, "sigma").types]
    else:
        off = [s is None for s in model.sigma]
    return tuple(k for k, is_off in enumerate(off) if not is_off)


def strengths(model):
    """(sigma_0, ..., sigma_{m-1}) as floats, 0 for a noise that is off."""
    return _floats(model.sigma)


def _floats(values):
    return tuple(0.0 if v is None else v for v in values)


@overload(strengths, jit_options=INLINED)
def _(model):
    return lambda model: _floats(model.sigma)


@overload(_floats, jit_options=INLINED)
def _(values):
    if len(values) == 0:
        return lambda values: ()
    if values[0] == types.none:
        return lambda values: (0.0,) + _floats(values[1:])
    return lambda values: (values[0],) + _floats(values[1:])


# ---------------------------------------------------------------------------------------------------------------------
# Angles: flows that rotate are told how large their angles may be
# ---------------------------------------------------------------------------------------------------------------------


class TinyAngles(NamedTuple):
    """All angles lie within +-2^-5: short polynomials."""


class SmallAngles(NamedTuple):
    """All angles lie within [-pi/4, pi/4]: no range reduction."""


class ReducedAngles(NamedTuple):
    """All angles lie within +-1.6e6: range reduction in vector instructions."""


class AnyAngles(NamedTuple):
    """Nothing is known: the library's scalar sine."""


TINY_ANGLES, SMALL_ANGLES, REDUCED_ANGLES, ANY_ANGLES = TinyAngles(), SmallAngles(), ReducedAngles(), AnyAngles()


@word
def sin_versine(angles, x):
    """(sin x, 1 - cos x).

    Rotations use the versine, because with a rounded cosine the length drifts systematically (-1e-17 a step), while
    with p += s w - v p, w -= s p + v w its error is an unbiased walk of roundings.
    """


@means(sin_versine, TinyAngles)
def _(angles, x):
    return _sin_versine_tiny(x)


@means(sin_versine, SmallAngles)
def _(angles, x):
    return _sin_versine_small(x)


@means(sin_versine, ReducedAngles)
def _(angles, x):
    return _sin_versine(x)


@means(sin_versine, AnyAngles)
def _(angles, x):
    return _sin_versine_huge(x)


# ---------------------------------------------------------------------------------------------------------------------
# Words that a model answers
# ---------------------------------------------------------------------------------------------------------------------


@word
def drift_flow(model, k, t, y, angles):
    """exp(t Y_{H_k})(y), the exact flow of y' = B(y) grad H_k(y); `angles` is passed on to :func:`sin_versine`."""


@word
def noise_flow(model, k, t, y, angles):
    """exp(t Y_{Ĥ_k})(y), the exact flow of y' = B(y) grad Ĥ_k(y), for any real t (sigma_k is not included)."""


@word_with_default
def drift_angle(model, k, t, y):
    """The largest |angle| whose sine ``drift_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""
    return 0.0


@word_with_default
def noise_angle(model, k, t, y):
    """The largest |angle| whose sine ``noise_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""
    return 0.0


@word
def structure(model, y, v):
    """B(y) v."""


@word_with_default
def structure_derivative(model, y, u, v):
    """(DB(y)[u]) v, the derivative of B at y along u, applied to v.

    The default holds for Lie-Poisson systems, where B is linear in y.
    """
    return structure(model, u, v)


@word_with_default
def noise_structure(model, k, y, v):
    """B(y) v for a v that is 0 wherever grad Ĥ_k always is: a model may leave out what vanishes."""
    return structure(model, y, v)


@word_with_default
def noise_structure_derivative(model, k, y, u, v):
    """(DB(y)[u]) v for such a v."""
    return structure_derivative(model, y, u, v)


@word
def hamiltonian(model, y):
    """H(y)."""


@word
def drift_gradient(model, y):
    """grad H(y)."""


@word
def drift_hessian(model, y, v):
    """Hess H(y) v."""


@word
def noise_gradient(model, k, y):
    """grad Ĥ_k(y)."""


@word
def noise_hessian(model, k, y, v):
    """Hess Ĥ_k(y) v."""


@word
def casimirs(model, y):
    """The Casimir functions at y, a tuple (empty if there are none)."""


# ---------------------------------------------------------------------------------------------------------------------
# Words that a scheme answers
# ---------------------------------------------------------------------------------------------------------------------


@word
def advance(scheme, model, h, dW, coins, y, work, report):
    """One step of size h for LANES paths: replaces the states in `y`.

    `dW` holds the increments, channel k of lane l at [k * LANES + l]; channels that are off are not to be read.
    `coins`, one of 1.0 or -1.0 per lane, is filled only if the scheme :func:`tosses`.  `work` is scratch of
    ``work_size(scheme, model)`` floats; the scheme adds to `report` what :data:`REPORT` says.
    """


@constant
def tosses(scheme):
    """Whether the scheme needs a fair coin per step and path."""
    asks = getattr(_class(scheme), "tosses", None)
    return bool(asks and asks(scheme))


@word_with_default
def work_size(scheme, model):
    """How many floats of scratch one block needs."""
    return 0


@word_with_default
def memory_size(scheme, model):
    """How many floats, at first 0, a block keeps from step to step behind its states in `y`."""
    return 0


#: What schemes report, per step size and over all paths and steps: how often they solved an equation, iterations and
#: failures in all, the largest relative residual; and the largest |angle| of a rotation (0 if none is above pi/4).
REPORT = ("solves", "iterations", "failures", "largest_residual", "largest_angle")
SUMMED = 3  #: so many of them are sums, the others maxima

# ---------------------------------------------------------------------------------------------------------------------
# The word that an observer answers
# ---------------------------------------------------------------------------------------------------------------------


@word
def observe(observer, model, row, paths, level, n, y, reference):
    """Called by the ensemble after step n (counted from 1) of step size number `level` (0 = the reference).

    `y` are the states of the block at that level, `reference` those of the reference at the same time; `paths` says how
    many lanes count (the last block may be partly idle) and `row` which row of its arrays belongs to this block.
    """
