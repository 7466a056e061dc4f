"""What the methods of every model must satisfy, checked in plain Python at some states: the generic checks.

Derivatives are central differences of eighth order, compared with the sizes of what they are made of, so that
rotations, exponentials and shears, with rates large or small, are all judged alike.
"""

import inspect
import itertools
import math

import numpy as np

from ..compiler.dispatch import answers
from ..compiler.inlining import uncompiled
from ..ensemble.fields import cross_product, lie_poisson, noise_field
from ..ensemble.inexact import inexact_pieces, piece_gradient, piece_hessian
from ..ensemble.joint import bracket_factors, bracket_flows
from ..ensemble.protocol import (
    casimirs,
    conserved,
    drift_gradient,
    drift_hessian,
    hamiltonian,
    lie_bracket,
    noise_bracket_gradient,
    noise_gradient,
    noise_hessian,
    noise_structure,
    noise_structure_derivative,
    noises,
    structure,
    structure_derivative,
)
from .compilable import obstacle
from .differences import (
    DIFFERENCES,
    EXACT,
    derivatives_along,
    differ,
    differ_from_derivative,
    matrix_of,
    shown,
    unit_vectors,
)
from .flow_checks import commuting, flows, flows_of_brackets, joint_flows


def check_model(record, states, written=True, finite_at=()):
    """What is wrong with a model at the first of some states where anything is: sentences that name method and k.

    `written`: whether somebody wrote its class, so that it may hold what cannot be compiled.  `finite_at`: states at
    which its functions must be finite, but need not be smooth.
    """
    if written and (wrong := obstacle(record)):
        return [wrong]
    with uncompiled(), np.errstate(all="ignore"):
        at_points = (_complaints(record, y, (_shapes,)) for y in finite_at)
        return next(filter(None, itertools.chain(at_points, (_complaints(record, y) for y in states))), [])


def _complaints(model, y, all_checks=None):
    """All that is wrong at one state; nothing that depends on what is wrong already."""
    for checks in all_checks or (
        _shapes,
        _structure,
        _gradients,
        check_brackets,
        flows,
        commuting,
        joint_flows,
        flows_of_brackets,
    ):
        try:
            found = list(checks(model, y))
        except Exception as error:
            place = inspect.trace()[-1]
            found = [f"{place.function}, line {place.lineno}, raises {type(error).__name__} at y = {shown(y)}: {error}"]
        if found:
            return found
    return []


# ---------------------------------------------------------------------------------------------------------------------
# The checks
# ---------------------------------------------------------------------------------------------------------------------


def _shapes(model, y):
    if (count := len(casimirs(model, y))) != conserved(model):
        yield f"casimirs has {count} functions and conserved is {conserved(model)}; they must agree"
    if not all(map(math.isfinite, (*structure(model, y, y), *drift_gradient(model, y), hamiltonian(model, y)))):
        yield f"structure, drift_gradient or hamiltonian is not finite at y = {shown(y)}"
    for k in range(noises(model)):
        if not all(map(math.isfinite, noise_gradient(model, k, y))):
            yield f"noise_gradient, k = {k}, is not finite at y = {shown(y)}"


def _structure(model, y):
    units = unit_vectors(len(y))
    B = matrix_of([structure(model, y, e) for e in units])
    if differ(B, -B.T, EXACT):
        yield "structure is not skew: v . B(y) w must be -w . B(y) v"
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if differ(structure(model, y, v), B @ v, EXACT, B @ np.abs(v)):
        yield "structure is not linear in v"
    if cross_product(model) and differ(structure(model, y, v), np.cross(y, v), EXACT, B @ np.abs(v)):
        yield "structure is not y x v, as structure_is_cross_product or axis_inertias says"
    derivatives = np.array([matrix_of([structure_derivative(model, y, e, w) for w in units]) for e in units])
    for i, e in enumerate(units):
        if differ_from_derivative(derivatives[i], lambda z: matrix_of([structure(model, z, w) for w in units]), y, e):
            yield "structure_derivative is not the derivative of structure along u"
            return
    terms = np.einsum("il,ljk->ijk", B, derivatives)  # sum_l B_il d_l B_jk
    if differ(terms + terms.transpose(1, 2, 0), -terms.transpose(2, 0, 1), EXACT, terms):
        yield "structure violates Jacobi's identity"
    for c in range(conserved(model)):
        if all(_moves(B, both) for both in zip(*(_slopes(model, c, y, e) for e in units), strict=True)):
            yield f"casimirs, number {c}, is not a Casimir function: structure(its gradient) is not 0"


