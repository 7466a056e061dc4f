"""The mean divergence of a flow at a temperature, which is the sum of its Lyapunov exponents."""

import numpy as np

from ..ensemble.protocol import drift_gradient, hamiltonian, noise_gradient, noise_indices, strengths, structure
from .surfaces import spheres

_NODES = 96  # of the height on the sphere, and of the longitude


def mean_divergence(model, temperature, point):
    """-(1/(2 T^2)) sum_k sigma_k^2 E (X_k H)^2 under the Gibbs law exp(-H/T) on the Casimir surface through a state.

    X_k = B grad Ĥ_k; `model` is that without friction.  On one sphere, by quadrature with Gauss' nodes in height and
    even ones in the longitude; None where the surface is no single sphere, or what is there depends on time.
    """
    surface = spheres(model, point)
    if surface is None or len(surface.triples) > 1 or hasattr(model, "time"):
        return None
    height, weight = np.polynomial.legendre.leggauss(_NODES)
    turn = 2 * np.pi * np.arange(_NODES) / _NODES
    z, phi = (one.ravel() for one in np.meshgrid(height, turn, indexing="ij"))
    x = np.zeros((len(surface.point), z.size))
    radius = np.sqrt(1 - z * z)
    x[list(surface.triples[0])] = radius * np.cos(phi), radius * np.sin(phi), z
    y = tuple(surface.onto(x))
    exponent = -hamiltonian(model, y) / temperature + 0.0 * z
    density = np.repeat(weight, _NODES) * np.exp(exponent - exponent.max())
    gradient, rates = drift_gradient(model, y), np.zeros_like(z)
    for k in noise_indices(model):
        field = structure(model, y, noise_gradient(model, k, y))
        rates += (strengths(model)[k] * sum(a * b for a, b in zip(gradient, field, strict=True))) ** 2
    return float(-(density @ rates) / density.sum() / (2 * temperature**2))
