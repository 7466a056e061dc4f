"""Keys of an experiment of kind stability."""

from typing import Annotated, ClassVar, Literal, Self

import pydantic
from annotated_types import MinLen

from spi.ensemble.protocol import Positive
from spi.ensemble.random_states import DrawnFromList, RandomState
from spi.specs.cases import FunctionsCase
from spi.specs.keys import Samples, condition, key_of, wrong
from spi.specs.sweep import POINT, SweptKey
from spi.statistics.claims import claimable

from .results import Stability

#: The panels of the figure.
PANELS = ("regimes", "finite", "casimir", "norm", "error", "law", "positive", "failures", "iterations", "angle")

StabilityPanels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]


class Case(FunctionsCase):
    """Properties of the equation that schemes preserve, for each step size and each value of a parameter."""

    sweep: key_of(
        SweptKey,
        "a parameter and its values, as in {s: [0.1, 1, 10]}, used in model, damping, temperature, initial or eps",
    ) = pydantic.Field(exclude=True)
    samples: key_of(Samples, "number of Brownian paths")
    accurate: key_of(Positive, "errors relative to |y_0| up to this count as accurate") = 0.1
    panels: key_of(StabilityPanels, f"what the figure shows, some of {', '.join(PANELS)}") = ("regimes",)

    example: ClassVar[str] = """\
model: {sigma: [s, s, s]}
sweep: {s: [0.1, 0.3, 1, 3, 10]}
final_time: 4
steps: 2^1 .. 2^-6
reference_step: 2^-8
schemes: [splitting, euler_maruyama]
samples: 500
panels: [regimes]
"""
    listed_under: ClassVar[str] = "stability"
    bounded_increments: ClassVar[bool] = False
    neutral: ClassVar[frozenset[str]] = FunctionsCase.neutral | {"accurate"}
    swept_in: ClassVar[tuple[str, ...]] = POINT
    most_swept: ClassVar[int] = 1
    sweeps_quantities: ClassVar[bool] = False
    quantities: ClassVar = claimable(Stability)

    @condition
    def _check_sweep(self) -> Self:
        if self.sweep is None:
            raise wrong("is empty", "must have a parameter and its values, as in sweep: {s: [0.1, 1, 10]}", "sweep")
        if self.sweep.of:
            raise wrong("is not for stability", f"say it by panels, some of {', '.join(PANELS)}", "sweep", "of")
        return self

    @condition
    def _check_not_zero(self) -> Self:
        drawn = isinstance(self.initial, RandomState) and isinstance(self.initial.law, DrawnFromList)
        if not any(self.initial) or (drawn and not self.initial.law.points.any(axis=1).all()):
            raise wrong("is 0", "must not be, because errors are relative to its length", "initial")
        return self

    @condition
    def _check_one_eps(self) -> Self:
        if self.eps is not None and len(self.eps) > 1:
            raise wrong(f"has {len(self.eps)} values", "must be one number, or the swept parameter", "eps")
        return self
