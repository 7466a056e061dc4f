"""Sources of models that are no part of the package."""

#: The worked example of CONTRIBUTING.md as a file of its own.
OSCILLATOR = '''"""An oscillator with noise."""

from typing import Annotated, NamedTuple

from spi.protocol import NonNegative


class Oscillator(NamedTuple):
    """H = p^2/2 + q^2/2 in canonical variables y = (q, p), kicked by the noise Ĥ = q; B is constant."""

    sigma: Annotated[tuple[NonNegative | None], "strength of the kicks; 0 switches them off"] = (1.0,)

    dimension = 2
    pieces = 2
    noises = 1
    conserved = 0

    def drift_flow(model, k, t, y, angles):
        q, p = y
        return (q + t * p, p) if k == 0 else (q, p - t * q)

    def noise_flow(model, k, t, y, angles):
        return y[0], y[1] - t

    def structure(model, y, v):
        return v[1], -v[0]

    def structure_derivative(model, y, u, v):
        return 0.0 * v[0], 0.0 * v[1]

    def casimirs(model, y):
        return ()

    def hamiltonian(model, y):
        return 0.5 * (y[0] * y[0] + y[1] * y[1])

    def drift_gradient(model, y):
        return y

    def drift_hessian(model, y, v):
        return v

    def noise_gradient(model, k, y):
        return 1.0, 0.0

    def noise_hessian(model, k, y, v):
        return 0.0 * v[0], 0.0 * v[1]
'''
