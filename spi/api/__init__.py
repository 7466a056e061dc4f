"""spi in Python: what ``import spi`` offers, see ``docs/python.md``."""

import warnings

from .. import CACHE_PROBLEM
from ..running import shipped
from .integrator import Integrator, increments
from .paths import expectations, trajectory
from .results import Results, load
from .running import run

__all__ = ["Integrator", "Results", "expectations", "experiments", "increments", "load", "run", "trajectory"]

if CACHE_PROBLEM:
    warnings.warn(f"{CACHE_PROBLEM}; compiled kernels cannot be saved for other processes", stacklevel=2)


def experiments() -> list[str]:
    """Names of the experiments that come with spi, which :func:`run` takes."""
    return shipped.names()
