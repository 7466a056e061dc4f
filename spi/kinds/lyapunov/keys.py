"""The keys of an experiment of kind lyapunov."""

from typing import Annotated, Any, ClassVar, Self

import pydantic
from annotated_types import Ge, Le

from spi.ensemble.protocol import NonNegative, Positive, conserved, dimension, large
from spi.ensemble.scheme_protocol import memory_size
from spi.numerics.rng import STEPS_PER_TOSS
from spi.specs.cases import CLIP, BaseCase
from spi.specs.checks import check_step
from spi.specs.conversion import Given
from spi.specs.keys import Samples, Schemes, condition, key_of, quantity, wrong
from spi.statistics.claims import EQUAL, Sort

from .tangents import leaf_dimension


class Case(BaseCase):
    """Lyapunov exponents of the flow on the Casimir surface, along many paths."""

    final_time: key_of(Positive, "final time T, a multiple of the step", "time")
    step: key_of(Positive, "step size h", "time")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of Brownian paths")
    warm_up: key_of(NonNegative, "time after which exponents are averaged", "time") = 0.0
    exponents: key_of(
        Annotated[int, Ge(1)] | None, "how many exponents, the largest ones; default: all on the Casimir surface"
    ) = None
    every: key_of(
        Annotated[int, Ge(1), Le(STEPS_PER_TOSS)], "steps after which tangent vectors are made orthogonal again"
    ) = 8
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    quantities: ClassVar = dict.fromkeys(("largest_exponent", "exponent_sum"), Sort(EQUAL))
    shown_over: ClassVar = tuple(quantities)
    driven: ClassVar = False  # between two stops paths use numbers of their own, so steps do not go on from one another

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @property
    def count(self) -> int:
        """How many exponents."""
        return self.exponents or leaf_dimension(self.model, self.initial)

    @condition("step", "schemes", "model")
    def _check_step(self) -> Self:
        if large(self.model):
            raise wrong("has states that are arrays", "take a model with components, such as sine_euler", "model")
        check_step(self)
        if any(self.row(name).multiscale or memory_size(self.row(name).record, self.model) for name in self.schemes):
            raise wrong("has a scheme that keeps more than the state", "use one such as splitting_symmetric", "schemes")
        return self

    @condition("warm_up", "final_time")
    def _check_warm_up(self) -> Self:
        if self.warm_up >= self.final_time:
            right = f"must be less than final_time, which is {quantity(self.final_time)}"
            raise wrong(f"is {quantity(self.warm_up)}", right, "warm_up")
        return self

    @condition("exponents", "model", "initial")
    def _check_exponents(self) -> Self:
        most, known = leaf_dimension(self.model, self.initial), conserved(self.model)
        if most == 0:
            raise wrong("is a point that no flow moves", "take one where the bracket does not vanish", "initial")
        if most + known != dimension(self.model):
            why = f"has {known} known Casimir functions, but surfaces of dimension {most} of {dimension(self.model)}"
            raise wrong(why, "take a model, or an initial state, with as many as there are", "model")
        if self.exponents and self.exponents > most:
            raise wrong(f"is {self.exponents}", f"must be at most {most}, the Casimir surface's dimension", "exponents")
        return self


def of_another(given: Given) -> dict[str, Any]:
    """What an experiment of another kind lacks to be one of this."""
    return {"final_time": given.step * 4096, "step": given.step, "samples": given.paths(256)}
