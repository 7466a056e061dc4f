"""Keys of an experiment of kind equilibrium."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from annotated_types import Ge, Le
from pydantic import BeforeValidator, Field

from spi.ensemble.protocol import NonNegative, Positive, dimension, one_path
from spi.expressions.arithmetic import NumberError
from spi.kinds import one_path as alone
from spi.kinds.functions import PathFunction, check_function, function_of
from spi.models.delegation import depends_on_time
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.plugins.dynamics.kinds.long_paths.keys import LongCase
from spi.plugins.dynamics.kinds.references import EXACT, FINEST
from spi.specs.cases import with_others
from spi.specs.checks import ROUNDING, check_count, check_multiple
from spi.specs.keys import Functions, condition, key_of, quantity, shown, wrong
from spi.specs.names import CodeKeys, numbers_of
from spi.specs.panels import check_further, panels_of, words
from spi.specs.sweep import PLACES
from spi.statistics.claims import claimable

from .references import REFERENCES, derived_quantity
from .results import PANELS, Equilibrium

Reference = Annotated[dict[str, str], BeforeValidator(lambda value: {"": value} if isinstance(value, str) else value)]

_MOST_SNAPSHOTS = 4096  # of each path, unless a spacing is given
_LOOKING = 1 / 16  # of the time in which a large lattice moves, for looking at it, unless a spacing is given
_LEAST_LOOKS = 8  # at it in any case
_LEAST_KEPT = 2
_BURNT = 0.2  # of the time
_BLOCKS = 16  # that are recorded together
_MOST_BYTES = 2**29  # of states that are recorded at a time


class Case(CodeKeys, LongCase):
    """Equilibrium: means over time of long paths."""

    final_time: key_of(Positive, "time until which every step size runs", "time")
    functions: key_of(
        Functions,
        "by name an expression in the state such as y1^2, H or a Casimir function C1, C2, ...; default: H",
    ) = Field(default_factory=dict)
    derived: key_of(
        Functions,
        "by name an expression in the means of functions, T and the numbers of the model (n, the number of sites), as "
        "in {binder: 1 - m4/(3*m2^2)}, with errors by the jackknife",
    ) = Field(default_factory=dict)
    burn_in: key_of(NonNegative | None, "time that does not count for functions; default: a fifth", "time") = None
    spacing: key_of(
        Positive | None,
        "time between two values of functions, a multiple of every step size; default: the largest step size, "
        f"or so many times that a path has at most {_MOST_SNAPSHOTS} and states fit into memory, and that a large "
        f"lattice is looked at for about {_LOOKING:.0%} of the time",
        "time",
    ) = None
    bins: key_of(Annotated[int, Ge(4), Le(512)], "bins of the histograms of functions") = 40
    reference: key_of(
        Reference,
        f"known means of functions: {EXACT} (the Gibbs law by quadrature), {FINEST} (the mean at the smallest step "
        "size), or by name one of these or a formula such as 1/3",
    ) = Field(default_factory=dict)
    accuracy: key_of(Positive | None, "bias and standard error for which the table says step size and time") = None
    panels: key_of(
        panels_of("statistics", PANELS, 0),
        f"what the figure shows, some of {', '.join(words('statistics', PANELS))}; "
        "default: means, histogram and autocorrelation",
    ) = ()

    example: ClassVar[str] = """\
