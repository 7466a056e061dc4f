"""What an answer decides next: pilot, a tenth of the work, the whole, checks."""

from typing import TYPE_CHECKING, Any

import numpy as np

from spi.ensemble.protocol import large
from spi.ensemble.random_states import RandomState
from spi.kinds.plans import State
from spi.numerics.rng import LANES
from spi.statistics.estimators import ROUND
from spi.storage.records import INTERVAL

from . import outcome, solving
from .decisions import BEGINNING, DONE, GLANCE_LEVELS, PILOTING, WHOLE, Decisions, pilot_of
from .keys import PILOT_LEVELS, PILOT_SAMPLES
from .levels import AGAINST, ALONG, DIFFERENCE, LEVELS, SETS, most_points, power_of_two, whole_blocks
from .planner import BIAS_SHARE, CHECK_SHARE, Choice, Measured, allocation, choose, contradicted

if TYPE_CHECKING:
    from .study import AnswerPlan

MOST_STAGES = 14  #: after so many the answer is given as it is

_PILOT_WORTH = 2.0  # pilots that what is predicted from these must take, or no more is asked for
_SHARE = 0.1  # of the work before it is decided again
_WORTH = 20.0  # so many times a pilot's work; where less is left, another pilot or choice does not pay
_POINTS = 2.0  # predicted seconds of typical speed from which on quasi-random points are tried
_SCHEME = 20.0  # the same, once these are known, of the other schemes
ALONG_PILOT = 2**15  #: samples of a pilot along points
_STRIDE = 4  # times as many points as there are, or samples of equal values, before it is decided again
MOST_UNSEEN = 2**17  #: samples after which values that are all equal, and may lie anywhere, are not resolved
_MARGIN = 0.98  # of the accuracy, aimed at when it was missed
_ROOM = 0.3  # of the accuracy, the most that the bias may have in the end


def decided(p: "AnswerPlan", state: State) -> Decisions | None:
    """What is wanted once all that was wanted is there; None at the end."""
    extra: Decisions = state.extra
    if extra.stage == DONE:
        return None
    if extra.solving == solving.SOLVING:
        return solving.turn(p, extra)
    if extra.stage == PILOTING:
        sampled = _after_pilot(p, state)
        undecided = p.solvable and extra.solving == solving.UNDECIDED and sampled.stage != PILOTING
        return solving.compared(p, extra, sampled) if undecided else sampled
    if extra.stage == BEGINNING:
        return _whole(p, state, extra, WHOLE)
    return _checked(p, state)


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
    return choose(measured, exponents, allowed, accuracy, p.case.step_levels), order


def _after_pilot(p: "AnswerPlan", state: State) -> Decisions:
    """A pilot along points, or of another scheme, where that pays, else the beginning of the work."""
    extra: Decisions = state.extra
    cost = p.costs
    if not extra.looked:
        extra, pilot = extra._replace(looked=1), pilot_of(0, len(extra.wanted))
        late = p.case.step_levels[0] >= GLANCE_LEVELS
        if late or _best(p, state, 0, p.case.accuracy)[0].work > _PILOT_WORTH * float(cost @ pilot):
            return extra._replace(wanted=np.maximum(extra.wanted, pilot))
    works = extra.works.copy()
    for levels in p.case.extrapolate:
        s = extra.piloted - 1
        measured = p.measured(state, s)
        if levels < max(p.case.step_levels) - min(p.case.step_levels) and (not levels or len(p.exponents(s)) > levels):
            works[s, levels] = choose(measured, p.exponents(s), [levels], p.case.accuracy, p.case.step_levels).work
    best = [_best(p, state, s, p.case.accuracy) for s in range(extra.piloted)]
    chosen = min(range(len(best)), key=lambda s: best[s][0].work)
    if (more := _until_seen(p, state, best[chosen][0].work)) is not None:
        return extra._replace(wanted=more)
    extra = extra._replace(works=works)
    worth = min(best[chosen][0].work, p.case.seconds) if np.isfinite(best[chosen][0].work) else 0.0
    followed = not isinstance(p.case.initial, RandomState) and not large(p.model)
    if followed and not extra.pointed and worth > _POINTS:
        more = extra.wanted + _pilot_along(p, chosen, best[chosen][0].base)
        return extra._replace(wanted=more, pointed=1)
    if extra.piloted < len(p.case.schemes) and worth > _SCHEME:
        more = extra.wanted + pilot_of(extra.piloted, len(extra.wanted))
        return extra._replace(wanted=more, piloted=extra.piloted + 1)
    spent = _cpu_seconds(p, state).sum()
    extra = extra._replace(scheme=chosen, pilot_cpu_seconds=float(spent))
    if best[chosen][0].work < _WORTH * float(cost @ extra.wanted):
        return _whole(p, state, extra, WHOLE)
    return _whole(p, state, extra, BEGINNING)


