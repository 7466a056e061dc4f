"""Generic checks of a model, in plain Python at some states: of its methods, flows and commuting noises.

Derivatives are central differences of eighth order, compared with the sizes of their terms, so that rotations,
exponentials and shears, with rates large or small, are all judged alike.
"""

import contextlib
import hashlib
import inspect
import itertools
import math
from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from .. import digest_of, sources
from ..compiler import modules
from ..compiler.dispatch import answers
from ..compiler.inlining import is_compiling, uncompiled
from ..ensemble import protocol
from ..ensemble.fields import cross_product, lie_poisson, noise_field, noise_field_derivative
from ..numerics.arrays import runge_kutta
from .compilable import obstacle

# ---------------------------------------------------------------------------------------------------------------------
# Derivatives by differences, and whether two results agree within the rounding errors of their terms.
# ---------------------------------------------------------------------------------------------------------------------

# Central differences of eighth order: with steps of 0.01 they err by about 1e-14 where derivatives are of size 1.
STENCIL = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
STEP = 0.01
STEPS = STEP, STEP / 10, STEP / 100, STEP / 10**4, STEP / 10**6
EXACT = 1e-9  #: relative tolerance for values that are equal but for rounding
DIFFERENCES = 1e-6  #: relative tolerance for values computed by differences


def derivative(f, step=STEP):
    """f'(0) for a function of one real number, with values in tuples or floats."""
    return sum(c * (np.asarray(f(j * step)) - np.asarray(f(-j * step))) for j, c in STENCIL.items()) / step


def along(y, v):
    """Line s -> y + s v."""
    return lambda s: tuple((np.array(y) + s * np.array(v)).tolist())


