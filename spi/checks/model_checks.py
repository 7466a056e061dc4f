"""The generic checks of the methods of a model, in plain Python at some states.

Derivatives are central differences of eighth order, compared with the sizes of their terms, so that rotations,
exponentials and shears, with rates large or small, are all judged alike.
"""

import contextlib
import hashlib
import inspect
import itertools
import math
from functools import cache, partial

import numpy as np

from .. import digest_of, sources
from ..compiler import modules
from ..compiler.dispatch import answers
from ..compiler.inlining import is_compiling, uncompiled
from ..ensemble.fields import cross_product, lie_poisson, noise_field
from ..ensemble.protocol import (
    bracket_factors,
    casimirs,
    conserved,
    dimension,
    drift_gradient,
    drift_hessian,
    frozen,
    hamiltonian,
    inexact_pieces,
    lie_bracket,
    noise_bracket_gradient,
    noise_gradient,
    noise_hessian,
    noise_structure,
    noise_structure_derivative,
    noises,
    piece_gradient,
    piece_hessian,
    populations,
    structure,
    structure_derivative,
)
from ..numerics.arrays import runge_kutta
from .compilable import obstacle
from .flow_checks import (
    DIFFERENCES,
    EXACT,
    commuting,
    derivatives_along,
    differ,
    differ_from_derivative,
    flows,
    joint_flows,
    matrix_of,
    shown,
    unit_vectors,
)

# ---------------------------------------------------------------------------------------------------------------------
# The states at which a model is checked.
# ---------------------------------------------------------------------------------------------------------------------

_MOVED = 0.4  # share of its size by which a state is moved on its surface, or a half, a quarter, ... of that
_HALVINGS = 6
_LEAST = 0.25  # least share of a component that remains
_DIRECTIONS, _STEPS = 3, 6


def states_around(y, model, count=2):
    """States near y, none of whose components is 0; positive ones if they are populations."""
    generator, y = np.random.default_rng(1), np.array(y, float)
    size = np.sqrt(np.mean(y * y)) or 1.0
    for _ in range(count):
        z = generator.choice([-1.0, 1.0], y.size) * generator.uniform(0.2, 0.6, y.size)
        yield tuple((y * np.exp(z) if populations(model) else y + size * z).tolist())


def states_on_surface(y, model, count=2):
    """States near y on the surface on which solutions from y stay, where H and the noises are finite.

    They are moved along the fields of linear functions drawn at random.  Where y cannot be moved, as 0 in many
    systems, they are those of :func:`states_around`.  Components that never change their sign stay away from 0, near
    which differences do not give the derivatives of a logarithm.
    """
    generator = np.random.default_rng(1)
    with uncompiled(), np.errstate(all="ignore"):
        least = np.where(_keep_their_sign(y, model), _LEAST * np.abs(y), -np.inf)
        for _ in range(count):
            gradients = generator.standard_normal((_DIRECTIONS, len(y)))
            yield next(_moved(y, model, gradients, least), None) or next(iter(states_around(y, model, 1)))


def _keep_their_sign(y, model):
    """For each component whether it never changes its sign: it is not 0, and nothing moves it where it is 0."""
    keeps = []
    for e in unit_vectors(len(y)):
        without = tuple(np.where(e, 0.0, y).tolist())
        keeps.append(np.dot(e, y) != 0.0 and not np.any(structure(model, without, e)))
    return keeps


def _moved(y, model, gradients, least):
    """A state on the surface, the first of several that are nearer and nearer to y where all is finite.

    Components have the sign of those of y, and are at least as large as `least`.
    """
    start = np.array(y, float)
    if not any(np.any(structure(model, y, tuple(g.tolist()))) for g in gradients):
        return
    for halvings in range(_HALVINGS):
        z = start
        for gradient in gradients:
            z = _along(z, model, gradient, _MOVED / 2**halvings)
        moved = tuple(z.tolist())
        if np.all(np.isfinite(z)) and np.all(z * np.sign(y) >= least) and not any(_shapes(model, moved)):
            yield moved
    yield tuple(y)


