"""Keys of an experiment of kind answer."""

import math
from collections.abc import Sequence
from functools import reduce
from itertools import groupby
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pydantic
from annotated_types import Ge, MinLen

from spi.ensemble.protocol import Positive, flows_lacking, large
from spi.expressions import as_numpy
from spi.numerics.rng import PATH_SETS
from spi.schemes import SCHEMES, has_theory
from spi.specs.cases import BaseCase, FunctionKeys
from spi.specs.checks import ROUNDING as RATIO
from spi.specs.checks import check_count, check_distinct, check_flows
from spi.specs.document import Document, SpecError
from spi.specs.experiment import ONLY_IN_FILES, Experiment, laid_over
from spi.specs.files import Files
from spi.specs.keys import (
    ExtrapolationLevels,
    Functions,
    SchemeName,
    Schemes,
    Steps,
    condition,
    entries_in,
    key_of,
    quantity,
    wrong,
)
from spi.specs.naming import as_yaml, with_numbers
from spi.specs.sweep import versions
from spi.statistics.claims import claimable

from .results import PANELS, Answer

AnswerPanels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]

#: The default schemes, the first tuple that a model can have: exact flows, or schemes without any.
CANDIDATES = (("splitting_order2", "splitting_symmetric"), ("munthe_kaas_midpoint",), ("euler_maruyama",))

#: The finest step is final_time / 2^FINEST.
FINEST = 16

#: The samples of each level of the pilot, and its levels 1 to PILOT_LEVELS.
PILOT_SAMPLES, PILOT_LEVELS = 1024, 7

#: The accuracy of sums of float64, relative to their largest terms.
ROUNDING = 1e-13


class Case(FunctionKeys, BaseCase):
    """Expectations E phi(y(T)) to a wanted accuracy; scheme, steps, extrapolation and samples are chosen."""

    final_time: key_of(Positive, "final time T", "time")
    functions: key_of(Functions, "test functions, as in {phi: sin(2*pi*y1) + y2^2}, or the text of one named phi")
    accuracy: key_of(
        Positive, "half the width of the 95 % interval that is wanted, with what is left of the bias", "value"
    )
    schemes: key_of(Schemes, "schemes to choose from; default: those of weak order 2, or what the model can have") = ()
    extrapolate: key_of(ExtrapolationLevels, "levels of extrapolation to choose from, 0 to 3") = (0, 1, 2, 3)
    steps: key_of(
        Steps | None, "steps to choose from, two or more of final_time / 1, 2, 4, ...; default: all", "time"
    ) = None
    samples: key_of(Annotated[int, Ge(PILOT_SAMPLES)] | None, "the largest number of paths of the largest step") = None
    reference_scheme: key_of(
        SchemeName | None, "another scheme that checks the bias on the same noise, as roessler_rs2 or midpoint rules do"
    ) = None
    sampling: key_of(pydantic.StrictBool, "sample, though the expectation may be known without it") = False
    seconds: key_of(Positive, "what it may take at most, in seconds of one thread of typical speed", "seconds") = 3600.0
    panels: key_of(AnswerPanels, f"what the figure shows, some of {', '.join(PANELS)}; default: both") = PANELS

    example: ClassVar[str] = """\
final_time: 1
functions: {phi: y1^2}
accuracy: 1e-4
"""
    driven: ClassVar[bool] = False
    truncate_noise: ClassVar[bool] = False
    unsaid: ClassVar = {**BaseCase.unsaid, "extrapolate": (0,)}
    quantities: ClassVar = claimable(Answer)
    scoping: ClassVar = ("functions",)

    @property
    def step_levels(self) -> tuple[int, ...]:
        """Levels l of the steps T / 2^l to choose from; one more is for the check."""
        if self.steps is None:
            return tuple(range(FINEST))
        return tuple(sorted({round(math.log2(self.final_time / h)) for h in self.steps}))

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @condition  # in the place of that of all cases, before claims name schemes
    def _check_names(self) -> Self:
        """Case with schemes: those that it has, or the first of CANDIDATES that the model can have."""
        if self.schemes:
            return super()._check_names()
        schemes = next(names for names in CANDIDATES if all(self._can_have(name) for name in names))
        return BaseCase._check_names(self.model_copy(update={"schemes": schemes}))

    @condition
    def _check_extrapolate(self) -> Self:
        check_distinct(self.extrapolate, "extrapolate")
        return self

    @condition
    def _check_steps(self) -> Self:
        end, levels = self.final_time, self.step_levels
        for h in self.steps or ():
            level = min(max(round(math.log2(end / h)), 0), FINEST - 1)
            if abs(end / 2.0**level - h) > RATIO * h:
                mistake = f"has {quantity(h)}, which is not final_time / 1, 2, 4, ..., {2 ** (FINEST - 1)}"
                raise wrong(mistake, f"the nearest is {quantity(end / 2.0**level)}", "steps")
        least = min(self.extrapolate) + 2
        if levels[0] >= PILOT_LEVELS:
            mistake = f"has at most {quantity(max(self.steps or ()))}"
            raise wrong(mistake, f"the largest must be at least {quantity(end / 2 ** (PILOT_LEVELS - 1))}", "steps")
        if levels[-1] - levels[0] + 1 < least:
            right = f"must have {least} or more, as in [{quantity(end / 8)}, {quantity(end / 2 ** (least + 2))}]"
            raise wrong(f"has {entries_in(len(levels))}, too few to tell the bias from", right, "steps")
        return self

    @condition
    def _check_accuracy(self) -> Self:
        y = np.reshape(np.asarray(self.initial, float), (-1, 1))
        with np.errstate(all="ignore"):
            values = np.abs([np.broadcast_to(as_numpy(tree)(y), 1)[0] for tree in self.expressions])
        least = ROUNDING * float(values.max(initial=0.0, where=np.isfinite(values)))
        if self.accuracy < least:
            mistake = f"is {self.accuracy:g}, below what float64 knows of such values"
            raise wrong(mistake, f"must be at least {1.5 * least:.1g}", "accuracy")
        return self

    @condition
    def _check_schemes(self) -> Self:
        check_count(self.final_time, self.final_time / 2.0**FINEST, "final_time")
        check_distinct(self.schemes, "schemes")
        if len(self.schemes) > len(PATH_SETS):
            raise wrong(f"has {entries_in(len(self.schemes))}", f"must have at most {len(PATH_SETS)}", "schemes")
        for name in self.schemes_used:
            key, has = ("schemes", "has") if name in self.schemes else ("reference_scheme", "is")
            if self.row(name).needs_truncation:
                raise wrong(f"{has} '{name}', which needs bounded increments", "leave it out", key)
            if self.row(name).multiscale:
                raise wrong(f"{has} '{name}' for the multiscale system", "use schemes without eps", key)
        check_flows(self)
        return self

    def _can_have(self, name: str) -> bool:
        row = SCHEMES[name]
        if large(self.model) and not row.for_large_models:
            return False
        if row.composition is not None:
            return not flows_lacking(self.model) and has_theory(row, self.model)
        return name == CANDIDATES[-1][0] or not row.needs or bool(row.needs(self.model))


