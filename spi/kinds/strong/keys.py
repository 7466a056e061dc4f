"""The keys of an experiment of kind strong."""

from typing import ClassVar

from spi.claims import ORDER, STEPWISE
from spi.spec.cases import ErrorCase
from spi.spec.keys import Samples, key_of


class Case(ErrorCase):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    samples: key_of(Samples, "number of Brownian paths")

    quantities: ClassVar = ORDER | STEPWISE