def _along(y, model, gradient, part):
    """The state moved by the share `part` of its size along the field of a linear function, by Runge-Kutta steps."""

    gradient = tuple(gradient.tolist())

    def field(z):
        return np.array(structure(model, tuple(z.tolist()), gradient))

    slopes = [structure_derivative(model, tuple(y.tolist()), e, gradient) for e in unit_vectors(len(y))]
    size = np.linalg.norm(y)
    # near a rest point the steps stay stable
    speed = max(np.linalg.norm(field(y)), np.linalg.norm(slopes) * size / _STEPS)
    h = part * size / speed / _STEPS if speed else 0.0
    return runge_kutta(field, y, h, _STEPS)


def check_model(record, states, written=True, finite_at=()):
    """The complaints about a model at the first of some states with any: sentences that name the method and k.

    `written`: whether a person wrote its class, so that methods may fail to compile.  `finite_at`: states at which its
    functions must be finite, but need not be smooth.
    """
    if written and (wrong := obstacle(record)):
        return [wrong]
    with uncompiled(), np.errstate(all="ignore"):
        at_points = (_complaints(record, y, (_shapes,)) for y in finite_at)
        return next(filter(None, itertools.chain(at_points, (_complaints(record, y) for y in states))), [])


def _complaints(model, y, all_checks=None):
    """The complaints of the first check that has any at one state; later checks depend on earlier ones."""
    for checks in all_checks or (_shapes, _structure, _gradients, check_brackets, flows, commuting, joint_flows):
        try:
            complaints = list(checks(model, y))
        except Exception as error:
            at = inspect.trace()[-1]
            complaints = [f"{at.function}, line {at.lineno}, raises {type(error).__name__} at y = {shown(y)}: {error}"]
        if complaints:
            return complaints
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
        slopes = (derivatives_along(lambda z, c=c: casimirs(model, z)[c], y, e) for e in units)
        if all(_moves(B, both) for both in zip(*slopes, strict=True)):
            yield f"casimirs, number {c}, is not a Casimir function: structure(its gradient) is not 0"


def _moves(B, slopes):
    """Whether a gradient is not that of a Casimir function; `slopes`: its components, each with its rounding error."""
    gradient, sizes = map(np.array, zip(*slopes, strict=True))
    return differ(B @ gradient, 0.0 * gradient, DIFFERENCES, np.linalg.norm(B) * gradient, sizes)


def _gradients(model, y):
    for e, slope in zip(unit_vectors(len(y)), drift_gradient(model, y), strict=True):
        if differ_from_derivative(slope, partial(hamiltonian, model), y, e, drift_gradient(model, y)):
            yield "drift_gradient is not the gradient of hamiltonian"
            break
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    yield from _hessian("drift", "", partial(drift_gradient, model), partial(drift_hessian, model), y, v)
    for k in inexact_pieces(model):
        gradient, hessian = partial(piece_gradient, model, k), partial(piece_hessian, model, k)
        yield from _hessian("piece", f", k = {k},", gradient, hessian, y, v)
    for k in range(noises(model)):
        gradient, hessian = partial(noise_gradient, model, k), partial(noise_hessian, model, k)
        yield from _hessian("noise", f", k = {k},", gradient, hessian, y, v)
        for w in (gradient(y), hessian(y, v)):
            if differ(noise_structure(model, k, y, w), structure(model, y, w), EXACT):
                yield f"noise_structure, k = {k}, differs from structure for a gradient of the noise"
            changed = structure_derivative(model, y, v, w)
            if differ(noise_structure_derivative(model, k, y, v, w), changed, EXACT):
                yield f"noise_structure_derivative, k = {k}, differs from structure_derivative for such a gradient"


def _hessian(part, number, gradient, hessian, y, v):
    """Yield a complaint if a method is not the derivative of a gradient, or not symmetric, as of a true gradient."""
    if differ_from_derivative(hessian(y, v), gradient, y, v):
        yield f"{part}_hessian{number} is not the derivative of {part}_gradient along v"
        return
    matrix = matrix_of([hessian(y, e) for e in unit_vectors(len(y))])
    if differ(matrix, matrix.T, EXACT):
        yield f"{part}_gradient{number} is the gradient of no function: {part}_hessian is not symmetric"


