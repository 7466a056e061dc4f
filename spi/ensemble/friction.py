"""What a model at a temperature is asked: the friction that goes with its noises, see docs/temperature.md.

With X_k = B grad Ĥ_k the equation has the fields -c_k (X_k H) X_k besides, c_k = sigma_k^2 / (2 T).  Along such a field
the state moves as exp(s(t) X_k) y with s' = -c_k g'(s), g(s) = H(exp(s X_k) y), so that the flow of the noise serves.
"""

from ..compiler.dispatch import device, method, trait
from .protocol import strengths


@trait(bool, default=False)
def has_friction(model):
    """Whether noises have friction with them."""


@method(optional=True)
def friction_time(model, k, t, y):
    """s(t): exp(s(t) X_k) y is what friction along noise k makes of y in the time t."""


@device
def friction_rate(model, k):
    """c_k = sigma_k^2 / (2 T) of a model at a temperature."""
    return strengths(model)[k] * strengths(model)[k] / (2.0 * model.temperature)


@device
def friction_after(c, t, slope, bend):
    """s(t) to order 2, given g' = slope and g'' = bend at s = 0; where g is quadratic s = s' t (1 - exp(-q)) / q.

    With s' = -c g' and q = c g'' t.  That quotient is taken as 1 / (1 + q/2 + q^2/12), which is right to third order,
    and never large: friction over long times, or near a maximum of g, is too weak, but cannot carry the state away.
    """
    q = c * t * bend
    return -c * t * slope / (1.0 + q * (0.5 + q * (1.0 / 12.0)))
