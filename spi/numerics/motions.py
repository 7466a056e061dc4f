"""Functions that generated models call, besides the elementary functions."""

from ..compiler.dispatch import device
from .elementary import expm1


@device
def times(c: float, rest: float, x: float) -> float:
    """A number of two parts times x."""
    return c * x + rest * x


@device
def larger(a: float, b: float) -> float:
    """The larger of two numbers; a choice, because a maximum of floats is not vectorised."""
    return a if a > b else b


@device
def sinh_coshm1(x: float) -> tuple[float, float]:
    """(sinh x, cosh x - 1), to all digits also for small x."""
    e = expm1(abs(x))
    f = e / (1.0 + e)
    s = 0.5 * (e + f)
    return (s if x >= 0.0 else -s), 0.5 * e * f
