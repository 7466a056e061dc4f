"""Stored mean energies as a record."""

from typing import NamedTuple

import numpy as np

from spi.storage.records import Description, Group


class Energies(NamedTuple):
    """Mean energies of one scheme at S step sizes, from large to small."""

    about: Description
    h: np.ndarray  #: (S,)
    energy: np.ndarray  #: (S,) mean of H(y(T))
    energy_stderr: np.ndarray  #: (S,)


def read(group: Group) -> Energies:
    v = group.arrays
    return Energies(Description.of(group), group.coordinates["h"], v["energy"], v["energy_stderr"])
