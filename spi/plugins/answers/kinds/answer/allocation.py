"""Samples of an answer: pilot, choice, a tenth of the samples, all of them, and the check, which may want more."""

import math
from dataclasses import dataclass

import numpy as np

from spi.ensemble.increments import dimensions_of
from spi.ensemble.protocol import large
from spi.ensemble.random_states import RandomState
from spi.kinds.blocks import DIFFERENCE
from spi.kinds.plans import State
from spi.numerics.rng import LANES
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS
from spi.statistics.estimators import ROUND

from . import planner
from .decisions import GLANCE_LEVELS, Best, Decisions, Outcome, Stage, pilot_of
from .estimates import OF_VALUES, EstimatingPlan
from .keys import PILOT_LEVELS, PILOT_SAMPLES
from .sets import LEVELS, Role, SetOf, all_sets, no_samples

MOST_CHECKS = 12  #: after which the answer is given as it is
QUASI_PILOT_SAMPLES = 2**15  #: of each step in a pilot along quasi-random points
QUASI_WORTH = 2.0  #: predicted seconds of typical speed from which on quasi-random points are tried
MOST_UNSEEN = 2**17  #: samples after which values that are all equal, with an unknown range, are not resolved
_PILOT_WORTH = 2.0  # work in pilots below which there is no full one after the first glance
_SHARE = 0.1  # of the work before it is chosen again
_WORTH = 20.0  # work in pilots below which another pilot or choice does not pay
_SCHEME_WORTH = 20.0  # predicted seconds of typical speed from which on, after points, the other schemes are tried
_STRIDE = 4  # ratio of points, or of samples of equal values, to those before
_MARGIN = 0.98  # of the accuracy, the aim after it was missed
_ROOM = 0.3  # of the accuracy, the most that the bias may have in the end
_MORE = 1.25  # ratio of samples to those before, where the variances ask for no more and the interval is too wide


def power_of_two(paths: float) -> int:
    """Least power of two, a number of paths along points, that is at least `paths`."""
    return max(LEAST_PATHS, 1 << math.ceil(math.log2(max(paths, 1.0))))


def whole_blocks(paths: np.ndarray) -> np.ndarray:
    """Numbers of paths in whole rounds of blocks, 0 where there are none."""
    size = ROUND * LANES
    return (np.ceil(np.minimum(paths, 1e15) / size) * size).astype(np.int64)


def cpu_seconds(state: State) -> float:
    """Processor seconds of all paths so far."""
    return float(sum(state.so_far(i).cpu_seconds for i in state.tallies))


def _all_raised(extra: Decisions, samples: np.ndarray, most: int | None) -> np.ndarray:
    """(schemes, roles, levels) the wanted samples, for the chosen scheme at least `samples` (2, levels).

    Of the largest step there are at most `most`.  Samples come in whole blocks, those along points in powers of two.
    """
    each, base = np.zeros_like(extra.wanted), extra.base_set._replace(role=Role.VALUES)
    finite = np.nan_to_num(samples, nan=1.0, posinf=1.0)  # where paths diverge no number of them is enough
    finite[Role.VALUES, extra.base] = min(finite[Role.VALUES, extra.base], most or np.inf)
    each[extra.scheme, [Role.DIFFERENCES, Role.VALUES]] = whole_blocks(finite)
    if extra.follows_points:
        points = power_of_two(float(each[base]))
        each[extra.base_set], each[base] = points if points <= (most or points) else points // 2, 0
    return np.maximum(extra.wanted, each)


