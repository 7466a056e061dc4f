"""Keys of an experiment of kind strong."""

from typing import ClassVar

from spi.specs.cases import ErrorCase
from spi.specs.keys import Samples, key_of
from spi.statistics.claims import claimable

from .results import StrongErrors


class Case(ErrorCase):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    samples: key_of(Samples, "number of Brownian paths")

    along_paths: ClassVar[bool] = True
    quantities: ClassVar = claimable(StrongErrors)
