"""The mean divergence of a flow at a temperature, which is the sum of its Lyapunov exponents."""

from functools import partial

from ..ensemble.protocol import drift_gradient, noise_gradient, noise_indices, strengths, structure
from .gibbs import law_of
from .surfaces import at_states, spheres


def mean_divergence(model, temperature, point):
    """-(1/(2 T^2)) sum_k sigma_k^2 E (X_k H)^2 under the Gibbs law exp(-H/T) on the Casimir surface through a state.

    X_k = B grad Ĥ_k; `model` is that without friction.  None where the surface is no single sphere, what is there
    depends on time, or the law is not known, as that of H = log(y3).
    """
    surface = spheres(model, point)
    if surface is None or len(surface.triples) > 1 or hasattr(model, "time"):
        return None

    def rate(y):
        gradient = drift_gradient(model, y)
        fields = [structure(model, y, noise_gradient(model, k, y)) for k in noise_indices(model)]
        slopes = [sum(a * b for a, b in zip(gradient, field, strict=True)) for field in fields]
        return sum((sigma * slope) ** 2 for sigma, slope in zip(strengths(model), slopes, strict=True))

    try:
        return -law_of(model, point, temperature).expectation(partial(at_states, rate))[0] / (2 * temperature**2)
    except ValueError:
        return None
