"""Stochastic rigid body (Example 3 and section 4.2): y is the angular momentum in the body frame.

With three independent noises, and, for the paper's remark 4, with one Wiener process for all three.
"""

from typing import Annotated, NamedTuple

from ..compiler.dispatch import device
from ..ensemble.protocol import NonNegative, Positive, drift_hessian, noise_hessian
from ..numerics.angles import sin_versine

Positives = tuple[Positive, Positive, Positive]
Strengths = tuple[NonNegative | None, NonNegative | None, NonNegative | None]


@device
def rotate(k, theta, y, angles):
    """Turn y by the angle theta about axis k: for k = 0, y2 + i y3 is multiplied by exp(-i theta)."""
    s, v = sin_versine(angles, theta)
    y1, y2, y3 = y
    if k == 0:
        return y1, y2 + (s * y3 - v * y2), y3 - (s * y2 + v * y3)
    if k == 1:
        return y1 - (s * y3 + v * y1), y2, y3 + (s * y1 - v * y3)
    return y1 + (s * y2 - v * y1), y2 - (s * y1 + v * y2), y3


class RigidBody(NamedTuple):
    """B(y) v = y x v, H = sum_k y_k^2 / (2 I_k), Ĥ_k = y_k^2 / (2 Î_k), C(y) = |y|^2.

    The example in the paper's section 2 has Ĥ_k without the 2; its section 4, which this follows, has it.
    """

    inertia: Annotated[Positives, "moments of inertia I_1, I_2, I_3"]
    noise_inertia: Annotated[Positives, "moments of inertia Î_1, Î_2, Î_3 of the noise"]
    sigma: Annotated[Strengths, "strengths of the three noises; 0 switches one off"] = (1.0, 1.0, 1.0)

    equation = (
        r"B(y)\,v = y \times v, \quad H = \sum_k \frac{y_k^2}{2 I_k}, \quad "
        r"\widehat H_k = \frac{y_k^2}{2 \hat I_k}"
    )
    dimension = 3
    pieces = 3
    noises = 3
    conserved = 1
    casimir_degrees = (2,)
    squared_length_is_casimir = True
    flow_ns = 0.5
    joint_noises = ((0,), (1,), (2,))  # rotations about one axis

    def drift_angle(model, k, t, y):
        return abs(t * (1.0 / model.inertia[k]) * y[k])

    def noise_angle(model, k, t, y):
        return abs(t * (1.0 / model.noise_inertia[k]) * y[k])

    def drift_flow(model, k, t, y, angles):
        return rotate(k, t * (1.0 / model.inertia[k]) * y[k], y, angles)

    def noise_flow(model, k, t, y, angles):
        return rotate(k, t * (1.0 / model.noise_inertia[k]) * y[k], y, angles)

    def joint_angle(model, k, t, s, y):
        return abs((t * (1.0 / model.inertia[k]) + s[0] * (1.0 / model.noise_inertia[k])) * y[k])

    def joint_flow(model, k, t, s, y, angles):
        theta = (t * (1.0 / model.inertia[k]) + s[0] * (1.0 / model.noise_inertia[k])) * y[k]
        return rotate(k, theta, y, angles)

    def bracket_factors(model):
        a, b, c = model.noise_inertia
        return 1.0 / (a * b), -1.0 / (a * c), 1.0 / (b * c)  # of y1 y2 y3

    def structure(model, y, v):
        return y[1] * v[2] - y[2] * v[1], y[2] * v[0] - y[0] * v[2], y[0] * v[1] - y[1] * v[0]

    def casimirs(model, y):
        return (y[0] * y[0] + y[1] * y[1] + y[2] * y[2],)

    def hamiltonian(model, y):
        i = model.inertia
        return 0.5 * (y[0] * y[0] / i[0] + y[1] * y[1] / i[1] + y[2] * y[2] / i[2])

    def drift_gradient(model, y):
        return drift_hessian(model, y, y)

    def drift_hessian(model, y, v):
        i = model.inertia
        return v[0] * (1.0 / i[0]), v[1] * (1.0 / i[1]), v[2] * (1.0 / i[2])

    def noise_gradient(model, k, y):
        return noise_hessian(model, k, y, y)

    def noise_hessian(model, k, y, v):
        c = 1.0 / model.noise_inertia[k]
        return (v[0] * c if k == 0 else 0.0, v[1] * c if k == 1 else 0.0, v[2] * c if k == 2 else 0.0)

    def noise_bracket_gradient(model, j, k, y):
        """Gradient of y1 y2 y3 / (Î_j Î_k) if j = k + 1, and of minus that if j = k + 2."""
        c = (1.0 / model.noise_inertia[j]) * (1.0 / model.noise_inertia[k])
        c = c if j == k + 1 else -c
        return c * (y[1] * y[2]), c * (y[2] * y[0]), c * (y[0] * y[1])

    def axis_inertias(model):
        return model.inertia, model.noise_inertia


class RigidBodySharedNoise(NamedTuple):
    """As rigid_body, with the one noise Ĥ = sum_k y_k^2 / (2 Î_k); splitting is *not* consistent here.

    The flow of Ĥ is not known in closed form.  ``noise_flow`` composes the three rotations with one increment, as the
    remark does: it is not a flow, and the splitting scheme built on it converges to another equation.
    """

    inertia: Annotated[Positives, "moments of inertia I_1, I_2, I_3"]
    noise_inertia: Annotated[Positives, "moments of inertia Î_1, Î_2, Î_3 of the noise"]
    sigma: Annotated[tuple[NonNegative | None], "strength of the noise; 0 switches it off"] = (1.0,)

    equation = (
        r"B(y)\,v = y \times v, \quad H = \sum_k \frac{y_k^2}{2 I_k}, \quad "
        r"\widehat H = \sum_k \frac{y_k^2}{2 \hat I_k}"
    )
    dimension = 3
    pieces = 3
    noises = 1
    conserved = 1
    casimir_degrees = (2,)
    squared_length_is_casimir = True
    flow_ns = 0.5
    exact_flows = False

    # all that does not depend on the noise is the rigid body's
    drift_angle, drift_flow = RigidBody.drift_angle, RigidBody.drift_flow
    structure, casimirs = RigidBody.structure, RigidBody.casimirs
    hamiltonian = RigidBody.hamiltonian
    drift_gradient, drift_hessian = RigidBody.drift_gradient, RigidBody.drift_hessian
    noise_gradient = RigidBody.noise_gradient  # the product of the Hessian and y

    def noise_angle(model, k, t, y):
        """A bound, since the later rotations act on a state already rotated."""
        a, b, c = model.noise_inertia
        return abs(t) * max(1.0 / a, 1.0 / b, 1.0 / c) * (abs(y[0]) + abs(y[1]) + abs(y[2]))

    def noise_flow(model, k, t, y, angles):
        a, b, c = model.noise_inertia
        y = rotate(0, t * (1.0 / a) * y[0], y, angles)
        y = rotate(1, t * (1.0 / b) * y[1], y, angles)
        return rotate(2, t * (1.0 / c) * y[2], y, angles)

    def noise_hessian(model, k, y, v):
        a, b, c = model.noise_inertia
        return v[0] * (1.0 / a), v[1] * (1.0 / b), v[2] * (1.0 / c)
