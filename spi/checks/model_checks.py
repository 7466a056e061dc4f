"""What the methods of every model must satisfy, checked in plain Python at some states: the generic checks.

Derivatives are central differences of eighth order, compared with the sizes of what they are made of, so that
rotations, exponentials and shears, with rates large or small, are all judged alike.
"""

import inspect
import itertools
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.fields import cross_product
from ..ensemble.protocol import (
    casimirs,
    commuting_noises,
    conserved,
    dimension,
    drift_angle,
    drift_flow,
    drift_gradient,
    drift_hessian,
    exact_flows,
    hamiltonian,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_structure,
    noise_structure_derivative,
    noises,
    pieces,
    structure,
    structure_derivative,
)
from .compilable import obstacle
from .differences import DIFFERENCES, derivative, derivatives_along, differ, differ_from_derivative, size_of

_EXACT = 1e-9  # relative: of what is equal but for roundings
_TIMES = (0.3, -0.9)  # of flows, in units of the time in which they move a state by its own size
_ANGLES = (
    2.0**-6,
    0.7,
    30.0,
)  # at which angle methods are compared: below each of the bounds for cheaper sines, and above


class NotedAngles(NamedTuple):
    """Takes every angle, and keeps in its one entry the largest modulus of those it is given."""

    largest: np.ndarray

    def sin_versine(angles, x):
        angles.largest[0] = max(angles.largest[0], abs(x))
        return math.sin(x), 2.0 * math.sin(0.5 * x) ** 2

    def sinc_versinc(angles, square):
        s, v = NotedAngles.sin_versine(angles, x := math.sqrt(square))
        return (s / x - 1.0, v / square) if square else (0.0, 0.5)

    def adding_to_zero(angles, p0, p1, p2):
        angles.largest[0] = max(angles.largest[0], abs(p0), abs(p1), abs(p2))
        return p0, p1, p2


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
    for checks in all_checks or (_shapes, _structure, _gradients, _flows, _commuting):
        try:
            found = list(checks(model, y))
        except Exception as error:
            place = inspect.trace()[-1]
            found = [
                f"{place.function}, line {place.lineno}, raises {type(error).__name__} at y = {_shown(y)}: {error}"
            ]
        if found:
            return found
    return []


def _shown(y):
    return "(" + ", ".join(f"{x:.6g}" for x in y[:8]) + ", ..." * (len(y) > 8) + ")"


def _matrix(columns):
    return np.array(columns, float).T


def _unit_vectors(model):
    return [tuple(row) for row in np.eye(dimension(model)).tolist()]


# ---------------------------------------------------------------------------------------------------------------------
# The checks
# ---------------------------------------------------------------------------------------------------------------------


def _shapes(model, y):
    if (count := len(casimirs(model, y))) != conserved(model):
        yield f"casimirs has {count} functions and conserved is {conserved(model)}; they must agree"
    if not all(map(math.isfinite, (*structure(model, y, y), *drift_gradient(model, y), hamiltonian(model, y)))):
        yield f"structure, drift_gradient or hamiltonian is not finite at y = {_shown(y)}"
    for k in range(noises(model)):
        if not all(map(math.isfinite, noise_gradient(model, k, y))):
            yield f"noise_gradient, k = {k}, is not finite at y = {_shown(y)}"


def _structure(model, y):
    units = _unit_vectors(model)
    B = _matrix([structure(model, y, e) for e in units])
    if differ(B, -B.T, _EXACT):
        yield "structure is not skew: v . B(y) w must be -w . B(y) v"
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if differ(structure(model, y, v), B @ v, _EXACT, B @ np.abs(v)):
        yield "structure is not linear in v"
    if cross_product(model) and differ(structure(model, y, v), np.cross(y, v), _EXACT, B @ np.abs(v)):
        yield "structure is not y x v, as axis_inertias says"
    derivatives = np.array([_matrix([structure_derivative(model, y, e, w) for w in units]) for e in units])
    for i, e in enumerate(units):
        if differ_from_derivative(derivatives[i], lambda z: _matrix([structure(model, z, w) for w in units]), y, e):
            yield "structure_derivative is not the derivative of structure along u"
            return
    terms = np.einsum("il,ljk->ijk", B, derivatives)  # sum_l B_il d_l B_jk
    if differ(terms + terms.transpose(1, 2, 0), -terms.transpose(2, 0, 1), _EXACT, terms):
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
    for e, slope in zip(_unit_vectors(model), drift_gradient(model, y), strict=True):
        if differ_from_derivative(slope, lambda z: hamiltonian(model, z), y, e, drift_gradient(model, y)):
            yield "drift_gradient is not the gradient of hamiltonian"
            break
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    yield from _hessian("drift", "", lambda z: drift_gradient(model, z), lambda z, w: drift_hessian(model, z, w), y, v)
    for k in range(noises(model)):
        gradient, hessian = lambda z, k=k: noise_gradient(model, k, z), lambda z, w, k=k: noise_hessian(model, k, z, w)
        yield from _hessian("noise", f", k = {k},", gradient, hessian, y, v)
        for w in (gradient(y), hessian(y, v)):
            if differ(noise_structure(model, k, y, w), structure(model, y, w), _EXACT):
                yield f"noise_structure, k = {k}, differs from structure for a gradient of the noise"
            changed = structure_derivative(model, y, v, w)
            if differ(noise_structure_derivative(model, k, y, v, w), changed, _EXACT):
                yield f"noise_structure_derivative, k = {k}, differs from structure_derivative for such a gradient"