def _slopes(model, c, y, e):
    return derivatives_along(lambda z: casimirs(model, z)[c], y, e)


def _moves(B, slopes):
    """Whether a gradient is none of a Casimir function; `slopes` are its components, each with its roundings."""
    gradient, sizes = map(np.array, zip(*slopes, strict=True))
    return differ(B @ gradient, 0.0 * gradient, DIFFERENCES, np.linalg.norm(B) * gradient, sizes)


def _gradients(model, y):
    for e, slope in zip(unit_vectors(len(y)), drift_gradient(model, y), strict=True):
        if differ_from_derivative(slope, lambda z: hamiltonian(model, z), y, e, drift_gradient(model, y)):
            yield "drift_gradient is not the gradient of hamiltonian"
            break
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    yield from _hessian("drift", "", lambda z: drift_gradient(model, z), lambda z, w: drift_hessian(model, z, w), y, v)
    for k in inexact_pieces(model):
        gradient, hessian = lambda z, k=k: piece_gradient(model, k, z), lambda z, w, k=k: piece_hessian(model, k, z, w)
        yield from _hessian("piece", f", k = {k},", gradient, hessian, y, v)
    for k in range(noises(model)):
        gradient, hessian = lambda z, k=k: noise_gradient(model, k, z), lambda z, w, k=k: noise_hessian(model, k, z, w)
        yield from _hessian("noise", f", k = {k},", gradient, hessian, y, v)
        for w in (gradient(y), hessian(y, v)):
            if differ(noise_structure(model, k, y, w), structure(model, y, w), EXACT):
                yield f"noise_structure, k = {k}, differs from structure for a gradient of the noise"
            changed = structure_derivative(model, y, v, w)
            if differ(noise_structure_derivative(model, k, y, v, w), changed, EXACT):
                yield f"noise_structure_derivative, k = {k}, differs from structure_derivative for such a gradient"


def _hessian(part, number, gradient, hessian, y, v):
    """Whether a method is the derivative of a gradient, which is one indeed if that is symmetric."""
    if differ_from_derivative(hessian(y, v), gradient, y, v):
        yield f"{part}_hessian{number} is not the derivative of {part}_gradient along v"
        return
    matrix = matrix_of([hessian(y, tuple(e)) for e in np.eye(len(y)).tolist()])
    if differ(matrix, matrix.T, EXACT):
        yield f"{part}_gradient{number} is the gradient of no function: {part}_hessian is not symmetric"


def check_brackets(model, y):
    """What is wrong at a state with what a model says of brackets, where it does."""
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if answers(lie_bracket, model):
        moved = np.array([structure(model, tuple(e), v) for e in np.eye(len(y)).tolist()])
        if not lie_poisson(model) or differ(lie_bracket(model, v, y), moved @ y, 1e-9, moved):
            yield "lie_bracket is not the gradient of w . structure(y, v), a function that is linear in y"
    for k, j in itertools.combinations(range(noises(model)), 2) if answers(noise_bracket_gradient, model) else ():
        slope = np.dot(v, noise_bracket_gradient(model, j, k, y))
        if differ_from_derivative(slope, lambda z, j=j, k=k: _bracket(model, j, k, z), y, v, *_sizes(model, j, k, y)):
            yield f"noise_bracket_gradient, j = {j}, k = {k}, is not the gradient of grad Ĥ_j . B grad Ĥ_k"

    if answers(bracket_factors, model):
        pairs = [pair for pair in itertools.combinations(range(noises(model)), 2) if pair not in bracket_flows(model)]
        numbers = dict(zip(itertools.combinations(range(noises(model)), 2), bracket_factors(model), strict=True))
        for first, second in itertools.combinations(pairs, 2):
            a, b = (_bracket(model, j, k, y) for k, j in (first, second))
            sizes = (np.linalg.norm(size) for k, j in (first, second) for size in _sizes(model, j, k, y))
            if differ(a * numbers[second], b * numbers[first], 1e-9, *(n * x for n in numbers.values() for x in sizes)):
                yield f"bracket_factors: the brackets of the pairs {first} and {second} are no such multiples"


def _bracket(model, j, k, y):
    """{Ĥ_j, Ĥ_k}."""
    return np.dot(noise_gradient(model, j, y), noise_field(model, k, y))


def _sizes(model, j, k, y):
    """What its derivative is made of, at least in size."""
    return noise_gradient(model, j, y), noise_field(model, k, y)
