"""The problem that all programs of ``peers.py`` solve, and what is asked of each of their schemes."""

import math
from collections.abc import Callable
from typing import NamedTuple

from spi.models import RigidBody

MODEL = RigidBody((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0))
INITIAL = (math.cos(1.1), 0.0, math.sin(1.1))
EXPONENTS = range(2, 11)  # the step sizes are 2^-k
REFERENCE = 16
PATHS = 1024  # for the errors
BATCH = {"spi": 4096, "diffrax": 1024, "torchsde": 4096}  # paths at once when timed: what is best for each


class Row(NamedTuple):
    """A scheme of a program."""

    program: str
    scheme: str
    final: Callable  #: final(dW): the last states (paths, 3) from increments (steps, 3, paths)
    work: Callable  #: work(n): integrate a batch in n steps