# ---------------------------------------------------------------------------------------------------------------------
# The answer spec that ``spi answer`` makes of an experiment of another kind.
# ---------------------------------------------------------------------------------------------------------------------


#: The keys about the system and its noise.
_SYSTEM = ("model", "damping", "temperature", "initial", "seed", "noise", "python")

#: The functions for an experiment without test functions, and the default accuracy.
_FUNCTIONS, _ACCURACY = {"mean": "y1", "square": "y1^2"}, 1e-3

#: What a file that says a system only lacks.
DEFAULTS: dict[str, Any] = {"kind": "answer", "functions": _FUNCTIONS, "accuracy": _ACCURACY}


def question(experiment: Experiment, functions: bool = True) -> str:
    """Spec, as YAML, of an answer about the models and the initial values of an experiment of another kind.

    Functions and final time are those of the experiment, without `functions` other ones stand for those that a person
    gives; the scheme is left to choose.  SpecError if a case of it has a multiscale scheme, or functions that are no
    formulas.
    """
    document = Document(experiment.text, str)
    own = {case["name"]: case for case in document.data.get("cases") or ()}
    above = {key: value for key, value in document.data.items() if key not in ONLY_IN_FILES}
    files = Files(experiment.path, experiment.files)
    answers = []
    for name, cases in groupby(experiment.cases, lambda case: case.owner):
        raw, case, title = _middle(laid_over(above, own.get(name, {})), [*cases], files)
        if case.eps is not None:
            right = "answers are about the equation; use schemes without eps"
            raise SpecError(f"{experiment.called}: has a multiscale scheme; {right}")
        asked = _asked(raw, case) | ({} if functions else {"functions": _FUNCTIONS})
        if no_formulas := [name for name, text in asked["functions"].items() if not isinstance(text, str)]:
            right = "name what to ask, as in --function 'y1^2'"
            raise SpecError(f"{experiment.called}: functions.{no_formulas[0]}: is no formula of the state; {right}")
        answers.append({"name": name, "title": title, **asked} if own else asked)
    heading = {"title": f"{experiment.title} (answer)", "kind": "answer"}
    return as_yaml(with_numbers(heading | ({"cases": answers} if own else answers[0])))


def _middle(raw: dict[str, Any], cases: Sequence[BaseCase], files: Files) -> tuple[dict[str, Any], BaseCase, str]:
    """Keys, the record and the title of a case; of a swept parameter those of its middle value."""
    case = cases[0]
    if not (sweep := case.sweep):
        return raw, case, case.title
    n = reduce(lambda n, values: n * len(values) + len(values) // 2, sweep.parameters.values(), 0)
    return [*versions(raw, case.swept_in, files).values()][n], cases[n], sweep.title


def _asked(raw: dict[str, Any], case: BaseCase) -> dict[str, Any]:
    """Keys of an answer about a case, of which `raw` are the keys as the file has them."""
    functions, time = dict(getattr(case, "functions", {})), case.last_time
    if not functions:
        h = max(getattr(case, "steps", None) or (case.step,))  # type: ignore[attr-defined]
        functions, time = _FUNCTIONS, h * max(round(time / h), 1)
    system = {key: raw[key] for key in _SYSTEM if raw.get(key) is not None}
    return {**system, "final_time": time, "functions": functions, "accuracy": _ACCURACY}