def _until_seen(p: "AnswerPlan", state: State, work: float) -> np.ndarray | None:
    """(path sets,) more samples of those of which all values are equal, as long as these are a share of the work.

    Where it is not known how far apart values can be, no work is known either: up to MOST_UNSEEN samples.
    """
    wanted = state.extra.wanted
    each = [p.spread(state.so_far(i), -1 if i % SETS >= LEVELS else DIFFERENCE) for i in range(len(p.sets))]
    equal = np.array([one.equal.any() for one in each]) & (wanted > 0)
    unknown = np.array([one.unknown.any() for one in each]) & (wanted > 0) & (wanted < MOST_UNSEEN)
    for some, limit in ((equal, min(work, p.case.seconds)), (unknown, p.case.seconds)):
        more = np.where(some, _STRIDE * wanted, wanted)
        if some.any() and float(p.costs @ more) <= _SHARE * limit:
            return more
    return None


def _pilot_along(p: "AnswerPlan", scheme: int, base: int) -> np.ndarray:
    """(path sets,) the samples of the pilot along points, at largest steps about the one that was chosen without."""
    wanted = np.zeros(len(p.sets), np.int64)
    last = min(base + 2, PILOT_LEVELS - 1, most_points(p.of_schemes[scheme].row, p.model))
    first = scheme * SETS + ALONG
    wanted[first + min(max(base - 1, 0), last) : first + last + 1] = ALONG_PILOT
    return wanted


def _affordable(p: "AnswerPlan", state: State, scheme: int) -> float:
    """The accuracy, or the best that the seconds and samples of the case allow."""
    aim, measured = p.case.accuracy, p.measured(state, scheme)
    for _ in range(4):
        choice, order = _best(p, state, scheme, aim)
        exponents = p.exponents(scheme) if order is None else (order,)
        samples = allocation(measured, exponents, choice, aim)
        points = int(measured.along[choice.base] > 0)
        extra = state.extra._replace(scheme=scheme, points=points).with_choice(choice, order)
        excess = float(p.costs @ _all_raised(extra, samples, None)) / p.case.seconds if choice.work < np.inf else np.inf
        if p.case.samples:
            excess = max(excess, float(samples[LEVELS + choice.base]) / p.case.samples)
        if excess <= 1.0:
            break
        aim *= 1.02 * np.sqrt(excess) if np.isfinite(excess) else 2.0
    return float(aim)


