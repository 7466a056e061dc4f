"""Path sets of an answer by name, and their numbers.

A scheme has a path set of each role at each level, and all of them in the order of schemes, roles and levels have the
numbers 0, 1, ...  So numbers of samples and costs, arrays (schemes, roles, levels), are laid out like the numbers, and
a :class:`SetOf` is an index of such an array.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np

from spi.numerics.rng import PATH_SETS

from .keys import FINEST

LEVELS = FINEST + 1  #: levels 0, ..., FINEST


class Role(IntEnum):
    """What is sampled on the paths of a set, in the order of their numbers."""

    DIFFERENCES = 0  #: Y_l, of a step and the one twice as large; that of level 0 is never wanted
    VALUES = 1  #: P_l, of one step alone
    POINTS = 2  #: P_l along quasi-random points
    REFERENCE = 3  #: differences from the reference scheme on the same noise


SETS = len(Role) * LEVELS  #: path sets of a scheme


class SetOf(NamedTuple):
    """A path set: of which scheme, in which role, at which level."""

    scheme: int
    role: Role
    level: int

    @classmethod
    def of(cls, number: int) -> "SetOf":
        """Path set that has a number."""
        scheme, own = divmod(number, SETS)
        return cls(scheme, Role(own // LEVELS), own % LEVELS)

    @property
    def number(self) -> int:
        """Number among all path sets of the plan."""
        return self.scheme * SETS + self.role * LEVELS + self.level

    @property
    def stream(self) -> int:
        """Stream of random numbers, see :data:`spi.numerics.rng.PATH_SETS`."""
        return PATH_SETS[self.scheme] + 2 * (self.number % SETS)


def all_sets(schemes: int) -> tuple[SetOf, ...]:
    """Path sets of some schemes in the order of their numbers."""
    return tuple(map(SetOf.of, range(schemes * SETS)))


def no_samples(schemes: int) -> np.ndarray:
    """(schemes, roles, levels) no samples of any path set."""
    return np.zeros((schemes, len(Role), LEVELS), np.int64)
