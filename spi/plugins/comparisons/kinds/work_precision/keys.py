"""Keys of an experiment of kind work_precision."""

from typing import Annotated, ClassVar, Literal, Self

from annotated_types import Ge, Le, MinLen

from spi.ensemble.protocol import Positive
from spi.kinds.weak.keys import SampledCase
from spi.kinds.weak.study import ESTIMATORS
from spi.specs.keys import condition, key_of, wrong
from spi.statistics.claims import claimable

from .results import PANELS, WorkPrecision

Targets = Annotated[tuple[Positive, ...], MinLen(1)]
WorkPanels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]
Repeats = Annotated[int, Ge(3), Le(1000)]


class Case(SampledCase):
    """Errors of schemes against the time that a path takes: strong errors, or weak ones of one test function."""

    targets: key_of(
        Targets | None, "errors for which the cheapest scheme is asked; default: powers of ten", "state or value"
    ) = None
    repeats: key_of(Repeats, "how often each step size is timed; the median counts") = 15
    panels: key_of(WorkPanels, f"what the figure shows, some of {', '.join(PANELS)}; default: both") = PANELS

    example: ClassVar[str] = """\
final_time: 1
steps: 2^-2 .. 2^-8
reference_step: 2^-11
truncate_noise: true
schemes: [splitting, euler_maruyama, midpoint]
samples: 200
targets: [0.1, 0.05]
"""
    driven: ClassVar[bool] = False
    prefixes: ClassVar[None] = None
    distinct: ClassVar = ("panels", "targets")
    neutral: ClassVar[frozenset[str]] = SampledCase.neutral | {"targets"}
    quantities: ClassVar = claimable(WorkPrecision)

    @property
    def along_paths(self) -> bool:  # type: ignore[override]
        """Strong errors are those of paths."""
        return not self.functions

    @condition
    def _check_measure(self) -> Self:
        if not self.functions:
            for key, given in (("estimators", self.estimators), ("extrapolate", any(self.extrapolate))):
                if given:
                    raise wrong("is for weak errors", "leave it out, or give functions", key)
            if self.samples is None:
                add = f"add samples: {type(self).model_fields['samples'].description}"
                raise wrong("missing key 'samples'", add, "samples")
        elif len(self.functions) > 1:
            raise wrong(f"has {len(self.functions)} functions", "must have one, for one error", "functions")
        elif not self.estimators:
            raise wrong("missing key 'estimators'", f"add estimators: some of {', '.join(ESTIMATORS)}", "estimators")
        return self
