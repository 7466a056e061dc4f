"""Stochastic Lotka-Volterra system (the paper's first example, eq. (5)): a prey y1 and its predator y2.

It is not a Lie-Poisson system, B being quadratic, and has no Casimir function; the flows are explicit all the same and
keep both populations positive.
"""

from typing import Annotated, NamedTuple

from ..ensemble.protocol import NonNegative
from ..numerics.elementary import exp, log


class LotkaVolterra(NamedTuple):
    """B(y) = y1 y2 ((0, 1), (-1, 0)), H = (y1 - ln y1) + (y2 - 2 ln y2), one noise with Ĥ = -ln y1 + ln y2.

    H_1 = y1 - ln y1 moves y2 at the constant rate 1 - y1, H_2 = y2 - 2 ln y2 moves y1 at the rate y2 - 2, and the noise
    multiplies both by exp(W).
    """

    sigma: Annotated[tuple[NonNegative | None], "strength of the noise; 0 switches it off"] = (1.0,)

    dimension = 2
    pieces = 2
    noises = 1
    conserved = 0
    populations = True
    equation = (
        r"B(y) = y_1 y_2 \begin{pmatrix} 0 & 1 \\ -1 & 0 \end{pmatrix}, \quad "
        r"H = y_1 - \ln y_1 + y_2 - 2 \ln y_2, \quad \widehat H = \ln y_2 - \ln y_1"
    )
    flow_ns = 0.5

    def drift_flow(model, k, t, y, angles):
        if k == 0:
            return y[0], y[1] * exp(t * (1.0 - y[0]))
        return y[0] * exp(t * (y[1] - 2.0)), y[1]

    def noise_flow(model, k, t, y, angles):
        factor = exp(t)
        return y[0] * factor, y[1] * factor

    def structure(model, y, v):
        c = y[0] * y[1]
        return c * v[1], -c * v[0]

    def structure_derivative(model, y, u, v):
        c = u[0] * y[1] + y[0] * u[1]
        return c * v[1], -c * v[0]

    def casimirs(model, y):
        return ()

    def hamiltonian(model, y):
        return y[0] - log(y[0]) + y[1] - 2.0 * log(y[1])

    def drift_gradient(model, y):
        return 1.0 - 1.0 / y[0], 1.0 - 2.0 * (1.0 / y[1])

    def drift_hessian(model, y, v):
        return v[0] / (y[0] * y[0]), 2.0 * v[1] / (y[1] * y[1])

    def noise_gradient(model, k, y):
        return -(1.0 / y[0]), 1.0 / y[1]

    def noise_hessian(model, k, y, v):
        return v[0] / (y[0] * y[0]), -v[1] / (y[1] * y[1])
