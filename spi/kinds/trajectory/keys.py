"""Keys of an experiment of kind trajectory."""

import math
from functools import partial
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
import pydantic
from annotated_types import Ge, Le, MinLen
from pydantic import BeforeValidator, Field

from spi.ensemble.protocol import NonNegative, dimension, noises
from spi.kinds.functions import OF_ONE_PATH, check_function, check_functional
from spi.numerics.rng import MOST_NOISES
from spi.specs.cases import StepCase, with_others
from spi.specs.checks import check_every, times_on_grid
from spi.specs.keys import NAME, Keys, by_name, condition, entries_in, key_of, quantity, wrong
from spi.specs.names import CodeKeys
from spi.specs.panels import check_further, panels_of, words
from spi.specs.sweep import SweptKey
from spi.statistics.claims import claimable

from .results import Trajectory

#: What the figure can show.
PANELS = (
    *("functions", "section"),
    *("casimirs", "casimir_errors", "hamiltonian", "components", "populations", "sphere", "phase"),
)

PathNumber = Annotated[int, Ge(0), Le(10**15)]
PathTimes = tuple[NonNegative, ...]

_Functional = Annotated[dict[Literal[OF_ONE_PATH], str], MinLen(1), Field(max_length=1)]
_Entry = Annotated[str | _Functional, BeforeValidator(partial(check_functional, OF_ONE_PATH))]
_ByName = Annotated[dict[Annotated[str, Field(pattern=NAME)], _Entry], MinLen(1)]
_Functions = Annotated[_ByName, BeforeValidator(by_name, json_schema_input_type=_ByName | str)]

_MOST_NUMBERS = 2 * 10**8  # of the states that are stored: 1.6 GB
_MOST_TIMES = 8  # at which fields stand side by side


class Section(Keys):
    """A Poincaré section."""

    of: key_of(str, "the function whose zeros make the section, such as y2 or H - 1")
    direction: key_of(Literal["up", "down", "both"], "in which its sign changes") = "up"
    store: key_of(tuple[str, ...], "functions of the state whose values are stored, as in [y1, y3]")


class Case(CodeKeys, StepCase):
    """One path of each scheme, all on the same Brownian path."""

    panels: key_of(
        panels_of("trajectory", PANELS), f"what the figure shows, some of {', '.join(words('trajectory', PANELS))}"
    )
    path: key_of(PathNumber, "number of the path") = 0
    every: key_of(Annotated[int, Ge(1)], "store the state after every n-th step") = 1
    save: key_of(
        PathTimes,
        "times whose states are stored, and that at the start, multiples of step; default: every n-th",
        "time",
    ) = ()
    times: key_of(
        PathTimes, "times at which fields are drawn, some of those stored; default: start, middle, end", "time"
    ) = ()

    functions: key_of(
        _Functions,
        "by name an expression in the state such as y1^2, H or a Casimir function C1, along the path, or its value up "
        f"to each time by one of {', '.join(OF_ONE_PATH)}, as in {{work: {{integral: y1*cos(t)}}}}",
    ) = pydantic.Field(default_factory=dict)
    section: key_of(Section | None, "the states at which a function of the state changes its sign") = None

    sweep: key_of(SweptKey, "not for trajectories, which are one path: list the values as cases") = pydantic.Field(
        default=None, exclude=True
    )

    example: ClassVar[str] = """\
final_time: 20
step: 2^-4
schemes: [euler_maruyama, splitting]
panels: [casimirs, hamiltonian, components]
"""
    scoping: ClassVar = ("functions",)
    neutral: ClassVar[frozenset[str]] = StepCase.neutral | {"times", "functions", "section", "python"}
    looks: ClassVar[frozenset[str]] = StepCase.looks | {"times"}
    unsaid: ClassVar = {**StepCase.unsaid, "every": 1, "save": (), "times": (), "functions": {}, "section": None}
    quantities: ClassVar = claimable(Trajectory)
    sweeps_quantities: ClassVar[bool] = False

    @property
    def spacing(self) -> int:
        """Steps between states that are recorded: those that are stored, and those that a section looks at."""
        steps = (round(t / self.step) for t in (self.final_time, *self.save))
        return 1 if self.section else math.gcd(*steps) if self.save else self.every

    @property
    def wanted_paths(self) -> int:
        """All paths up to the only one."""
        return self.path + 1

    @property
    def recorded(self) -> int:
        """Number of states recorded after the initial one."""
        return round(self.final_time / self.step) // self.spacing

    @property
    def stored(self) -> np.ndarray:
        """Numbers of the recorded states that are stored, among them the initial one."""
        if not self.save:
            return np.arange(0, self.recorded + 1, self.every // self.spacing)
        return np.unique([0, *(round(t / self.step) // self.spacing for t in self.save)])

    @property
    def in_parts(self) -> bool:
        """Whether the path is that of a lattice with more noises than paths may have, whose state threads share."""
        return noises(self.model) > MOST_NOISES and self.can_share_one(self.step)

    @condition
    def _check_sweep(self) -> Self:
        if self.sweep:
            mistake = "is for results of many paths or of several step sizes, and a trajectory is one path"
            raise wrong(mistake, "write a case for each value, as in cases: [{name: a, model: {...}}, ...]", "sweep")
        return self

    @condition
    def _check_every(self) -> Self:
        """Case with times of stored states that are exactly multiples of the step."""
        check_every(self)
        if self.save and self.every != 1:
            raise wrong("is given beside every", "leave out one of them", "save")
        case = self.model_copy(update={"save": times_on_grid(self, self.step, "the step {}", self.save, "save")})
        d = dimension(self.model)
        if (case.recorded + 1) * d > _MOST_NUMBERS:
            key = "section" if case.section else "save" if case.save else "every"
            least = -(-case.recorded * case.spacing // (_MOST_NUMBERS // d - 1))
            now, right = f"{case.recorded + 1} states of {d} numbers", f"must be at least {least}"
            if key == "every":
                mistake = f"is {self.every}, so that {now} would be stored"
            else:
                mistake = f"needs {now}, one after {case.spacing} steps each"
                right = f"take times so that {least} steps lie between them"
            raise wrong(mistake, f"{right}, for 2*10^8 numbers in all", key)
        return case

    @condition
    def _check_times(self) -> Self:
        """Case with times that are exactly those of stored states."""
        if len(self.times) > _MOST_TIMES:
            raise wrong(f"has {entries_in(len(self.times))}", f"must have at most {_MOST_TIMES}", "times")
        between = self.step if self.save else self.every * self.step
        times = times_on_grid(self, between, "{}, the time between stored states", self.times, "times")
        for i, t in enumerate(times):
            if self.save and t not in (0, *self.save):
                raise wrong(f"is {quantity(t)}", "must be 0 or one of save", "times", i)
        return self.model_copy(update={"times": times})

    @condition
    def _check_functions(self) -> Self:
        """Case with functions in which names of others are written out."""
        functions = with_others(self, self.functions)
        for name, text in functions.items():
            check_function(self, name, text)
        section = self.section
        for key, text in [("of", section.of), *(("store", text) for text in section.store)] if section else ():
            check_function(self, key, text, key="section", timeless="a section is a surface of states")
        return self.model_copy(update={"functions": functions})

    @condition
    def _check_panels(self) -> Self:
        for i, panel in enumerate(self.panels):
            if panel in ("functions", "section") and not getattr(self, panel):
                raise wrong(f"is '{panel}', and the key {panel} is missing", f"add {panel}:", "panels", i)
        check_further("trajectory", self)
        return self
