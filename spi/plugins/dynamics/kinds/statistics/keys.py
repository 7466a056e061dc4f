"""Keys of an experiment of kind statistics."""

import math
from collections.abc import Callable
from functools import partial, reduce
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pydantic
from annotated_types import Ge, Gt, Le, Len, Lt, MinLen
from pydantic import BeforeValidator, Field

from spi.ensemble.protocol import NonNegative, Positive, geometry
from spi.kinds.functions import FUNCTIONALS, PathFunction, check_function, check_functional, function_of
from spi.models.delegation import depends_on_time
from spi.plugins import lacking
from spi.plugins.dynamics.kinds.references import EXACT, STATIONARY, curve
from spi.plugins.dynamics.statistics.quantiles import EDGES
from spi.specs.cases import StepCase, with_others
from spi.specs.checks import ROUNDING, check_distinct, check_every, times_on_grid
from spi.specs.initial import names_in_formulas
from spi.specs.keys import NAME, Keys, Samples, by_name, condition, key_of, quantity, shown, wrong
from spi.specs.names import CodeKeys
from spi.specs.panels import check_further, panels_of, words
from spi.specs.sweep import PLACES
from spi.statistics.claims import claimable
from spi.statistics.estimators import GROUPS

from .estimates import SPHERE, on_sphere
from .fits import FITS
from .references import REFERENCES
from .results import OF_LATTICES, OF_TIMES, PANELS, Statistics
from .stationary import FURTHER, WAVES, WINDOWS, modes_of

QUANTITIES = ("mean", "variance", "covariance", "quantiles", "histogram")

_MOST_NUMBERS = 10**7  # of what is summed up
_MOST_OF_WAVES = 5 * 10**7  # the same of modes of lattices
_NAMES = tuple(name for name in FUNCTIONALS if name != "first")
_One = MinLen(1), Field(max_length=1)
_Both = Annotated[dict[str, str], MinLen(2), Field(max_length=2)]
_Functional = Annotated[dict[Literal[_NAMES], str], *_One] | Annotated[dict[Literal["first"], _Both], *_One]


_Entry = Annotated[str | _Functional, BeforeValidator(partial(check_functional, tuple(FUNCTIONALS)))]
_ByName = Annotated[dict[Annotated[str, Field(pattern=NAME)], _Entry], MinLen(1)]
PathFunctions = Annotated[_ByName, BeforeValidator(by_name)]
Quantities = Annotated[tuple[Literal[QUANTITIES], ...], MinLen(1)]
Probabilities = Annotated[tuple[Annotated[float, Gt(0), Lt(1)], ...], MinLen(1)]
OutputTimes = tuple[NonNegative, ...]
_Names = Annotated[tuple[str, ...], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]
_MOST_MAPS = 8
_FUNCTIONAL = ", or a functional, as in {maximum: y1}"
_WHICH = "; ".join(f"{name}: {meaning}" for name, meaning in FUNCTIONALS.items())


class InFile(Keys):
    """Known means in a file."""

    file: key_of(str, "a CSV file with columns t and value, and stderr where that is known")


def _read(value: Any, handler: Callable[[Any], Any], info: pydantic.ValidationInfo) -> Any:
    """A text as it is, and a file as the numbers in it; raises the error about anything else."""
    if isinstance(value, str | tuple):  # a tuple has been read already
        return handler(value)
    if not isinstance(value, dict):
        raise wrong(f"is {shown(value)}", REFERENCES.right)
    given = InFile.model_validate(value)
    return () if info.context is None else curve(info.context.text(given.file, "file"), given.file)


ReferenceKey = Annotated[Any, pydantic.WrapValidator(_read, json_schema_input_type=str | InFile)]


class Density(Keys):
    """Maps of a density."""

    of: key_of(_Names, f"{SPHERE}, where |y|^2 is a Casimir function, or the names of two functions") = (SPHERE,)
    times: key_of(OutputTimes, "times of the maps, among those of the statistics; default: the last", "time") = ()
    cells: key_of(Annotated[int, Ge(4), Le(128)], "cells along a side; of a sphere bands, each with twice as many") = 24

    @property
    def number(self) -> tuple[int, int]:
        """Numbers of rows and columns of cells."""
        return self.cells, self.cells * (2 if self.of == (SPHERE,) else 1)

    @property
    def count(self) -> int:
        """Number of cells."""
        return self.number[0] * self.number[1]


