"""Expectations without sampling, on two-dimensional Casimir surfaces.

The backward operator of a splitting step, (P f)(y) = E f(y_1) given y_0 = y, is a product of operators f -> E f(flow),
one for each exact flow, and each of them is diagonal in a Fourier variable.  It is applied in the reverse order of the
flows.
"""

from .result import Expectations

__all__ = ["Expectations", "expectations", "limits"]


def expectations(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """E phi(y_N) of a splitting scheme at each step size, and E phi(y(T)) of the equation; an :class:`Expectations`.

    `compositions` is a step as ``schemes.splitting.compositions`` gives it; `functions` take an array y of shape (3, n)
    and return n values.  `accuracy` asks for an absolute numerical error.  ValueError for a model without a
    two-dimensional Casimir surface (class attribute ``surface``) that we know.
    """
    surface = getattr(type(model), "surface", None)
    if surface == "sphere":
        from .sphere import expectations as solve
    elif surface == "cylinder":
        from .cylinder import expectations as solve
    else:
        raise ValueError(f"no solver without sampling for {type(model).__name__}")
    return solve(model, compositions, initial, final_time, steps, functions, accuracy)


def limits(model, initial, final_time, functions, accuracy):
    """E phi(y(T)) of the equation for F functions, and its numerical error, two arrays (F,); no scheme is looked at.

    For models with the ``surface`` "sphere"; ValueError for others, where the limit is only known from schemes.
    """
    if getattr(type(model), "surface", None) != "sphere":
        raise ValueError(f"no limit without schemes for {type(model).__name__}")
    from .sphere import limits as solve

    return solve(model, initial, final_time, functions, accuracy)