def differ(a, b, tolerance, *others):
    """Whether two arrays differ by more than `tolerance` times the largest norm of a, b and `others`."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    size = max(float(np.linalg.norm(x)) for x in (a, b, *others))
    return not np.linalg.norm(a - b) <= tolerance * size  # true for NaN


def size_of(y):
    """|y|, or 1 where y is 0."""
    return float(np.linalg.norm(y)) or 1.0


def derivatives_along(f, y, v):
    """Derivative of f at y along v by steps from large to small, each with the size of its rounding errors.

    Where f ends near y, as a logarithm does, bends there or oscillates fast, the smaller steps are right; else the
    largest.
    """
    scale = size_of(y) / size_of(v)
    line = along(y, v)
    for step in STEPS:
        largest = max(np.linalg.norm(f(y)), np.linalg.norm(f(line(max(STENCIL) * step * scale))))
        yield derivative(lambda s: f(line(s * scale)), step) / scale, 1e-6 * largest / scale * (STEP / step)


def differ_from_derivative(value, f, y, v, *others):
    """Whether `value` differs from the derivative of f at y along v by all of the steps."""
    return all(differ(value, changed, DIFFERENCES, size, *others) for changed, size in derivatives_along(f, y, v))


def matrix_of(columns):
    """Matrix with these columns."""
    return np.array(columns, float).T


def unit_vectors(d):
    """e_1, ..., e_d."""
    return [tuple(row) for row in np.eye(d).tolist()]


def shown(y):
    """A state in a message."""
    more = ", ..." if len(y) > 8 else ""
    return f"({', '.join(f'{x:.6g}' for x in y[:8])}{more})"


_TIMES = (0.3, -0.9)  # of flows, in units of the time in which they move a state by its own size
_ANGLES = 2.0**-6, 0.7, 30.0  # at which angle methods are compared: below each bound for cheaper sines, and above


class NotedAngles(NamedTuple):
    """Accepts every angle, and records the largest modulus in its one entry."""

    largest: np.ndarray

    def sin_versine(angles, x):
        angles.largest[0] = max(angles.largest[0], abs(x))
        return math.sin(x), 2.0 * math.sin(0.5 * x) ** 2

    def adding_to_zero(angles, p0, p1, p2):
        angles.largest[0] = max(angles.largest[0], abs(p0), abs(p1), abs(p2))
        return p0, p1, p2


class _Flow(NamedTuple):
    """Flow of one piece or noise, with its number."""

    part: str
    k: int
    act: Callable  #: (t, y) -> the flow, which notes its angles
    bound: Callable  #: (t, y) -> the bound of the angle method
    noted: np.ndarray  #: (1,) the largest |angle| since :meth:`noting` was called

    def noting(self, t, y):
        """Largest |angle| whose sine the flow takes."""
        self.noted[0] = 0.0
        self.act(t, y)
        return float(self.noted[0])

    def rate(self, y, field):
        """One over the time in which it moves a state by its own size or by an angle of 1; `field` is a guess."""
        guess = size_of(field) / size_of(y)
        t = 1e-3 / guess
        moved = np.linalg.norm(np.subtract(self.act(t, y), y)) / size_of(y)
        return max(guess, self.noting(t, y) / t, float(moved) / t)

    def __str__(self):
        return f"{self.part}_flow, k = {self.k},"


#: part -> (number of flows, those that are not exact, flow, angle)
_PARTS = {
    "drift": (protocol.pieces, protocol.inexact_pieces, protocol.drift_flow, protocol.drift_angle),
    "noise": (protocol.noises, protocol.inexact_noises, protocol.noise_flow, protocol.noise_angle),
}


def _flows_of(model, part):
    """{k: flow} of the pieces or the noises that have an exact flow."""
    count, lacking, act, bound = _PARTS[part]
    flows = {}
    for k in sorted({*range(count(model))} - {*lacking(model)}):
        noted = np.zeros(1)

        def acting(t, y, k=k, noted=noted):
            return act(model, k, t, y, NotedAngles(noted))

        flows[k] = _Flow(part, k, acting, partial(bound, model, k), noted)
    return flows


def flows(model, y):
    """Yield complaints about the flows of pieces and noises at a state."""
    field = protocol.structure(model, y, protocol.drift_gradient(model, y))
    fields = (
        protocol.structure(model, y, protocol.piece_gradient(model, k, y)) for k in protocol.inexact_pieces(model)
    )
    total = sum(map(np.array, fields), np.zeros(len(y)))
    size = float(np.linalg.norm(total))
    for flow in _flows_of(model, "drift").values():
        rate = flow.rate(y, field)
        total, size = total + _velocity(flow, y, rate), max(size, size_of(y) * rate)
        yield from _one_flow(model, flow, y, rate)
    if differ(total, field, DIFFERENCES, 1e-6 * size):
        yield "drift_flow: its derivatives at t = 0, added up over k, are not structure(drift_gradient)"
    for flow in _flows_of(model, "noise").values():
        field = protocol.structure(model, y, protocol.noise_gradient(model, flow.k, y))
        rate = flow.rate(y, field)
        if differ(_velocity(flow, y, rate), field, DIFFERENCES, 1e-6 * size_of(y) * rate):
            yield f"{flow} does not solve its equation: its derivative at t = 0 is not structure(noise_gradient)"
        yield from _one_flow(model, flow, y, rate)


def commuting(model, y):
    """Yield complaints about noises that are declared to commute and whose fields do not, f_k' f_l = f_l' f_k."""
    m = protocol.noises(model)
    for pair in protocol.commuting_noises(model):
        if pair not in itertools.combinations(range(m), 2):
            yield f"commuting_noises has {pair}, which is not a pair (k, l) of noises with 0 <= k < l < {m}"
            continue
        there, back = (noise_field_derivative(model, j, y, noise_field(model, k, y)) for j, k in (pair, pair[::-1]))
        if differ(there, back, EXACT, y):
            yield f"commuting_noises has {pair}, but their fields do not commute"


def joint_flows(model, y):
    """Yield complaints about joint flows: each is that of a piece and then of its noises, in either order."""
    groups, listed = protocol.joint_noises(model), sum(protocol.joint_noises(model), ())
    if not groups:
        return
    once = sorted(listed) == sorted(set(listed) & set(range(protocol.noises(model))))
    if len(groups) > protocol.pieces(model) or not once:
        yield f"joint_noises is {groups}, which must be a tuple of numbers of noises for each piece, no noise twice"
        return
    if not (answers(protocol.joint_flow, model) and answers(protocol.joint_angle, model)):
        yield "joint_noises needs the methods joint_flow and joint_angle"
        return
    drift, noise = _flows_of(model, "drift"), _flows_of(model, "noise")
    for k, group in enumerate(groups):
        if group:  # noises that have one
            flows = [drift[k], *(noise[j] for j in group)]
            fields = [protocol.drift_gradient(model, y), *(protocol.noise_gradient(model, j, y) for j in group)]
            moved = [protocol.structure(model, y, field) for field in fields]
            rates = [flow.rate(y, along) for flow, along in zip(flows, moved, strict=True)]
            yield from _joint(model, k, y, flows, [_TIMES[i % 2] / rate for i, rate in enumerate(rates)])


def _joint(model, k, y, flows, times):
    """Yield complaints about one joint flow."""
    there = back = y
    for flow, t in zip(flows, times, strict=True):
        there = flow.act(t, there)
    for flow, t in zip(reversed(flows), reversed(times), strict=True):
        back = flow.act(t, back)
    rest = protocol.most_joined(model) - len(times) + 1
    t, s, noted = times[0], (*times[1:], *[0.0] * rest), np.zeros(1)
    moved = protocol.joint_flow(model, k, t, s, y, NotedAngles(noted))
    if differ(moved, there, EXACT, y) or differ(moved, back, EXACT, y):
        yield f"joint_flow, k = {k}, is not the flow of the piece with those of its noises, in either order"
    if not noted[0] <= (said := protocol.joint_angle(model, k, t, s, y)) * (1.0 + 1e-9) and math.isfinite(noted[0]):
        problem = f"is {said:.3g} where joint_flow takes the sine of {noted[0]:.3g}; it must be no less"
        yield f"joint_angle, k = {k}, {problem}"


def _velocity(flow, y, rate):
    return derivative(lambda s: flow.act(s / rate, y)) * rate


def _one_flow(model, flow, y, rate):
    """Yield complaints about the angle method of a flow, and, if flows are exact, about the flow itself."""
    per_time = flow.noting(1e-3 / rate, y) * 1e3 * rate
    for t in [sign * angle / (per_time or rate) for angle in _ANGLES for sign in (1.0, -1.0)]:
        largest, said = flow.noting(t, y), flow.bound(t, y)
        if not largest <= said * (1.0 + 1e-9) and math.isfinite(largest):
            name = f"{flow.part}_angle, k = {flow.k},"
            yield f"{name} is {said:.3g} where {flow.part}_flow takes the sine of {largest:.3g}; it must be no less"
            break
    if protocol.exact_flows(model):
        yield from _exactness(model, flow, y, rate)


def _exactness(model, flow, y, rate):
    if differ(flow.act(0.0, y), y, EXACT):
        yield f"{flow} at t = 0 does not leave the state as it is"
    s, t = (time / rate for time in _TIMES)
    there = flow.act(t, y)
    if not all(map(math.isfinite, there)):
        yield f"{flow} is not finite at t = {t:.3g}, y = {shown(y)}"
        return
    if differ(flow.act(s, there), flow.act(s + t, y), EXACT, there, y):
        yield f"{flow} is not a flow: flows by t and then s differ from the flow by t + s"
        return
    yield from _preserved(model, flow, y, t, there)


def _preserved(model, flow, y, t, there):
    units = unit_vectors(len(y))
    before, after = (matrix_of([protocol.structure(model, z, e) for e in units]) for z in (y, there))
    columns = zip(*(derivatives_along(lambda z: flow.act(t, z), y, e) for e in units), strict=True)
    if all(_changes(np.array([changed for changed, _ in both]).T, before, after) for both in columns):
        yield f"{flow} is not a Poisson map: it changes the structure"
    sizes = [protocol.casimirs(model, tuple(np.abs(z).tolist())) for z in (y, there)]
    for c, (was, now) in enumerate(zip(protocol.casimirs(model, y), protocol.casimirs(model, there), strict=True)):
        if differ(was, now, EXACT, *(size[c] for size in sizes)):
            yield f"{flow} does not keep casimirs, number {c}"


def _changes(jacobian, before, after):
    """Whether a map with this Jacobian matrix does not take the structure matrix `before` to `after`."""
    return differ(jacobian @ before @ jacobian.T, after, DIFFERENCES, np.linalg.norm(jacobian) ** 2 * before)


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
        yield tuple((y * np.exp(z) if protocol.populations(model) else y + size * z).tolist())


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
        keeps.append(np.dot(e, y) != 0.0 and not np.any(protocol.structure(model, without, e)))
    return keeps


def _moved(y, model, gradients, least):
    """A state on the surface, the first of several that are nearer and nearer to y where all is finite.

    Components have the sign of those of y, and are at least as large as `least`.
    """
    start = np.array(y, float)
    if not any(np.any(protocol.structure(model, y, tuple(g.tolist()))) for g in gradients):
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
    """State moved by the share `part` of its size along the field of a linear function, by Runge-Kutta steps."""

    gradient = tuple(gradient.tolist())

    def field(z):
        return np.array(protocol.structure(model, tuple(z.tolist()), gradient))

    slopes = [protocol.structure_derivative(model, tuple(y.tolist()), e, gradient) for e in unit_vectors(len(y))]
    size = np.linalg.norm(y)
    # near a rest point the steps stay stable
    speed = max(np.linalg.norm(field(y)), np.linalg.norm(slopes) * size / _STEPS)
    h = part * size / speed / _STEPS if speed else 0.0
    return runge_kutta(field, y, h, _STEPS)


def check_model(record, states, written=True, finite_at=()):
    """Complaints about a model at the first of some states with any: sentences that name the method and k.

    `written`: whether a person wrote its class, so that methods may fail to compile.  `finite_at`: states at which its
    functions must be finite, but need not be smooth.
    """
    if written and (wrong := obstacle(record)):
        return [wrong]
    with uncompiled(), np.errstate(all="ignore"):
        at_points = (_complaints(record, y, (_shapes,)) for y in finite_at)
        return next(filter(None, itertools.chain(at_points, (_complaints(record, y) for y in states))), [])


def _complaints(model, y, all_checks=None):
    """Complaints of the first check that has any at one state; later checks depend on earlier ones."""
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
    if (count := len(protocol.casimirs(model, y))) != protocol.conserved(model):
        yield f"casimirs has {count} functions and conserved is {protocol.conserved(model)}; they must agree"
    if not all(
        map(
            math.isfinite,
            (*protocol.structure(model, y, y), *protocol.drift_gradient(model, y), protocol.hamiltonian(model, y)),
        )
    ):
        yield f"structure, drift_gradient or hamiltonian is not finite at y = {shown(y)}"
    for k in range(protocol.noises(model)):
        if not all(map(math.isfinite, protocol.noise_gradient(model, k, y))):
            yield f"noise_gradient, k = {k}, is not finite at y = {shown(y)}"


def _structure(model, y):
    units = unit_vectors(len(y))
    B = matrix_of([protocol.structure(model, y, e) for e in units])
    if differ(B, -B.T, EXACT):
        yield "structure is not skew: v . B(y) w must be -w . B(y) v"
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if differ(protocol.structure(model, y, v), B @ v, EXACT, B @ np.abs(v)):
        yield "structure is not linear in v"
    if cross_product(model) and differ(protocol.structure(model, y, v), np.cross(y, v), EXACT, B @ np.abs(v)):
        yield "structure is not y x v, as structure_is_cross_product or axis_inertias says"
    derivatives = np.array([matrix_of([protocol.structure_derivative(model, y, e, w) for w in units]) for e in units])
    for i, e in enumerate(units):
        if differ_from_derivative(
            derivatives[i], lambda z: matrix_of([protocol.structure(model, z, w) for w in units]), y, e
        ):
            yield "structure_derivative is not the derivative of structure along u"
            return
    terms = np.einsum("il,ljk->ijk", B, derivatives)  # sum_l B_il d_l B_jk
    if differ(terms + terms.transpose(1, 2, 0), -terms.transpose(2, 0, 1), EXACT, terms):
        yield "structure violates Jacobi's identity"
    yield from _casimirs(model, y, B, units)


def _casimirs(model, y, B, units):
    for c in range(protocol.conserved(model)):
        slopes = (derivatives_along(lambda z, c=c: protocol.casimirs(model, z)[c], y, e) for e in units)
        if all(_moves(B, both) for both in zip(*slopes, strict=True)):
            yield f"casimirs, number {c}, is not a Casimir function: structure(its gradient) is not 0"


def _moves(B, slopes):
    """Whether a gradient is not that of a Casimir function; `slopes`: its components, each with its rounding error."""
    gradient, sizes = map(np.array, zip(*slopes, strict=True))
    return differ(B @ gradient, 0.0 * gradient, DIFFERENCES, np.linalg.norm(B) * gradient, sizes)


def _gradients(model, y):
    for e, slope in zip(unit_vectors(len(y)), protocol.drift_gradient(model, y), strict=True):
        if differ_from_derivative(slope, partial(protocol.hamiltonian, model), y, e, protocol.drift_gradient(model, y)):
            yield "drift_gradient is not the gradient of hamiltonian"
            break
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    yield from _hessian(
        "drift", "", partial(protocol.drift_gradient, model), partial(protocol.drift_hessian, model), y, v
    )
    for k in protocol.inexact_pieces(model):
        gradient, hessian = partial(protocol.piece_gradient, model, k), partial(protocol.piece_hessian, model, k)
        yield from _hessian("piece", f", k = {k},", gradient, hessian, y, v)
    for k in range(protocol.noises(model)):
        gradient, hessian = partial(protocol.noise_gradient, model, k), partial(protocol.noise_hessian, model, k)
        yield from _hessian("noise", f", k = {k},", gradient, hessian, y, v)
        for w in (gradient(y), hessian(y, v)):
            if differ(protocol.noise_structure(model, k, y, w), protocol.structure(model, y, w), EXACT):
                yield f"noise_structure, k = {k}, differs from structure for a gradient of the noise"
            changed = protocol.structure_derivative(model, y, v, w)
            if differ(protocol.noise_structure_derivative(model, k, y, v, w), changed, EXACT):
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
    if answers(protocol.lie_bracket, model):
        yield from _lie_bracket(model, y, v)
    if answers(protocol.noise_bracket_gradient, model):
        yield from _bracket_gradients(model, y, v)
    if answers(protocol.bracket_factors, model):
        yield from _bracket_factors(model, y)


def _lie_bracket(model, y, v):
    moved = np.array([protocol.structure(model, e, v) for e in unit_vectors(len(y))])
    if not lie_poisson(model) or differ(protocol.lie_bracket(model, v, y), moved @ y, 1e-9, moved):
        yield "lie_bracket is not the gradient of w . structure(y, v), a function that is linear in y"


def _bracket_gradients(model, y, v):
    for k, j in itertools.combinations(range(protocol.noises(model)), 2):
        slope = np.dot(v, protocol.noise_bracket_gradient(model, j, k, y))
        if differ_from_derivative(slope, partial(_bracket, model, j, k), y, v, *_sizes(model, j, k, y)):
            yield f"noise_bracket_gradient, j = {j}, k = {k}, is not the gradient of grad Ĥ_j . B grad Ĥ_k"


def _bracket_factors(model, y):
    pairs = itertools.combinations(range(protocol.noises(model)), 2)
    numbers = dict(zip(pairs, protocol.bracket_factors(model), strict=True))
    for first, second in itertools.combinations(numbers, 2):
        a, b = (_bracket(model, j, k, y) for k, j in (first, second))
        sizes = [np.linalg.norm(size) for k, j in (first, second) for size in _sizes(model, j, k, y)]
        if differ(a * numbers[second], b * numbers[first], 1e-9, *(n * x for n in numbers.values() for x in sizes)):
            yield f"bracket_factors: the brackets of the pairs {first} and {second} are no such multiples"


def _bracket(model, j, k, y):
    """{Ĥ_j, Ĥ_k}."""
    return np.dot(protocol.noise_gradient(model, j, y), noise_field(model, k, y))


def _sizes(model, j, k, y):
    """Vectors as large as the terms of the derivative of :func:`_bracket`."""
    return protocol.noise_gradient(model, j, y), noise_field(model, k, y)


# ---------------------------------------------------------------------------------------------------------------------
# The generic checks of a model that is no part of this package are made once; files record which have passed.
# ---------------------------------------------------------------------------------------------------------------------

_PASSED: set[tuple[type, str]] = set()  # in this process: a class, and the digest of numbers and an initial state


@cache
def _digest_of_checks():
    """A digest of the code of the checks, so that models are checked again when it changes."""
    return digest_of(sources("checks", "compiler", "ensemble", "numerics"))


def check_once(record, initial):
    """Complaints of :func:`check_model` about a foreign model near an initial state.

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
    count = 2 if protocol.dimension(record) <= 12 else 1
    own = protocol.generated(cls)
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


