"""E phi(y(T)) to a wanted accuracy: without sampling where that is possible, else by the cheapest choice of levels.

The order of events, as in :meth:`AnswerPlan.next_allocation`:

* the **pilot**, some paths of each of the larger steps, estimates variances and means;
* the **choice** of scheme, levels and extrapolation by :mod:`.planner`, from these and from typical costs, so that it
  depends on the spec alone; where the expectation can be solved for, solving and sampling are compared as well;
* the **samples**: a tenth of the work, after which it is chosen again, then the whole;
* the **check**: one step finer is compared on paths of its own.  Where it differs by more than the bias that is stated,
  it becomes the finest step, and the one below is compared.  A reference scheme is compared at the end;
* the **answer**: the value, its interval and warnings.

One class, as all of it are decisions from the same sums over the same path sets: hence the length of this file.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import RandomStream, dimensions_of, points_of
from spi.ensemble.loop import grid, thread_count
from spi.ensemble.protocol import has_friction, large
from spi.ensemble.random_states import RandomState
from spi.exact.expectations import SOLVING as TITLE
from spi.exact.expectations import can_solve, demands, refiner
from spi.exact.linear import Moments
from spi.exact.work import work as working
from spi.expressions import as_numpy, canonical, range_of
from spi.expressions.summands import hidden_summands, is_plain, unbounded_rest
from spi.kinds.blocks import BATCH_BYTES, DIFFERENCE, POWERS, VALUE, Sample, SamplesPlan, two_steps, values_of_blocks
from spi.kinds.linear import linear_moments
from spi.kinds.plans import Cost, Done, KernelCall, State
from spi.numerics.rng import LANES, PATH_SETS
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS
from spi.plugins.solve.exact.refining import Known, Outlook, Refined, outlook, refined
from spi.printing.text import joined, short
from spi.schemes import typical_ns, weak_exponents
from spi.schemes.splitting import has_antithetic_path
from spi.statistics.accumulators import Array, Sums, moments
from spi.statistics.estimators import ROUND, weights
from spi.statistics.tallies import Chunk
from spi.storage.records import HEAVY_TAILS, INTERVAL, Part

from . import planner
from .keys import FINEST, PILOT_LEVELS, PILOT_SAMPLES, ROUNDING
from .results import Answer, Chosen, Compared, Levels

LEVELS = FINEST + 1  #: levels 0, ..., FINEST
ALONG = 2 * LEVELS  #: behind differences and values, the path sets of values along quasi-random points
AGAINST = 3 * LEVELS  #: behind these, those of differences from the reference scheme on the same noise
SETS = 4 * LEVELS  #: path sets of a scheme

#: The costs of a path besides its steps, its beginning and phi at its end, and of the sums over a quantity of a
#: function; measured, of typical speed.
PATH_NS, SUM_NS = 25.0, 15.0

#: The samples of each level of a first glance before the pilot, and the number of its levels, of larger steps.
GLANCE, GLANCE_LEVELS = ROUND * LANES, 4

_ORDERS = 4  # powers of h that extrapolation removes, and the next

#: Seconds of solving below which there is no pilot, which has kernels compiled.
SURE = 3.0
_LEAST_SHARE = 0.02  # of the seconds, which may be sampled in any case
_SMALL = 0.1  # of the seconds of sampling, for which a refinement is tried
#: The stages: the pilot, a share of the work, the whole of it and more for its checks; and the end.
PILOTING, BEGINNING, WHOLE, DONE = 0, 1, 2, 99
#: The states of `solving`: not decided, as long as the pilot goes on; solved for; and sampled.
UNDECIDED, SOLVING, SAMPLING = 0, 1, 2

MOST_STAGES = 14  #: after which the answer is given as it is
_PILOT_WORTH = 2.0  # work in pilots below which there is no full one after the first glance
_SHARE = 0.1  # of the work before it is chosen again
_WORTH = 20.0  # work in pilots below which another pilot or choice does not pay
_POINTS = 2.0  # predicted seconds of typical speed from which on quasi-random points are tried
_SCHEME = 20.0  # and, after these, the other schemes
ALONG_PILOT = 2**15  #: samples of a pilot along points
_STRIDE = 4  # ratio of points, or of samples of equal values, to those before
MOST_UNSEEN = 2**17  #: samples after which values that are all equal, with an unknown range, are not resolved
_MARGIN = 0.98  # of the accuracy, the aim after it was missed
_ROOM = 0.3  # of the accuracy, the most that the bias may have in the end

_CHECK_WIDTH = 2.0  # standard errors by which the check may be off


class Totals(Sums):
    """Sums over some samples of one path set, for F functions."""

    sums: Array = moments("quantity function", POWERS)


class Best(NamedTuple):
    """The best choice of levels of a scheme, from the estimates of its levels."""

    choice: planner.Choice
    measured: planner.Measured
    exponents: tuple[float, ...]  #: powers of h in the weak error
    order: float  #: of the means, where it is not that of theory; NaN else

    def samples(self, accuracy: float, bias: float | None = None, factor: float = INTERVAL) -> np.ndarray:
        """The samples of differences and values that an answer to an accuracy wants, see :func:`allocation`."""
        return planner.allocation(self.measured, self.exponents, self.choice, accuracy, bias, factor)


class Decisions(NamedTuple):
    """Results besides sums over paths, for F functions."""

    wanted: np.ndarray  #: (path sets,) samples
    refined: np.ndarray  #: (refinements, F) expectations without sampling
    uncertain: np.ndarray  #: (refinements, F) the uncertainty of each refinement by itself
    efforts: np.ndarray  #: (refinements,) that each of them took
    solving: int  #: whether it is solved for, one of UNDECIDED, SOLVING and SAMPLING
    solving_seconds: float = math.nan  #: predicted, of typical speed
    sampling_seconds: float = math.nan
    seconds: float = 0.0  #: wall clock, of what needs no paths
    cpu_seconds: float = 0.0
    stage: int = PILOTING
    piloted: int = 1  #: the number of schemes with a pilot
    looked: int = 0  #: whether it is decided if the pilot needs its small steps
    pointed: int = 0  #: whether there is a pilot along quasi-random points
    points: int = 0  #: whether the largest step follows such points
    scheme: int = 0  #: the number of the scheme that was chosen
    levels: int = 0  #: of extrapolation
    base: int = 0  #: the level that is sampled alone
    finest: int = 0
    compared: int = 0  #: level at whose step the reference scheme is compared, 0 before that
    order: float = math.nan  #: of the bias, where it is not that of theory
    aim: float = math.nan  #: half the width of the interval that is aimed at
    work: float = 0.0  #: predicted, in seconds of typical speed
    pilot_cpu_seconds: float = 0.0
    predicted_cpu_seconds: float = math.nan
    next_cpu_seconds: float = math.nan  #: of an answer to a tenth of the accuracy

    @classmethod
    def initial(cls, sets: int, functions: int, sampling: bool) -> "Decisions":
        """The pilot of the first scheme is wanted, if anything is sampled."""
        wanted, none = glance(sets) if sampling else np.zeros(sets, np.int64), np.zeros((0, functions))
        return cls(wanted, none, none, np.zeros(0), UNDECIDED if sampling else SOLVING)

    @property
    def set_of_base(self) -> int:
        """The number of the path set with the largest step alone among those of the scheme."""
        return (ALONG if self.points else LEVELS) + self.base

    def with_best(self, best: Best) -> "Decisions":
        """The decisions with other levels."""
        levels, base, finest, work, _ = best.choice
        points = int(best.measured.along[base] > 0)
        return self._replace(levels=levels, base=base, finest=finest, work=work, order=best.order, points=points)


def pilot_of(scheme: int, sets: int) -> np.ndarray:
    """(sets,) the samples of the pilot of a scheme: of differences, and of the largest step alone."""
    wanted = np.zeros(sets, np.int64)
    wanted[[scheme * SETS + level for level in (*range(1, PILOT_LEVELS + 1), LEVELS)]] = PILOT_SAMPLES
    return wanted


def glance(sets: int) -> np.ndarray:
    """(sets,) the samples of the first steps of the pilot of the first scheme."""
    wanted = np.zeros(sets, np.int64)
    wanted[[*range(1, GLANCE_LEVELS + 1), LEVELS]] = GLANCE
    return wanted


class Outcome(NamedTuple):
    """The estimates from all sums, arrays (F,)."""

    value: np.ndarray
    half: np.ndarray  #: half the width of the 95 % interval, the bias included
    bias: np.ndarray
    stderr: np.ndarray
    order: float  #: of the bias
    check: np.ndarray  #: the difference to one step finer
    check_stderr: np.ndarray
    passed: bool
    share: np.ndarray  #: (levels,) weights of the differences in the value
    unresolved: np.ndarray  #: whether all values of a mean are equal, and may lie anywhere, or
    few: np.ndarray  #: a few samples have the variance, and others may lie anywhere

    @property
    def factor(self) -> float:
        """(half width without the bias) / standard error, 1.96 unless few samples decide."""
        with np.errstate(all="ignore"):
            factor = np.nan_to_num((self.half - self.bias) / self.stderr, nan=INTERVAL).max()
        return float(np.clip(factor, INTERVAL, 10.0))


class Prediction(NamedTuple):
    """The prediction of an answer, from its pilot alone."""

    how: str  #: the choice, in words
    seconds: float  #: of processor time; NaN where nothing would be sampled
    next_digit: float  #: the same to a tenth of the accuracy


def parts(case: Any) -> list[Part]:
    """One: all schemes are for one answer."""
    return [Part(case.schemes[0])]


def remarks(case: Any) -> Iterator[str]:
    """A hint on the cost of an answer."""
    if not plan(case, parts(case)[0]).solvable:
        yield "`spi answer --dry` runs the pilot and predicts how long it takes"


def _goes_on(ahead: Outlook, most: float, left: float) -> bool:
    """Whether a refinement more pays: all that is to come does, or one alone takes so little that it is tried.

    The predicted fall of errors may be wrong, the cost of one refinement is not.
    """
    most = min(most, left)
    return ahead.next_seconds <= left and (ahead.seconds <= most or ahead.next_seconds <= max(SURE, _SMALL * most))


def why(extra: Decisions, accuracy: float) -> str:
    """The predicted seconds of solving and of sampling, as a text."""
    if math.isnan(extra.solving_seconds):
        return ""
    solving, sampling = (
        short(x, ".2g") if math.isfinite(x) else "does not reach it"
        for x in (extra.solving_seconds, extra.sampling_seconds)
    )
    if math.isnan(extra.sampling_seconds):
        sampling = f"not looked at, as solving was to take less than {SURE:g}"
    return f"predicted seconds of typical speed to {accuracy:g}: solving {solving}, sampling {sampling}"


def power_of_two(paths: float) -> int:
    """The least power of two, a number of paths along points, that is at least `paths`."""
    return max(LEAST_PATHS, 1 << math.ceil(math.log2(max(paths, 1.0))))


def whole_blocks(paths: np.ndarray) -> np.ndarray:
    """Numbers of paths in whole rounds of blocks, 0 where there are none."""
    size = ROUND * LANES
    return (np.ceil(np.minimum(paths, 1e15) / size) * size).astype(np.int64)


def _first_sampled(ways: Sequence[planner.Spread], samples: Sequence[int]) -> tuple[planner.Spread, int]:
    """The first of some spreads that has samples, and their number; else the last one."""
    pairs = list(zip(ways, samples, strict=True))
    return next((pair for pair in pairs if not np.isnan(pair[0].mean).all()), pairs[-1])


def _cpu_seconds(state: State) -> float:
    """Processor seconds of all paths so far."""
    return float(sum(state.so_far(i).cpu_seconds for i in state.tallies))


def _all_raised(extra: Decisions, samples: np.ndarray, most: int | None) -> np.ndarray:
    """(path sets,) the wanted samples, for the chosen scheme at least `samples`, of the largest step at most `most`.

    Samples come in whole blocks, those along points in powers of two.
    """
    each, base = np.zeros(SETS, np.int64), LEVELS + extra.base
    finite = np.nan_to_num(samples[:ALONG], nan=1.0, posinf=1.0)  # where paths diverge no number of them is enough
    finite[base] = min(finite[base], most or np.inf)
    each[:ALONG] = whole_blocks(finite)
    if extra.points:
        points = power_of_two(float(each[base]))
        each[LEVELS + base], each[base] = points if points <= (most or points) else points // 2, 0
    wanted, own = extra.wanted.copy(), slice(extra.scheme * SETS, (extra.scheme + 1) * SETS)
    wanted[own] = np.maximum(wanted[own], each)
    return wanted


@dataclass(frozen=True, kw_only=True)
class AnswerPlan(SamplesPlan):
    """The answer of a case."""

    record = Answer
    sums = Totals

    python: tuple[tuple[str, Callable], ...] = ()  #: Python functions by name, in place of formulas of the case

    # -----------------------------------------------------------------------------------------------------------------
    # The question: functions of the state at the end, and whether their expectations can be solved for.
    # -----------------------------------------------------------------------------------------------------------------

    @cached_property
    def asked(self) -> list[Callable]:
        """The F test functions of arrays of states."""
        given = dict(self.python)
        return [given.get(name, phi) for name, phi in zip(self.case.functions, super().phis, strict=True)]

    @property
    def phis(self) -> list[Callable]:
        """The functions of which there are sums: the F asked ones, and behind them summands that these may hide."""
        return [*self.asked, *(as_numpy(tree) for _, tree in self.hidden)]

    @cached_property
    def hidden(self) -> list[tuple[int, Any]]:
        """Summands in which rare values may hide, each with the number of the function that it belongs to.

        Behind them stand the rests of functions, see :func:`spi.expressions.summands.unbounded_rest`.
        """
        return [(f, part) for f, tree in self._trees for part in hidden_summands(tree)] + self.rests

    @cached_property
    def rests(self) -> list[tuple[int, Any]]:
        """The rests of functions without the summands whose range is known, each with the number of the function."""
        each = ((f, unbounded_rest(tree)) for f, tree in self._trees)
        return [(f, rest) for f, rest in each if rest is not None]

    @property
    def _trees(self) -> list[tuple[int, Any]]:
        """The formulas, each with its number, but for those that have a Python function in their place."""
        python, named = dict(self.python), zip(self.case.functions, self.case.expressions, strict=True)
        return [(f, tree) for f, (name, tree) in enumerate(named) if name not in python]

    @cached_property
    def owners(self) -> np.ndarray:
        """The numbers of the functions that the hidden summands belong to."""
        return np.array([f for f, _ in self.hidden], np.int64)

    @property
    def formulas(self) -> tuple[str, ...]:
        """The texts of the functions, of those in Python their names."""
        texts = zip(self.case.functions, map(canonical, self.case.expressions), strict=True)
        return tuple(name if name in dict(self.python) else text for name, text in texts)

    @cached_property
    def ranges(self) -> np.ndarray:
        """(F + summands, 2) bounds of the functions and of the hidden summands, whatever the state is."""
        bounds = zip(self.case.functions, map(range_of, self.case.expressions), strict=True)
        own = [(-np.inf, np.inf) if name in dict(self.python) else ends for name, ends in bounds]
        return np.array([*own, *(range_of(tree) for _, tree in self.hidden)])

    @cached_property
    def steep(self) -> np.ndarray:
        """(F + summands,) whether a formula may be nearly an indicator: polynomials, sines and cosines are not."""
        return ~np.array([is_plain(tree) for tree in (*self.case.expressions, *(tree for _, tree in self.hidden))])

    @cached_property
    def spans(self) -> np.ndarray:
        """(F + summands,) the largest distance of two values: 0 where all paths are the same, or infinity."""
        if not self.is_random:
            return np.zeros(len(self.ranges))
        return np.asarray(self.ranges[:, 1] - self.ranges[:, 0])

    def exponents(self, scheme: int) -> tuple[float, ...]:
        """The powers of h in the weak error of a scheme; () where theory states none."""
        return weak_exponents(self.of_schemes[scheme].row, self.model, _ORDERS) or ()

    @cached_property
    def moments(self) -> Moments | None:
        """The moments that the functions need, where the equation is linear and they are polynomials; else None."""
        case = self.case
        if case.sampling or self.python or isinstance(case.initial, RandomState):
            return None
        return linear_moments(case.model, case.expressions, (case.final_time,))

    @cached_property
    def solvable(self) -> bool:
        """Whether the expectation can be computed without sampling."""
        if self.moments is not None:
            return True
        case = self.case
        open_ended = case.damping or has_friction(case.model) or isinstance(case.initial, RandomState)
        if case.sampling or open_ended or not can_solve(case.model):
            return False
        end = case.final_time
        return not demands(case.model, ((1.0, ()),), case.initial, end, (end,), self.asked).obstacle

    # -----------------------------------------------------------------------------------------------------------------
    # The paths: the path sets of each scheme, and the cost of their samples.
    # -----------------------------------------------------------------------------------------------------------------

    @cached_property
    def of_schemes(self) -> tuple["AnswerPlan", ...]:
        """The plan as that of each scheme."""
        return tuple(replace(self, part=Part(name)) for name in self.case.schemes)

    @cached_property
    def reference(self) -> "AnswerPlan | None":
        """The plan as that of the scheme that checks the bias."""
        name = self.case.reference_scheme
        return replace(self, part=Part(name)) if name else None

    @cached_property
    def sets(self) -> tuple[Sample, ...]:
        """All path sets, of differences and values of each scheme; that of difference 0 is never wanted."""
        return tuple(map(self._sample, range(len(self.case.schemes) * SETS)))

    def _sample(self, number: int) -> Sample:
        """The paths of a sample of set number `number` of all: of scheme number // SETS.

        VALUE is that of one path, of a level alone the only quantity.  Against a reference scheme DIFFERENCE is that at
        the fine step, VALUE that at the fine step less that at the coarse one.
        """
        case, own, records = self.case, number % SETS, [plan.row.record for plan in self.schemes_of(number)]
        level, paths, weights = own % LEVELS, {"doublings": (0,)}, [[1.0]]
        if own >= AGAINST:
            paths, weights = two_steps(False)[0], [[0.0, 1.0, 0.0, -1.0], [-1.0, 1.0, 1.0, -1.0]]
        elif own < LEVELS:
            paths, difference = two_steps(has_antithetic_path(records[0]))
            weights = [difference, [1.0 * (i == len(difference) // 2) for i in range(len(difference))]]
        h = case.final_time / 2.0**level
        terms = fourier_terms(case.model, records, h, areas=case.areas)
        times = grid(h, 2**level, by_reference=(0,) * len(paths["doublings"]), area_terms=terms, **paths)
        stream = PATH_SETS[number // SETS] + 2 * own
        return Sample.of(times, RandomStream(np.uint64(case.seed), np.uint64(stream)), weights)

    def schemes_of(self, number: int) -> tuple["AnswerPlan", ...]:
        """The plans of the schemes that a path set has paths of."""
        own = (self.of_schemes[number // SETS],)
        return (*own, self.reference) if self.reference and number % SETS >= AGAINST else own

    def noise(self, number: int) -> Any:
        """The random numbers of a path set, or its points."""
        sample, scheme = self.sets[number], self.of_schemes[number // SETS]
        if number % SETS < ALONG or number % SETS >= AGAINST:
            return sample.stream
        return points_of(self.case.seed, int(sample.stream.stream), scheme.scheme, self.model, sample.grid)

    def cost_of(self, number: int) -> float:
        """Seconds of typical speed of a sample of a path set."""
        sample = self.sets[number]
        quantities, paths = sample.weights.shape
        besides = PATH_NS * paths + SUM_NS * quantities * len(self.phis)
        rates = (typical_ns(plan.row, self.case.model) for plan in self.schemes_of(number))
        return sum(1e-9 * (rate * sample.steps + besides) for rate in rates)

    @cached_property
    def costs(self) -> np.ndarray:
        """(path sets,) :meth:`cost_of` all of them."""
        return np.array([self.cost_of(number) for number in range(len(self.sets))])

    def lengths(self, number: int) -> dict[str, int]:
        """The lengths of the axes of the sums."""
        return {"quantity": len(self.sets[number].weights), "function": len(self.ranges)}

    def deciding(self, number: int | None) -> dict[str, Any]:
        """For a path set the model, the functions and the scheme; for the decisions the whole case."""
        rows = self.case.model_dump(include={"compositions"}).get("compositions", {})
        keys = super().deciding(number) | {"compositions": [[name, rows[name]] for name in sorted(rows)]}
        if number is None:
            return keys | {"schemes": self.case.schemes, "samples": self.case.samples}
        for key in ("accuracy", "seconds", "sampling", "extrapolate", "steps"):
            keys.pop(key, None)
        if number % SETS < AGAINST:
            keys.pop("reference_scheme", None)
        return keys | {"part": None, "scheme": self.case.schemes[number // SETS]}

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block of the scheme; the others are rarely needed."""
        return [] if self.solvable else self.calls_of_a_step(self.sets[1].grid, self.sets[1].stream)

    def advance(self, chunks: Sequence[Chunk], started: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, once the kernel of its scheme is there, see :class:`Plan`."""
        number = chunks[0].path_set
        for plan in self.schemes_of(number):
            for call in plan.calls_of_a_step(self.sets[number].grid, self.noise(number)):
                if not is_loaded(call.kernel, call.arguments):
                    with working(f"compiling {plan.part.scheme}", 0.0):
                        call.kernel(*call.arguments)
        yield from super().advance(chunks, started)

    def values(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """The values of the test functions at the end of some blocks."""
        times, noise = self.sets[number].grid, self.noise(number)
        each = [values_of_blocks(plan, times, noise, first, blocks, end)[0] for plan in self.schemes_of(number)]
        return np.concatenate(each, axis=1)

    # -----------------------------------------------------------------------------------------------------------------
    # Estimates from the sums over path sets.
    # -----------------------------------------------------------------------------------------------------------------

    def totals(self, state: State, scheme: int) -> list[Totals]:
        """The sums over all path sets of a scheme."""
        return [state.so_far(scheme * SETS + i) for i in range(SETS)]

    def spread(self, totals: Totals, quantity: int = DIFFERENCE, along: bool = False) -> planner.Spread:
        """The moments (F,) of a quantity of a path set, with the rare values of hidden summands."""
        return self._spread_of_all(totals, quantity, along).with_hidden(self.owners)

    def _spread_of_all(self, totals: Totals, quantity: int = DIFFERENCE, along: bool = False) -> planner.Spread:
        """The moments (F + summands,) of a quantity of a path set.

        Differences are no larger than the range of values, or, where that is infinite, are taken to be no larger than
        the range of the values so far.
        """
        sums, span, paths = totals.sums[:, quantity], self.spans, totals.paths
        if quantity == DIFFERENCE:
            seen = planner.Spread.of(totals.sums[:, -1], paths, span).range_seen(paths)
            with np.errstate(all="ignore"):
                span = np.minimum(span, seen) + np.where(span > 0.0, np.abs(sums[0].sum(axis=-1) / paths), 0.0)
            return planner.Spread.of(sums, paths, span, along, bounded=np.isfinite(self.spans))
        bounds = self.ranges if self.is_random else np.repeat(sums[0].sum(axis=-1)[:, np.newaxis] / paths, 2, axis=1)
        steep = self.steep & ~np.bool_(along)  # along points variances of smooth functions fall faster
        return planner.Spread.of(sums, paths, span, along, bounds, steep, np.isfinite(self.spans))

    def measured(self, state: State, scheme: int) -> planner.Measured:
        """The estimates of the levels of a scheme; values along points come first, then those of levels alone."""
        totals = self.totals(state, scheme)
        differences = [self.spread(each) for each in totals[:LEVELS]]
        beside = [self.spread(each, -1) for each in totals[:LEVELS]]
        alone = [self.spread(each, -1) for each in totals[LEVELS:ALONG]]
        along = [self.spread(each, -1, True) for each in totals[ALONG:AGAINST]]
        paths = [each.paths for each in totals]
        ways = zip(along, alone, beside, strict=True)
        there = zip(paths[ALONG:AGAINST], paths[LEVELS:ALONG], paths[:LEVELS], strict=True)
        values, samples = zip(*map(_first_sampled, ways, there), strict=True)
        return planner.Measured.of(
            planner.Spread.together(differences),
            np.array(paths[:LEVELS], float),
            planner.Spread.together(values),
            self.costs[scheme * SETS : scheme * SETS + ALONG],
            paths[ALONG:AGAINST],
            samples,
        )

    # -----------------------------------------------------------------------------------------------------------------
    # The order of events: pilot, choice, a tenth of the samples, all of them, and the check, which may want more.
    # -----------------------------------------------------------------------------------------------------------------

    def initial_extra(self) -> Decisions:
        """The pilot of the first scheme is wanted, or nothing where no paths are needed."""
        return Decisions.initial(len(self.case.schemes) * SETS, len(self.case.functions), not self.solvable)

    def wanted(self, extra: Decisions) -> np.ndarray:
        """(path sets,) the samples that are wanted for now."""
        return extra.wanted

    def next_allocation(self, state: State) -> Decisions | None:
        """The decisions once all wanted samples are there; None at the end."""
        extra: Decisions = state.extra
        if extra.stage == DONE:
            return None
        if extra.solving == SOLVING:
            return self._after_refinement(extra)
        if extra.stage == PILOTING:
            sampled = self._after_pilot(state)
            undecided = self.solvable and extra.solving == UNDECIDED and sampled.stage != PILOTING
            return self._solve_or_sample(extra, sampled) if undecided else sampled
        if extra.stage == BEGINNING:
            return self._allocated(state, extra, WHOLE)
        return self._checked(state)

    def _after_pilot(self, state: State) -> Decisions:
        """A pilot along points, or of another scheme, where that pays, else the beginning of the work."""
        extra: Decisions = state.extra
        case = self.case
        if not extra.looked:
            extra, pilot = extra._replace(looked=1), pilot_of(0, len(extra.wanted))
            late = case.step_levels[0] >= GLANCE_LEVELS
            if late or self._best(state, 0, case.accuracy).choice.work > _PILOT_WORTH * float(self.costs @ pilot):
                return extra._replace(wanted=np.maximum(extra.wanted, pilot))
        choices = [self._best(state, s, case.accuracy).choice for s in range(extra.piloted)]
        chosen = min(range(len(choices)), key=lambda s: choices[s].work)
        best = choices[chosen]
        if (more := self._until_seen(state, best.work)) is not None:
            return extra._replace(wanted=more)
        worth = min(best.work, self.seconds_left(extra)) if np.isfinite(best.work) else 0.0
        followed = not isinstance(case.initial, RandomState) and not large(self.model)
        if followed and not extra.pointed and worth > _POINTS:
            return extra._replace(wanted=extra.wanted + self._pilot_along(chosen, best.base), pointed=1)
        if extra.piloted < len(case.schemes) and worth > _SCHEME:
            more = extra.wanted + pilot_of(extra.piloted, len(extra.wanted))
            return extra._replace(wanted=more, piloted=extra.piloted + 1)
        extra = extra._replace(scheme=chosen, pilot_cpu_seconds=_cpu_seconds(state))
        few = best.work < _WORTH * float(self.costs @ extra.wanted)
        return self._allocated(state, extra, WHOLE if few else BEGINNING)

    def _until_seen(self, state: State, work: float, few: bool = False) -> np.ndarray | None:
        """(path sets,) more samples of those of which all values are equal, as long as these are a share of the work.

        Where the range of values is infinite, so is the work: up to MOST_UNSEEN samples, also of those of which a `few`
        values have the variance.  None if there are no such.
        """
        wanted = state.extra.wanted
        each = [self.spread(state.so_far(i), -1 if i % SETS >= LEVELS else DIFFERENCE) for i in range(len(self.sets))]
        equal = np.array([spread.equal.any() for spread in each]) & (wanted > 0)
        unknown = np.array([(spread.unknown | (few & np.asarray(spread.few))).any() for spread in each])
        unknown &= (wanted > 0) & (wanted < MOST_UNSEEN)
        left = self.seconds_left(state.extra)
        for some, limit in ((equal, min(work, left)), (unknown, left)):
            more = np.where(some, _STRIDE * wanted, wanted)
            if some.any() and float(self.costs @ more) <= _SHARE * limit:
                return more
        return None

    def _pilot_along(self, scheme: int, base: int) -> np.ndarray:
        """(path sets,) the samples of the pilot along points, at largest steps about the `base` chosen without."""
        wanted = np.zeros(len(self.sets), np.int64)
        record = self.of_schemes[scheme].row.record
        able = [dimensions_of(record, None, self.model, 2**level)[1] <= MOST_DIMENSIONS for level in range(LEVELS)]
        last = min(base + 2, PILOT_LEVELS - 1, sum(able) - 1)
        first = scheme * SETS + ALONG
        wanted[first + min(max(base - 1, 0), last) : first + last + 1] = ALONG_PILOT
        return wanted

    def _best(self, state: State, scheme: int, accuracy: float, bases: tuple[int, ...] = ()) -> Best:
        """The best choice of levels of a scheme; with `bases` one of these is the level of the largest step."""
        measured, exponents = self.measured(state, scheme), self.exponents(scheme)
        allowed = self.case.extrapolate if exponents else (0,)
        order = planner.contradicted(measured, exponents, bases[0] if bases else 0, accuracy)
        if order is not None:
            exponents, allowed = (order,), (0,)
        choice = planner.choose(measured, exponents, allowed, accuracy, self.case.step_levels, bases)
        return Best(choice, measured, exponents, math.nan if order is None else order)

    def _allocated(self, state: State, extra: Decisions, stage: int) -> Decisions:
        """The best choice, with the samples that it wants, or at the beginning a share of them."""
        aim = self._affordable(state, extra.scheme)
        best, next_digit = (self._best(state, extra.scheme, accuracy) for accuracy in (aim, aim / 10))
        extra, samples = extra._replace(aim=aim).with_best(best), best.samples(aim)
        base, most = LEVELS + extra.base, _STRIDE * float(best.measured.along[extra.base])
        if extra.points and min(samples[base], self.case.samples or np.inf) > most:
            stage = BEGINNING  # along points the variance falls faster than can be predicted
        begun = samples * (_SHARE if stage == BEGINNING else 1.0)
        if extra.points:
            begun[base] = min(samples[base], most)
        speed, own = self._speed(state, extra.scheme), slice(extra.scheme * SETS, (extra.scheme + 1) * SETS)
        seconds = float(np.nan_to_num(self.costs[own] @ self._raised(extra, samples)[own]))
        return extra._replace(
            stage=stage,
            wanted=self._raised(extra, begun),
            predicted_cpu_seconds=speed * seconds + extra.pilot_cpu_seconds,
            next_cpu_seconds=speed * float(best.measured.cost @ next_digit.samples(aim / 10)),
        )

    def _affordable(self, state: State, scheme: int) -> float:
        """The accuracy, or the best that the seconds and samples of the case allow."""
        aim, left = self.case.accuracy, self.seconds_left(state.extra)
        for _ in range(4):
            best = self._best(state, scheme, aim)
            samples, extra = best.samples(aim), state.extra._replace(scheme=scheme).with_best(best)
            finite = best.choice.work < np.inf
            excess = float(self.costs @ _all_raised(extra, samples, None)) / left if finite else np.inf
            if self.case.samples:
                excess = max(excess, float(samples[LEVELS + extra.base]) / self.case.samples)
            if excess <= 1.0:
                break
            aim *= 1.02 * np.sqrt(excess) if np.isfinite(excess) else 2.0
        return float(aim)

    def _raised(self, extra: Decisions, samples: np.ndarray) -> np.ndarray:
        """(path sets,) the wanted samples, for the chosen scheme at least `samples`, as far as the seconds allow.

        Those wanted before are there; of new ones each path set has one round of blocks at least.
        """
        more = _all_raised(extra, samples, self.case.samples) - extra.wanted
        left, cost = self.seconds_left(extra) - float(self.costs @ extra.wanted), float(self.costs @ more)
        if cost <= max(left, 0.0):
            return extra.wanted + more
        size = ROUND * LANES
        fewer = (more * max(left, 0.0) / cost).astype(np.int64) // size * size
        fewer = np.maximum(fewer, np.where(extra.wanted == 0, np.minimum(more, size), 0))
        allowed = extra.wanted + fewer
        if extra.points:
            points = extra.scheme * SETS + extra.set_of_base
            allowed[points] = max(int(extra.wanted[points]), power_of_two(allowed[points] // 2 + 1))
        return allowed

    def _speed(self, state: State, scheme: int) -> float:
        """Processor seconds of a second of typical speed, by that path set of a scheme which took least.

        The others have more of the time of a batch that does not grow.
        """
        done = [i for i in state.tallies if i // SETS == scheme and state.tally(i).paths]
        return min(state.so_far(i).cpu_seconds / (self.costs[i] * state.tally(i).paths) for i in done)

    def _checked(self, state: State) -> Decisions:
        """The end, or more samples where the interval is too wide or one step finer differs by too much."""
        extra: Decisions = state.extra
        outcome = self.outcome(state)
        if not (outcome.half <= extra.aim).all():
            extra = extra._replace(aim=max(extra.aim, self._affordable(state, extra.scheme)))
        narrow = bool((outcome.half <= extra.aim).all())
        if outcome.unresolved.any() and (unseen := self._until_seen(state, 0.0, few=True)) is not None:
            return extra._replace(wanted=unseen, stage=extra.stage + 1)
        lost = not np.isfinite(outcome.half).all()
        if (narrow and outcome.passed) or lost or extra.stage >= MOST_STAGES:
            return extra._replace(stage=DONE) if lost else self._comparing(state)
        best = self._best(state, extra.scheme, extra.aim, (extra.base,))
        finer = not outcome.passed or bool((outcome.bias > _ROOM * extra.aim).any())
        above = [level for level in self.case.step_levels if level > extra.finest]
        if finer and not above and bool((outcome.half - outcome.bias <= (1.0 - _ROOM) * extra.aim).all()):
            return extra._replace(stage=DONE)  # no step is left that is small enough
        choice = best.choice._replace(work=extra.work)
        if choice.levels == extra.levels or not finer:
            finest = max(choice.finest, above[0] if finer and above else extra.finest)
            choice = choice._replace(levels=extra.levels if math.isnan(best.order) else 0, finest=finest)
        best = best._replace(choice=choice)
        bias = min(float(outcome.bias.max()), _ROOM * extra.aim) if not finer else planner.BIAS_SHARE * extra.aim
        samples = best.samples(_MARGIN * extra.aim, bias, outcome.factor)
        wanted = self._raised(extra, samples)
        if (wanted == extra.wanted).all():
            there = np.array([state.tally(extra.scheme * SETS + i).paths for i in range(SETS)], float)
            there[LEVELS + extra.base] = there[extra.set_of_base]
            wanted = self._raised(extra, 1.25 * np.where(samples > 0, there[:ALONG], 0.0))
        if (wanted == extra.wanted).all():
            return extra._replace(stage=DONE)  # the case allows no more
        return extra.with_best(best)._replace(stage=extra.stage + 1, wanted=wanted)

    def _comparing(self, state: State) -> Decisions:
        """The end, or samples of the difference from the reference scheme: first a few, then by their variance."""
        extra: Decisions = state.extra
        level = extra.compared or min(max(extra.finest, PILOT_LEVELS - 1), LEVELS - 2)
        number = extra.scheme * SETS + AGAINST + level
        if not self.reference or extra.wanted[number] > PILOT_SAMPLES:
            return extra._replace(stage=DONE)
        wanted = extra.wanted.copy()
        wanted[number] = PILOT_SAMPLES
        if extra.compared:
            stderr = float(np.nan_to_num(self.compared(state).stderr.max()))  # of as many paths as in a pilot
            most = max(self.seconds_left(extra) - float(self.costs @ wanted), 0.0) / self.cost_of(number)
            needed = PILOT_SAMPLES * (stderr / (planner.CHECK_SHARE * extra.aim)) ** 2
            wanted[number] = max(whole_blocks(np.array(min(needed, most))), 2 * PILOT_SAMPLES)
        return extra._replace(wanted=wanted, compared=level)

    # -----------------------------------------------------------------------------------------------------------------
    # Solving in place of sampling: whichever is predicted to take less is continued.
    #
    # One refinement of the solution is made at a time.  While the rest is predicted to take less than a pilot is worth,
    # solving goes on; else the pilot predicts the work of sampling, and the cheaper goes on.  Predictions are in
    # seconds of typical speed, and do not depend on a clock.
    # -----------------------------------------------------------------------------------------------------------------

    @cached_property
    def refining(self) -> Any:
        """The solver that refines the solution of the case, see :func:`spi.exact.expectations.refiner`."""
        if self.moments is not None:
            value, error = self.moments.expectations(self.case.initial, (self.case.final_time,))
            return Known(value[:, 0], error[:, 0])
        return refiner(self.case.model, self.case.initial, self.case.final_time, self.asked, self.case.accuracy)

    def prospect(self, extra: Decisions, accuracy: float | None = None) -> tuple[Refined, Outlook]:
        """The solution by the refinements so far, and the outlook on the next ones."""
        refining, number = self.refining, len(extra.refined)
        solution = refined(extra.refined, extra.uncertain, refining.rough)
        if refining.known is not None:
            solution = solution._replace(value=refining.known, bound=refining.known_bound + 0.0 * refining.known)
        costs = refining.costs(extra.efforts[-1] if number else refining.effort)  # the next take what the last one took
        return solution, outlook(solution, number, costs, accuracy or self.case.accuracy)

    def solved_seconds(self, extra: Decisions) -> float:
        """Seconds of typical speed of the refinements so far."""
        return float(sum(self.refining.costs(effort)[number] for number, effort in enumerate(extra.efforts)))

    def seconds_left(self, extra: Decisions) -> float:
        """Seconds of typical speed that may be sampled: those of the case without the solved ones, but never none."""
        return max(self.case.seconds - self.solved_seconds(extra), _LEAST_SHARE * self.case.seconds)

    def _after_refinement(self, extra: Decisions) -> Decisions:
        """The end, one refinement more, or the comparison with sampling, before the first of which there is a pilot."""
        solution, ahead = self.prospect(extra)
        if ahead.refinements == 0 and not ahead.seconds:
            return self._solved(extra, solution)
        spent, compared = self.solved_seconds(extra), not math.isnan(extra.sampling_seconds)
        if _goes_on(ahead, extra.sampling_seconds if compared else SURE, self.case.seconds - spent):
            return self._refined(extra, ahead)
        wanted = extra.wanted if compared else glance(len(extra.wanted))
        return extra._replace(solving=UNDECIDED, solving_seconds=spent + ahead.seconds, wanted=wanted)

    def _refined(self, extra: Decisions, ahead: Outlook) -> Decisions:
        """The decisions after one refinement more."""
        began, cpu_began = time.perf_counter(), time.process_time()
        before = self.solved_seconds(extra)
        to_come = ahead.seconds if math.isfinite(ahead.seconds) else ahead.next_seconds
        with working(TITLE, to_come, before):
            value, uncertainty, effort = self.refining.refine(len(extra.refined))
        return extra._replace(
            refined=np.concatenate([extra.refined, value[np.newaxis]]),
            uncertain=np.concatenate([extra.uncertain, uncertainty[np.newaxis]]),
            efforts=np.append(extra.efforts, float(effort)),
            seconds=extra.seconds + time.perf_counter() - began,
            cpu_seconds=extra.cpu_seconds + time.process_time() - cpu_began,
            solving_seconds=before + to_come,
            predicted_cpu_seconds=before + to_come,
        )

    def _solve_or_sample(self, extra: Decisions, sampled: Decisions) -> Decisions:
        """After the pilot: its decisions, or those to solve where that is predicted to be cheaper."""
        solution, ahead = self.prospect(extra)
        reaches = sampled.aim <= self.case.accuracy and math.isfinite(sampled.work)
        sampling = sampled.work if reaches else math.inf
        spent = self.solved_seconds(extra)
        both: dict[str, Any] = {"sampling_seconds": sampling, "solving_seconds": spent + ahead.seconds}
        if _goes_on(ahead, sampling, self.case.seconds - spent):
            return extra._replace(solving=SOLVING, pilot_cpu_seconds=sampled.pilot_cpu_seconds, **both)
        if not reaches:  # and solving is not expected to: this goes on where it is, or becomes, the better
            left, (_, better) = self.case.seconds - spent, self.prospect(extra, sampled.aim)
            if max(better.seconds, ahead.next_seconds) <= left:
                return self._refined(extra._replace(solving=SOLVING, **both), ahead)
            if not better.seconds:
                return self._solved(extra._replace(**both), solution)
        return sampled._replace(solving=SAMPLING, **both)

    def _solved(self, extra: Decisions, solution: Refined) -> Decisions:
        """The end, with the solution as the answer."""
        _, next_digit = self.prospect(extra, self.case.accuracy / 10)
        return extra._replace(
            stage=DONE,
            solving=SOLVING,
            aim=max(self.case.accuracy, float(solution.bound.max())),
            next_cpu_seconds=float(next_digit.seconds) + extra.cpu_seconds,
        )

    def prediction(self, extra: Decisions) -> Prediction | None:
        """The prediction after the pilot, or once it is solved for with a finite error; None before."""
        solving, reason = extra.solving == SOLVING, why(extra, self.case.accuracy)
        both = f" ({reason})" if reason else ""
        if extra.stage == PILOTING:
            if not solving:
                return None
            solution, ahead = self.prospect(extra)
            finite = np.isfinite(solution.bound).all() and math.isfinite(ahead.seconds)
            if not finite and ahead.next_seconds <= 10 * SURE:
                return None
        if solving:
            return Prediction(f"without sampling{both}", extra.solving_seconds, math.nan)
        largest, smallest = (self.case.final_time / 2**level for level in (extra.base, extra.finest))
        how = f"{self.case.schemes[extra.scheme]}, {extra.levels} levels of extrapolation, multilevel, steps "
        how += f"{largest:g} to {smallest:g}, for {extra.aim:g}{both}"
        return Prediction(how, extra.predicted_cpu_seconds, extra.next_cpu_seconds)

    # -----------------------------------------------------------------------------------------------------------------
    # The answer: the value, its interval, the check by one step finer, and warnings.
    # -----------------------------------------------------------------------------------------------------------------

    @np.errstate(all="ignore")  # paths may diverge
    def outcome(self, state: State) -> Outcome:
        """The value with its interval, and the check."""
        extra = state.extra
        measured, exponents = self.measured(state, extra.scheme), self.exponents(extra.scheme)
        if not math.isnan(extra.order):
            exponents = (extra.order,)
        w, finest = weights(exponents[: extra.levels]), extra.finest
        share = planner.shares(w, extra.base, finest, LEVELS)
        used, totals = np.flatnonzero(share), self.totals(state, extra.scheme)
        base, along = totals[extra.set_of_base], bool(extra.points)
        of_all = [planner.Term(1.0, self._spread_of_all(base, -1, along), base.paths, along)]
        of_all += [
            planner.Term(float(share[level]), self._spread_of_all(totals[level]), totals[level].paths) for level in used
        ]
        terms = [term._replace(spread=term.spread.with_hidden(self.owners)) for term in of_all]
        value = terms[0].spread.mean + (share[used, np.newaxis] * measured.mean[used]).sum(axis=0)
        (stderr, sampling, _), q = planner.sampling_error(terms), planner.order_of(exponents, extra.levels)
        constant = np.equal(*self.ranges[: len(value)].T)  # by the formula
        rounding = np.where(constant, 0.0, ROUNDING * np.abs(value))
        bias = np.maximum(planner.bound(measured, exponents, extra.levels, finest, extra.base), rounding)
        few = self._few(of_all)
        unresolved = few | np.any([term.spread.unknown for term in terms], axis=0)
        half = np.where(unresolved, np.inf, bias + sampling)
        check, check_stderr = planner.changed(measured, w, finest + 1)
        passed = bool((np.abs(check) <= (1.0 + 2.0**-q) * bias + _CHECK_WIDTH * check_stderr).all())
        return Outcome(value, half, bias, stderr, q, check, check_stderr, passed, share, unresolved, few)

    def _few(self, terms: Sequence[planner.Term]) -> np.ndarray:
        """(F,) whether a few samples have the variance of an estimate whose function has no known range, or a summand.

        With fewer than planner.ENOUGH the largest values of heavy tails have not been seen, and no interval holds.
        """
        seen = [term.spread._replace(variance=term.spread.variance - term.spread.unseen) for term in terms]
        _, _, degrees = planner.sampling_error(
            [term._replace(spread=spread) for term, spread in zip(terms, seen, strict=True)]
        )
        some = np.any(
            [np.asarray(term.spread.few) for term in terms], axis=0
        )  # else it is the variance of rounding errors
        few = some & np.isinf(self.spans) & (degrees < 2.0 * planner.ENOUGH)
        own = few[: len(few) - len(self.owners)]
        own[[f for f, _ in self.rests]] = False  # of these the rest is judged
        return own | (np.bincount(self.owners, few[len(own) :], len(own)) > 0.0)

    @np.errstate(all="ignore")
    def compared(self, state: State) -> Compared:
        """The difference from the reference scheme at a step h, and its limit as h tends to 0.

        With D(h) = a h^r + ..., r the lower order of the two, that is D(h) - (D(2h) - D(h)) / (2^r - 1).
        """
        extra, scheme = state.extra, self.reference
        totals = state.so_far(extra.scheme * SETS + AGAINST + extra.compared)
        of_reference = weak_exponents(scheme.row, self.model, 1) if scheme else None
        r = min((self.exponents(extra.scheme) or (1.0,))[0], (of_reference or (1.0,))[0])
        of_difference, of_change = self.spread(totals), self.spread(totals, VALUE)
        left = of_difference.mean + of_change.mean / (2.0**r - 1.0)
        spread = np.sqrt(of_difference.variance), np.sqrt(of_change.variance) / (2.0**r - 1.0)
        stderr = (spread[0] + spread[1]) / math.sqrt(totals.paths)
        allowed = 0.5 * np.abs(of_change.mean) / (2.0**r - 1.0) + self.outcome(state).bias + _CHECK_WIDTH * stderr
        return Compared(
            reference=self.case.reference_scheme or "",
            step=self.case.final_time / 2.0**extra.compared,
            difference=of_difference.mean,
            left=left,
            stderr=stderr,
            agrees=bool((np.abs(left) <= allowed).all()),
        )

    def results(self, state: State) -> Answer:
        """The answer, from the final state."""
        case, extra = self.case, state.extra
        facts: dict[str, Any] = self.whole(state) | {
            "functions": tuple(case.functions),
            "formulas": self.formulas,
            "why": why(extra, case.accuracy),
            "aim": extra.aim,
            "pilot_seconds": extra.pilot_cpu_seconds,
            "predicted_seconds": extra.predicted_cpu_seconds,
            "next_digit_seconds": extra.next_cpu_seconds,
            "cpu_seconds": extra.cpu_seconds + _cpu_seconds(state),
        }
        outcome = None if extra.solving == SOLVING else self.outcome(state)
        if outcome is None or self._is_better_solved(extra, outcome):
            solution, _ = self.prospect(extra)
            reached = bool((solution.bound <= case.accuracy).all())
            return Answer(
                value=solution.value,
                half=solution.bound,
                bias=solution.bound,
                stderr=np.zeros(len(case.functions)),
                reached=reached,
                solver="the moments of a linear equation" if self.moments else "the backward operator",
                warnings=() if reached else (f"the numerical error is more than {short(case.accuracy, 'g')}",),
                **facts,
            )
        if extra.aim > case.accuracy and np.isfinite(outcome.half).all():
            facts["aim"] = max(case.accuracy, float(outcome.half.max()))  # as far as seconds and samples allow
        chosen = self._chosen(state, outcome)
        other = self.compared(state) if extra.compared else None
        return Answer(
            value=outcome.value,
            half=outcome.half,
            bias=outcome.bias,
            stderr=outcome.stderr,
            reached=bool(outcome.passed and (outcome.half <= facts["aim"]).all() and (not other or other.agrees)),
            warnings=tuple(self._warnings(state, outcome, chosen, other)),
            chosen=chosen,
            compared=other,
            **facts,
        )

    def _is_better_solved(self, extra: Decisions, outcome: Outcome) -> bool:
        """Whether the refinements before it was sampled have a narrower interval, where that is not narrow enough."""
        if not len(extra.refined):
            return False
        both = self.prospect(extra)[0].bound, outcome.half
        bound, half = (float(np.nan_to_num(each, nan=np.inf).max()) for each in both)
        return bound < half and half > self.case.accuracy

    def _chosen(self, state: State, outcome: Outcome) -> Chosen:
        """The choice, with the levels that it uses and that of the check."""
        extra, measured = state.extra, self.measured(state, state.extra.scheme)
        used = np.arange(extra.base + 1, extra.finest + 2)  # the last one is that of the check
        totals = self.totals(state, extra.scheme)
        steps = self.case.final_time / 2.0 ** np.arange(LEVELS)
        return Chosen(
            scheme=self.case.schemes[extra.scheme],
            extrapolated=extra.levels,
            largest_step=float(steps[extra.base]),
            smallest_step=float(steps[extra.finest]),
            order=float(outcome.order),
            samples=int(totals[extra.set_of_base].paths),
            points=bool(extra.points),
            check=outcome.check,
            check_stderr=outcome.check_stderr,
            passed=outcome.passed,
            levels=Levels(
                h=steps[used],
                share=outcome.share[used],
                samples=np.array([totals[level].paths for level in used]),
                **{name: getattr(measured, name)[used].T for name in ("mean", "stderr", "variance", "kurtosis")},
            ),
        )

    def _warnings(self, state: State, outcome: Outcome, chosen: Chosen, other: Compared | None) -> Iterator[str]:
        """The warnings about an answer by sampling."""
        case, extra = self.case, state.extra
        resolved = np.isfinite(outcome.half)
        if not (outcome.half[resolved] <= case.accuracy).all():
            yield f"the interval is {short(outcome.half[resolved].max())} to each side{self._obstacle(extra, outcome)}"
        if not math.isnan(extra.order):
            theory = self.exponents(extra.scheme)[0]
            order = f"the order found is {extra.order:.2f}, not {theory:g} as assumed"
            yield f"{order}, as with functions that have jumps; not extrapolated"
        if (heavy := float(chosen.levels.kurtosis.max())) > HEAVY_TAILS:
            yield f"heavy tails: the kurtosis of a level is {heavy:.3g}, so that intervals may be too narrow"
        if not outcome.passed and np.isfinite(outcome.value).all():
            yield "one step finer differs by more than the bias that is stated; the interval may be too narrow"
        if outcome.unresolved.any():
            equal, few = "all values that were seen are equal", "a few samples have nearly all of the variance"
            for seen, which in ((equal, outcome.unresolved & ~outcome.few), (few, outcome.few)):
                if names := [name for name, so in zip(case.functions, which, strict=True) if so]:
                    reason = f"{seen}, and how far off others can be is not known from the formula"
                    yield f"not resolved: {joined(names)}; {reason}"
        if lost := [name for name, x in zip(case.functions, outcome.value, strict=True) if not math.isfinite(x)]:
            yield f"not finite: {joined(lost)}; paths diverged"
        if other and not other.agrees:
            off = f"{short(np.abs(other.left).max())} +- {short(INTERVAL * other.stderr.max())}"
            limits = f"{chosen.scheme} and {other.reference} have other limits, {off} apart on the same noise"
            yield f"{limits}: one of them is not a scheme for this equation"

    def _obstacle(self, extra: Decisions, outcome: Outcome) -> str:
        """The reason why an interval is wider than the accuracy, as the end of a sentence."""
        case = self.case
        if case.steps and (outcome.bias > outcome.half / 2).any():
            return ", because of the bias of the smallest step"
        if extra.aim > case.accuracy:
            samples, raised = (f" or {case.samples:,} samples", "them") if case.samples else ("", "seconds")
            more = f"more than {case.seconds:g} s of typical speed{samples}"
            return f": accuracy {short(case.accuracy, 'g')} would take {more}; raise {raised}"
        return ", because of few samples" if case.samples else ""

    # -----------------------------------------------------------------------------------------------------------------
    # Cost and progress.
    # -----------------------------------------------------------------------------------------------------------------

    def cost(self) -> Cost:
        """The cost of the pilot, with NaN seconds; or of the refinements before the first decision."""
        if self.solvable:
            _, ahead = self.prospect(self.initial_extra())
            return Cost(0, float(min(ahead.seconds, self.case.seconds)) * thread_count(), int(BATCH_BYTES))
        steps = PILOT_SAMPLES * sum(self.sets[level].steps for level in range(1, PILOT_LEVELS + 1))
        return Cost(steps, float("nan"), int(BATCH_BYTES))

    def progress(self, state: State) -> Done:
        """Work done and work allocated, in seconds of typical speed.

        A rest of solving that cannot be predicted counts with its next refinement alone.
        """
        extra = state.extra
        done = float(sum(self.costs[i] * tally.paths for i, tally in state.tallies.items()))
        total = float(self.costs @ extra.wanted)
        if self.solvable:
            solved = self.solved_seconds(extra)
            done, total = done + solved, total + solved
            if extra.solving == SOLVING and extra.stage != DONE:
                _, ahead = self.prospect(extra)
                total += min(ahead.seconds if math.isfinite(ahead.seconds) else ahead.next_seconds, 1e300)
        return Done(done, total, math.nan)


plan = AnswerPlan.of
