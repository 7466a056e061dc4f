"""Keys of an experiment of kind lyapunov."""

from typing import Annotated, ClassVar, Literal, Self

from annotated_types import Ge, Le

from spi.ensemble.protocol import NonNegative, Positive, conserved, dimension, large
from spi.ensemble.random_states import RandomState
from spi.ensemble.scheme_protocol import memory_size
from spi.exact.surfaces import spheres
from spi.models.delegation import undamped
from spi.numerics.rng import STEPS_PER_TOSS
from spi.plugins.dynamics.ensemble.laws import Uniform
from spi.specs.cases import StepCase
from spi.specs.checks import times_on_grid
from spi.specs.keys import Keys, Samples, condition, entries_in, key_of, quantity, wrong
from spi.statistics.claims import claimable

from .results import PANELS, Exponents
from .study import leaf_dimension

_MOST_TIMES = 8
_WARM_UP = 0.2  # of final_time, by default


class Pullback(Keys):
    """Pull-back pictures: many states on one path of noise that ends now, and began so long ago."""

    times: key_of(
        tuple[Positive, ...], "how long ago, multiples of the step; default: T/64, T/16, T/4, T of final_time", "time"
    ) = ()
    points: key_of(Annotated[int, Ge(64), Le(10**9)], "number of initial states") = 100_000


class Case(StepCase):
    """Lyapunov exponents of the flow on the Casimir surface, along many paths."""

    samples: key_of(Samples, "number of Brownian paths")
    warm_up: key_of(
        NonNegative | None, "time after which exponents are averaged; default: a fifth of final_time", "time"
    ) = None
    exponents: key_of(
        Annotated[int, Ge(1)] | None, "how many exponents, the largest ones; default: all on the Casimir surface"
    ) = None
    every: key_of(
        Annotated[int, Ge(1), Le(STEPS_PER_TOSS)], "steps after which tangent vectors are made orthogonal again"
    ) = 8
    pullback: key_of(Pullback | None, "pictures of many states on one path of noise; {} for those by default") = None
    panels: key_of(
        tuple[Literal[PANELS], ...], f"what the figure shows, some of {', '.join(PANELS)}; default: all that is known"
    ) = ()

    example: ClassVar[str] = """\
temperature: 1/4
final_time: 400
warm_up: 40
step: 1/16
schemes: [splitting_symmetric]
samples: 256
"""
    quantities: ClassVar = claimable(Exponents)
    neutral: ClassVar[frozenset[str]] = StepCase.neutral | {"pullback"}
    unsaid: ClassVar = {**StepCase.unsaid, "every": 1, "pullback": None, "panels": ()}
    driven: ClassVar = False  # between two stops paths use numbers of their own, so steps do not go on from one another

    @property
    def count(self) -> int:
        """Number of exponents."""
        return self.exponents or leaf_dimension(self.model, self.initial)

    @property
    def points_law(self) -> RandomState | None:
        """Law of the initial states of the pictures: ``initial``, or uniform on the surface; None if not known."""
        if isinstance(self.initial, RandomState):
            return self.initial
        surface = spheres(undamped(self.model), self.initial)
        return surface and RandomState(surface.typical, Uniform(surface), {"law": "uniform_on_surface"})

    @condition
    def _check_model(self) -> Self:
        if large(self.model):
            raise wrong("has states that are arrays", "take a model with components, such as sine_euler", "model")
        if any(self.row(name).multiscale or memory_size(self.row(name).record, self.model) for name in self.schemes):
            raise wrong("has a scheme that keeps more than the state", "use one such as splitting_symmetric", "schemes")
        return self

    @condition
    def _check_warm_up(self) -> Self:
        """Case with its warm-up, within which vectors turn into the directions of the exponents."""
        if self.warm_up is None:
            return self.model_copy(update={"warm_up": _WARM_UP * self.final_time})
        if self.warm_up >= self.final_time:
            right = f"must be less than final_time, which is {quantity(self.final_time)}"
            raise wrong(f"is {quantity(self.warm_up)}", right, "warm_up")
        return self

    @condition
    def _check_exponents(self) -> Self:
        most, count = leaf_dimension(self.model, self.initial), conserved(self.model)
        if most == 0:
            raise wrong("is a point that no flow moves", "take one where the bracket does not vanish", "initial")
        if most + count != dimension(self.model):
            why = f"has {count} known Casimir functions, but surfaces of dimension {most} of {dimension(self.model)}"
            raise wrong(why, "take a model, or an initial state, with as many as there are", "model")
        if self.exponents and self.exponents > most:
            raise wrong(f"is {self.exponents}", f"must be at most {most}, the Casimir surface's dimension", "exponents")
        return self

    @condition
    def _check_pullback(self) -> Self:
        """Case with the times of its pictures in their order."""
        if self.pullback is None and "pullback" not in self.panels:
            return self
        given = self.pullback or Pullback()
        if self.points_law is None:
            right = "give a law of initial states, as in {law: gaussian, mean: [...], sd: 0.1}"
            raise wrong("is one state, and its surface is no product of spheres", right, "initial")
        if len(given.times) > _MOST_TIMES:
            raise wrong(f"has {entries_in(len(given.times))}", f"must have at most {_MOST_TIMES}", "pullback", "times")
        times = times_on_grid(self, self.step, "the step {}", given.times, "pullback", "times")
        if not times:
            steps = round(self.final_time / self.step)
            times = tuple(n * self.step for n in sorted({max(1, steps >> k) for k in (6, 4, 2, 0)}))
        return self.model_copy(update={"pullback": given.model_copy(update={"times": times})})
