"""The keys of an experiment of kind trajectory."""

from typing import Annotated, ClassVar, Literal, Self

import pydantic
from annotated_types import Ge, Le, MinLen

from spi.ensemble.protocol import NonNegative, dimension
from spi.models.zeitlin.fields import lattice_of
from spi.specs.cases import StepCase
from spi.specs.checks import check_every, times_on_grid
from spi.specs.keys import condition, entries_in, key_of, wrong
from spi.specs.sweep import Swept
from spi.statistics.claims import claimable

from .results import Trajectory

#: What the figure can show.
OF_FIELDS = ("vorticity", "spectrum", "enstrophy")  #: those of vorticity on a torus
PANELS = (
    *("casimirs", "casimir_errors", "hamiltonian", "components", "populations", "sphere", "phase"),
    *OF_FIELDS,
)

Panels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]
Path = Annotated[int, Ge(0), Le(10**15)]
Times = tuple[NonNegative, ...]

_MOST_NUMBERS = 2 * 10**8  # of the states that are stored: 1.6 GB
_MOST_TIMES = 8  # at which fields stand side by side


class Case(StepCase):
    """One path of each scheme, all on the same Brownian path."""

    panels: key_of(Panels, f"what the figure shows, some of {', '.join(PANELS)}")
    path: key_of(Path, "number of the path") = 0
    every: key_of(Annotated[int, Ge(1)], "store the state after every n-th step") = 1
    times: key_of(
        Times, "times at which fields are drawn, multiples of every*step; default: start, middle, end", "time"
    ) = ()

    sweep: key_of(Swept, "not for trajectories, which are one path: list the values as cases") = pydantic.Field(
        default=None, exclude=True
    )

    neutral: ClassVar[frozenset[str]] = StepCase.neutral | {"times"}
    unsaid: ClassVar = {**StepCase.unsaid, "every": 1, "times": ()}
    quantities: ClassVar = claimable(Trajectory)

    @property
    def steps_stored(self) -> int:
        """The number of states stored after the initial one."""
        return round(self.final_time / self.step) // self.every

    @condition
    def _check_sweep(self) -> Self:
        if self.sweep:
            mistake = "is for results of many paths or of several step sizes, and a trajectory is one path"
            raise wrong(mistake, "write a case for each value, as in cases: [{name: a, model: {...}}, ...]", "sweep")
        return self

    @condition
    def _check_every(self) -> Self:
        check_every(self)
        steps, d = round(self.final_time / self.step), dimension(self.model)
        if (self.steps_stored + 1) * d > _MOST_NUMBERS:
            mistake = f"is {self.every}, so that {self.steps_stored + 1} states of {d} numbers would be stored"
            least = -(-steps // (_MOST_NUMBERS // d - 1))
            raise wrong(mistake, f"must be at least {least}, for 2*10^8 numbers in all", "every")
        return self

    @condition
    def _check_times(self) -> Self:
        """The case with times that are exactly those of stored states."""
        if len(self.times) > _MOST_TIMES:
            raise wrong(f"has {entries_in(len(self.times))}", f"must have at most {_MOST_TIMES}", "times")
        times = times_on_grid(self, self.every * self.step, "{}, the time between stored states", self.times, "times")
        return self.model_copy(update={"times": times})

    @condition
    def _check_panels(self) -> Self:
        for i, panel in enumerate(self.panels):
            if panel in OF_FIELDS and lattice_of(self.model) is None:
                raise wrong(f"is '{panel}', which is for sine_euler and zeitlin", "leave it out", "panels", i)
        return self
