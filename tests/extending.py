"""A system and a composition that are not in the package: the examples of CONTRIBUTING.md, for test_extending.py."""

from typing import Annotated, NamedTuple

from spi.ensemble.protocol import NonNegative
from spi.models import register_model
from spi.schemes import register_scheme
from spi.schemes.splitting import splitting
from spi.schemes.stages import flows


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


def register():
    """Make both known, a line each."""
    register_model("oscillator", Oscillator)
    register_scheme(
        "splitting_noise_amid",
        record=splitting(flows("drift", "backwards", 1 / 2), flows("noise"), flows("drift", "forwards", 1 / 2)),
        label="splitting, noise amid",
        formula="z = D* N D y, the drift in halves around the noise, in opposite orders",
        reference="CONTRIBUTING.md",
        look=("<", "#000000"),
        strong_order=0.5,
        strong_order_commuting=1.0,
        weak_order=1.0,
        preserves="Casimirs, Poisson structure",
    )
