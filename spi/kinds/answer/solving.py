"""Whether an answer is solved for or sampled: at each turn what either is predicted to take is compared.

One refinement of the solution is made at a time.  While what is left is predicted to take less than a pilot is worth,
it goes on; else the pilot says what sampling takes, and the cheaper goes on.  Predictions are in seconds of typical
speed, and no clock has a say.
"""

import math
import time
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.ensemble.protocol import dimension
from spi.exact.kolmogorov import SOLVING as TITLE
from spi.exact.kolmogorov import refiner
from spi.exact.kolmogorov.refining import Outlook, Refined, outlook, refined
from spi.exact.work import part
from spi.exact.work import work as working
from spi.expressions import canonical, functions_of
from spi.printing.text import short

from .decisions import DONE, Decisions, glance

if TYPE_CHECKING:
    from .study import AnswerPlan

#: Seconds of solving that are not worth a pilot, which has kernels compiled.
SURE = 3.0
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
    return found, outlook(found, number, refining.costs, accuracy or p.case.accuracy)


def seconds_until_known(p: "AnswerPlan") -> float:
    """Seconds of typical speed until the error of the solution is known, which is before the first decision."""
    _, ahead = prospect(p, p.initial_extra())
    return float(min(ahead.seconds, p.case.seconds))


def turn(p: "AnswerPlan", extra: Decisions) -> Decisions:
    """The end, one refinement more, or the comparison with sampling, before the first of which there is a pilot."""
    found, ahead = prospect(p, extra)
    if ahead.refinements == 0 and not ahead.seconds:
        return _ended(p, extra, found)
    spent = sum(refining_of(p).costs[: len(extra.refined)])
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


def compared(p: "AnswerPlan", extra: Decisions, sampled: Decisions) -> Decisions:
    """After the pilot: what it decided, or to go on without sampling, where that is predicted to be cheaper."""
    found, ahead = prospect(p, extra)
    reaches = sampled.aim <= p.case.accuracy and math.isfinite(sampled.work)
    sampling = sampled.work if reaches else math.inf
    spent = sum(refining_of(p).costs[: len(extra.refined)])
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
    refining = refining_of(p)
    before = sum(refining.costs[: len(extra.refined)])
    to_come = ahead.seconds if math.isfinite(ahead.seconds) else ahead.next_seconds
    with working(TITLE, to_come, before), part(ahead.next_seconds):
        each = refining.refine(len(extra.refined))
    value, uncertain = (
        np.concatenate([a, b[np.newaxis]]) for a, b in zip((extra.refined, extra.uncertain), each, strict=True)
    )
    return extra._replace(
        refined=value,
        uncertain=uncertain,
        seconds=extra.seconds + time.perf_counter() - began,
        cpu_seconds=extra.cpu_seconds + time.process_time() - cpu_began,
        solving_seconds=before + to_come,
        predicted_cpu_seconds=before + to_come,
    )


def work(p: "AnswerPlan", extra: Decisions) -> tuple[float, float]:
    """(done, done and to do) of solving, in seconds of typical speed; what cannot be predicted is not to do."""
    done = float(sum(refining_of(p).costs[: len(extra.refined)]))
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


def _in_seconds(x: float) -> str:
    return short(x, ".2g") if math.isfinite(x) else "does not reach it"