def _whole(p: "AnswerPlan", state: State, extra: Decisions, stage: int) -> Decisions:
    """The best choice, with what it wants, or at the beginning with a share of that."""
    extra = extra._replace(aim=_affordable(p, state, extra.scheme))
    choice, order = _best(p, state, extra.scheme, extra.aim)
    measured = p.measured(state, extra.scheme)
    exponents, _, _ = powers_of(p, measured, extra.scheme, extra.aim, 0)
    extra = extra.with_choice(choice, order)
    samples = allocation(measured, exponents, choice, extra.aim)
    extra = extra._replace(points=int(measured.along[choice.base] > 0))
    base, most = LEVELS + choice.base, _STRIDE * float(measured.along[choice.base])
    if extra.points and min(samples[base], p.case.samples or np.inf) > most:
        stage = BEGINNING  # along points the variance falls faster than is known yet
    begun = samples * (_SHARE if stage == BEGINNING else 1.0)
    if extra.points:
        begun[base] = min(samples[base], most)
    levels = p.case.extrapolate if order is None else (0,)
    next_digit = choose(measured, exponents, levels, extra.aim / 10, p.case.step_levels)
    rate, own = _seconds_per_sample(p, state, extra.scheme), slice(extra.scheme * SETS, (extra.scheme + 1) * SETS)
    return extra._replace(
        stage=stage,
        wanted=_raised(p, extra, begun),
        predicted_cpu_seconds=float(np.nan_to_num(rate @ _raised(p, extra, samples)[own])) + extra.pilot_cpu_seconds,
        next_cpu_seconds=float(rate[:ALONG] @ allocation(measured, exponents, next_digit, extra.aim / 10)),
    )


def _of_sets(extra: Decisions, samples: np.ndarray, most: int | None) -> np.ndarray:
    """(SETS,) samples in whole blocks, of the largest step `most`; those along points, where it follows them."""
    found, base = np.zeros(SETS, np.int64), LEVELS + extra.base
    finite = np.nan_to_num(samples[:ALONG], nan=1.0, posinf=1.0)  # where paths diverge no number of them is enough
    finite[base] = min(finite[base], most or np.inf)
    found[:ALONG] = whole_blocks(finite, ROUND)
    if extra.points:
        points = power_of_two(float(found[base]))
        found[LEVELS + base], found[base] = points if points <= (most or points) else points // 2, 0
    return found


def _raised(p: "AnswerPlan", extra: Decisions, samples: np.ndarray) -> np.ndarray:
    """What is wanted, with so many samples of the path sets of the chosen scheme, as far as the seconds allow.

    All that was wanted before is there; of what is new each path set has one round of blocks at least.
    """
    more = _all_raised(extra, samples, p.case.samples) - extra.wanted
    left, cost = p.case.seconds - float(p.costs @ extra.wanted), float(p.costs @ more)
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


def _all_raised(extra: Decisions, samples: np.ndarray, most: int | None) -> np.ndarray:
    """What is wanted, with at least so many samples of the path sets of the chosen scheme."""
    wanted, own = extra.wanted.copy(), slice(extra.scheme * SETS, (extra.scheme + 1) * SETS)
    wanted[own] = np.maximum(wanted[own], _of_sets(extra, samples, most))
    return wanted


def _cpu_seconds(p: "AnswerPlan", state: State) -> np.ndarray:
    """(path sets,) processor seconds so far."""
    return np.array([state.so_far(i).cpu_seconds if i in state.tallies else 0.0 for i in range(len(p.sets))])


def _seconds_per_sample(p: "AnswerPlan", state: State, scheme: int) -> np.ndarray:
    """(SETS,) processor seconds of a sample as measured, or as the others tell by what is typical."""
    own = slice(scheme * SETS, (scheme + 1) * SETS)
    typical = p.costs[own]
    paths = np.array([state.tally(i).paths for i in range(len(p.sets))])[own]
    spent = _cpu_seconds(p, state)[own]
    with np.errstate(invalid="ignore", divide="ignore"):
        rate = spent / paths
        ratio = np.nanmin(rate / typical)  # the other sets have more of what a batch takes whatever its size
        return np.where(paths >= 8 * PILOT_SAMPLES, rate, typical * ratio)