temperature: 1/4
steps: 2^0 .. 2^-3
final_time: 2^10
schemes: [splitting_symmetric, splitting_metropolis]
samples: 500
functions: {energy: H, square: y3^2}
reference: exact
"""
    swept_in: ClassVar = (*PLACES, "reference")
    quantities: ClassVar = claimable(Equilibrium)
    scoping: ClassVar = ("functions", "derived")
    elsewhere: ClassVar[Mapping[str, str]] = {"step_count": "kind: growth has it; this one has final_time"}
    unsaid: ClassVar[dict[str, Any]] = {**LongCase.unsaid, "derived": {}}
    neutral: ClassVar[frozenset[str]] = LongCase.neutral | {"reference", "accuracy"}

    @property
    def last_time(self) -> float:
        """T."""
        return self.final_time

    @property
    def counts(self) -> list[int]:
        return [round(self.final_time / h) for h in self.steps]

    @property
    def path_functions(self) -> tuple[PathFunction, ...]:
        """Functions, in the order of their names."""
        return tuple(function_of(self, text) for text in self.functions.values())

    @property
    def between(self) -> float:
        """Time between two values of functions."""
        return self.spacing or max(self.steps) * 2.0 ** max(0, np.ceil(np.log2(self._least_stride)))

    @property
    def _least_stride(self) -> float:
        """Number of the largest steps from which on a power of two lies between two values."""
        h = max(self.steps)
        least = self.last_time / (_MOST_SNAPSHOTS * h)
        if not alone.is_long(self):
            return max(least, STEPS_PER_TOSS / (self._fitting - 1) if self._fitting > 1 else 0.0, 1.0)
        a_step = min(one_path(self.model, self.row(name).record, h).ns for name in self.schemes)
        looking = alone.look_ns(self, len(self.functions)) / (_LOOKING * a_step)
        return max(least, min(looking, self.last_time / (_LEAST_LOOKS * h) / 2), 1.0)

    @property
    def _fitting(self) -> float:
        """Number of states of paths that are moved together that fit into memory."""
        paths = 1 if self.in_parts else LANES * min(_BLOCKS, -(-self.samples // LANES))
        return _MOST_BYTES / (8 * paths * dimension(self.model))

    @property
    def burnt(self) -> float:
        """Time that does not count."""
        return _BURNT * self.last_time if self.burn_in is None else self.burn_in

    def check_time(self) -> None:
        """See :class:`LongCase`."""
        for h in self.steps:
            check_multiple(self.final_time, h, "steps", "has")
            check_count(self.final_time, h, "steps")
            if self.final_time / h < STEPS_PER_TOSS and not alone.is_long(self):
                mistake = f"is {quantity(self.final_time)}, fewer than {STEPS_PER_TOSS} steps of {quantity(h)}"
                raise wrong(mistake, f"must be at least {quantity(STEPS_PER_TOSS * h)}", "final_time")

    @condition
    def _check_functions(self) -> Self:
        """Case with functions."""
        if not self.functions and depends_on_time(self.model):
            right = "add functions of the state, as in {phi: y1^2}; H, the default, depends on time"
            raise wrong("missing key 'functions'", right, "functions")
        functions = with_others(self, self.functions) or {"H": "H"}
        for name, text in functions.items():
            check_function(self, name, text, timeless="means are over time; statistics has means at each time")
        if both := self.derived.keys() & functions.keys():
            raise wrong("is the name of a function", "take another name", "derived", min(both))
        numbers = numbers_of(self)
        for name, text in self.derived.items():
            try:
                derived_quantity(text, tuple(functions), numbers)
            except NumberError as error:
                right = f"must be an expression in {', '.join(functions)} and T"
                raise wrong(f"is {shown(text)} ({error})", right, "derived", name) from None
        return self.model_copy(update={"functions": functions})

    @condition
    def _check_kept(self) -> Self:
        key = "spacing" if self.spacing else "steps"
        for h in self.steps:
            if abs(round(self.between / h) * h - self.between) > ROUNDING * self.between:
                mistake = f"{'is' if self.spacing else 'give the spacing'} {quantity(self.between)}, no multiple of"
                raise wrong(f"{mistake} {quantity(h)}", "give a spacing that is one of every step size", key)
        left = int((self.last_time - self.burnt) / self.between * (1 + ROUNDING))
        if left < _LEAST_KEPT:
            values = "1 value" if left == 1 else "no value"
            mistake = f"leaves {values} with a spacing of {quantity(self.between)} after burn_in"
            right = f"must leave {_LEAST_KEPT}: final_time {quantity(self.burnt + _LEAST_KEPT * self.between)} or more"
            raise wrong(mistake, right, "final_time")
        if not alone.is_long(self) and 1 + STEPS_PER_TOSS * max(self.steps) / self.between > self._fitting:
            right = f"must be larger, such as {quantity(STEPS_PER_TOSS * max(self.steps))}"
            if self._fitting < 2:
                fault = f"moves {LANES} paths of {dimension(self.model)} numbers together, whose states do not fit"
                raise wrong(fault, "give samples: 1, for which threads share one path where they can", "samples")
            raise wrong("records more states at a time than fit", right, "spacing")
        return self

    @condition
    def _check_reference(self) -> Self:
        """Case with the reference of each function by its name."""
        of_all = self.reference.get("")
        reference = dict.fromkeys(self.functions, of_all) if of_all is not None else self.reference
        reference = with_others(self, reference, "reference")
        for name, text in reference.items():
            REFERENCES.check(self, name, text)
        return self.model_copy(update={"reference": reference})

    @condition
    def _check_panels(self) -> Self:
        """Case with the panels of its figure."""
        if "derived" in self.panels and not self.derived:
            raise wrong("has 'derived', and the key derived is missing", "add derived:", "panels")
        check_further("statistics", self)
        return self if self.panels else self.model_copy(update={"panels": PANELS[:3]})
