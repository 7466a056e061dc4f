"""E phi(y(T)) to a wanted accuracy: without sampling where that is possible, else by the cheapest choice of levels.

The pilot, some paths of each of the larger steps, tells variances and means; :mod:`.planner` chooses by them, and by
costs that are known before anything is timed, so that a choice depends on the spec alone.  A tenth of the work follows,
after which it chooses again, then the whole.  One step finer is compared on paths of its own: where it differs by more
than the bias that is stated, it becomes the finest step, and the one below is compared.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.ensemble.given import points_of
from spi.ensemble.loop import thread_count
from spi.ensemble.protocol import dimension, has_friction, large
from spi.ensemble.random_states import RandomState
from spi.exact.kolmogorov import SOLVING as TITLE
from spi.exact.kolmogorov import can_solve, refiner
from spi.exact.kolmogorov.refining import Outlook, Refined, outlook, refined
from spi.exact.work import part
from spi.exact.work import work as working
from spi.expressions import canonical, functions_of, range_of
from spi.kinds.blocks import BATCH_BYTES, DIFFERENCE, POWERS, VALUE, Sample, SamplesPlan, values_of_blocks
from spi.kinds.plans import Cost, Done, KernelCall, State
from spi.kinds.weak.estimators.kolmogorov.keys import demands_of
from spi.numerics.rng import LANES
from spi.printing.text import joined, short
from spi.schemes import SCHEMES, weak_exponents
from spi.statistics.accumulators import Array, Sums, moments
from spi.statistics.estimators import ROUND, weights
from spi.statistics.tallies import Chunk
from spi.storage.records import HEAVY_TAILS, INTERVAL, Part

from .keys import PILOT_LEVELS, PILOT_SAMPLES, ROUNDING
from .planner import (
    AGAINST,
    ALONG,
    BEGINNING,
    BIAS_SHARE,
    CHECK_SHARE,
    DONE,
    GLANCE_LEVELS,
    LEVELS,
    PILOTING,
    SETS,
    WHOLE,
    Choice,
    Decisions,
    Measured,
    Spread,
    Term,
    allocation,
    bound,
    changed,
    choose,
    contradicted,
    glance,
    most_points,
    order_of,
    paths_of_set,
    pilot_of,
    power_of_two,
    sampling_error,
    seconds_of,
    shares,
    whole_blocks,
)
from .results import Answer, Chosen, Compared, Levels

# ---------------------------------------------------------------------------------------------------------------------
# The answer that sums over paths make: the value, its interval, the check by one step finer, and what to say of it.
# ---------------------------------------------------------------------------------------------------------------------


_CHECK_WIDTH = 2.0  # standard errors by which the check may be off
_DOUBT = 1.5  # of the consistency, whose bound 1 one of many levels passes now and then


class Found(NamedTuple):
    """What the sums tell, arrays (F,)."""

    value: np.ndarray
    half: np.ndarray
    bias: np.ndarray
    stderr: np.ndarray
    order: float  #: of the bias
    check: np.ndarray  #: by how much one step finer differs
    check_stderr: np.ndarray
    passed: bool
    share: np.ndarray  #: (levels,) how much of each difference is in the value
    unresolved: np.ndarray  #: whether all values of a mean are equal, and nothing is known of how far others may be


@np.errstate(all="ignore")  # paths may diverge
def outcome_of(p: "AnswerPlan", state: State) -> Found:
    """The value with its interval, and the check."""
    extra = state.extra
    measured, exponents = p.measured(state, extra.scheme), p.exponents(extra.scheme)
    if not math.isnan(extra.order):
        exponents = (extra.order,)
    w, finest = weights(exponents[: extra.levels]), extra.finest
    share = shares(w, extra.base, finest, LEVELS)
    used, totals = np.flatnonzero(share), p.totals(state, extra.scheme)
    base = totals[extra.set_of_base]
    of_base = p.spread(base, -1, bool(extra.points))
    value = of_base.mean + (share[used, np.newaxis] * measured.mean[used]).sum(axis=0)
    terms = [Term(1.0, of_base, base.paths, bool(extra.points))]
    terms += [Term(float(share[level]), p.spread(totals[level]), totals[level].paths) for level in used]
    (stderr, sampling), q = sampling_error(terms), order_of(exponents, extra.levels)
    constant = p.ranges[:, 0] == p.ranges[:, 1]  # by the formula
    rounding = np.where(constant, 0.0, ROUNDING * np.abs(value))
    bias = np.maximum(bound(measured, exponents, extra.levels, finest, extra.base), rounding)
    unresolved = np.any([one.spread.unknown for one in terms], axis=0)
    half = np.where(unresolved, np.inf, bias + sampling)
    check, check_stderr = changed(measured, w, finest + 1)
    passed = bool((np.abs(check) <= (1.0 + 2.0**-q) * bias + _CHECK_WIDTH * check_stderr).all())
    return Found(value, half, bias, stderr, q, check, check_stderr, passed, share, unresolved)


def standard_error(p: "AnswerPlan", state: State) -> float:
    """Of the first function, NaN before there is one."""
    extra = state.extra
    if extra.stage == 0 or extra.scheme < 0 or state.tally(extra.scheme * SETS + extra.set_of_base).paths == 0:
        return float("nan")
    with np.errstate(all="ignore"):
        return float(outcome_of(p, state).stderr[0])


@np.errstate(all="ignore")
def compared(p: "AnswerPlan", state: State) -> Compared:
    """The difference from the reference scheme at a step h, and what is left of it as h tends to 0.

    With D(h) = a h^r + ..., r the lower order of the two, that is D(h) - (D(2h) - D(h)) / (2^r - 1).
    """
    extra, scheme = state.extra, p.reference
    number = extra.scheme * SETS + AGAINST + extra.compared
    totals = state.so_far(number)
    of_reference = weak_exponents(scheme.row, p.model, 1) if scheme else None
    r = min((p.exponents(extra.scheme) or (1.0,))[0], (of_reference or (1.0,))[0])
    of_difference, of_change = p.spread(totals), p.spread(totals, VALUE)
    off, fallen = of_difference.mean, of_change.mean
    left = off + fallen / (2.0**r - 1.0)
    spread = np.sqrt(of_difference.variance), np.sqrt(of_change.variance) / (2.0**r - 1.0)
    stderr = (spread[0] + spread[1]) / math.sqrt(totals.paths)
    allowed = 0.5 * np.abs(fallen) / (2.0**r - 1.0) + outcome_of(p, state).bias + _CHECK_WIDTH * stderr
    name, h = p.case.reference_scheme or "", p.case.final_time / 2.0**extra.compared
    return Compared(
        reference=name, step=h, difference=off, left=left, stderr=stderr, agrees=bool((np.abs(left) <= allowed).all())
    )


@np.errstate(all="ignore")
def consistency(p: "AnswerPlan", state: State) -> float:
    """Giles' check |a - b| / (3 (sd a + sd b)): the mean at a step on paths of its own, and beside those of half of it.

    The largest over the levels that are used, each above 1 with probability 0.3 %.
    """
    extra, worst = state.extra, 0.0
    totals = p.totals(state, extra.scheme)
    for level in range(extra.base + 1, extra.finest + 1):
        below = totals[extra.set_of_base if level == extra.base + 1 else level - 1]
        each = ((below, -1), (totals[level], VALUE), (totals[level], DIFFERENCE))
        (coarse, sd_coarse), (fine, sd_fine), (off, sd_off) = (_mean(p, *one) for one in each)
        rounding = ROUNDING * (np.abs(fine) + np.abs(coarse))
        ratio = np.abs(fine - off - coarse) / (3.0 * (sd_coarse + sd_fine + sd_off) + rounding)
        worst = max(worst, float(np.nan_to_num(ratio).max()))
    return worst


def _mean(p: "AnswerPlan", totals: "Totals", quantity: int) -> tuple[np.ndarray, np.ndarray]:
    """(F,) the mean of a quantity of a path set, and its standard error."""
    one = p.spread(totals, quantity)
    return one.mean, np.sqrt(one.variance / totals.paths)


def answer(p: "AnswerPlan", state: State) -> Answer:
    """What is stored."""
    case, extra = p.case, state.extra
    told: dict[str, Any] = p.whole(state) | {
        "functions": tuple(case.functions),
        "formulas": p.formulas,
        "aim": extra.aim,
        "pilot_seconds": extra.pilot_cpu_seconds,
        "predicted_seconds": extra.predicted_cpu_seconds,
        "next_digit_seconds": extra.next_cpu_seconds,
        "cpu_seconds": extra.cpu_seconds + sum(state.so_far(i).cpu_seconds for i in state.tallies),
    }
    if extra.scheme < 0:
        zero, limit = np.zeros(len(case.functions)), extra.known_bound
        reached = bool((limit <= case.accuracy).all())
        return Answer(
            value=extra.known,
            half=limit,
            bias=limit,
            stderr=zero,
            reached=reached,
            why=why(extra, case.accuracy),
            warnings=() if reached else (f"the numerical error is more than {short(case.accuracy, 'g')}",),
            **told,
        )
    one = outcome_of(p, state)
    if extra.aim > case.accuracy and np.isfinite(one.half).all():
        told["aim"] = max(case.accuracy, float(one.half.max()))  # which is what the seconds and samples allow
    reached = bool(one.passed and (one.half <= told["aim"]).all())
    chosen = _chosen(p, state, one)
    other = compared(p, state) if extra.compared else None
    warnings = tuple(_warnings(p, state, one, chosen))
    if other and not other.agrees:
        off = f"{short(np.abs(other.left).max())} +- {short(INTERVAL * other.stderr.max())}"
        what = f"{chosen.scheme} and {other.reference} have other limits, {off} apart on the same noise"
        warnings, reached = (*warnings, f"{what}: one of them is not a scheme for this equation"), False
    named: dict[str, Any] = {"value": one.value, "half": one.half, "bias": one.bias, "stderr": one.stderr}
    return Answer(
        **named, reached=reached, why=_why(p, state), warnings=warnings, chosen=chosen, compared=other, **told
    )


def _chosen(p: "AnswerPlan", state: State, one: Found) -> Chosen:
    extra, measured = state.extra, p.measured(state, state.extra.scheme)
    used = np.arange(extra.base + 1, extra.finest + 2)  # the last one is that of the check
    totals = p.totals(state, extra.scheme)
    steps = p.case.final_time / 2.0 ** np.arange(LEVELS)
    return Chosen(
        scheme=p.case.schemes[extra.scheme],
        extrapolated=extra.levels,
        largest_step=float(steps[extra.base]),
        smallest_step=float(steps[extra.finest]),
        order=float(one.order),
        samples=int(totals[extra.set_of_base].paths),
        points=bool(extra.points),
        check=one.check,
        check_stderr=one.check_stderr,
        passed=one.passed,
        consistency=consistency(p, state),
        levels=Levels(
            h=steps[used],
            share=one.share[used],
            samples=np.array([totals[level].paths for level in used]),
            **{name: getattr(measured, name)[used].T for name in ("mean", "stderr", "variance", "kurtosis")},
        ),
    )


def _why(p: "AnswerPlan", state: State) -> str:
    """What the choice was made from, in seconds of typical speed, which no clock decides."""
    each = []
    for name, works in zip(p.case.schemes, state.extra.works, strict=True):
        known = [f"{short(work, '.2g')} ({n})" for n, work in enumerate(works) if np.isfinite(work)]
        each += [f"{name} {', '.join(known)}"] if known else []
    said = "predicted seconds of typical speed after the pilot (levels of extrapolation)"
    both = [why(state.extra, p.case.accuracy)] if p.solvable else []
    return "; ".join([*both, f"{said}: {'; '.join(each)}" if each else ""]).strip("; ")


def _warnings(p: "AnswerPlan", state: State, one: Found, chosen: Chosen) -> Iterator[str]:
    case, extra = p.case, state.extra
    known = np.isfinite(one.half)
    if not (one.half[known] <= case.accuracy).all():
        yield f"the interval is {short(one.half[known].max())} to each side{_in_the_way(p, state, one)}"
    if not math.isnan(extra.order):
        theory = p.exponents(extra.scheme)[0]
        what = f"the order found is {extra.order:.2f}, not {theory:g} as assumed"
        yield f"{what}, as with functions that have jumps; not extrapolated"
    if (heavy := float(chosen.levels.kurtosis.max())) > HEAVY_TAILS:
        yield f"heavy tails: the kurtosis of a level is {heavy:.3g}, so that intervals may be too narrow"
    if chosen.consistency > _DOUBT:
        yield f"levels do not agree with one another: their check is {chosen.consistency:.1f}, and should be below 1"
    if not one.passed and np.isfinite(one.value).all():
        yield "one step finer differs by more than the bias that is stated; the interval may be too narrow"
    if one.unresolved.any():
        names = [name for name, unknown in zip(case.functions, one.unresolved, strict=True) if unknown]
        what = "all values that were seen are equal, and how far off others can be is not known from the formula"
        yield f"not resolved: {joined(names)}; {what}"
    if lost := [name for name, value in zip(case.functions, one.value, strict=True) if not math.isfinite(value)]:
        yield f"not finite: {joined(lost)}; paths diverged"


def _in_the_way(p: "AnswerPlan", state: State, one: Found) -> str:
    """What keeps an interval from the accuracy that was asked for, as the end of a sentence."""
    case = p.case
    if case.steps and (one.bias > one.half / 2).any():
        return ", because of the bias of the smallest step"
    if state.extra.aim > case.accuracy:
        samples, raised = (f" or {case.samples:,} samples", "them") if case.samples else ("", "seconds")
        more = f"more than {case.seconds:g} s of typical speed{samples}"
        return f": accuracy {short(case.accuracy, 'g')} would take {more}; raise {raised}"
    return ", because of few samples" if case.samples else ""


# ---------------------------------------------------------------------------------------------------------------------
# Whether an answer is solved for or sampled: at each turn what either is predicted to take is compared.
#
# One refinement of the solution is made at a time.  While what is left is predicted to take less than a pilot is worth,
# it goes on; else the pilot says what sampling takes, and the cheaper goes on.  Predictions are in seconds of typical
# speed, and no clock has a say.
# ---------------------------------------------------------------------------------------------------------------------


#: Seconds of solving that are not worth a pilot, which has kernels compiled.
SURE = 3.0
_LEAST_SHARE = 0.02  # of the seconds, which may be sampled in any case
_SMALL = 0.1  # of what sampling takes, for which a refinement is tried
#: Whether it is solved for: not yet decided while the pilot goes on, it is, and not any more.
UNDECIDED, SOLVING, SAMPLING = 0, 1, 2


@lru_cache(maxsize=8, typed=True)
def _refining(model: Any, initial: tuple, final_time: float, functions: tuple, accuracy: float) -> Any:
    return refiner(model, initial, final_time, functions_of(functions, dimension(model)), accuracy)


def refining_of(p: "AnswerPlan") -> Any:
    """What refines the solution of a case."""
    case = p.case
    texts = tuple(canonical(one) for one in case.expressions)
    return _refining(case.model, case.initial, case.final_time, texts, case.accuracy)


def prospect(p: "AnswerPlan", extra: Decisions, accuracy: float | None = None) -> tuple[Refined, Outlook]:
    """What the refinements so far tell, and what it takes to go on with them."""
    refining, number = refining_of(p), len(extra.refined)
    found = refined(extra.refined, extra.uncertain, refining.rough)
    if refining.known is not None:
        found = found._replace(value=refining.known, bound=0.0 * refining.known)
    costs = refining.costs(extra.efforts[-1] if number else refining.effort)  # the next take what the last one took
    return found, outlook(found, number, costs, accuracy or p.case.accuracy)


def solved_seconds(p: "AnswerPlan", extra: Decisions) -> float:
    """Seconds of typical speed of the refinements so far."""
    return float(sum(refining_of(p).costs(effort)[number] for number, effort in enumerate(extra.efforts)))


def seconds_left(p: "AnswerPlan", extra: Decisions) -> float:
    """Seconds of typical speed that may be sampled: those of the case without what was solved, but never none."""
    return max(p.case.seconds - solved_seconds(p, extra), _LEAST_SHARE * p.case.seconds)


def seconds_until_known(p: "AnswerPlan") -> float:
    """Seconds of typical speed until the error of the solution is known, which is before the first decision."""
    _, ahead = prospect(p, p.initial_extra())
    return float(min(ahead.seconds, p.case.seconds))


def turn(p: "AnswerPlan", extra: Decisions) -> Decisions:
    """The end, one refinement more, or the comparison with sampling, before the first of which there is a pilot."""
    found, ahead = prospect(p, extra)
    if ahead.refinements == 0 and not ahead.seconds:
        return _ended(p, extra, found)
    spent = solved_seconds(p, extra)
    most = SURE if math.isnan(extra.sampling_seconds) else extra.sampling_seconds
    if _goes_on(ahead, most, p.case.seconds - spent):
        return _refined(p, extra, ahead)
    wanted = glance(len(extra.wanted)) if math.isnan(extra.sampling_seconds) else extra.wanted
    return extra._replace(solving=UNDECIDED, solving_seconds=spent + ahead.seconds, wanted=wanted)


def _goes_on(ahead: Outlook, most: float, left: float) -> bool:
    """Whether a refinement more pays: all that is to come does, or one alone takes so little that it is tried.

    How fast errors fall may be known badly, and one refinement is known to take what it does.
    """
    most = min(most, left)
    return ahead.next_seconds <= left and (ahead.seconds <= most or ahead.next_seconds <= max(SURE, _SMALL * most))


def solve_or_sample(p: "AnswerPlan", extra: Decisions, sampled: Decisions) -> Decisions:
    """After the pilot: what it decided, or to go on without sampling, where that is predicted to be cheaper."""
    found, ahead = prospect(p, extra)
    reaches = sampled.aim <= p.case.accuracy and math.isfinite(sampled.work)
    sampling = sampled.work if reaches else math.inf
    spent = solved_seconds(p, extra)
    both = {"sampling_seconds": sampling, "solving_seconds": spent + ahead.seconds}
    if _goes_on(ahead, sampling, p.case.seconds - spent):
        return extra._replace(solving=SOLVING, pilot_cpu_seconds=sampled.pilot_cpu_seconds, **both)
    if not reaches and (found.bound <= sampled.aim).all():  # neither reaches it, and this is the better
        return _ended(p, extra._replace(**both), found)
    return sampled._replace(solving=SAMPLING, **both)


def is_clear(p: "AnswerPlan", extra: Decisions) -> bool:
    """Whether it is solved for, and so many refinements are there that what is left can be predicted."""
    if not p.solvable or extra.solving != SOLVING:
        return False
    found, ahead = prospect(p, extra)
    return bool(np.isfinite(found.bound).all() and math.isfinite(ahead.seconds)) or ahead.next_seconds > SURE * 10


def _ended(p: "AnswerPlan", extra: Decisions, found: Refined) -> Decisions:
    """The solution is the answer."""
    aim = max(p.case.accuracy, float(found.bound.max()))
    _, next_digit = prospect(p, extra, p.case.accuracy / 10)
    return extra._replace(
        stage=DONE,
        solving=SOLVING,
        scheme=-1,
        known=found.value,
        known_bound=found.bound,
        aim=aim,
        next_cpu_seconds=float(next_digit.seconds) + extra.cpu_seconds,
    )


def _refined(p: "AnswerPlan", extra: Decisions, ahead: Outlook) -> Decisions:
    """With one refinement more."""
    began, cpu_began = time.perf_counter(), time.process_time()
    before = solved_seconds(p, extra)
    to_come = ahead.seconds if math.isfinite(ahead.seconds) else ahead.next_seconds
    with working(TITLE, to_come, before), part(ahead.next_seconds):
        *each, effort = refining_of(p).refine(len(extra.refined))
    value, uncertain = (
        np.concatenate([a, b[np.newaxis]]) for a, b in zip((extra.refined, extra.uncertain), each, strict=True)
    )
    return extra._replace(
        refined=value,
        uncertain=uncertain,
        efforts=np.append(extra.efforts, float(effort)),
        seconds=extra.seconds + time.perf_counter() - began,
        cpu_seconds=extra.cpu_seconds + time.process_time() - cpu_began,
        solving_seconds=before + to_come,
        predicted_cpu_seconds=before + to_come,
    )


def solving_work(p: "AnswerPlan", extra: Decisions) -> tuple[float, float]:
    """(done, done and to do) of solving, in seconds of typical speed; what cannot be predicted is not to do."""
    done = solved_seconds(p, extra)
    if extra.solving != SOLVING or extra.stage == DONE:
        return done, done
    _, ahead = prospect(p, extra)
    return done, done + min(ahead.seconds if math.isfinite(ahead.seconds) else ahead.next_seconds, 1e300)


def why(extra: Decisions, accuracy: float) -> str:
    """What solving and sampling were predicted to take."""
    if math.isnan(extra.solving_seconds):
        return ""
    solving, sampling = (_in_seconds(x) for x in (extra.solving_seconds, extra.sampling_seconds))
    if math.isnan(extra.sampling_seconds):
        sampling = f"not looked at, as solving was to take less than {SURE:g}"
    return f"predicted seconds of typical speed to {accuracy:g}: solving {solving}, sampling {sampling}"


class Prediction(NamedTuple):
    """The prediction of an answer, from its pilot alone."""

    how: str  #: the choice, in words
    seconds: float  #: of processor time; NaN where nothing would be sampled
    next_digit: float  #: the same to a tenth of the accuracy


def prediction(p: "AnswerPlan", extra: Decisions) -> Prediction | None:
    """The prediction once the pilot is complete and it is clear whether to solve; None before."""
    if extra.stage == PILOTING and not is_clear(p, extra):
        return None
    reason = why(extra, p.case.accuracy) if p.solvable else ""
    both = f" ({reason})" if reason else ""
    if extra.solving == SOLVING:
        return Prediction(f"without sampling{both}", extra.solving_seconds, math.nan)
    end = p.case.final_time
    how = f"{p.case.schemes[extra.scheme]}, {extra.levels} levels of extrapolation, multilevel, steps "
    how += f"{end / 2**extra.base:g} to {end / 2**extra.finest:g}, for {extra.aim:g}{both}"
    return Prediction(how, extra.predicted_cpu_seconds, extra.next_cpu_seconds)


def _in_seconds(x: float) -> str:
    return short(x, ".2g") if math.isfinite(x) else "does not reach it"


# ---------------------------------------------------------------------------------------------------------------------
# What an answer decides next: pilot, a tenth of the work, the whole, checks.
# ---------------------------------------------------------------------------------------------------------------------


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


def next_decisions(p: "AnswerPlan", state: State) -> Decisions | None:
    """What is wanted once all that was wanted is there; None at the end."""
    extra: Decisions = state.extra
    if extra.stage == DONE:
        return None
    if extra.solving == SOLVING:
        return turn(p, extra)
    if extra.stage == PILOTING:
        sampled = _after_pilot(p, state)
        undecided = p.solvable and extra.solving == UNDECIDED and sampled.stage != PILOTING
        return solve_or_sample(p, extra, sampled) if undecided else sampled
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
    worth = min(best[chosen][0].work, seconds_left(p, extra)) if np.isfinite(best[chosen][0].work) else 0.0
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
    left = seconds_left(p, state.extra)
    for some, limit in ((equal, min(work, left)), (unknown, left)):
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
    aim, measured, left = p.case.accuracy, p.measured(state, scheme), seconds_left(p, state.extra)
    for _ in range(4):
        choice, order = _best(p, state, scheme, aim)
        exponents = p.exponents(scheme) if order is None else (order,)
        samples = allocation(measured, exponents, choice, aim)
        points = int(measured.along[choice.base] > 0)
        extra = state.extra._replace(scheme=scheme, points=points).with_choice(choice, order)
        excess = float(p.costs @ _all_raised(extra, samples, None)) / left if choice.work < np.inf else np.inf
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
    left, cost = seconds_left(p, extra) - float(p.costs @ extra.wanted), float(p.costs @ more)
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
    found = outcome_of(p, state)
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
        stderr = np.nan_to_num(compared(p, state).stderr.max())  # of as many paths as in a pilot
        most = max(seconds_left(p, extra) - float(p.costs @ wanted), 0.0) / p.cost_of(number)
        needed = PILOT_SAMPLES * (stderr / (CHECK_SHARE * extra.aim)) ** 2
        wanted[number] = max(whole_blocks(min(needed, most), ROUND), 2 * PILOT_SAMPLES)
    return extra._replace(wanted=wanted, compared=level)


def state_samples(state: State, extra: Decisions) -> np.ndarray:
    """(ALONG,) samples that there are of the chosen scheme, of the largest step those that count."""
    found = np.array([state.tally(extra.scheme * SETS + i).paths for i in range(SETS)], float)
    found[LEVELS + extra.base] = found[extra.set_of_base]
    return found[:ALONG]


def _factor(found: Found) -> float:
    """(half width without the bias) / standard error, 1.96 unless few samples decide."""
    with np.errstate(all="ignore"):
        return float(
            np.clip(np.nan_to_num((found.half - found.bias) / found.stderr, nan=INTERVAL).max(), INTERVAL, 10.0)
        )


_SOLVING = "splitting_order2"  # by whose steps the solvers check the limit
_ORDERS = 4  # powers of h that extrapolation removes, and the next


class Totals(Sums):
    """Sums over some samples of one path set, for F functions."""

    sums: Array = moments("quantity function", POWERS)


def parts(case: Any) -> list[Part]:
    """One: all schemes are for one answer."""
    return [Part(case.schemes[0])]


def remarks(case: Any) -> Iterator[str]:
    """How a person learns what an answer takes."""
    if not plan(case, parts(case)[0]).solvable:
        yield "`spi answer --dry` runs the pilot and predicts how long it takes"


@dataclass(frozen=True, kw_only=True)
class AnswerPlan(SamplesPlan):
    """The answer of a case."""

    record = Answer
    sums = Totals

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
            return Cost(0, seconds_until_known(self) * thread_count(), int(BATCH_BYTES))
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

    def lengths(self, number: int) -> dict[str, int]:
        """The lengths of the axes of the sums."""
        return {"quantity": len(self.sets[number].weights), "function": len(self.case.functions)}

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block of the scheme; the others are rarely needed."""
        return [] if self.solvable else self.calls_of_a_step(self.sets[1].grid, self.sets[1].stream)

    def advance(self, chunks: Sequence[Chunk], known: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, once the kernel of its scheme is there, see :class:`Plan`."""
        number = chunks[0].path_set
        for scheme in self.schemes_of(number):
            for call in scheme.calls_of_a_step(self.sets[number].grid, self.noise(number)):
                if not is_loaded(call.kernel, call.arguments):
                    with working(f"compiling {scheme.part.scheme}", 0.0):
                        call.kernel(*call.arguments)
        yield from super().advance(chunks, known)

    def values(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """The values of the test functions at the end of some blocks."""
        one, noise = self.sets[number], self.noise(number)
        each = [values_of_blocks(s, one.grid, noise, first, blocks, end)[0] for s in self.schemes_of(number)]
        return np.concatenate(each, axis=1)

    def next_allocation(self, state: State) -> Decisions | None:
        """What is wanted next; None once the answer is there."""
        return next_decisions(self, state)

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
        solved, whole = solving_work(self, state.extra) if self.solvable else (0.0, 0.0)
        total = float(self.costs @ state.extra.wanted) + whole
        return Done(float(done) + solved, total, standard_error(self, state))

    def so_far(self, state: State) -> State | None:
        """None: before all is there nothing is known of the bias."""
        return None if state.missing() or state.extra.stage < DONE else state

    def results(self, state: State) -> Answer:
        """The answer, from the final state."""
        return answer(self, state)


plan = AnswerPlan.of
