"""Operations of generated models that vectorise."""

from spi.compiler.dispatch import device


@device
def times(c: float, rest: float, x: float) -> float:
    """A number of two parts times x."""
    return c * x + rest * x


@device
def larger(a: float, b: float) -> float:
    """Larger of two numbers; a choice, because a maximum of floats is not vectorised."""
    return a if a > b else b
