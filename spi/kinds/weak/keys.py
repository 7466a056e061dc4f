"""Keys of an experiment of kind weak."""

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, Self

from annotated_types import MinLen
from pydantic import BeforeValidator

from spi.ensemble.protocol import Positive
from spi.specs.cases import FunctionsCase
from spi.specs.checks import check_distinct, check_extrapolate
from spi.specs.keys import ExtrapolationLevels, Functions, Samples, check_here, condition, key_of, wrong
from spi.statistics.claims import claimable

from .results import AGREEMENT, UNIFORM_ORDER, WeakErrors
from .study import ESTIMATORS

#: The panels of the figure.
PANELS = ("errors", "samples", "seconds", "eps")

WeakPanels = Annotated[tuple[Literal[PANELS], ...], MinLen(1)]
PrefixCounts = Annotated[tuple[Samples, ...], MinLen(1)]


def _none_lacking(names: Any) -> Any:
    """Names of estimators; raises the error about one that a plug-in has which is not here."""
    for n, name in enumerate(names if isinstance(names, list) else ()):
        check_here("estimators", name, n)
    return names


NAMES = tuple(ESTIMATORS)
Estimators = Annotated[tuple[Literal[NAMES], ...], MinLen(1), BeforeValidator(_none_lacking)]


class SampledCase(FunctionsCase):
    """Keys of all cases in which expectations are estimated."""

    samples: key_of(Samples | None, "number of Brownian paths") = None
    standard_error: key_of(
        Positive | None, "what multilevel aims at for the weak error at the largest step", "value"
    ) = None
    seconds: key_of(Positive | None, "budget of multilevel, in seconds of one thread of typical speed", "seconds") = (
        None
    )
    accuracy: key_of(
        Positive | None,
        "numerical error of estimators that do not sample; default: as fine as a figure needs",
        "value",
    ) = None
    estimators: key_of(Estimators, f"a list, some of {', '.join(ESTIMATORS)}") = ()
    extrapolate: key_of(
        ExtrapolationLevels, "levels of Richardson extrapolation of weak errors, 0 to 3 or a list of them"
    ) = (0,)

    unsaid: ClassVar = {**FunctionsCase.unsaid, "extrapolate": (0,)}

    @property
    def scopes(self) -> list[str]:
        """Also levels of extrapolation."""
        return [*super().scopes, *(f"extrapolate {levels}" for levels in self.extrapolate)]

    def check_driven(self) -> None:
        """See ``BaseCase``: also estimators other than plain and extrapolation are for Brownian motion."""
        super().check_driven()
        others = [name for name in self.estimators if name != "plain"]
        for key, entries in (("estimators", others), ("extrapolate", [count for count in self.extrapolate if count])):
            if entries:
                right = "use plain, not extrapolated"
                raise wrong(f"has {entries[0]}, which is for Brownian motion", right, key)

    @condition
    def _check_extrapolate(self) -> Self:
        check_extrapolate(self)
        return self

    @condition
    def _check_estimators(self) -> Self:
        check_distinct(self.estimators, "estimators")
        for name in self.estimators if self.functions else ():
            ESTIMATORS[name].check(self)
        return self


class Case(SampledCase):
    """Weak errors of schemes: E phi(y_N) for test functions phi, against the same at the reference step."""

    functions: key_of(Functions, "test functions, as in {phi: sin(2*pi*y1) + y2^2}, or the text of one named phi")
    estimators: key_of(Estimators, f"a list, some of {', '.join(ESTIMATORS)}")
    prefixes: key_of(PrefixCounts | None, "numbers of first paths for which plain gives results as well") = None
    panels: key_of(WeakPanels, f"what the figure shows, some of {', '.join(PANELS)}") = ("errors",)

    example: ClassVar[str] = """\
final_time: 1
steps: 2^-3 .. 2^-7
reference_step: 2^-10
schemes: [splitting, splitting_order2]
functions: {phi: sin(2*pi*y1) + y2^2}
estimators: [multilevel]
seconds: 20
"""
    quantities: ClassVar = claimable(WeakErrors) | {"uniform_order": UNIFORM_ORDER, "agreement": AGREEMENT}
    scoping: ClassVar = ("estimators", "functions")

    @condition
    def _check_prefixes(self) -> Self:
        for before, n in pairwise(self.prefixes or ()):
            if n <= before:
                raise wrong(f"has {n} after {before}", "must increase", "prefixes")
        if self.prefixes and "plain" in self.estimators and self.prefixes[-1] > self.samples:
            raise wrong(f"has {self.prefixes[-1]}", f"must not exceed samples, which is {self.samples}", "prefixes")
        return self

    @condition
    def _check_panels(self) -> Self:
        if "eps" in self.panels and (self.eps is None or len(self.eps) < 2):
            raise wrong("has 'eps'", "needs several values of eps, as in eps: [1, 0.1]", "panels")
        if {"samples", "seconds"} & set(self.panels) and not ("plain" in self.estimators and self.prefixes):
            panel = next(p for p in self.panels if p in ("samples", "seconds"))
            right = "needs the estimator plain and prefixes, as in prefixes: [10^3, 10^4]"
            raise wrong(f"has '{panel}', but there are no results of fewer samples", right, "panels")
        return self