def _hessian(part, number, gradient, hessian, y, v):
    """Whether a method is the derivative of a gradient, which is one indeed if that is symmetric."""
    if differ_from_derivative(hessian(y, v), gradient, y, v):
        yield f"{part}_hessian{number} is not the derivative of {part}_gradient along v"
        return
    matrix = _matrix([hessian(y, tuple(e)) for e in np.eye(len(y)).tolist()])
    if differ(matrix, matrix.T, _EXACT):
        yield f"{part}_gradient{number} is the gradient of no function: {part}_hessian is not symmetric"


class _Flow(NamedTuple):
    """The flow of one piece or noise, with its number."""

    part: str
    k: int
    act: Callable  #: (t, y) -> the flow, which notes its angles
    bound: Callable  #: (t, y) -> what the angle method says
    noted: np.ndarray  #: of the angles since :meth:`noting` was called

    def noting(self, t, y):
        """The largest |angle| whose sine the flow takes."""
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


def _flows_of(model, part, count, flow, angle):
    for k in range(count):
        noted = np.zeros(1)
        yield _Flow(
            part,
            k,
            lambda t, y, k=k, noted=noted: flow(model, k, t, y, NotedAngles(noted)),
            lambda t, y, k=k: angle(model, k, t, y),
            noted,
        )


def _flows(model, y):
    field = structure(model, y, drift_gradient(model, y))
    total, size = np.zeros(len(y)), 0.0
    for flow in _flows_of(model, "drift", pieces(model), drift_flow, drift_angle):
        rate = flow.rate(y, field)
        total, size = total + _velocity(flow, y, rate), max(size, size_of(y) * rate)
        yield from _one_flow(model, flow, y, rate)
    if differ(total, field, DIFFERENCES, 1e-6 * size):
        yield "drift_flow: its derivatives at t = 0, added up over k, are not structure(drift_gradient)"
    for flow in _flows_of(model, "noise", noises(model), noise_flow, noise_angle):
        field = structure(model, y, noise_gradient(model, flow.k, y))
        rate = flow.rate(y, field)
        if differ(_velocity(flow, y, rate), field, DIFFERENCES, 1e-6 * size_of(y) * rate):
            yield f"{flow} does not solve its equation: its derivative at t = 0 is not structure(noise_gradient)"
        yield from _one_flow(model, flow, y, rate)


def _commuting(model, y):
    """That the noises which are said to commute do."""
    flows = list(_flows_of(model, "noise", noises(model), noise_flow, noise_angle))
    for pair in commuting_noises(model):
        if pair not in itertools.combinations(range(len(flows)), 2):
            yield f"commuting_noises has {pair}, which is not a pair (k, l) of noises with 0 <= k < l < {len(flows)}"
            continue
        first, second = (flows[k] for k in pair)
        s, t = (
            time / flow.rate(y, structure(model, y, noise_gradient(model, flow.k, y)))
            for time, flow in zip(_TIMES, (first, second), strict=True)
        )
        there, back = first.act(s, second.act(t, y)), second.act(t, first.act(s, y))
        if differ(there, back, _EXACT, y):
            yield f"commuting_noises has {pair}, but their flows do not commute"


def _velocity(flow, y, rate):
    return derivative(lambda s: flow.act(s / rate, y)) * rate


def _one_flow(model, flow, y, rate):
    """The angle method of a flow; and if flows are exact, that it is the flow of a Poisson system."""
    per_time = flow.noting(1e-3 / rate, y) * 1e3 * rate
    for t in [sign * angle / (per_time or rate) for angle in _ANGLES for sign in (1.0, -1.0)]:
        largest, said = flow.noting(t, y), flow.bound(t, y)
        if not largest <= said * (1.0 + 1e-9) and math.isfinite(largest):
            name = f"{flow.part}_angle, k = {flow.k},"
            yield f"{name} is {said:.3g} where {flow.part}_flow takes the sine of {largest:.3g}; it must be no less"
            break
    if exact_flows(model):
        yield from _exactness(model, flow, y, rate)


def _exactness(model, flow, y, rate):
    if differ(flow.act(0.0, y), y, _EXACT):
        yield f"{flow} at t = 0 does not leave the state as it is"
    s, t = (time / rate for time in _TIMES)
    there = flow.act(t, y)
    if not all(map(math.isfinite, there)):
        yield f"{flow} is not finite at t = {t:.3g}, y = {_shown(y)}"
        return
    if differ(flow.act(s, there), flow.act(s + t, y), _EXACT, there, y):
        yield f"{flow} is not a flow: flows by t and then s differ from the flow by t + s"
        return
    units = _unit_vectors(model)
    before, after = (_matrix([structure(model, z, e) for e in units]) for z in (y, there))
    columns = zip(*(derivatives_along(lambda z: flow.act(t, z), y, e) for e in units), strict=True)
    if all(_changes(np.array([changed for changed, _ in both]).T, before, after) for both in columns):
        yield f"{flow} is not a Poisson map: it changes the structure"
    sizes = [casimirs(model, tuple(np.abs(z).tolist())) for z in (y, there)]
    for c, (was, now) in enumerate(zip(casimirs(model, y), casimirs(model, there), strict=True)):
        if differ(was, now, _EXACT, *(size[c] for size in sizes)):
            yield f"{flow} does not keep casimirs, number {c}"


def _changes(jacobian, before, after):
    """Whether a map with this Jacobian matrix makes another structure of that before it than the one behind it."""
    return differ(jacobian @ before @ jacobian.T, after, DIFFERENCES, np.linalg.norm(jacobian) ** 2 * before)
