"""What may stand in a spec file: the keys of each kind of experiment.

A new kind is a subclass of Case and a line in KINDS.
"""

from itertools import pairwise
from typing import ClassVar

import pydantic
from pydantic import model_validator

from ..protocol import Positive
from ..rng import STEPS_PER_TOSS
from ..schemes import SCHEMES
from .cases import (
    CLIP,
    Case,
    ErrorCase,
    FunctionsCase,
    SampledCase,
    check_multiple,
    check_once,
    check_schemes,
)
from .keys import (
    ESTIMATORS,
    LONG_TIME_PANELS,
    PANELS,
    STABILITY_PANELS,
    WEAK_PANELS,
    Estimators,
    Functions,
    LongTimePanels,
    Panels,
    Path,
    Prefixes,
    Repeats,
    Samples,
    Schemes,
    StabilityPanels,
    StepCount,
    Steps,
    Swept,
    Targets,
    WeakPanels,
    key_of,
    quantity,
    wrong,
)
from .sweep import Sweep

_MOST_STORED = 10**7  # states of a trajectory


class StrongCase(ErrorCase):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    samples: key_of(Samples, "number of Brownian paths")


class WeakCase(SampledCase):
    """Weak errors of schemes: E phi(y_N) for test functions phi, against the same at the reference step."""

    functions: key_of(Functions, "test functions, as in {phi: sin(2*pi*y1) + y2^2}, or the text of one named phi")
    estimators: key_of(Estimators, f"a list, some of {', '.join(ESTIMATORS)}")
    prefixes: key_of(Prefixes | None, "numbers of first paths for which plain gives results as well") = None
    panels: key_of(WeakPanels, f"what the figure shows, some of {', '.join(WEAK_PANELS)}") = ("errors",)

    @model_validator(mode="after")
    def _check_prefixes(self):
        for before, n in pairwise(self.prefixes or ()):
            if n <= before:
                raise wrong(f"has {n} after {before}", "must increase", "prefixes")
        if self.prefixes and "plain" in self.estimators and self.prefixes[-1] > self.samples:
            raise wrong(f"has {self.prefixes[-1]}", f"must not exceed samples, which is {self.samples}", "prefixes")
        return self

    @model_validator(mode="after")
    def _check_panels(self):
        if "eps" in self.panels and (self.eps is None or len(self.eps) < 2):
            raise wrong("has 'eps'", "needs several values of eps, as in eps: [1, 0.1]", "panels")
        if {"samples", "seconds"} & set(self.panels) and not ("plain" in self.estimators and self.prefixes):
            panel = next(p for p in self.panels if p in ("samples", "seconds"))
            right = "needs the estimator plain and prefixes, as in prefixes: [10^3, 10^4]"
            raise wrong(f"has '{panel}', but there are no results of fewer samples", right, "panels")
        return self


class WorkPrecisionCase(SampledCase):
    """Errors of schemes against the time that a path takes: strong errors, or weak ones of one test function."""

    targets: key_of(Targets | None, "errors for which the cheapest scheme is asked; default: powers of ten") = None
    repeats: key_of(Repeats, "how often each step size is timed; the median counts") = 15

    prefixes: ClassVar[None] = None
    panels: ClassVar[tuple] = ()

    @model_validator(mode="after")
    def _check_measure(self):
        if not self.functions:
            if self.estimators:
                raise wrong("is for weak errors", "leave it out, or give functions", "estimators")
            if self.samples is None:
                add = f"add samples: {type(self).model_fields['samples'].description}"
                raise wrong("missing key 'samples'", add, "samples")
        elif len(self.functions) > 1:
            raise wrong(f"has {len(self.functions)} functions", "must have one, for one error", "functions")
        elif not self.estimators:
            raise wrong("missing key 'estimators'", f"add estimators: some of {', '.join(ESTIMATORS)}", "estimators")
        return self


