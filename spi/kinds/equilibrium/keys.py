"""The keys of an experiment of kind equilibrium."""

from typing import Annotated, Any, ClassVar, Literal, Self

import pydantic
from annotated_types import Ge, Le, MinLen

from spi.numerics.rng import STEPS_PER_TOSS
from spi.specs.cases import CLIP, BaseCase
from spi.specs.checks import check_once, check_schemes
from spi.specs.conversion import Given
from spi.specs.keys import Samples, Schemes, Steps, condition, key_of, wrong
from spi.statistics.claims import AT_MOST, EQUAL, Sort

#: What the figure can show.
PANELS = ("growth", "law", "distance", "moments")

Panels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]
StepCount = Annotated[int, Ge(1), Le(2**34)]


class Case(BaseCase):
    """Casimirs over very many steps, and the law of the states after a long time."""

    steps: key_of(Steps, "step sizes, a list or a range such as 2^-1 .. 2^-5", "time")
    step_count: key_of(StepCount, f"number of steps of every path, a multiple of {STEPS_PER_TOSS}")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of Brownian paths")
    panels: key_of(Panels, f"what the figure shows, some of {', '.join(PANELS)}") = ("growth",)
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    quantities: ClassVar = {
        **dict.fromkeys(("growth", "bias"), Sort(EQUAL, per_step=True)),
        **dict.fromkeys(("casimir_worst", "law_distance", "mean_z", "nonfinite"), Sort(AT_MOST, per_step=True)),
    }
    shown_over: ClassVar = ("casimir_worst", "growth", "law_distance")

    @property
    def last_time(self) -> float:
        """Of the largest step size."""
        return max(self.steps) * self.step_count

    @condition("steps", "step_count", "schemes")
    def _check_steps(self) -> Self:
        if self.step_count % STEPS_PER_TOSS:
            lower = max(self.step_count // STEPS_PER_TOSS, 1) * STEPS_PER_TOSS
            nearest = f"must be a multiple of {STEPS_PER_TOSS}, such as {lower} or {lower + STEPS_PER_TOSS}"
            raise wrong(f"is {self.step_count}", nearest, "step_count")
        check_once(self.steps, "steps")
        check_schemes(self, self.schemes, self.steps, "steps")
        if any(self.row(name).multiscale for name in self.schemes):
            raise wrong("has a multiscale scheme", "use schemes without eps", "schemes")
        return self.model_copy(update={"steps": tuple(sorted(self.steps, reverse=True))})


def of_another(given: Given) -> dict[str, Any]:
    """What an experiment of another kind lacks to be one of this."""
    return {"steps": [given.step, given.step / 2], "step_count": STEPS_PER_TOSS * 1000, "samples": given.paths(64)}
