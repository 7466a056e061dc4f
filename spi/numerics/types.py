"""Types that all rooms share: arrays in annotations, what formulas may call, and their mistakes."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

Array = np.ndarray


class NumberError(ValueError):
    """A text is no number; the message says why in a few words, without a full stop."""


class FunctionFamily(NamedTuple):
    """Functions of the state that have a name and numbers as arguments, as E(3)."""

    member: Callable  #: of the numbers: a function of states (d, ...); NumberError where there is none
