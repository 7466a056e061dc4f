"""Record of an answer."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from spi.printing.text import human_time, power_of_two, readable, short, with_interval
from spi.storage.stored import Array, Claimed, Described, Stored, array, axis, derived, fact, nested

#: The panels of the figure; where nothing is sampled there are estimates alone, the values.
PANELS = ("estimates", "levels")


class SampledDifferences(Described):
    """Differences between neighbouring steps that were sampled, from large to small steps."""

    h: Array = axis("smaller step size of the level", "time", name="level")
    share: Array = array("level", "how much of the difference is in the answer")
    mean: Array = array("function level", "mean of the difference", "value", "E phi(y_h(T)) - E phi(y_2h(T))")
    stderr: Array = array("function level", "standard error of the mean", "value")
    variance: Array = array("function level", "variance of the difference")
    kurtosis: Array = array("function level", "kurtosis of the difference")
    samples: Array = array("level", "samples of the difference")

    @derived("function level", "standard error of the mean")
    def mean_stderr(self) -> Array:
        """(F, levels) of the field `stderr`."""
        return self.stderr


class Chosen(Described):
    """Scheme and steps chosen for sampling, and the outcome of the check."""

    scheme: str = fact("scheme that was chosen", name="chosen_scheme", column=True)
    extrapolated: int = fact("levels of extrapolation", name="extrapolated", column=True)
    largest_step: float = fact("step of the level that is sampled alone", "time", column=True)
    smallest_step: float = fact("smallest step", "time", column=True)
    order: float = fact("order of the bias that was assumed")
    samples: int = fact("samples of the largest step", column=True)
    points: bool = fact("whether the largest step follows quasi-random points", default=False)
    check: Array = array("function", "by how much one step finer differs", "value")
    check_stderr: Array = array("function", "standard error of that difference", "value")
    passed: bool = fact("whether one step finer differs by no more than the bias that is stated")
    levels: SampledDifferences = nested(prefix="level_")


class Compared(Described):
    """Check of the bias by another scheme, on the same noise."""

    reference: str = fact("scheme that checks the bias", name="reference_scheme")
    step: float = fact("step of that check", "time", name="compared_step")
    difference: Array = array("function", "mean difference from the scheme that checks", "value")
    left: Array = array("function", "what is left of it as the step tends to 0", "value")
    stderr: Array = array("function", "standard error of what is left", "value", name="left_stderr")
    agrees: bool = fact("whether the rest vanishes up to its errors")


class Answer(Stored):
    """Expectations E phi(y(T)) with what is left of errors, and how they were found."""

    headline = ("value",)
    measures = (
        r"The answer is $\mathbb{E}\, \varphi(y(T))$ of the equation itself: its 95 % interval holds the error of "
        "sampling and the bias of the step size."
    )
    row_axes = ("function",)

    functions: tuple[str, ...] = axis("test function", name="function")
    value: Array = array("function", "expectation", "value", "E phi(y(T))", claim="equal")
    half: Array = array(
        "function",
        "half the width of the 95 % interval, the bias included",
        "value",
        claim=Claimed("at most", "interval", lost="lost"),
    )
    bias: Array = array("function", "of it the bias at most, or the numerical error", "value")
    stderr: Array = array("function", "standard error of sampling", "value")
    accuracy: float = fact("requested half width", "value", column=True)
    aim: float = fact("half the width that was aimed at, larger where time does not allow more", "value")
    reached: bool = fact("whether the interval is as narrow as was aimed at, and the check passed", column=True)
    why: str = fact("what else might have been chosen, and what it would have taken")
    warnings: tuple[str, ...] = fact("what a person should know", default=())
    panels: tuple[str, ...] = fact("what the figure of the case shows", default=PANELS)
    formulas: tuple[str, ...] = fact("formulas of the test functions in y1, y2, ...", name="functions")
    cpu_seconds: float = fact("processor time", "s", column=True)
    pilot_seconds: float = fact("of it for the pilot", "s", default=0.0)
    predicted_seconds: float = fact("processor time that was predicted", "s", column=True)
    next_digit_seconds: float = fact("processor time of an answer to a tenth of the accuracy", "s")
    solver: str = fact("the way to the solution where nothing is sampled", default="")
    chosen: Chosen | None = None
    compared: Compared | None = None

    def __str__(self) -> str:
        return "\n".join(self.remarks())

    def remarks(self) -> Iterator[str]:
        """Values with intervals, how they were found, what that took, and what a person should know."""
        for f in range(len(self.functions)):
            parts = f"of it bias at most {short(self.bias[f])}, sampling {short(self.sampling[f])}"
            trust = parts if self.chosen else "numerical error, nothing is sampled"
            answer = f"{with_interval(self.value[f], self.half[f])} (95 %; {trust})"
            time = f"at t = {self.about.final_time:g}"
            yield f"{self._expectation(f)} {time}: {answer if np.isfinite(self.half[f]) else self._unresolved(f)}"
        yield f"  {self._method()}"
        yield f"  {self._cost()}"
        if self.why:
            yield f"  {self.why}"
        for warning in self.warnings:
            yield f"  warning: {warning}"

    @classmethod
    def answers(cls, readings: Sequence["Answer"]) -> Iterator[str]:
        """Each expectation with its interval."""
        for one in readings:
            for f, half in enumerate(one.half):
                number = f"{with_interval(one.value[f], half)} (95 %)" if np.isfinite(half) else one._unresolved(f)
                yield f"{one._asked(f)} is {number}."

    def titled(self, title: str, readings: Sequence["Answer"]) -> str:
        """Of a question about an experiment of another kind the expectation itself."""
        asked = title.endswith("(answer)") and len(readings) == len(self.functions) == 1
        return self._asked(0) if asked else title

    def _asked(self, f: int) -> str:
        return f"{self._expectation(f).removeprefix('E phi = ')} at t = {self.about.final_time:g}"

    def _expectation(self, f: int) -> str:
        name, formula = self.functions[f], readable(self.formulas[f], self.about.variables)
        return f"E {name} = E {formula}" if formula != name else f"E {name}"

    def _unresolved(self, f: int) -> str:
        return f"{short(self.value[f])}, not resolved" if np.isfinite(self.value[f]) else "not finite"

    def _method(self) -> str:
        """Scheme, steps and paths, and the check."""
        if not (chosen := self.chosen):
            return f"without sampling, by {self.solver or 'the backward operator'}"
        times = {0: "", 1: " extrapolated once"}.get(chosen.extrapolated, f" extrapolated {chosen.extrapolated} times")
        steps = f"steps {power_of_two(chosen.largest_step)} to {power_of_two(chosen.smallest_step)}"
        paths = "quasi-random points" if chosen.points else "paths"
        by = f" and by {self.compared.reference}" if self.compared and self.compared.agrees else ""
        check = f"checked at {power_of_two(chosen.smallest_step / 2)}{by}" if chosen.passed else "the check failed"
        return f"{chosen.scheme}{times}, multilevel, {steps}, {chosen.samples:,} {paths} of the largest; {check}"

    def _cost(self) -> str:
        """Time that it took, and that the next digit would."""
        took = f"processor time {human_time(self.cpu_seconds)}"
        if self.chosen or math.isfinite(self.predicted_seconds):
            pilot = f", of it the pilot {human_time(self.pilot_seconds)}" if self.chosen else ""
            took += f" (predicted {human_time(self.predicted_seconds)}{pilot})"
        if np.isfinite(self.half).all() and np.isfinite(self.next_digit_seconds):
            took += f"; the next digit would take about {human_time(self.next_digit_seconds)}"
        return took

    @derived("function", "half the interval of the value")
    def value_half(self) -> Array:
        """(F,) of the field `half`."""
        return self.half

    @derived("function", "why no claim about the interval passes")
    def lost(self) -> Array:
        """(F,) of a value that is not finite that this is so; else empty."""
        return np.where(np.isfinite(self.value), "", "of a value that is not finite")

    @property
    def sampling(self) -> Array:
        """(F,) of the half width what sampling has."""
        return self.half - self.bias


Record = Answer
