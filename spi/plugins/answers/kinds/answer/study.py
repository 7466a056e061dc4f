"""E phi(y(T)) to a wanted accuracy: without sampling where that is possible, else by the cheapest choice of levels.

The order of events, as in :meth:`AnswerPlan.next_allocation`:

* the **pilot**, some paths of each of the larger steps, estimates variances and means;
* the **choice** of scheme, levels and extrapolation by :mod:`.planner`, from these and from typical costs, so that it
  depends on the spec alone; where the expectation can be solved for, solving and sampling are compared as well;
* the **samples**: a tenth of the work, after which it is chosen again, then the whole;
* the **check**: one step finer is compared on paths of its own.  Where it differs by more than the bias that is stated,
  it becomes the finest step, and the one below is compared.  A reference scheme is compared at the end;
* the **answer**: the value, its interval and warnings.

All of it are decisions (:mod:`.decisions`) from the same sums over the same path sets (:mod:`.sets`).  The plan is in
layers, each of which uses only those before: :mod:`.question`, :mod:`.solving`, :mod:`.estimates`, :mod:`.allocation`
and this one.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from spi.ensemble.loop import thread_count
from spi.kinds.blocks import BATCH_BYTES
from spi.kinds.plans import Done, PartCost, State
from spi.printing.text import joined, short
from spi.storage.records import HEAVY_TAILS, INTERVAL, Part

from .allocation import AllocatingPlan, cpu_seconds
from .decisions import Decisions, Outcome, Prediction, SolveOrSample, Stage
from .keys import PILOT_LEVELS, PILOT_SAMPLES
from .results import Answer, Chosen, Compared, SampledDifferences
from .sets import LEVELS, Role, SetOf
from .solving import SURE, why


def parts(case: Any) -> list[Part]:
    """One: all schemes are for one answer."""
    return [Part(case.schemes[0])]


def remarks(case: Any) -> Iterator[str]:
    """A hint on the cost of an answer."""
    if not plan(case, parts(case)[0]).solvable:
        yield "`spi answer --dry` runs the pilot and predicts how long it takes"


@dataclass(frozen=True, kw_only=True)
class AnswerPlan(AllocatingPlan):
    """Answer of a case."""

    record = Answer

    # -----------------------------------------------------------------------------------------------------------------
    # The order of events.
    # -----------------------------------------------------------------------------------------------------------------

    def initial_extra(self) -> Decisions:
        """The pilot of the first scheme is wanted, or nothing where no paths are needed."""
        return Decisions.initial(len(self.case.schemes), len(self.case.functions), not self.solvable)

    def wanted(self, extra: Decisions) -> np.ndarray:
        """(path sets,) the samples that are wanted for now."""
        return extra.wanted.ravel()

    def next_allocation(self, state: State) -> Decisions | None:
        """The decisions once all wanted samples are there; None at the end."""
        extra: Decisions = state.extra
        if extra.stage == Stage.DONE:
            return None
        if extra.way == SolveOrSample.SOLVING:
            return self._after_refinement(extra)
        if extra.stage == Stage.PILOT:
            sampled = self._after_pilot(state)
            undecided = self.solvable and extra.way == SolveOrSample.UNDECIDED and sampled.stage != Stage.PILOT
            return self._solve_or_sample(extra, sampled) if undecided else sampled
        if extra.stage == Stage.BEGINNING:
            return self._allocated(state, extra, Stage.WHOLE)
        return self._checked(state)

    def prediction(self, extra: Decisions) -> Prediction | None:
        """The prediction after the pilot, or once it is solved for with a finite error; None before."""
        solving, reason = extra.way == SolveOrSample.SOLVING, why(extra, self.case.accuracy)
        both = f" ({reason})" if reason else ""
        if extra.stage == Stage.PILOT:
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

    def results(self, state: State) -> Answer:
        """Answer, from the final state."""
        case, extra = self.case, state.extra
        facts: dict[str, Any] = self.whole(state) | {
            "functions": tuple(case.functions),
            "formulas": self.formulas,
            "why": why(extra, case.accuracy),
            "aim": extra.aim,
            "pilot_seconds": extra.pilot_cpu_seconds,
            "predicted_seconds": extra.predicted_cpu_seconds,
            "next_digit_seconds": extra.next_cpu_seconds,
            "cpu_seconds": extra.cpu_seconds + cpu_seconds(state),
        }
        outcome = None if extra.way == SolveOrSample.SOLVING else self.outcome(state)
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
        other = self.compared(state) if extra.compared_level else None
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
        """Choice, with the levels that it uses and that of the check."""
        extra, measured = state.extra, self.measured(state, state.extra.scheme)
        used = np.arange(extra.base + 1, extra.finest + 2)  # the last one is that of the check
        coupled = self.totals(state, extra.scheme, Role.DIFFERENCES)
        steps = self.case.final_time / 2.0 ** np.arange(LEVELS)
        return Chosen(
            scheme=self.case.schemes[extra.scheme],
            extrapolated=extra.levels,
            largest_step=float(steps[extra.base]),
            smallest_step=float(steps[extra.finest]),
            order=float(outcome.order),
            samples=int(state.so_far(extra.base_set.number).paths),
            points=bool(extra.follows_points),
            check=outcome.check,
            check_stderr=outcome.check_stderr,
            passed=outcome.passed,
            levels=SampledDifferences(
                h=steps[used],
                share=outcome.share[used],
                samples=np.array([coupled[level].paths for level in used]),
                **{name: getattr(measured, name)[used].T for name in ("mean", "stderr", "variance", "kurtosis")},
            ),
        )

    def _warnings(self, state: State, outcome: Outcome, chosen: Chosen, other: Compared | None) -> Iterator[str]:
        """Warnings about an answer by sampling."""
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
        yield from self._unresolved(outcome)
        if lost := [name for name, x in zip(case.functions, outcome.value, strict=True) if not math.isfinite(x)]:
            yield f"not finite: {joined(lost)}; paths diverged"
        if other and not other.agrees:
            off = f"{short(np.abs(other.left).max())} +- {short(INTERVAL * other.stderr.max())}"
            limits = f"{chosen.scheme} and {other.reference} have other limits, {off} apart on the same noise"
            yield f"{limits}: one of them is not a scheme for this equation"

    def _unresolved(self, outcome: Outcome) -> Iterator[str]:
        """Warnings about functions in which rare values may hide."""
        equal, few = "all values that were seen are equal", "a few samples have nearly all of the variance"
        for seen, which in ((equal, outcome.unresolved & ~outcome.few), (few, outcome.few)):
            if names := [name for name, so in zip(self.case.functions, which, strict=True) if so]:
                reason = f"{seen}, and how far off others can be is not known from the formula"
                yield f"not resolved: {joined(names)}; {reason}"

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

    def cost(self) -> PartCost:
        """Cost of the pilot, with NaN seconds; or of the refinements before the first decision."""
        if self.solvable:
            _, ahead = self.prospect(self.initial_extra())
            return PartCost(0, float(min(ahead.seconds, self.case.seconds)) * thread_count(), int(BATCH_BYTES))
        steps = PILOT_SAMPLES * sum(
            self.sets[SetOf(0, Role.DIFFERENCES, level).number].steps for level in range(1, PILOT_LEVELS + 1)
        )
        return PartCost(steps, float("nan"), int(BATCH_BYTES))

    def progress(self, state: State) -> Done:
        """Work done and work allocated, in seconds of typical speed.

        A rest of solving that cannot be predicted counts with its next refinement alone.
        """
        extra = state.extra
        done = float(sum(self.costs[SetOf.of(i)] * tally.paths for i, tally in state.tallies.items()))
        total = self.seconds_of(extra.wanted)
        if self.solvable:
            solved = self.solved_seconds(extra)
            done, total = done + solved, total + solved
            if extra.way == SolveOrSample.SOLVING and extra.stage != Stage.DONE:
                _, ahead = self.prospect(extra)
                total += min(ahead.seconds if math.isfinite(ahead.seconds) else ahead.next_seconds, 1e300)
        return Done(done, total, math.nan)


plan = AnswerPlan.of
