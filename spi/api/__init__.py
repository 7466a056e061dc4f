"""spi in Python: what ``import spi`` offers, see ``docs/python.md``."""

from .. import shipped
from .expecting import expectations
from .paths import trajectory
from .results import Results, load
from .running import run

__all__ = ["Results", "expectations", "experiments", "load", "run", "trajectory"]


def experiments() -> list[str]:
    """The names of the experiments that come with spi, which :func:`run` takes."""
    return shipped.names()
