"""E phi(y(T)) to a wanted accuracy: without sampling where that is possible, else by the cheapest choice of levels.

The pilot, some paths of each of the larger steps, tells variances and means; :mod:`.planner` chooses by them, and by
costs that are known before anything is timed, so that a choice depends on the spec alone.  A tenth of the work follows,
after which it chooses again, then the whole.  One step finer is compared on paths of its own: where it differs by more
than the bias that is stated, it becomes the finest step, and the one below is compared.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.ensemble.friction import has_friction
from spi.ensemble.loop import thread_count
from spi.ensemble.points import points_of
from spi.ensemble.random_states import RandomState
from spi.exact.kolmogorov import can_solve
from spi.exact.work import work
from spi.expressions import canonical, range_of
from spi.kinds.plans import Cost, Done, KernelCall, State
from spi.kinds.samples import BATCH_BYTES, POWERS, Sample, SamplesPlan, values_of_blocks
from spi.kinds.weak.estimators.kolmogorov.keys import demands_of
from spi.schemes import SCHEMES, weak_exponents
from spi.statistics.estimators import GROUPS
from spi.statistics.tallies import Chunk, sum_of_fields
from spi.storage.records import Part

from . import deciding, outcome, solving
from .decisions import DONE, Decisions
from .keys import PILOT_LEVELS, PILOT_SAMPLES
from .levels import AGAINST, ALONG, DIFFERENCE, LEVELS, SETS, paths_of_set, seconds_of
from .planner import Measured
from .results import Answer
from .spread import Spread

_SOLVING = "splitting_order2"  # by whose steps the solvers check the limit
_ORDERS = 4  # powers of h that extrapolation removes, and the next


class Totals(NamedTuple):
    """The sums over some samples of one path set, for F functions."""

    paths: int  #: samples
    seconds: float  #: wall clock
    cpu_seconds: float
    sums: np.ndarray  #: (powers, quantities, F, GROUPS)

    def plus(self, later: "Totals") -> "Totals":
        """These samples and some later ones."""
        return sum_of_fields(self, later)


def parts(case: Any) -> list[Part]:
    """One: all schemes are for one answer."""
    return [Part(case.schemes[0])]


def remarks(case: Any) -> Iterator[str]:
    """How a person learns what an answer takes."""
    if not plan(case, parts(case)[0]).solvable:
        yield "`spi answer --dry` runs the pilot and predicts how long it takes"


def plan(case: Any, part: Part) -> "AnswerPlan":
    """The plan of a case."""
    return AnswerPlan(case=case, part=part)


@dataclass(frozen=True, kw_only=True)
class AnswerPlan(SamplesPlan):
    """The answer of a case."""

    python: tuple[tuple[str, Callable], ...] = ()  #: functions that are no formulas, which stand for these in the case

    @property
    def phis(self) -> list[Callable]:
        """The test functions of arrays of states."""
        given = dict(self.python)
        return [given.get(name, phi) for name, phi in zip(self.case.functions, super().phis, strict=True)]

    @property
    def formulas(self) -> tuple[str, ...]:
        """The texts of the functions, of those in Python their names."""
        texts = zip(self.case.functions, map(canonical, self.case.expressions), strict=True)
        return tuple(name if name in dict(self.python) else text for name, text in texts)

    @cached_property
    def ranges(self) -> np.ndarray:
        """(F, 2) between which values the functions lie, whatever the state is."""
        known = zip(self.case.functions, map(range_of, self.case.expressions), strict=True)
        return np.array([(-np.inf, np.inf) if name in dict(self.python) else ends for name, ends in known])

    @cached_property
    def solvable(self) -> bool:
        """Whether the expectation is found without sampling."""
        case = self.case
        unknown = case.damping or has_friction(case.model) or isinstance(case.initial, RandomState)
        if case.sampling or unknown or not can_solve(case.model):
            return False
        return not demands_of(case, *self.solving).obstacle

    @property
    def solving(self) -> tuple[Any, tuple[float, ...]]:
        """The composition and the steps with which the solvers check the limit."""
        return SCHEMES[_SOLVING].composition, tuple(self.case.final_time / 2.0**k for k in (4, 5, 6))

    @cached_property
    def of_schemes(self) -> tuple["AnswerPlan", ...]:
        """The plan as that of each scheme."""
        return tuple(replace(self, part=Part(name)) for name in self.case.schemes)

    @cached_property
    def sets(self) -> tuple[Sample, ...]:
        """All path sets, of differences and values of each scheme; that of difference 0 is never wanted."""
        return tuple(
            paths_of_set(self.case, one.row, s * SETS + i) for s, one in enumerate(self.of_schemes) for i in range(SETS)
        )

    @cached_property
    def reference(self) -> "AnswerPlan | None":
        """The plan as that of the scheme that checks the bias."""
        name = self.case.reference_scheme
        return replace(self, part=Part(name)) if name else None

    def exponents(self, scheme: int) -> tuple[float, ...]:
        """The powers of h in the weak error of a scheme; () where theory knows none."""
        return weak_exponents(self.of_schemes[scheme].row, self.model, _ORDERS) or ()

    def noise(self, number: int) -> Any:
        """The random numbers of a path set, or its points."""
        one, scheme = self.sets[number], self.of_schemes[number // SETS]
        if number % SETS < ALONG or number % SETS >= AGAINST:
            return one.stream
        return points_of(self.case.seed, int(one.stream.stream), scheme.scheme, self.model, one.grid)

    def cost_of(self, number: int) -> float:
        """Seconds of typical speed of a sample of a path set."""
        schemes = self.schemes_of(number)
        return sum(seconds_of(self.case, one.row, self.sets[number]) for one in schemes)

    @cached_property
    def costs(self) -> np.ndarray:
        """(path sets,) those of all path sets."""
        return np.array([self.cost_of(number) for number in range(len(self.sets))])

    def schemes_of(self, number: int) -> tuple["AnswerPlan", ...]:
        """The plans of the schemes that a path set has paths of."""
        own = (self.of_schemes[number // SETS],)
        return (*own, self.reference) if self.reference and number % SETS >= AGAINST else own

    def cost(self) -> Cost:
        """That of the pilot, whose seconds are not known; or of so many refinements that their error is known."""
        if self.solvable:
            return Cost(0, solving.seconds_until_known(self) * thread_count(), int(BATCH_BYTES))
        number = PILOT_SAMPLES
        steps = number * sum(self.sets[level].steps for level in range(1, PILOT_LEVELS + 1))
        return Cost(steps, float("nan"), int(BATCH_BYTES))

    def deciding(self, number: int | None) -> dict[str, Any]:
        """Of a path set the model, the functions and the scheme; of what is chosen all."""
        rows = self.case.model_dump(include={"compositions"}).get("compositions", {})
        found = super().deciding(number) | {"compositions": [[name, rows[name]] for name in sorted(rows)]}
        if number is None:
            return found | {"schemes": self.case.schemes, "samples": self.case.samples}
        for key in ("accuracy", "seconds", "sampling", "extrapolate", "steps"):
            found.pop(key, None)
        if number % SETS < AGAINST:
            found.pop("reference_scheme", None)
        return found | {"part": None, "scheme": self.case.schemes[number // SETS]}

    def initial_extra(self) -> Decisions:
        """The pilot of the first scheme is wanted, or nothing where no paths are needed."""
        return Decisions.initial(len(self.case.schemes) * SETS, len(self.case.functions), not self.solvable)

    def wanted(self, extra: Decisions) -> np.ndarray:
        """(path sets,) the samples that are wanted for now."""
        return extra.wanted

    def empty(self, number: int) -> Totals:
        """The totals over no samples."""
        shape = POWERS, len(self.sets[number].weights), len(self.case.functions), GROUPS
        return Totals(0, 0.0, 0.0, np.zeros(shape))

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block of the scheme; the others are rarely needed."""
        return [] if self.solvable else self.calls_of_a_step(self.sets[1].grid, self.sets[1].stream)

    def advance(self, chunks: Sequence[Chunk], known: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, once the kernel of its scheme is there, see :class:`Plan`."""
        number = chunks[0].path_set
        for scheme in self.schemes_of(number):
            for call in scheme.calls_of_a_step(self.sets[number].grid, self.noise(number)):
                if not is_loaded(call.kernel, call.arguments):
                    with work(f"compiling {scheme.part.scheme}", 0.0):
                        call.kernel(*call.arguments)
        yield from super().advance(chunks, known)

    def values(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """The values of the test functions at the end of some blocks."""
        one, noise = self.sets[number], self.noise(number)
        each = [values_of_blocks(s, one.grid, noise, first, blocks, end)[0] for s in self.schemes_of(number)]
        return np.concatenate(each, axis=1)

    def next_allocation(self, state: State) -> Decisions | None:
        """What is wanted next; None once the answer is there."""
        return deciding.decided(self, state)

    def totals(self, state: State, scheme: int) -> list[Totals]:
        """Those of all path sets of a scheme."""
        return [state.so_far(scheme * SETS + i) for i in range(SETS)]

    def measured(self, state: State, scheme: int) -> Measured:
        """What is known of the levels of a scheme."""
        totals = self.totals(state, scheme)
        differences = [self.spread(one) for one in totals[:LEVELS]]
        beside, alone = ([self.spread(one, -1) for one in some] for some in (totals[:LEVELS], totals[LEVELS:ALONG]))
        along = [self.spread(one, -1, True) for one in totals[ALONG:AGAINST]]
        ways = zip(along, alone, beside, strict=True)
        values = [next((one for one in way if not np.isnan(one.mean).all()), way[-1]) for way in ways]
        samples = np.array([one.paths for one in totals], float)
        cost = self.costs[scheme * SETS : scheme * SETS + ALONG]
        together = Spread.together(differences), samples[:LEVELS], Spread.together(values)
        return Measured.of(*together, cost[:LEVELS], cost[LEVELS:], [one.paths for one in totals[ALONG:AGAINST]])

    @cached_property
    def spans(self) -> np.ndarray:
        """(F,) how far apart values of each function can be: 0 where paths are all the same, infinity if unknown."""
        if not self.is_random:
            return np.zeros(len(self.case.functions))
        return np.asarray(self.ranges[:, 1] - self.ranges[:, 0])

    def spread(self, totals: Totals, quantity: int = DIFFERENCE, along: bool = False) -> Spread:
        """What is known of the mean of a quantity of a path set.

        Differences are no larger than values are apart, or, where that is not known, are taken to be no larger than
        the values that were seen.
        """
        sums, span, paths = totals.sums[:, quantity], self.spans, totals.paths
        if quantity == DIFFERENCE:
            seen = Spread.of(totals.sums[:, -1], paths, span).range_seen(paths)
            with np.errstate(all="ignore"):
                span = np.minimum(span, seen) + np.where(span > 0.0, np.abs(sums[0].sum(axis=-1) / paths), 0.0)
        return (Spread.along if along else Spread.of)(sums, paths, span)

    def progress(self, state: State) -> Done:
        """Work done and work allocated, in seconds of typical speed, and the standard error."""
        done = sum(self.costs[i] * tally.paths for i, tally in state.tallies.items())
        solved, whole = solving.work(self, state.extra) if self.solvable else (0.0, 0.0)
        total = float(self.costs @ state.extra.wanted) + whole
        return Done(float(done) + solved, total, outcome.standard_error(self, state))

    def so_far(self, state: State) -> State | None:
        """None: before all is there nothing is known of the bias."""
        return None if state.missing() or state.extra.stage < DONE else state

    def results(self, state: State) -> Answer:
        """The answer, from the final state."""
        return outcome.answer(self, state)
