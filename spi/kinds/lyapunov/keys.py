"""The keys of an experiment of kind lyapunov."""

from typing import Annotated, ClassVar, Literal, Self

from annotated_types import Ge, Le

from spi.ensemble.protocol import NonNegative, Positive, conserved, dimension, large
from spi.ensemble.random_states import RandomState, Uniform
from spi.ensemble.scheme_protocol import memory_size
from spi.exact.surfaces import spheres
from spi.expressions import parse_expression
from spi.expressions.arithmetic import NumberError
from spi.models.delegation import undamped
from spi.numerics.rng import STEPS_PER_TOSS
from spi.specs.cases import StepCase
from spi.specs.checks import ROUNDING
from spi.specs.keys import Keys, Samples, condition, entries_in, key_of, quantity, shown, wrong
from spi.statistics.claims import claimable

from .results import PANELS, Exponents
from .study import leaf_dimension

_MOST_TIMES = 8
_FORMULAS = "two expressions in the state, the axes of the pictures; default: the first sphere of the surface, in a "
_FORMULAS += "projection that keeps areas, or where there is none the first two components"


class Pullback(Keys):
    """Pull-back pictures: many states on one path of noise that ends now, and began so long ago."""

    times: key_of(
        tuple[Positive, ...], "how long ago, multiples of the step; default: T/64, T/16, T/4, T of final_time", "time"
    ) = ()
    points: key_of(Annotated[int, Ge(64), Le(10**9)], "number of initial states") = 100_000
    of: key_of(tuple[str, ...], _FORMULAS) = ()


class Case(StepCase):
    """Lyapunov exponents of the flow on the Casimir surface, along many paths."""

    samples: key_of(Samples, "number of Brownian paths")
    warm_up: key_of(NonNegative, "time after which exponents are averaged", "time") = 0.0
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

    quantities: ClassVar = claimable(Exponents)
    neutral: ClassVar[frozenset[str]] = StepCase.neutral | {"pullback"}
    unsaid: ClassVar = {**StepCase.unsaid, "every": 1, "pullback": None, "panels": ()}
    driven: ClassVar = False  # between two stops paths use numbers of their own, so steps do not go on from one another

    @property
    def count(self) -> int:
        """How many exponents."""
        return self.exponents or leaf_dimension(self.model, self.initial)

    @property
    def points_law(self) -> RandomState | None:
        """The law of the initial states of the pictures: ``initial``, or uniform on the surface; None if not known."""
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
        if self.warm_up >= self.final_time:
            right = f"must be less than final_time, which is {quantity(self.final_time)}"
            raise wrong(f"is {quantity(self.warm_up)}", right, "warm_up")
        return self

    @condition
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

    @condition
    def _check_pullback(self) -> Self:
        """The case with the times of its pictures in their order."""
        if self.pullback is None and "pullback" not in self.panels:
            return self
        given = self.pullback or Pullback()
        if self.points_law is None:
            right = "give a law of initial states, as in {law: gaussian, mean: [...], sd: 0.1}"
            raise wrong("is one state, and its surface is no product of spheres", right, "initial")
        if len(given.times) > _MOST_TIMES:
            raise wrong(f"has {entries_in(len(given.times))}", f"must have at most {_MOST_TIMES}", "pullback", "times")
        for i, t in enumerate(given.times):
            self._check_time(i, t)
        counts = [round(t / self.step) for t in given.times]
        if len(given.of) not in (0, 2):
            raise wrong(f"has {entries_in(len(given.of))}", "must have two, as in of: [y1, y2]", "pullback", "of")
        for i, text in enumerate(given.of):
            self._check_formula(i, text)
        steps = round(self.final_time / self.step)
        times = tuple(n * self.step for n in sorted(set(counts or [max(1, steps >> k) for k in (6, 4, 2, 0)])))
        return self.model_copy(update={"pullback": given.model_copy(update={"times": times})})

    def _check_time(self, i: int, t: float) -> None:
        place = "pullback", "times", i
        if t > self.final_time * (1 + ROUNDING):
            raise wrong(f"is {quantity(t)}", f"must not exceed final_time, {quantity(self.final_time)}", *place)
        if abs(round(t / self.step) * self.step - t) > ROUNDING * max(t, self.step):
            lower = max(1, int(t / self.step)) * self.step
            right = f"the nearest are {quantity(lower)} and {quantity(lower + self.step)}"
            raise wrong(f"is {quantity(t)}, no multiple of the step {quantity(self.step)}", right, *place)

    def _check_formula(self, i: int, text: str) -> None:
        try:
            parse_expression(text, dimension(self.model), self.variables)
        except NumberError as error:
            right = f"must be an expression in the state, such as {(self.variables or ('y1',))[0]}"
            raise wrong(f"is {shown(text)} ({error})", right, "pullback", "of", i) from None
