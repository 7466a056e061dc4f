"""The heavy top of Lagrange in the body frame, with noise in the weight and in one momentum."""

from typing import Annotated, NamedTuple

from spi.compiler.dispatch import device
from spi.ensemble.protocol import NonNegative, Positive
from spi.numerics.angles import sin_versine


@device
def turned(k, theta, y, angles):
    """(y1, y2, y3) turned by theta about axis k, as the rigid body turns."""
    s, v = sin_versine(angles, theta)
    a, b, c = y
    if k == 0:
        return a, b + (s * c - v * b), c - (s * b + v * c)
    if k == 1:
        return a - (s * c + v * a), b, c + (s * a - v * c)
    return a + (s * b - v * a), b - (s * a + v * b), c


@device
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


class HeavyTop(NamedTuple):
    """B of se(3): y = (P, G), H = sum_k P_k^2 / (2 I_k) + weight G_3, noises G_3 and P_1."""

    inertia: Annotated[tuple[Positive, Positive, Positive], "moments of inertia"]
    weight: float = 1.0
    sigma: Annotated[tuple[NonNegative | None, NonNegative | None], "strengths of the noises"] = (0.5, 0.5)

    dimension = 6
    pieces = 4
    noises = 2
    conserved = 2

    def drift_angle(model, k, t, y):
        return 0.0 if k == 3 else abs(t * y[k] / model.inertia[k])

    def drift_flow(model, k, t, y, angles):
        if k == 3:
            return y[0] + t * model.weight * (y[4]), y[1] - t * model.weight * y[3], y[2], y[3], y[4], y[5]
        theta = t * y[k] / model.inertia[k]
        P, G = turned(k, theta, (y[0], y[1], y[2]), angles), turned(k, theta, (y[3], y[4], y[5]), angles)
        return P[0], P[1], P[2], G[0], G[1], G[2]

    def noise_angle(model, k, t, y):
        return abs(t) if k == 1 else 0.0

    def noise_flow(model, k, t, y, angles):
        if k == 0:
            return y[0] + t * y[4], y[1] - t * y[3], y[2], y[3], y[4], y[5]
        P, G = turned(0, t, (y[0], y[1], y[2]), angles), turned(0, t, (y[3], y[4], y[5]), angles)
        return P[0], P[1], P[2], G[0], G[1], G[2]

    def structure(model, y, v):
        P, G, p, g = (y[0], y[1], y[2]), (y[3], y[4], y[5]), (v[0], v[1], v[2]), (v[3], v[4], v[5])
        a, b, c = cross(P, p), cross(G, g), cross(G, p)
        return a[0] + b[0], a[1] + b[1], a[2] + b[2], c[0], c[1], c[2]

    def casimirs(model, y):
        return y[3] * y[3] + y[4] * y[4] + y[5] * y[5], y[0] * y[3] + y[1] * y[4] + y[2] * y[5]

    def hamiltonian(model, y):
        i = model.inertia
        return 0.5 * (y[0] * y[0] / i[0] + y[1] * y[1] / i[1] + y[2] * y[2] / i[2]) + model.weight * y[5]

    def drift_gradient(model, y):
        i = model.inertia
        return y[0] / i[0], y[1] / i[1], y[2] / i[2], 0.0, 0.0, model.weight

    def drift_hessian(model, y, v):
        i = model.inertia
        return v[0] / i[0], v[1] / i[1], v[2] / i[2], 0.0, 0.0, 0.0

    def noise_gradient(model, k, y):
        return (0.0, 0.0, 0.0, 0.0, 0.0, 1.0) if k == 0 else (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)

    def noise_hessian(model, k, y, v):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
