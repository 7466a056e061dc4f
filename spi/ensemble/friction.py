"""What a model at a temperature is asked: the friction that goes with its noises, see docs/temperature.md.

With X_k = B grad Ĥ_k the equation has the fields -c_k (X_k H) X_k besides, c_k = sigma_k^2 / (2 T).  Along such a field
the state moves as exp(s(t) X_k) y with s' = -c_k g'(s), g(s) = H(exp(s X_k) y), so that the flow of the noise serves.
"""

from ..compiler.dispatch import method, trait


@trait(bool, default=False)
def has_friction(model):
    """Whether noises have friction with them."""


@method(optional=True)
def friction_time(model, k, t, y):
    """s(t): exp(s(t) X_k) y is what friction along noise k makes of y in the time t."""
