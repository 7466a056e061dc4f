"""The keys of an experiment of kind trajectory."""

from typing import Annotated, ClassVar, Literal, Self

import pydantic
from annotated_types import Ge, Le, MinLen
from pydantic import model_validator

from spi.claims import AT_LEAST, AT_MOST, Sort
from spi.protocol import Positive
from spi.spec.cases import CLIP, BaseCase
from spi.spec.checks import check_multiple, check_schemes
from spi.spec.keys import Schemes, key_of, quantity, wrong

#: What the figure can show.
PANELS = ("casimirs", "casimir_errors", "hamiltonian", "components", "populations", "sphere", "phase")

Panels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]
Path = Annotated[int, Ge(0), Le(10**15)]

_MOST_STORED = 10**7  # states of a trajectory


class Case(BaseCase):
    """One path of each scheme, all on the same Brownian path."""

    final_time: key_of(Positive, "final time T, a multiple of the step")
    step: key_of(Positive, "step size h")
    schemes: key_of(Schemes, "a list of schemes")
    panels: key_of(Panels, f"what the figure shows, some of {', '.join(PANELS)}")
    path: key_of(Path, "number of the path") = 0
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    quantities: ClassVar = {
        **dict.fromkeys(("casimir_drift", "hamiltonian_drift", "nonfinite"), Sort(AT_MOST)),
        "lowest": Sort(AT_LEAST),
    }

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @model_validator(mode="after")
    def _check_step(self) -> Self:
        if self.final_time / self.step > _MOST_STORED:
            least = quantity(self.final_time / _MOST_STORED)
            raise wrong("gives more than 10^7 steps, all of which are kept", f"must be at least {least}", "step")
        check_multiple(self.final_time, self.step, "step", "is")
        check_schemes(self, self.schemes, self.step, "step")
        return self
