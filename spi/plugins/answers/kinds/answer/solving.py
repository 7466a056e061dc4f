"""Solving in place of sampling: whichever is predicted to take less is continued.

One refinement of the solution is made at a time.  While the rest is predicted to take less than a pilot is worth,
solving goes on; else the pilot predicts the work of sampling, and the cheaper goes on.  Predictions are in seconds of
typical speed, and do not depend on a clock.
"""

import math
import time
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spi.exact.expectations import SOLVING as TITLE
from spi.exact.expectations import refiner
from spi.exact.work import work as working
from spi.plugins.solve.exact.refining import KnownExpectations, Outlook, Refined, outlook, refined
from spi.printing.text import short

from .decisions import Decisions, SolveOrSample, Stage, glance
from .question import QuestionPlan

#: Seconds of solving below which there is no pilot, which has kernels compiled.
SURE = 3.0
_LEAST_SHARE = 0.02  # of the seconds, which may be sampled in any case
_SMALL = 0.1  # of the seconds of sampling, for which a refinement is tried


def _goes_on(ahead: Outlook, most: float, left: float) -> bool:
    """Whether a refinement more pays: all that is to come does, or one alone takes so little that it is tried.

    The predicted fall of errors may be wrong, the cost of one refinement is not.
    """
    most = min(most, left)
    return ahead.next_seconds <= left and (ahead.seconds <= most or ahead.next_seconds <= max(SURE, _SMALL * most))


def why(extra: Decisions, accuracy: float) -> str:
    """Predicted seconds of solving and of sampling, as a text."""
    if math.isnan(extra.solving_seconds):
        return ""
    solving, sampling = (
        short(x, ".2g") if math.isfinite(x) else "does not reach it"
        for x in (extra.solving_seconds, extra.sampling_seconds)
    )
    if math.isnan(extra.sampling_seconds):
        sampling = f"not looked at, as solving was to take less than {SURE:g}"
    return f"predicted seconds of typical speed to {accuracy:g}: solving {solving}, sampling {sampling}"


@dataclass(frozen=True, kw_only=True)
class SolvingPlan(QuestionPlan):
    """Refinements of the solution, and the choice between one more and samples."""

    @cached_property
    def refining(self) -> Any:
        """Solver that refines the solution of the case, see :func:`spi.exact.expectations.refiner`."""
        if self.moments is not None:
            value, error = self.moments.expectations(self.case.initial, (self.case.final_time,))
            return KnownExpectations(value[:, 0], error[:, 0])
        return refiner(self.case.model, self.case.initial, self.case.final_time, self.asked, self.case.accuracy)

    def prospect(self, extra: Decisions, accuracy: float | None = None) -> tuple[Refined, Outlook]:
        """Solution by the refinements so far, and the outlook on the next ones."""
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
        """End, one refinement more, or the comparison with sampling, before the first of which there is a pilot."""
        solution, ahead = self.prospect(extra)
        if ahead.refinements == 0 and not ahead.seconds:
            return self._solved(extra, solution)
        spent, compared = self.solved_seconds(extra), not math.isnan(extra.sampling_seconds)
        if _goes_on(ahead, extra.sampling_seconds if compared else SURE, self.case.seconds - spent):
            return self._refined(extra, ahead)
        wanted = extra.wanted if compared else glance(len(extra.wanted))
        return extra._replace(way=SolveOrSample.UNDECIDED, solving_seconds=spent + ahead.seconds, wanted=wanted)

    def _refined(self, extra: Decisions, ahead: Outlook) -> Decisions:
        """Decisions after one refinement more."""
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
            return extra._replace(way=SolveOrSample.SOLVING, pilot_cpu_seconds=sampled.pilot_cpu_seconds, **both)
        if not reaches:  # and solving is not expected to: this goes on where it is, or becomes, the better
            left, (_, better) = self.case.seconds - spent, self.prospect(extra, sampled.aim)
            if max(better.seconds, ahead.next_seconds) <= left:
                return self._refined(extra._replace(way=SolveOrSample.SOLVING, **both), ahead)
            if not better.seconds:
                return self._solved(extra._replace(**both), solution)
        return sampled._replace(way=SolveOrSample.SAMPLING, **both)

    def _solved(self, extra: Decisions, solution: Refined) -> Decisions:
        """End, with the solution as the answer."""
        _, next_digit = self.prospect(extra, self.case.accuracy / 10)
        return extra._replace(
            stage=Stage.DONE,
            way=SolveOrSample.SOLVING,
            aim=max(self.case.accuracy, float(solution.bound.max())),
            next_cpu_seconds=float(next_digit.seconds) + extra.cpu_seconds,
        )
