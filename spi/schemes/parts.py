"""The parts and orders of the stages of a composition: records, so that the compiler knows them by their types."""

from typing import NamedTuple

from ..compiler.dispatch import method
from ..ensemble.inexact import piece_gradient, piece_hessian
from ..ensemble.joint import bracket_angle, bracket_flow, joint_angle, joint_flow
from ..ensemble.long_flows import drift_phases, drift_turned, noise_phases, noise_turned
from ..ensemble.protocol import (
    drift_angle,
    drift_flow,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_structure,
    noise_structure_derivative,
    structure,
    structure_derivative,
)


@method
def flow(part, model, k, t, y, angles):
    """The flow number k of a part."""


@method
def angle(part, model, k, t, y):
    """The largest |angle| in it."""


@method
def phases_in(part, model, k, t, y):
    """The angles whose sines it takes, of a model that is asked for them."""


@method
def turned(part, model, k, s, y):
    """The same flow, given their sines and versines."""


@method
def gradient(part, model, k, y):
    """The gradient of the Hamiltonian of this flow, one without an exact flow."""


@method
def hessian(part, model, k, y, v):
    """Its Hessian times v."""


@method
def structure_along(part, model, k, y, v):
    """B(y) v for a v that is 0 wherever this gradient always is."""


@method
def structure_derivative_along(part, model, k, y, u, v):
    """(DB(y)[u]) v for such a v."""


class Drift(NamedTuple):
    """The flows of H_1, ..., H_p."""

    def flow(part, model, k, t, y, angles):
        return drift_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return drift_angle(model, k, t, y)

    def phases_in(part, model, k, t, y):
        return drift_phases(model, k, t, y)

    def turned(part, model, k, s, y):
        return drift_turned(model, k, s, y)

    def gradient(part, model, k, y):
        return piece_gradient(model, k, y)

    def hessian(part, model, k, y, v):
        return piece_hessian(model, k, y, v)

    def structure_along(part, model, k, y, v):
        return structure(model, y, v)

    def structure_derivative_along(part, model, k, y, u, v):
        return structure_derivative(model, y, u, v)


class Noise(NamedTuple):
    """The flows of Ĥ_1, ..., Ĥ_m; a noise that is off is left out."""

    def flow(part, model, k, t, y, angles):
        return noise_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return noise_angle(model, k, t, y)

    def phases_in(part, model, k, t, y):
        return noise_phases(model, k, t, y)

    def turned(part, model, k, s, y):
        return noise_turned(model, k, s, y)

    def gradient(part, model, k, y):
        return noise_gradient(model, k, y)

    def hessian(part, model, k, y, v):
        return noise_hessian(model, k, y, v)

    def structure_along(part, model, k, y, v):
        return noise_structure(model, k, y, v)

    def structure_derivative_along(part, model, k, y, u, v):
        return noise_structure_derivative(model, k, y, u, v)


class Joint(NamedTuple):
    """The flows of H_1, ..., H_p, each together with those of the noises of its family."""


class Together(NamedTuple):
    """What moves the lanes in a stage of joint flows; t = (time of the piece, times of its noises)."""

    time: float | None  #: of the piece; None where it differs from lane to lane
    count: NamedTuple  #: how many noises go with the piece, as one of INDICES
    most: NamedTuple  #: with any piece, likewise

    def flow(part, model, k, t, y, angles):
        return joint_flow(model, k, t[0], t[1], y, angles)

    def angle(part, model, k, t, y):
        return joint_angle(model, k, t[0], t[1], y)


class Friction(NamedTuple):
    """What friction does along the noises, see ``ensemble/friction.py``; nothing for a model without a temperature."""


class Loops(NamedTuple):
    """The loops of flows of pairs of noises that do not commute, see the head of this file."""


class Areas(NamedTuple):
    """The same by the fewest flows that are known, see the head of ``stages.py``."""


class Bracket(NamedTuple):
    """What moves the lanes where the bracket of two noises has an exact flow."""

    def flow(part, model, k, t, y, angles):
        return bracket_flow(model, k, t, y, angles)

    def angle(part, model, k, t, y):
        return bracket_angle(model, k, t, y)


class Forwards(NamedTuple):
    """1, ..., n."""

    def arranged(indices):
        """((k, share of the stage's fraction), ...), the first to act first; the same for the other orders."""
        return tuple((k, 1.0) for k in indices)


class Backwards(NamedTuple):
    """n, ..., 1."""

    def arranged(indices):
        return Forwards.arranged(indices)[::-1]


class Symmetric(NamedTuple):
    """1, ..., n - 1 with half the fraction, n, and n - 1, ..., 1 with half the fraction again."""

    def arranged(indices):
        halves = tuple((k, 0.5) for k in indices[:-1])
        return (*halves, *Forwards.arranged(indices[-1:]), *halves[::-1])


class Coin(NamedTuple):
    """The order is reversed for the paths whose coin is -1."""


class Shared(NamedTuple):
    """The noise flows have shares of the increment of the whole step."""


PARTS = {"drift": Drift(), "noise": Noise(), "friction": Friction(), "joint": Joint()}
PARTS |= {"loops": Loops(), "areas": Areas()}
ORDERS = {"forwards": Forwards(), "backwards": Backwards(), "symmetric": Symmetric()}