@dataclass(frozen=True, kw_only=True)
class AllocatingPlan(EstimatingPlan):
    """Samples that are wanted, step by step."""

    def _after_pilot(self, state: State) -> Decisions:
        """A pilot along points, or of another scheme, where that pays, else the beginning of the work."""
        extra: Decisions = state.extra
        case = self.case
        if not extra.glance_done:
            extra, pilot = extra._replace(glance_done=True), pilot_of(0, len(extra.wanted))
            late = case.step_levels[0] >= GLANCE_LEVELS
            if late or self._best(state, 0, case.accuracy).choice.work > _PILOT_WORTH * self.seconds_of(pilot):
                return extra._replace(wanted=np.maximum(extra.wanted, pilot))
        choices = [self._best(state, s, case.accuracy).choice for s in range(extra.schemes_piloted)]
        chosen = min(range(len(choices)), key=lambda s: choices[s].work)
        best = choices[chosen]
        if (more := self._until_seen(state, best.work)) is not None:
            return extra._replace(wanted=more)
        worth = min(best.work, self.seconds_left(extra)) if np.isfinite(best.work) else 0.0
        followed = not isinstance(case.initial, RandomState) and not large(self.model)
        if followed and not extra.quasi_pilot_done and worth > QUASI_WORTH:
            return extra._replace(wanted=extra.wanted + self._quasi_pilot(chosen, best.base), quasi_pilot_done=True)
        if extra.schemes_piloted < len(case.schemes) and worth > _SCHEME_WORTH:
            more = extra.wanted + pilot_of(extra.schemes_piloted, len(extra.wanted))
            return extra._replace(wanted=more, schemes_piloted=extra.schemes_piloted + 1)
        extra = extra._replace(scheme=chosen, pilot_cpu_seconds=cpu_seconds(state))
        few = best.work < _WORTH * self.seconds_of(extra.wanted)
        return self._allocated(state, extra, Stage.WHOLE if few else Stage.BEGINNING)

    def _until_seen(self, state: State, work: float, few: bool = False) -> np.ndarray | None:
        """(schemes, roles, levels) more samples of sets whose values are all equal, if these are a share of the work.

        Where the range of values is infinite, so is the work: up to MOST_UNSEEN samples, also of those of which a `few`
        values have the variance.  None if there are no such.
        """
        wanted = state.extra.wanted
        each = [
            self.spread(state.so_far(path_set.number), DIFFERENCE if path_set.role == Role.DIFFERENCES else OF_VALUES)
            for path_set in all_sets(len(self.case.schemes))
        ]
        equal = np.reshape([spread.equal.any() for spread in each], wanted.shape) & (wanted > 0)
        unknown = np.reshape([(spread.unknown | (few & np.asarray(spread.few))).any() for spread in each], wanted.shape)
        unknown &= (wanted > 0) & (wanted < MOST_UNSEEN)
        left = self.seconds_left(state.extra)
        for some, limit in ((equal, min(work, left)), (unknown, left)):
            more = np.where(some, _STRIDE * wanted, wanted)
            if some.any() and self.seconds_of(more) <= _SHARE * limit:
                return more
        return None

    def _quasi_pilot(self, scheme: int, base: int) -> np.ndarray:
        """(schemes, roles, levels) the samples of the pilot along points, at steps about the `base` chosen without."""
        wanted = no_samples(len(self.case.schemes))
        record = self.of_schemes[scheme].row.record
        able = [dimensions_of(record, None, self.model, 2**level)[1] <= MOST_DIMENSIONS for level in range(LEVELS)]
        last = min(base + 2, PILOT_LEVELS - 1, sum(able) - 1)
        wanted[scheme, Role.POINTS, min(max(base - 1, 0), last) : last + 1] = QUASI_PILOT_SAMPLES
        return wanted

    def _best(self, state: State, scheme: int, accuracy: float, bases: tuple[int, ...] = ()) -> Best:
        """Best choice of levels of a scheme; with `bases` one of these is the level of the largest step."""
        measured, exponents = self.measured(state, scheme), self.exponents(scheme)
        allowed = self.case.extrapolate if exponents else (0,)
        order = planner.contradicted(measured, exponents, bases[0] if bases else 0, accuracy)
        if order is not None:
            exponents, allowed = (order,), (0,)
        choice = planner.choose(measured, exponents, allowed, accuracy, self.case.step_levels, bases)
        return Best(choice, measured, exponents, math.nan if order is None else order)

    def _allocated(self, state: State, extra: Decisions, stage: Stage) -> Decisions:
        """Best choice, with the samples that it wants, or at the beginning a share of them."""
        aim = self._affordable(state, extra.scheme)
        best, next_digit = (self._best(state, extra.scheme, accuracy) for accuracy in (aim, aim / 10))
        extra, samples = extra._replace(aim=aim).with_best(best), best.samples(aim)
        base, most = (Role.VALUES, extra.base), _STRIDE * float(best.measured.along[extra.base])
        if extra.follows_points and min(samples[base], self.case.samples or np.inf) > most:
            stage = Stage.BEGINNING  # along points the variance falls faster than can be predicted
        begun = samples * (_SHARE if stage == Stage.BEGINNING else 1.0)
        if extra.follows_points:
            begun[base] = min(samples[base], most)
        speed, all_samples = self._speed(state, extra.scheme), self._raised(extra, samples)
        seconds = float(np.nan_to_num(self.costs[extra.scheme].ravel() @ all_samples[extra.scheme].ravel()))
        return extra._replace(
            stage=stage,
            wanted=self._raised(extra, begun),
            predicted_cpu_seconds=speed * seconds + extra.pilot_cpu_seconds,
            next_cpu_seconds=speed * float(best.measured.cost @ next_digit.samples(aim / 10).ravel()),
        )

    def _affordable(self, state: State, scheme: int) -> float:
        """Accuracy, or the best that the seconds and samples of the case allow."""
        aim, left = self.case.accuracy, self.seconds_left(state.extra)
        for _ in range(4):
            best = self._best(state, scheme, aim)
            samples, extra = best.samples(aim), state.extra._replace(scheme=scheme).with_best(best)
            finite = best.choice.work < np.inf
            excess = self.seconds_of(_all_raised(extra, samples, None)) / left if finite else np.inf
            if self.case.samples:
                excess = max(excess, float(samples[Role.VALUES, extra.base]) / self.case.samples)
            if excess <= 1.0:
                break
            aim *= 1.02 * np.sqrt(excess) if np.isfinite(excess) else 2.0
        return float(aim)

    def _raised(self, extra: Decisions, samples: np.ndarray) -> np.ndarray:
        """(schemes, roles, levels) the wanted samples, for the chosen scheme at least `samples` (2, levels).

        That is as far as the seconds allow.  Those wanted before are there; of new ones each path set has one round of
        blocks at least.
        """
        more = _all_raised(extra, samples, self.case.samples) - extra.wanted
        left, cost = self.seconds_left(extra) - self.seconds_of(extra.wanted), self.seconds_of(more)
        if cost <= max(left, 0.0):
            return extra.wanted + more
        size = ROUND * LANES
        fewer = (more * max(left, 0.0) / cost).astype(np.int64) // size * size
        fewer = np.maximum(fewer, np.where(extra.wanted == 0, np.minimum(more, size), 0))
        allowed = extra.wanted + fewer
        if extra.follows_points:
            points = extra.base_set
            allowed[points] = max(int(extra.wanted[points]), power_of_two(allowed[points] // 2 + 1))
        return allowed

    def _speed(self, state: State, scheme: int) -> float:
        """Processor seconds of a second of typical speed, by that path set of a scheme which took least.

        The others have more of the time of a batch that does not grow.
        """
        done = [i for i in state.tallies if SetOf.of(i).scheme == scheme and state.tally(i).paths]
        return min(state.so_far(i).cpu_seconds / (self.costs[SetOf.of(i)] * state.tally(i).paths) for i in done)

    def _checked(self, state: State) -> Decisions:
        """End, or more samples where the interval is too wide or one step finer differs by too much."""
        extra: Decisions = state.extra
        outcome = self.outcome(state)
        if not (outcome.half <= extra.aim).all():
            extra = extra._replace(aim=max(extra.aim, self._affordable(state, extra.scheme)))
        if outcome.unresolved.any() and (unseen := self._until_seen(state, 0.0, few=True)) is not None:
            return extra._replace(wanted=unseen, checks=extra.checks + 1)
        if not np.isfinite(outcome.half).all():  # paths diverged, or a mean is not resolved
            return extra._replace(stage=Stage.DONE)
        if (outcome.passed and bool((outcome.half <= extra.aim).all())) or extra.checks >= MOST_CHECKS:
            return self._comparing(state)
        return self._improved(state, extra, outcome)

    def _improved(self, state: State, extra: Decisions, outcome: Outcome) -> Decisions:
        """More samples, or a smaller step; the end where the case allows no more of them."""
        finer = not outcome.passed or bool((outcome.bias > _ROOM * extra.aim).any())
        smaller = any(level > extra.finest for level in self.case.step_levels)
        if finer and not smaller and bool((outcome.half - outcome.bias <= (1.0 - _ROOM) * extra.aim).all()):
            return extra._replace(stage=Stage.DONE)  # no step is left that is small enough
        best = self._improved_choice(state, extra, finer)
        bias = planner.BIAS_SHARE * extra.aim if finer else min(float(outcome.bias.max()), _ROOM * extra.aim)
        samples = best.samples(_MARGIN * extra.aim, bias, outcome.factor)
        wanted = self._raised(extra, samples)
        if (wanted == extra.wanted).all():
            there = self._sampled(state, extra)
            wanted = self._raised(extra, _MORE * np.where(samples > 0, there, 0.0))
        if (wanted == extra.wanted).all():
            return extra._replace(stage=Stage.DONE)
        return extra.with_best(best)._replace(checks=extra.checks + 1, wanted=wanted)

    def _improved_choice(self, state: State, extra: Decisions, finer: bool) -> Best:
        """Best choice with the largest step as it is, and with a `finer` smallest one where that is wanted.

        Extrapolation stays as it is, but where a smaller step with more or less of it is better.
        """
        best = self._best(state, extra.scheme, extra.aim, (extra.base,))
        choice = best.choice._replace(work=extra.work)
        if choice.levels == extra.levels or not finer:
            above = [level for level in self.case.step_levels if level > extra.finest]
            finest = max(choice.finest, above[0] if finer and above else extra.finest)
            choice = choice._replace(levels=extra.levels if math.isnan(best.order) else 0, finest=finest)
        return best._replace(choice=choice)

    def _sampled(self, state: State, extra: Decisions) -> np.ndarray:
        """(2, levels) the samples of differences and values that there are, of the largest step also along points."""
        roles = Role.DIFFERENCES, Role.VALUES
        each = [[SetOf(extra.scheme, role, level) for level in range(LEVELS)] for role in roles]
        there = np.array([[state.tally(path_set.number).paths for path_set in row] for row in each], float)
        there[Role.VALUES, extra.base] = state.tally(extra.base_set.number).paths
        return there

    def _comparing(self, state: State) -> Decisions:
        """End, or samples of the difference from the reference scheme: first a few, then by their variance."""
        extra: Decisions = state.extra
        level = extra.compared_level or min(max(extra.finest, PILOT_LEVELS - 1), LEVELS - 2)
        path_set = SetOf(extra.scheme, Role.REFERENCE, level)
        if not self.reference or extra.wanted[path_set] > PILOT_SAMPLES:
            return extra._replace(stage=Stage.DONE)
        wanted = extra.wanted.copy()
        wanted[path_set] = PILOT_SAMPLES
        if extra.compared_level:
            stderr = float(np.nan_to_num(self.compared(state).stderr.max()))  # of as many paths as in a pilot
            most = max(self.seconds_left(extra) - self.seconds_of(wanted), 0.0) / self.cost_of(path_set)
            needed = PILOT_SAMPLES * (stderr / (planner.CHECK_SHARE * extra.aim)) ** 2
            wanted[path_set] = max(whole_blocks(np.array(min(needed, most))), 2 * PILOT_SAMPLES)
        return extra._replace(wanted=wanted, compared_level=level)
