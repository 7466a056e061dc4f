"""The keys of an experiment of kind statistics."""

import math
import re
from functools import reduce
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pydantic
from annotated_types import Ge, Gt, Le, Lt, MinLen
from pydantic import BeforeValidator, Field

from spi.ensemble.protocol import NonNegative, Positive, dimension
from spi.expressions import as_numpy, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.specs.cases import CLIP, BaseCase
from spi.specs.checks import ROUNDING, check_count, check_multiple, check_once, check_schemes
from spi.specs.conversion import Given
from spi.specs.keys import NAME, Samples, Schemes, condition, key_of, quantity, shown, wrong
from spi.specs.mistakes import every
from spi.statistics.claims import AT_MOST, EQUAL, Sort

from .functions import FUNCTIONALS, PathFunction, path_function

QUANTITIES = ("mean", "variance", "covariance", "quantiles", "histogram")

_MOST_NUMBERS = 10**7  # of what is summed up
_NAMES = tuple(FUNCTIONALS)
_Functional = Annotated[dict[Literal[_NAMES], str], MinLen(1), Field(max_length=1)]
_ByName = Annotated[dict[Annotated[str, Field(pattern=NAME)], str | _Functional], MinLen(1)]
_PHI = BeforeValidator(lambda value: {"phi": value} if isinstance(value, str) else value)
PathFunctions = Annotated[_ByName, _PHI]
Quantities = Annotated[tuple[Literal[QUANTITIES], ...], MinLen(1)]
Levels = Annotated[tuple[Annotated[float, Gt(0), Lt(1)], ...], MinLen(1)]
Times = tuple[NonNegative, ...]
_WHICH = "; ".join(f"{name}: {meaning}" for name, meaning in FUNCTIONALS.items())


