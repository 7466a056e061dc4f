"""Keys of an experiment of kind strong."""

from typing import Annotated, ClassVar, Literal

from annotated_types import MinLen

from spi.specs.cases import ErrorCase
from spi.specs.keys import Samples, key_of
from spi.statistics.claims import claimable

from .results import PANELS, StrongErrors

StrongPanels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]


class Case(ErrorCase):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    samples: key_of(Samples, "number of Brownian paths")
    panels: key_of(StrongPanels, f"what the figure shows, some of {', '.join(PANELS)}") = PANELS[:1]

    along_paths: ClassVar[bool] = True
    quantities: ClassVar = claimable(StrongErrors)
