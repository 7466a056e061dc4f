"""Keys that kinds of experiments with long paths have in common."""

from typing import ClassVar, Self

import pydantic

from spi.specs.cases import CLIP, BaseCase
from spi.specs.checks import check_distinct, check_schemes
from spi.specs.keys import Samples, Schemes, Steps, condition, key_of, wrong


class LongCase(BaseCase):
    """Paths of very many steps, at several step sizes."""

    steps: key_of(Steps, "step sizes, a list or a range such as 2^-1 .. 2^-5", "time")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of Brownian paths")
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    at_once: ClassVar[bool] = False

    @property
    def noise_steps(self) -> tuple[float, ...]:
        """All steps: none has the increments of another."""
        return self.steps

    @property
    def counts(self) -> list[int]:
        """Number of steps of each step size."""
        raise NotImplementedError

    @property
    def in_parts(self) -> bool:
        return self.samples == 1 and self.can_share_one(self.steps[0])

    def check_time(self) -> None:
        """Raise the error about the time or the number of steps."""
        raise NotImplementedError

    @condition
    def _check_steps(self) -> Self:
        """Case with its steps from large to small."""
        check_distinct(self.steps, "steps")
        self.check_time()
        check_schemes(self, self.schemes, self.steps, "steps")
        if any(self.row(name).multiscale for name in self.schemes):
            raise wrong("has a multiscale scheme", "use schemes without eps", "schemes")
        return self.model_copy(update={"steps": tuple(sorted(self.steps, reverse=True))})