def _checked(p: "AnswerPlan", state: State) -> Decisions:
    """The end, or what is wanted where the interval is too wide or one step finer differs by too much."""
    extra: Decisions = state.extra
    found = outcome.found(p, state)
    if not (found.half <= extra.aim).all():
        extra = extra._replace(aim=max(extra.aim, _affordable(p, state, extra.scheme)))
    narrow = bool((found.half <= extra.aim).all())
    if found.unresolved.any() and (unseen := _until_seen(p, state, 0.0)) is not None:
        return extra._replace(wanted=unseen, stage=extra.stage + 1)
    lost = not np.isfinite(found.half).all()
    if (narrow and found.passed) or lost or extra.stage >= MOST_STAGES:
        return extra._replace(stage=DONE) if lost else _compared(p, state)
    measured = p.measured(state, extra.scheme)
    exponents, allowed, order = powers_of(p, measured, extra.scheme, extra.aim, extra.base)
    choice = choose(measured, exponents, allowed, extra.aim, p.case.step_levels, (extra.base,))
    finer = not found.passed or bool((found.bias > _ROOM * extra.aim).any())
    above = [level for level in p.case.step_levels if level > extra.finest]
    if finer and not above and bool((found.half - found.bias <= (1.0 - _ROOM) * extra.aim).all()):
        return extra._replace(stage=DONE)  # no step is left that is small enough
    finest = max(choice.finest, above[0] if finer and above else extra.finest)
    if choice.levels == extra.levels or not finer:
        choice = choice._replace(levels=extra.levels if order is None else 0, finest=finest)
    bias = min(float(found.bias.max()), _ROOM * extra.aim) if not finer else BIAS_SHARE * extra.aim
    samples = allocation(measured, exponents, choice, _MARGIN * extra.aim, bias, _factor(found))
    more = extra.with_choice(choice._replace(work=extra.work), order)._replace(stage=extra.stage + 1)
    wanted = _raised(p, extra, samples)
    if (wanted == extra.wanted).all():
        wanted = _raised(p, extra, 1.25 * np.where(samples > 0, state_samples(state, extra), 0.0))
    if (wanted == extra.wanted).all():
        return extra._replace(stage=DONE)  # the case allows no more
    return more._replace(wanted=wanted)


def _compared(p: "AnswerPlan", state: State) -> Decisions:
    """The end, or some samples of the difference from the reference scheme, by whose variance as many as are needed."""
    extra: Decisions = state.extra
    level = extra.compared or min(max(extra.finest, PILOT_LEVELS - 1), LEVELS - 2)
    number = extra.scheme * SETS + AGAINST + level
    if not p.reference or extra.wanted[number] > PILOT_SAMPLES:
        return extra._replace(stage=DONE)
    wanted = extra.wanted.copy()
    wanted[number] = PILOT_SAMPLES
    if extra.compared:
        stderr = np.nan_to_num(outcome.compared(p, state).stderr.max())  # of as many paths as in a pilot
        most = max(p.case.seconds - float(p.costs @ wanted), 0.0) / p.cost_of(number)
        needed = PILOT_SAMPLES * (stderr / (CHECK_SHARE * extra.aim)) ** 2
        wanted[number] = max(whole_blocks(min(needed, most), ROUND), 2 * PILOT_SAMPLES)
    return extra._replace(wanted=wanted, compared=level)


def state_samples(state: State, extra: Decisions) -> np.ndarray:
    """(ALONG,) samples that there are of the chosen scheme, of the largest step those that count."""
    found = np.array([state.tally(extra.scheme * SETS + i).paths for i in range(SETS)], float)
    found[LEVELS + extra.base] = found[extra.set_of_base]
    return found[:ALONG]


def _factor(found: outcome.Found) -> float:
    """(half width without the bias) / standard error, 1.96 unless few samples decide."""
    with np.errstate(all="ignore"):
        return float(
            np.clip(np.nan_to_num((found.half - found.bias) / found.stderr, nan=INTERVAL).max(), INTERVAL, 10.0)
        )