class Case(BaseCase):
    """What a system does: statistics over many paths of functions of the state, at many times."""

    final_time: key_of(Positive, "final time T, a multiple of the step", "time")
    step: key_of(Positive, "step size h", "time")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of Brownian paths")
    functions: key_of(
        PathFunctions,
        "by name an expression in the state such as y1^2, H or a Casimir function C1, C2, ..., or a functional "
        f"of the path, as in {{highest: {{maximum: y1}}}} ({_WHICH}); default: the first components",
    ) = pydantic.Field(default_factory=dict)
    statistics: key_of(Quantities, f"what is found of them, some of {', '.join(QUANTITIES)}") = ("mean",)
    every: key_of(Annotated[int, Ge(1)], "statistics after every n-th step") = 1
    times: key_of(Times, "in place of every: the times of the statistics, multiples of the step", "time") = ()
    quantiles: key_of(Levels, "probabilities of the quantiles") = (0.05, 0.5, 0.95)
    bins: key_of(Annotated[int, Ge(4), Le(512)], "bins of a histogram") = 64
    reference: key_of(dict[str, str], "known means: for functions by name an expression in t") = pydantic.Field(
        default_factory=dict
    )
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    quantities: ClassVar = {**dict.fromkeys(("mean", "variance", "quantile"), Sort(EQUAL)), "deviation": Sort(AT_MOST)}
    scoping: ClassVar = ("functions", "quantile_names")
    shown_over: ClassVar = ("mean", "variance", "quantile")
    neutral: ClassVar[frozenset[str]] = BaseCase.neutral | {"reference"}

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @property
    def path_functions(self) -> tuple[PathFunction, ...]:
        """The functions, in the order of their names."""
        return tuple(path_function(self.model, self.variables, entry) for entry in self.functions.values())

    @property
    def quantile_names(self) -> tuple[str, ...]:
        """What claims about single quantiles are under."""
        return tuple(f"{name}, {level:g}-quantile" for name in self.functions for level in self.quantiles)

    @property
    def stride(self) -> int:
        """Steps between states that are looked at."""
        counts = [round(t / self.step) for t in self.times]
        return reduce(math.gcd, counts, round(self.final_time / self.step)) if self.times else self.every

    @property
    def places(self) -> np.ndarray:
        """Which of the states that are looked at, from 0 on, have statistics."""
        if not self.times:
            return np.arange(round(self.final_time / self.step) // self.stride + 1)
        return np.array([round(t / self.step) // self.stride for t in self.times])

    @property
    def t(self) -> np.ndarray:
        """The times of the statistics."""
        return self.places * self.stride * self.step

    @condition("step", "schemes")
    def _check_step(self) -> Self:
        check_count(self.final_time, self.step, "step")
        check_multiple(self.final_time, self.step, "step", "is")
        check_schemes(self, self.schemes, [self.step], "step")
        return self

    @condition("every", "times", "step")
    def _check_times(self) -> Self:
        """The case with its times in their order."""
        steps = round(self.final_time / self.step)
        if steps % self.every:
            what = f"is {self.every}, of which the number of steps, {steps}, is not a multiple"
            raise wrong(what, f"take {math.gcd(steps, self.every)}, which divides both", "every")
        if self.times and self.every > 1:
            raise wrong("is given beside times", "leave one of them out", "every")
        every(self._check_time, enumerate(self.times))
        numbers = [round(t / self.step) for t in self.times]
        check_once([quantity(n * self.step) for n in numbers], "times")
        return self.model_copy(update={"times": tuple(n * self.step for n in sorted(numbers))})

    def _check_time(self, i: int, t: float) -> None:
        if t > self.final_time * (1 + ROUNDING):
            right = f"must not exceed final_time, which is {quantity(self.final_time)}"
            raise wrong(f"is {quantity(t)}", right, "times", i)
        if abs(round(t / self.step) * self.step - t) > ROUNDING * max(t, self.step):
            lower = math.floor(t / self.step) * self.step
            right = f"the nearest are {quantity(lower)} and {quantity(lower + self.step)}"
            raise wrong(f"is {quantity(t)}, no multiple of the step {quantity(self.step)}", right, "times", i)

    @condition("functions", "model", "statistics", "bins", "times", "every")
    def _check_functions(self) -> Self:
        """The case with functions: the first components, unless it has some."""
        names = self.variables or tuple(f"y{i + 1}" for i in range(dimension(self.model)))
        functions = self.functions or {name: name for name in names[:4]}
        every(self._check_function, functions.items())
        found = self.model_copy(update={"functions": functions})
        per_time = len(functions) * (1 + len(functions) * ("covariance" in self.statistics) + found.fine_bins / 64)
        if len(found.places) * per_time > _MOST_NUMBERS:
            what = f"gives statistics of {len(functions)} functions at {len(found.places)} times, more than fit"
            raise wrong(what, "take fewer times, functions or bins", "every")
        return found

    @property
    def fine_bins(self) -> int:
        """Bins of equal width in which values are counted: a multiple of those of histograms, 0 if none are needed."""
        return self.bins * max(1, 1024 // self.bins) if {"quantiles", "histogram"} & set(self.statistics) else 0

    def _check_function(self, name: str, entry: Any) -> None:
        try:
            path_function(self.model, self.variables, entry)
        except NumberError as error:
            known = ", ".join(self.variables) or f"y1 .. y{dimension(self.model)}"
            right = f"must be an expression in {known}, H or C1, or a functional, as in {{maximum: y1}}"
            raise wrong(f"is {shown(entry)} ({error})", right, "functions", name) from None

    @condition("reference", "functions")
    def _check_reference(self) -> Self:
        every(self._check_formula, self.reference.items())
        return self

    def _check_formula(self, name: str, text: str) -> None:
        if name not in self.functions:
            raise wrong("is not the name of a function", f"known: {', '.join(self.functions)}", "reference", name)
        try:
            if re.search(r"\by1\b", text):
                raise NumberError("unknown name 'y1'")
            parse_expression(text, 1, ("t",))
        except NumberError as error:
            raise wrong(f"is {shown(text)} ({error})", "must be an expression in t", "reference", name) from None

    @property
    def reference_means(self) -> np.ndarray:
        """(F, T) what is known of the means, NaN where nothing is."""
        known = np.full((len(self.functions), len(self.t)), np.nan)
        for f, name in enumerate(self.functions):
            if text := self.reference.get(name):
                known[f] = as_numpy(parse_expression(text, 1, ("t",)))(self.t[np.newaxis])
        return known


def of_another(given: Given) -> dict[str, Any]:
    """What an experiment of another kind lacks to be one of this."""
    length = min(given.length, 200)
    functions = {"functions": given.functions} if given.functions else {}
    return {"final_time": given.step * length, "step": given.step, "samples": given.paths(10**4), **functions}
