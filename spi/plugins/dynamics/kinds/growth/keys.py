"""Keys of an experiment of kind growth."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

from annotated_types import Ge, Le

from spi.numerics.rng import STEPS_PER_TOSS
from spi.plugins.dynamics.kinds.long_paths.keys import LongCase
from spi.specs.keys import condition, key_of, wrong
from spi.specs.sweep import PLACES
from spi.statistics.claims import claimable

from .results import PANELS, Growth

_OF_MEANS = "kind: equilibrium has it"


class Case(LongCase):
    """Errors of the Casimir functions over very many steps, and the law of the states beside the uniform one."""

    step_count: key_of(
        Annotated[int, Ge(1), Le(2**34)], f"number of steps of every path, a multiple of {STEPS_PER_TOSS}"
    )
    panels: key_of(
        tuple[Literal[PANELS], ...], f"what the figure shows, some of {', '.join(PANELS)}; default: growth"
    ) = ()

    example: ClassVar[str] = """\
steps: [2^-7]
step_count: 2^20
schemes: [splitting]
samples: 64
"""
    swept_in: ClassVar = (*PLACES, "step_count")
    quantities: ClassVar = claimable(Growth)
    elsewhere: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("final_time", "functions", "derived", "burn_in", "spacing", "bins", "reference", "accuracy"), _OF_MEANS
    )

    @property
    def last_time(self) -> float:
        """Final time of the largest step size."""
        return max(self.steps) * self.step_count

    @property
    def laws_shown(self) -> tuple[str, ...]:
        """Those of the uniform law, and of the distance from it."""
        return tuple(panel for panel in self.panels if panel in ("law", "distance"))

    @property
    def counts(self) -> list[int]:
        return [self.step_count] * len(self.steps)

    def check_time(self) -> None:
        """See :class:`LongCase`."""
        if self.step_count % STEPS_PER_TOSS:
            lower = max(self.step_count // STEPS_PER_TOSS, 1) * STEPS_PER_TOSS
            nearest = f"must be a multiple of {STEPS_PER_TOSS}, such as {lower} or {lower + STEPS_PER_TOSS}"
            raise wrong(f"is {self.step_count}", nearest, "step_count")

    @condition
    def _check_panels(self) -> Self:
        """Case with the panels of its figure."""
        return self if self.panels else self.model_copy(update={"panels": PANELS[:1]})
