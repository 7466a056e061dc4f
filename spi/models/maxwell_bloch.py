"""Stochastic Maxwell-Bloch system of laser-matter dynamics (Example 2 and section 4.1)."""

from typing import Annotated, NamedTuple

from ..ensemble.protocol import NonNegative, drift_angle, drift_flow
from ..numerics.angles import sin_versine


class MaxwellBloch(NamedTuple):
    """B(y) v = (y2 v3 - y3 v2, y3 v1, -y2 v1), H = y1^2/2 + y3 = Ĥ_1 + Ĥ_3, C(y) = (y2^2 + y3^2)/2.

    Pieces and noises are those of the paper's H_1 and H_3, Ĥ_1 and Ĥ_3; there is no number 2.
    """

    sigma: Annotated[
        tuple[NonNegative | None, NonNegative | None],
        "strengths sigma_1, sigma_3 of the two noises; 0 switches one off",
    ] = (1.0, 1.0)

    equation = (
        r"B(y)\,v = (y_2 v_3 - y_3 v_2,\; y_3 v_1,\; -y_2 v_1), \quad H = \widehat H_1 + \widehat H_3, "
        r"\quad \widehat H_1 = \frac{y_1^2}{2}, \quad \widehat H_3 = y_3"
    )
    dimension = 3
    pieces = 2
    noises = 2
    conserved = 1
    casimir_degrees = (2,)
    flow_ns = 0.5
    joint_noises = ((0,), (1,))

    def drift_angle(model, k, t, y):
        return abs(t * y[0]) if k == 0 else 0.0

    def drift_flow(model, k, t, y, angles):
        y1, y2, y3 = y
        if k == 1:
            return y1 + t * y2, y2, y3
        s, v = sin_versine(angles, t * y1)
        return y1, y2 + (s * y3 - v * y2), y3 - (s * y2 + v * y3)

    noise_angle, noise_flow = drift_angle, drift_flow  # since Ĥ_k = H_k

    def joint_angle(model, k, t, s, y):
        return drift_angle(model, k, t + s[0], y)

    def joint_flow(model, k, t, s, y, angles):
        return drift_flow(model, k, t + s[0], y, angles)

    def structure(model, y, v):
        return y[1] * v[2] - y[2] * v[1], y[2] * v[0], -y[1] * v[0]

    def noise_bracket_gradient(model, j, k, y):
        """Gradient of -y1 y2."""
        return -y[1], -y[0], 0.0

    def casimirs(model, y):
        return (0.5 * (y[1] * y[1] + y[2] * y[2]),)

    def hamiltonian(model, y):
        return 0.5 * y[0] * y[0] + y[2]

    def drift_gradient(model, y):
        return y[0], 0.0, 1.0

    def drift_hessian(model, y, v):
        return v[0], 0.0, 0.0

    def noise_gradient(model, k, y):
        return (y[0] if k == 0 else 0.0), 0.0, (0.0 if k == 0 else 1.0)

    def noise_hessian(model, k, y, v):
        return (v[0] if k == 0 else 0.0), 0.0, 0.0

    def rotation_shear_rates(model):
        return (1.0, 1.0), (1.0, 1.0)