class StabilityCase(FunctionsCase):
    """What schemes keep of the equation where it is hard: sweeps the step size and a word in the parameters."""

    sweep: key_of(Swept, "a word and its values, as in {s: [0.1, 1, 10]}, to stand in model, initial or eps")
    samples: key_of(Samples, "number of Brownian paths")
    accurate: key_of(Positive, "errors relative to |y_0| up to this count as accurate") = 0.1
    panels: key_of(StabilityPanels, f"what the figure shows, some of {', '.join(STABILITY_PANELS)}") = ("regimes",)

    bounded_increments: ClassVar[bool] = False

    @pydantic.field_validator("sweep")
    @classmethod
    def _check_sweep(cls, sweep):
        for word, values in sweep.items():
            if len(set(values)) < len(values):
                raise wrong("has a value twice", "remove one", word)
        return sweep

    @model_validator(mode="after")
    def _check_not_zero(self):
        if not any(self.initial):
            raise wrong("is 0", "must not be, because errors are relative to its length", "initial")
        return self

    @model_validator(mode="after")
    def _check_one_eps(self):
        if self.eps is not None and len(self.eps) > 1:
            raise wrong(f"has {len(self.eps)} values", "must be one number, or the swept word", "eps")
        return self

    @pydantic.field_serializer("sweep")
    def _effective_sweep(self, sweep):
        return sweep.effective() if isinstance(sweep, Sweep) else sweep


class LongTimeCase(Case):
    """Casimirs over very many steps, and the law of the states after a long time."""

    steps: key_of(Steps, "step sizes, a list or a range such as 2^-1 .. 2^-5")
    step_count: key_of(StepCount, f"number of steps of every path, a multiple of {STEPS_PER_TOSS}")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of Brownian paths")
    panels: key_of(LongTimePanels, f"what the figure shows, some of {', '.join(LONG_TIME_PANELS)}") = ("growth",)
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    @model_validator(mode="after")
    def _check_steps(self):
        if self.step_count % STEPS_PER_TOSS:
            lower = max(self.step_count // STEPS_PER_TOSS, 1) * STEPS_PER_TOSS
            nearest = f"must be a multiple of {STEPS_PER_TOSS}, such as {lower} or {lower + STEPS_PER_TOSS}"
            raise wrong(f"is {self.step_count}", nearest, "step_count")
        check_once(self.steps, "steps")
        check_schemes(self.schemes, self.schemes, max(self.steps), self.truncate_noise, "steps")
        if any(SCHEMES[name].multiscale for name in self.schemes):
            raise wrong("has a multiscale scheme", "use schemes without eps", "schemes")
        return self.model_copy(update={"steps": tuple(sorted(self.steps, reverse=True))})


class TrajectoryCase(Case):
    """One path of each scheme, all on the same Brownian path."""

    final_time: key_of(Positive, "final time T, a multiple of the step")
    step: key_of(Positive, "step size h")
    schemes: key_of(Schemes, "a list of schemes")
    panels: key_of(Panels, f"what the figure shows, some of {', '.join(PANELS)}")
    path: key_of(Path, "number of the path") = 0
    truncate_noise: key_of(pydantic.StrictBool, CLIP) = False

    @model_validator(mode="after")
    def _check_step(self):
        if self.final_time / self.step > _MOST_STORED:
            least = quantity(self.final_time / _MOST_STORED)
            raise wrong("gives more than 10^7 steps, all of which are kept", f"must be at least {least}", "step")
        check_multiple(self.final_time, self.step, "step", "is")
        check_schemes(self.schemes, self.schemes, self.step, self.truncate_noise, "step")
        return self


#: kind in a spec file -> record of a case
KINDS: dict[str, type[Case]] = {
    "strong": StrongCase,
    "trajectory": TrajectoryCase,
    "weak": WeakCase,
    "work_precision": WorkPrecisionCase,
    "stability": StabilityCase,
    "long_time": LongTimeCase,
}
