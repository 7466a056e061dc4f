"""What an answer has decided, and what it decides next: pilot, a tenth of the work, the whole, checks."""

import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.kinds.plans import State
from spi.kinds.weak.estimators.kolmogorov.study import solution
from spi.numerics.rng import LANES
from spi.statistics.estimators import ROUND

from . import outcome
from .levels import ALONG, LEVELS, SETS, most_points, power_of_two, whole_blocks
from .planner import BIAS_SHARE, Choice, Measured, allocation, choose, contradicted

if TYPE_CHECKING:
    from .study import AnswerPlan

#: The stages: the pilot, a share of the work, the whole of it and what its checks ask for; and the end.
PILOTING, BEGINNING, WHOLE, DONE = 0, 1, 2, 99
MOST_STAGES = 14  #: after so many the answer is given as it is

PILOT, PILOT_LEVELS = 2 * ROUND, 7  #: blocks of the pilot, of the levels from 0 up to that
_SHARE = 0.1  # of the work before it is decided again
_WORTH = 20.0  # so many times a pilot's work; where less is left, another pilot or choice does not pay
_POINTS = 5.0  # predicted seconds of typical speed from which on quasi-random points are tried
_SCHEME = 20.0  # the same, once these are known, of the other schemes
_ALONG = 2**15  # samples of a pilot along points
_MARGIN = 0.98  # of the accuracy, aimed at when it was missed
_ROOM = 0.3  # of the accuracy, the most that the bias may have in the end