Maps = Annotated[Density, BeforeValidator(lambda value: {"of": value} if isinstance(value, str) else value)]


_Direction = tuple[float, float, float]
OF_FITS = ("fit", "fit_from")  # the keys of :class:`Correlated` that decide no sums
LEAST_FITTED = 8  # lags behind the first one of a fit


class Correlated(Keys):
    """Correlations in time of stationary paths."""

    until: key_of(Positive, "the largest time between two values", "time")
    window: key_of(Literal[tuple(WINDOWS)], "w(t) of spectra; it ends, with hann at 0, at `until`") = "hann"
    spins: key_of(
        Annotated[tuple[Literal["x", "y", "z"], ...], MinLen(1)] | None,
        "of a lattice the components that the structure factor S(q, omega) adds up, as in [x, y, z]",
    ) = None
    through: key_of(
        Annotated[tuple[Annotated[tuple[float, ...], Len(1, 3)], ...], MinLen(1)] | None,
        "corners of the path of the wave vectors q, in reciprocal vectors; default: from 0 to half of the first of "
        "these, or as far as waves fit",
    ) = None
    about: key_of(
        _Direction | Annotated[tuple[_Direction, ...], MinLen(1)] | Literal["initial"] | None,
        "directions of sites about which linear waves are computed and drawn: one, as in [0, 0, 1], one for each site "
        "of a cell or sublattice, as in [[0, 0, 1], [0, 0, -1]], or those of `initial`",
    ) = None
    labels: key_of(
        Annotated[tuple[str, ...], MinLen(2)] | None, "names of the corners of `through` in figures, as in [G, X, M, G]"
    ) = None
    fit: key_of(
        Literal[tuple(FITS)] | None,
        "to covariances from `fit_from` to `until`, a rate and a frequency with their errors: "
        + ", ".join(f"{name}: {form}" for name, form in FITS.items()),
    ) = None
    fit_from: key_of(NonNegative, "the first time between two values that a fit uses", "time") = 0.0

    @pydantic.model_serializer(mode="wrap")
    def _without_fit(self, write: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        """Keys that decide results: of a fit only where there is one, as in specs from before it was a key."""
        return {key: value for key, value in write(self).items() if self.fit is not None or key not in OF_FITS}

    @condition
    def _check_fit(self) -> None:
        if self.fit_from and self.fit is None:
            raise wrong("is for fits", f"add fit: {' or '.join(FITS)}", "fit_from")

    @condition
    def _check_spins(self) -> Self:
        for key in ("through", "about", "labels"):
            if getattr(self, key) is not None and self.spins is None:
                raise wrong("is for structure factors", "add spins: [x, y, z]", key)
        if self.labels is not None and len(self.labels) != len(self.through or ()):
            right = f"must have {len(self.through)}, one for each corner of through" if self.through else "add through"
            raise wrong(f"has {len(self.labels)} names", right, "labels")
        return self

    def check(self, case: Any) -> None:
        """Raise the error about a key that does not go with the case."""
        if depends_on_time(case.model):
            fault = "is for paths whose law does not change, and the model depends on time"
            raise wrong(fault, "leave it out; autocorrelation names a first time", "time_correlations")
        for name, function in zip(case.functions, case.path_functions, strict=True):
            if function.start is not None:
                raise wrong(
                    "names t, and time_correlations average over times", "leave out one of them", "functions", name
                )
        between, last = case.stride * case.step, float(case.t[-1])
        if case.times or round(self.until / between) < 2 or self.until > last:
            right = f"must be between {quantity(2 * between)} and {quantity(last)}; leave out times, use every"
            raise wrong(f"is {quantity(self.until)}", right, "time_correlations", "until")
        if self.fit is not None and round((self.until - self.fit_from) / between) < LEAST_FITTED:
            right = f"must be at most {quantity(self.until - LEAST_FITTED * between)}, or take a larger until"
            raise wrong(f"is {quantity(self.fit_from)}", right, "time_correlations", "fit_from")
        if self.spins is None:
            return
        place = geometry(case.model)
        if place.get("on") != "lattice" or not place["periodic"]:
            raise wrong("is for periodic lattices", "leave it out", "time_correlations", "spins")
        if self.about is not None:
            if advice := lacking("further", WAVES):
                raise wrong("is for linear waves", advice, "time_correlations", "about")
            FURTHER[WAVES].check(case)
        numbers = 2 * GROUPS * len(modes_of(self, place)) * (round(self.until / between) + 1)
        if numbers > _MOST_OF_WAVES:
            right = f"must be at most {quantity(self.until * _MOST_OF_WAVES / numbers)}, or take fewer wave vectors"
            raise wrong(f"is {quantity(self.until)}, for {numbers:.2g} sums", right, "time_correlations", "until")


class Case(CodeKeys, StepCase):
    """Statistics over many paths of functions of the state, at many times."""

    samples: key_of(Samples, "number of Brownian paths")
    functions: key_of(
        PathFunctions,
        "by name an expression in the state such as y1^2, H or a Casimir function C1, C2, ..., or a functional "
        f"of the path, as in {{highest: {{maximum: y1}}}} ({_WHICH}); default: the first components",
    ) = pydantic.Field(default_factory=dict)
    statistics: key_of(Quantities, f"what is found of them, some of {', '.join(QUANTITIES)}") = ("mean",)
    every: key_of(Annotated[int, Ge(1)], "statistics after every n-th step") = 1
    times: key_of(OutputTimes, "instead of every: the times of the statistics, multiples of the step", "time") = ()
    quantiles: key_of(Probabilities, "probabilities of the quantiles") = (0.05, 0.5, 0.95)
    bins: key_of(Annotated[int, Ge(4), Le(512)], "bins of a histogram") = 64
    density: key_of(Maps | None, "maps of the density on the sphere or of two functions") = None
    autocorrelation: key_of(dict[str, NonNegative], "for functions by name the time from which it counts", "time") = (
        pydantic.Field(default_factory=dict)
    )
    time_correlations: key_of(
        Correlated | None,
        "of stationary paths: covariances at two times, over all first times, their integrals and spectra",
    ) = None
    reference: key_of(
        dict[str, ReferenceKey],
        f"known means: for functions by name an expression in t, a file, {EXACT} (expectations of the equation without "
        f"sampling) or {STATIONARY} (under the uniform law on the sphere, or the Gibbs law at a temperature)",
    ) = pydantic.Field(default_factory=dict)
    panels: key_of(
        panels_of("statistics", PANELS, 0),
        f"what the figure shows, some of {', '.join(words('statistics', PANELS))}; default: all that is known",
    ) = ()

    example: ClassVar[str] = """\
final_time: 4
step: 2^-6
every: 4
schemes: [splitting]
samples: 20000
functions: {y1: y1, energy: H, turned: {passage: "y1 < 0"}}
statistics: [mean, variance, quantiles, histogram]
"""
    swept_in: ClassVar = (*PLACES, "reference")
    quantities: ClassVar = claimable(Statistics)
    scoping: ClassVar = ("functions", "quantile_names")
    distinct: ClassVar = ("panels", "statistics", "quantiles")
    unsaid: ClassVar[dict[str, Any]] = {
        **StepCase.unsaid,
        **dict.fromkeys(("times", "panels"), ()),
        **{"density": None, "every": 1, "autocorrelation": {}, "time_correlations": None},
    }
    neutral: ClassVar[frozenset[str]] = StepCase.neutral | {"reference"}

    @property
    def path_functions(self) -> tuple[PathFunction, ...]:
        """Functions, in the order of their names."""
        return tuple(function_of(self, entry) for entry in self.functions.values())

    @property
    def quantile_names(self) -> tuple[str, ...]:
        """Names of single quantiles in claims."""
        return tuple(f"{name}, {level:g}-quantile" for name in self.functions for level in self.quantiles)

    @property
    def stride(self) -> int:
        """Steps between states that are stored."""
        counts = [round(t / self.step) for t in self.times]
        return reduce(math.gcd, counts, round(self.final_time / self.step)) if self.times else self.every

    @property
    def places(self) -> np.ndarray:
        """Numbers, from 0 on, of those of the stored states that have statistics."""
        if not self.times:
            return np.arange(round(self.final_time / self.step) // self.stride + 1)
        return np.array([round(t / self.step) // self.stride for t in self.times])

    @property
    def t(self) -> np.ndarray:
        """Times of the statistics."""
        return self.places * self.stride * self.step

    @condition
    def _check_times(self) -> Self:
        """Case with its times in their order."""
        check_every(self)
        if self.times and self.every > 1:
            raise wrong("is given beside times", "leave one of them out", "every")
        return self.model_copy(update={"times": times_on_grid(self, self.step, "the step {}", self.times, "times")})

    @condition
    def _check_functions(self) -> Self:
        """Case with functions: the first components, unless it has some."""
        names = names_in_formulas(self.model)
        functions = with_others(self, self.functions) or {name: name for name in names[:4]}
        for name, entry in functions.items():
            check_function(self, name, entry, _FUNCTIONAL)
        case = self.model_copy(update={"functions": functions})
        per_time = len(functions) * (1 + len(functions) * ("covariance" in self.statistics) + case.counters / GROUPS)
        if len(case.places) * per_time > _MOST_NUMBERS:
            mistake = f"gives statistics of {len(functions)} functions at {len(case.places)} times, more than fit"
            raise wrong(mistake, "take fewer times, functions or bins", "every")
        return case

    @property
    def counted_bins(self) -> int:
        """Bins of histograms, 0 if none are wanted."""
        return self.bins if "histogram" in self.statistics else 0

    @property
    def ranked_places(self) -> int:
        """Bins in which values are counted for quantiles, 0 if none are wanted."""
        return EDGES + 1 if "quantiles" in self.statistics else 0

    @property
    def counters(self) -> int:
        """All bins of a function at a time."""
        return self.counted_bins + self.ranked_places

    @condition
    def _check_reference(self) -> Self:
        """Case with references in which names of others are written out."""
        references = with_others(self, self.reference, "reference")
        for name, reference in references.items():
            REFERENCES.check(self, name, reference)
        return self.model_copy(update={"reference": references})

    @condition
    def _check_autocorrelation(self) -> Self:
        for name, since in self.autocorrelation.items():
            self._check_name(name, "autocorrelation", name)
            self.place(since, "autocorrelation", name)
        return self

    @condition
    def _check_time_correlations(self) -> Self:
        given = self.time_correlations
        if given is not None:
            given.check(self)
        for i, panel in enumerate(self.panels):
            if panel in OF_TIMES and given is None:
                raise wrong(f"is '{panel}', which is of time_correlations", "add these, or leave it out", "panels", i)
            if panel in OF_LATTICES and given is not None and given.spins is None:
                raise wrong(f"is '{panel}'", "add spins: [x, y, z] to time_correlations", "panels", i)
        return self

    @condition
    def _check_panels(self) -> Self:
        check_further("statistics", self)
        return self

    @condition
    def _check_density(self) -> Self:
        """Case with the times of its maps in their order."""
        if self.density is None:
            return self
        of, given = self.density.of, self.density.times or (float(self.t[-1]),)
        if of == (SPHERE,) and not on_sphere(self.model):
            mistake = f"is '{SPHERE}', but the states of {self.model_name} are on none: |y|^2 is no Casimir function"
            raise wrong(mistake, "name two functions, as in of: [y1, y2]", "density", "of")
        if of != (SPHERE,):
            for i, name in enumerate(of):
                self._check_name(name, "density", "of", i)
            check_distinct(of, "density")
            if len(of) != 2:
                raise wrong(f"has {len(of)} names", f"must be {SPHERE} or the names of two functions", "density", "of")
        if len(given) > _MOST_MAPS:
            raise wrong(f"has {len(given)} entries", f"must have at most {_MOST_MAPS}", "density", "times")
        places = [self.place(t, "density", "times", i) for i, t in enumerate(given)]
        times = tuple(self.t[np.unique(places)].tolist())
        return self.model_copy(update={"density": self.density.model_copy(update={"times": times})})

    def _check_name(self, name: str, *keys: str | int) -> None:
        if name not in self.functions:
            raise wrong(f"is {shown(name)}, not the name of a function", f"known: {', '.join(self.functions)}", *keys)

    def place(self, t: float, *keys: str | int) -> int:
        """Number of t among the times of the statistics; raises the error about `keys` if it is none."""
        nearest = int(np.abs(self.t - t).argmin())
        if abs(self.t[nearest] - t) > ROUNDING * max(t, self.step):
            right = f"the nearest is {quantity(float(self.t[nearest]))}"
            raise wrong(f"is {quantity(t)}, which is none of the times of the statistics", right, *keys)
        return nearest