def check_brackets(model, y):
    """Yield complaints about the brackets of a model at a state, where it has methods for them."""
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if answers(lie_bracket, model):
        moved = np.array([structure(model, e, v) for e in unit_vectors(len(y))])
        if not lie_poisson(model) or differ(lie_bracket(model, v, y), moved @ y, 1e-9, moved):
            yield "lie_bracket is not the gradient of w . structure(y, v), a function that is linear in y"
    for k, j in itertools.combinations(range(noises(model)), 2) if answers(noise_bracket_gradient, model) else ():
        slope = np.dot(v, noise_bracket_gradient(model, j, k, y))
        if differ_from_derivative(slope, partial(_bracket, model, j, k), y, v, *_sizes(model, j, k, y)):
            yield f"noise_bracket_gradient, j = {j}, k = {k}, is not the gradient of grad Ĥ_j . B grad Ĥ_k"

    if answers(bracket_factors, model):
        numbers = dict(zip(itertools.combinations(range(noises(model)), 2), bracket_factors(model), strict=True))
        for first, second in itertools.combinations(numbers, 2):
            a, b = (_bracket(model, j, k, y) for k, j in (first, second))
            sizes = (np.linalg.norm(size) for k, j in (first, second) for size in _sizes(model, j, k, y))
            if differ(a * numbers[second], b * numbers[first], 1e-9, *(n * x for n in numbers.values() for x in sizes)):
                yield f"bracket_factors: the brackets of the pairs {first} and {second} are no such multiples"


def _bracket(model, j, k, y):
    """{Ĥ_j, Ĥ_k}."""
    return np.dot(noise_gradient(model, j, y), noise_field(model, k, y))


def _sizes(model, j, k, y):
    """Vectors as large as the terms of the derivative of :func:`_bracket`."""
    return noise_gradient(model, j, y), noise_field(model, k, y)


# ---------------------------------------------------------------------------------------------------------------------
# The generic checks of a model that is no part of this package are made once; files record which have passed.
# ---------------------------------------------------------------------------------------------------------------------

_PASSED: set[tuple[type, str]] = set()  # in this process: a class, and the digest of numbers and an initial state


@cache
def _digest_of_checks():
    """A digest of the code of the checks, so that models are checked again when it changes."""
    return digest_of(sources("checks", "compiler", "ensemble", "numerics"))


def check_once(record, initial):
    """The complaints of :func:`check_model` about a foreign model near an initial state.

    None if these numbers have passed before with this class and this state, as a file beside the stored modules says.
    """
    cls = type(record)
    key = hashlib.sha256(repr((tuple(record), tuple(initial))).encode()).hexdigest()[:32]
    if not modules.is_foreign(cls) or (cls, key) in _PASSED:
        return []
    name = f"{cls.__module__}.{cls.__qualname__}.{modules.digest(cls)}.{_digest_of_checks()}.checked"
    path = modules.folder() / name
    passed = _passed(path) if modules.digest(cls) else set()
    if key in passed:
        return []
    count = 2 if dimension(record) <= 12 else 1
    own = modules.system_of(cls) is not None
    states = (states_on_surface if own else states_around)(initial, record, count)
    complaints = check_model(
        _moving(record) if own else record, states, written=not own and not passed, finite_at=[tuple(initial)] * own
    )
    if not complaints:
        _PASSED.add((cls, key))
        if modules.digest(cls) and is_compiling():
            with contextlib.suppress(OSError):  # then it is checked again in the next process
                path.parent.mkdir(parents=True, exist_ok=True)
                with open(path, "a", encoding="ascii") as file:
                    file.write(key + "\n")
    return complaints


def _moving(record):
    """A generated model at a time at which none of its functions of time vanishes, as one may at the beginning."""
    if not answers(frozen, record):
        return record
    with uncompiled(), np.errstate(all="ignore"):
        at = [frozen(record, begin, 0.0) for begin in (0.618, 1.7, 2.9, 0.1)]
    return max(at, key=lambda model: min(map(abs, model.driving), default=0.0))


def _passed(path):
    """The digests of numbers and states that a file says have passed."""
    with contextlib.suppress(OSError, ValueError):
        return set(path.read_text(encoding="ascii").split())
    return set()