class Decisions(NamedTuple):
    """What is known besides sums over paths, for F functions."""

    seconds: float  #: wall clock, of what needs no paths
    cpu_seconds: float
    stage: int
    wanted: np.ndarray  #: (path sets,) samples
    piloted: int  #: of how many schemes there is a pilot
    pointed: int  #: whether there is one along quasi-random points
    points: int  #: whether the largest step follows such points
    scheme: int  #: the number of the scheme that was chosen; -1 for the solution without sampling
    levels: int  #: of extrapolation
    base: int  #: the level that is sampled alone
    finest: int
    order: float  #: of the bias, where it is not that of theory; NaN else
    aim: float  #: half the width of the interval that is aimed at
    work: float  #: predicted, in seconds of typical speed
    pilot_cpu_seconds: float
    predicted_cpu_seconds: float
    next_cpu_seconds: float  #: of an answer to a tenth of the accuracy
    works: np.ndarray  #: (schemes, 4) predicted work by levels of extrapolation, NaN where it is not known
    known: np.ndarray  #: (F,) expectations that were found without sampling
    known_bound: np.ndarray  #: (F,)

    @classmethod
    def initial(cls, sets: int, functions: int, sampling: bool) -> "Decisions":
        """The pilot of the first scheme is wanted, if anything is sampled."""
        nothing, nan = np.full(functions, np.nan), float("nan")
        wanted = pilot_of(0, sets) if sampling else np.zeros(sets, np.int64)
        fields: dict[str, Any] = dict.fromkeys(("seconds", "cpu_seconds", "work", "pilot_cpu_seconds"), 0.0)
        fields |= dict.fromkeys(("order", "aim", "predicted_cpu_seconds", "next_cpu_seconds"), nan)
        fields |= dict.fromkeys(("levels", "base", "finest", "scheme", "pointed", "points"), 0)
        return cls(
            **fields,
            stage=PILOTING,
            wanted=wanted,
            piloted=1,
            works=np.full((sets // SETS, 4), nan),
            known=nothing,
            known_bound=nothing,
        )

    @property
    def set_of_base(self) -> int:
        """Which of the path sets of the scheme the largest step alone has."""
        return (ALONG if self.points else LEVELS) + self.base

    @property
    def choice(self) -> Choice:
        """The levels that were chosen."""
        return Choice(self.levels, self.base, self.finest, self.work, 0.0)

    def with_choice(self, choice: Choice, order: float | None) -> "Decisions":
        """With other levels."""
        levels, base, finest, work, _ = choice
        of_order = float("nan") if order is None else order
        return self._replace(levels=levels, base=base, finest=finest, work=work, order=of_order)


def pilot_of(scheme: int, sets: int) -> np.ndarray:
    """(sets,) the samples of the pilot of a scheme: of differences, and of the largest step alone."""
    wanted = np.zeros(sets, np.int64)
    wanted[scheme * SETS + 1 : scheme * SETS + PILOT_LEVELS + 1] = PILOT * LANES
    wanted[scheme * SETS + LEVELS] = PILOT * LANES
    return wanted


def decided(p: "AnswerPlan", state: State) -> Decisions | None:
    """What is wanted once all that was wanted is there; None at the end."""
    extra: Decisions = state.extra
    if extra.stage == DONE:
        return None
    if p.solvable and np.isnan(extra.known).any():
        return _solved(p, extra)
    if extra.stage == PILOTING:
        return _after_pilot(p, state)
    if extra.stage == BEGINNING:
        return _whole(p, state, extra, WHOLE)
    return _checked(p, state)


def _solved(p: "AnswerPlan", extra: Decisions) -> Decisions:
    """With the solution without sampling, which is the answer if it is good enough."""
    began, cpu_began = time.perf_counter(), time.process_time()
    found = solution(p.case, p.solving_rows, p.solving_steps)
    spent = time.perf_counter() - began, time.process_time() - cpu_began
    extra = extra._replace(
        seconds=spent[0],
        cpu_seconds=spent[1],
        known=found.limit,
        known_bound=found.limit_bound,
        aim=p.case.accuracy,
        predicted_cpu_seconds=spent[1],
        next_cpu_seconds=2.0 * spent[1],
    )
    if (found.limit_bound <= p.case.accuracy).all():
        return extra._replace(stage=DONE, scheme=-1)
    return extra._replace(wanted=pilot_of(0, len(extra.wanted)))


def powers_of(p: "AnswerPlan", measured: Measured, scheme: int, accuracy: float, lowest: int) -> Any:
    """(powers of h, levels of extrapolation that may be chosen, order found if it is not that of theory)."""
    exponents = p.exponents(scheme)
    found = contradicted(measured, exponents, lowest, accuracy)
    if found is None:
        return exponents, p.case.extrapolate if exponents else (0,), None
    return (found,), (0,), found


def _best(p: "AnswerPlan", state: State, scheme: int, accuracy: float) -> tuple[Choice, float | None]:
    """The best choice of levels of a scheme, and the order that was found if it is not that of theory."""
    measured = p.measured(state, scheme)
    exponents, allowed, order = powers_of(p, measured, scheme, accuracy, 0)
    return choose(measured, exponents, allowed, accuracy), order


def _after_pilot(p: "AnswerPlan", state: State) -> Decisions:
    """A pilot along points, or of another scheme, where that pays, else the beginning of the work."""
    extra: Decisions = state.extra
    works = extra.works.copy()
    for levels in p.case.extrapolate:
        s = extra.piloted - 1
        measured = p.measured(state, s)
        if not levels or len(p.exponents(s)) > levels:
            works[s, levels] = choose(measured, p.exponents(s), [levels], p.case.accuracy).work
    best = [_best(p, state, s, p.case.accuracy) for s in range(extra.piloted)]
    chosen = min(range(len(best)), key=lambda s: best[s][0].work)
    extra = extra._replace(works=works)
    worth = min(best[chosen][0].work, p.case.seconds) if np.isfinite(best[chosen][0].work) else 0.0
    if not extra.pointed and worth > _POINTS and p.may_follow_points:
        more = extra.wanted + _pilot_along(p, chosen, best[chosen][0].base)
        return extra._replace(wanted=more, pointed=1)
    if extra.piloted < len(p.case.schemes) and worth > _SCHEME:
        more = extra.wanted + pilot_of(extra.piloted, len(extra.wanted))
        return extra._replace(wanted=more, piloted=extra.piloted + 1)
    spent = _cpu_seconds(p, state).sum()
    extra = extra._replace(scheme=chosen, pilot_cpu_seconds=float(spent), aim=_affordable(p, state, chosen))
    cost = np.array([p.cost_of(i) for i in range(len(p.sets))])
    if best[chosen][0].work < _WORTH * float(cost @ extra.wanted):
        return _whole(p, state, extra, WHOLE)
    return _whole(p, state, extra, BEGINNING)


def _pilot_along(p: "AnswerPlan", scheme: int, base: int) -> np.ndarray:
    """(path sets,) the samples of the pilot along points, at largest steps about the one that was chosen without."""
    wanted = np.zeros(len(p.sets), np.int64)
    last = min(base + 2, PILOT_LEVELS - 1, most_points(p.of_schemes[scheme].row, p.model))
    first = scheme * SETS + ALONG
    wanted[first + min(max(base - 1, 0), last) : first + last + 1] = _ALONG
    return wanted


def _affordable(p: "AnswerPlan", state: State, scheme: int) -> float:
    """The accuracy, or the best that the seconds of the case allow."""
    aim = p.case.accuracy
    for _ in range(4):
        work = _best(p, state, scheme, aim)[0].work
        if work <= p.case.seconds:
            break
        aim *= 1.02 * np.sqrt(work / p.case.seconds) if np.isfinite(work) else 2.0
    return float(aim)


def _whole(p: "AnswerPlan", state: State, extra: Decisions, stage: int) -> Decisions:
    """The best choice, with what it wants, or at the beginning with a share of that."""
    choice, order = _best(p, state, extra.scheme, extra.aim)
    measured = p.measured(state, extra.scheme)
    exponents, _, _ = powers_of(p, measured, extra.scheme, extra.aim, 0)
    extra = extra.with_choice(choice, order)
    samples = allocation(measured, exponents, choice, extra.aim)
    extra = extra._replace(points=int(state.tally(extra.scheme * SETS + ALONG + choice.base).paths > 0))
    next_digit = choose(measured, exponents, p.case.extrapolate if order is None else (0,), extra.aim / 10)
    rate = _seconds_per_sample(p, state, extra.scheme)
    return extra._replace(
        stage=stage,
        wanted=_raised(extra, samples * (_SHARE if stage == BEGINNING else 1.0)),
        predicted_cpu_seconds=float(np.nan_to_num(rate @ _of_sets(extra, samples))) + extra.pilot_cpu_seconds,
        next_cpu_seconds=float(rate[:ALONG] @ allocation(measured, exponents, next_digit, extra.aim / 10)),
    )


def _of_sets(extra: Decisions, samples: np.ndarray) -> np.ndarray:
    """(SETS,) samples in whole blocks; those of the largest step along points, where it follows them."""
    found, base = np.zeros(SETS, np.int64), LEVELS + extra.base
    finite = np.nan_to_num(samples[:ALONG], nan=1.0, posinf=1.0)  # where paths diverge no number of them is enough
    found[:ALONG] = whole_blocks(finite, ROUND)
    if extra.points:
        found[LEVELS + base], found[base] = power_of_two(float(found[base])), 0
    return found


def _raised(extra: Decisions, samples: np.ndarray) -> np.ndarray:
    """What is wanted, with at least so many samples of the path sets of the chosen scheme."""
    wanted, own = extra.wanted.copy(), slice(extra.scheme * SETS, (extra.scheme + 1) * SETS)
    wanted[own] = np.maximum(wanted[own], _of_sets(extra, samples))
    return wanted


def _cpu_seconds(p: "AnswerPlan", state: State) -> np.ndarray:
    """(path sets,) processor seconds so far."""
    return np.array([state.so_far(i).cpu_seconds if i in state.tallies else 0.0 for i in range(len(p.sets))])


def _seconds_per_sample(p: "AnswerPlan", state: State, scheme: int) -> np.ndarray:
    """(SETS,) processor seconds of a sample as measured, or as the others tell by what is typical."""
    own = slice(scheme * SETS, (scheme + 1) * SETS)
    typical = np.array([p.cost_of(i) for i in range(len(p.sets))])[own]
    paths = np.array([state.tally(i).paths for i in range(len(p.sets))])[own]
    spent = _cpu_seconds(p, state)[own]
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = spent / paths
        ratio = np.nanmin(rate / typical)  # the other sets have more of what a batch takes whatever its size
        return np.where(paths >= 8 * PILOT * LANES, rate, typical * ratio)


def _checked(p: "AnswerPlan", state: State) -> Decisions:
    """The end, or what is wanted where the interval is too wide or one step finer differs by too much."""
    extra: Decisions = state.extra
    found = outcome.found(p, state)
    narrow = bool((found.half <= extra.aim).all())
    lost = not np.isfinite(found.half).all()
    if (narrow and found.passed) or lost or extra.stage >= MOST_STAGES:
        return extra._replace(stage=DONE)
    measured = p.measured(state, extra.scheme)
    exponents, allowed, order = powers_of(p, measured, extra.scheme, extra.aim, extra.base)
    choice = choose(measured, exponents, allowed, extra.aim, bases=(extra.base,))
    finer = not found.passed or bool((found.bias > _ROOM * extra.aim).any())
    finest = max(choice.finest, min(extra.finest + finer, LEVELS - 2))
    if choice.levels == extra.levels or not finer:
        choice = choice._replace(levels=extra.levels if order is None else 0, finest=finest)
    bias = min(float(found.bias.max()), _ROOM * extra.aim) if not finer else BIAS_SHARE * extra.aim
    samples = allocation(measured, exponents, choice, _MARGIN * extra.aim, bias)
    more = extra.with_choice(choice._replace(work=extra.work), order)._replace(stage=extra.stage + 1)
    wanted = _raised(extra, samples)
    if (wanted == extra.wanted).all():
        wanted = _raised(extra, 1.25 * np.where(samples > 0, state_samples(state, extra), 0.0))
    return more._replace(wanted=wanted)


def state_samples(state: State, extra: Decisions) -> np.ndarray:
    """(ALONG,) samples that there are of the chosen scheme, of the largest step those that count."""
    found = np.array([state.tally(extra.scheme * SETS + i).paths for i in range(SETS)], float)
    found[LEVELS + extra.base] = found[extra.set_of_base]
    return found[:ALONG]
