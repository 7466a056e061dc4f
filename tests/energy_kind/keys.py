"""The keys of an experiment of kind energy."""

from spi.specs.cases import ErrorCase
from spi.specs.keys import Samples, key_of


class Case(ErrorCase):
    """The mean of the Hamiltonian at the final time."""

    samples: key_of(Samples, "number of Brownian paths")
