"""The answer that sums over paths make: the value, its interval, the check by one step finer, and what to say of it."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.kinds.plans import State
from spi.printing.sentences import joined
from spi.printing.text import short
from spi.schemes import weak_exponents
from spi.statistics.richardson import weights
from spi.storage.records import HEAVY_TAILS, INTERVAL

from . import solving
from .keys import ROUNDING
from .levels import AGAINST, DIFFERENCE, LEVELS, SETS, VALUE
from .planner import bound, changed, order_of, shares
from .results import Answer, Chosen, Compared, Levels
from .spread import Term, sampling_error

if TYPE_CHECKING:
    from .study import AnswerPlan, Totals

_SURE = 2.0  # standard errors by which the check may be off
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
def found(p: "AnswerPlan", state: State) -> Found:
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
    passed = bool((np.abs(check) <= (1.0 + 2.0**-q) * bias + _SURE * check_stderr).all())
    return Found(value, half, bias, stderr, q, check, check_stderr, passed, share, unresolved)


def standard_error(p: "AnswerPlan", state: State) -> float:
    """Of the first function, NaN before there is one."""
    extra = state.extra
    if extra.stage == 0 or extra.scheme < 0 or state.tally(extra.scheme * SETS + extra.set_of_base).paths == 0:
        return float("nan")
    with np.errstate(all="ignore"):
        return float(found(p, state).stderr[0])


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
    allowed = 0.5 * np.abs(fallen) / (2.0**r - 1.0) + found(p, state).bias + _SURE * stderr
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
    told: dict[str, Any] = {
        **p.whole(state),
        "functions": tuple(case.functions),
        "formulas": p.formulas,
        "accuracy": case.accuracy,
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
            why=solving.why(extra, case.accuracy),
            warnings=() if reached else (f"the numerical error is more than {short(case.accuracy, 'g')}",),
            **told,
        )
    one = found(p, state)
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
    both = [solving.why(state.extra, p.case.accuracy)] if p.solvable else []
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
