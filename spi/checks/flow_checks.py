"""The generic checks of flows: against their fields, as flows of a Poisson system; and noises that commute."""

import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import answers
from ..ensemble.fields import noise_field, noise_field_derivative
from ..ensemble.protocol import (
    casimirs,
    commuting_noises,
    drift_angle,
    drift_flow,
    drift_gradient,
    exact_flows,
    inexact_noises,
    inexact_pieces,
    joint_angle,
    joint_flow,
    joint_noises,
    most_joined,
    noise_angle,
    noise_flow,
    noise_gradient,
    noises,
    piece_gradient,
    pieces,
    structure,
)

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
    """The line s -> y + s v."""
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
    """The derivative of f at y along v by steps from large to small, each with the size of its rounding errors.

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
    """The matrix with these columns."""
    return np.array(columns, float).T


def unit_vectors(d):
    """e_1, ..., e_d."""
    return [tuple(row) for row in np.eye(d).tolist()]


def shown(y):
    """A state in a message."""
    return "(" + ", ".join(f"{x:.6g}" for x in y[:8]) + ", ..." * (len(y) > 8) + ")"


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
    """The flow of one piece or noise, with its number."""

    part: str
    k: int
    act: Callable  #: (t, y) -> the flow, which notes its angles
    bound: Callable  #: (t, y) -> the bound of the angle method
    noted: np.ndarray  #: (1,) the largest |angle| since :meth:`noting` was called

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


#: part -> (number of flows, those that are not exact, flow, angle)
_PARTS = {
    "drift": (pieces, inexact_pieces, drift_flow, drift_angle),
    "noise": (noises, inexact_noises, noise_flow, noise_angle),
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
    field = structure(model, y, drift_gradient(model, y))
    fields = (structure(model, y, piece_gradient(model, k, y)) for k in inexact_pieces(model))
    total = sum(map(np.array, fields), np.zeros(len(y)))
    size = float(np.linalg.norm(total))
    for flow in _flows_of(model, "drift").values():
        rate = flow.rate(y, field)
        total, size = total + _velocity(flow, y, rate), max(size, size_of(y) * rate)
        yield from _one_flow(model, flow, y, rate)
    if differ(total, field, DIFFERENCES, 1e-6 * size):
        yield "drift_flow: its derivatives at t = 0, added up over k, are not structure(drift_gradient)"
    for flow in _flows_of(model, "noise").values():
        field = structure(model, y, noise_gradient(model, flow.k, y))
        rate = flow.rate(y, field)
        if differ(_velocity(flow, y, rate), field, DIFFERENCES, 1e-6 * size_of(y) * rate):
            yield f"{flow} does not solve its equation: its derivative at t = 0 is not structure(noise_gradient)"
        yield from _one_flow(model, flow, y, rate)


def commuting(model, y):
    """Yield complaints about noises that are declared to commute and whose fields do not, f_k' f_l = f_l' f_k."""
    m = noises(model)
    for pair in commuting_noises(model):
        if pair not in itertools.combinations(range(m), 2):
            yield f"commuting_noises has {pair}, which is not a pair (k, l) of noises with 0 <= k < l < {m}"
            continue
        there, back = (noise_field_derivative(model, j, y, noise_field(model, k, y)) for j, k in (pair, pair[::-1]))
        if differ(there, back, EXACT, y):
            yield f"commuting_noises has {pair}, but their fields do not commute"


def joint_flows(model, y):
    """Yield complaints about joint flows: each is that of a piece and then of its noises, in either order."""
    groups, listed = joint_noises(model), sum(joint_noises(model), ())
    if not groups:
        return
    if len(groups) > pieces(model) or len(set(listed)) < len(listed) or not set(listed) <= set(range(noises(model))):
        yield f"joint_noises is {groups}, which must be a tuple of numbers of noises for each piece, no noise twice"
        return
    if not (answers(joint_flow, model) and answers(joint_angle, model)):
        yield "joint_noises needs the methods joint_flow and joint_angle"
        return
    drift, noise = _flows_of(model, "drift"), _flows_of(model, "noise")
    for k, group in enumerate(groups):
        if group:
            flows = [drift[k], *(noise[j] for j in group)]
            fields = [drift_gradient(model, y), *(noise_gradient(model, j, y) for j in group)]
            rates = [flow.rate(y, structure(model, y, field)) for flow, field in zip(flows, fields, strict=True)]
            yield from _joint(model, k, y, flows, [_TIMES[i % 2] / rate for i, rate in enumerate(rates)])


def _joint(model, k, y, flows, times):
    """Yield complaints about one joint flow."""
    there = back = y
    for flow, t in zip(flows, times, strict=True):
        there = flow.act(t, there)
    for flow, t in zip(reversed(flows), reversed(times), strict=True):
        back = flow.act(t, back)
    rest = most_joined(model) - len(times) + 1
    t, s, noted = times[0], (*times[1:], *[0.0] * rest), np.zeros(1)
    moved = joint_flow(model, k, t, s, y, NotedAngles(noted))
    if differ(moved, there, EXACT, y) or differ(moved, back, EXACT, y):
        yield f"joint_flow, k = {k}, is not the flow of the piece with those of its noises, in either order"
    if not noted[0] <= (said := joint_angle(model, k, t, s, y)) * (1.0 + 1e-9) and math.isfinite(noted[0]):
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
    if exact_flows(model):
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
    units = unit_vectors(len(y))
    before, after = (matrix_of([structure(model, z, e) for e in units]) for z in (y, there))
    columns = zip(*(derivatives_along(lambda z: flow.act(t, z), y, e) for e in units), strict=True)
    if all(_changes(np.array([changed for changed, _ in both]).T, before, after) for both in columns):
        yield f"{flow} is not a Poisson map: it changes the structure"
    sizes = [casimirs(model, tuple(np.abs(z).tolist())) for z in (y, there)]
    for c, (was, now) in enumerate(zip(casimirs(model, y), casimirs(model, there), strict=True)):
        if differ(was, now, EXACT, *(size[c] for size in sizes)):
            yield f"{flow} does not keep casimirs, number {c}"


def _changes(jacobian, before, after):
    """Whether a map with this Jacobian matrix does not take the structure matrix `before` to `after`."""
    return differ(jacobian @ before @ jacobian.T, after, DIFFERENCES, np.linalg.norm(jacobian) ** 2 * before)