def undefined(model, y):
    """Where a generated model is not finite, ``(0, 1), where H is not finite``; "" if that is not at the state y."""
    parts = {"H": protocol.hamiltonian, "the gradient of H": protocol.drift_gradient}
    parts["the bracket"] = lambda model, y: protocol.structure(model, y, y)
    for k in range(protocol.noises(model)):
        parts[f"the gradient of noise {k + 1}"] = lambda model, y, k=k: protocol.noise_gradient(model, k, y)
    with uncompiled(), np.errstate(all="ignore"):
        what = next((name for name, part in parts.items() if not _is_finite(part, model, y)), "")
    return what and f"{shown(y)}, where {what} is not finite"


def _is_finite(part, model, y):
    try:
        return bool(np.isfinite(part(model, y)).all())
    except (ArithmeticError, ValueError):
        return False


def _moving(record):
    """A generated model at a time at which none of its functions of time vanishes, as one may at the beginning."""
    if not answers(protocol.frozen, record):
        return record
    with uncompiled(), np.errstate(all="ignore"):
        at = [protocol.frozen(record, begin, 0.0) for begin in (0.618, 1.7, 2.9, 0.1)]
    tuples = [k for k, field in enumerate(record) if isinstance(field, tuple)]
    moving = [(k, n) for k in tuples for n in range(len(record[k])) if len({model[k][n] for model in at}) > 1]
    return max(at, key=lambda model: min((abs(model[k][n]) for k, n in moving), default=0.0))


def _passed(path):
    """Digests of numbers and states that a file says have passed."""
    with contextlib.suppress(OSError, ValueError):
        return set(path.read_text(encoding="ascii").split())
    return set()
