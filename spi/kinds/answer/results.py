"""What is stored of an answer."""

from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np

from spi.statistics.claims import Quantity, quantity
from spi.storage.stored import Array, Described, Stored, array, axis, fact, nested


class Levels(Described):
    """The differences between neighbouring steps that were sampled, from large to small steps."""

    h: Annotated[Array, axis("smaller step size of the level", "time", name="level")]
    share: Annotated[Array, array("level", "how much of the difference is in the answer")]
    mean: Annotated[Array, array("function level", "mean of the difference", "value", "E phi(y_h(T)) - E phi(y_2h(T))")]
    stderr: Annotated[Array, array("function level", "standard error of the mean", "value")]
    variance: Annotated[Array, array("function level", "variance of the difference")]
    kurtosis: Annotated[Array, array("function level", "kurtosis of the difference")]
    samples: Annotated[Array, array("level", "samples of the difference")]


class Chosen(Described):
    """What was chosen for sampling, and how the check came out."""

    scheme: Annotated[str, fact("scheme that was chosen", name="chosen_scheme", column=True)]
    extrapolated: Annotated[int, fact("levels of extrapolation", name="extrapolated", column=True)]
    largest_step: Annotated[float, fact("step of the level that is sampled alone", "time", column=True)]
    smallest_step: Annotated[float, fact("smallest step", "time", column=True)]
    order: Annotated[float, fact("order of the bias that was assumed")]
    samples: Annotated[int, fact("samples of the largest step", column=True)]
    points: Annotated[bool, fact("whether the largest step follows quasi-random points")] = False
    check: Annotated[Array, array("function", "by how much one step finer differs", "value")]
    check_stderr: Annotated[Array, array("function", "standard error of that difference", "value")]
    passed: Annotated[bool, fact("whether one step finer differs by no more than the bias that is stated")]
    consistency: Annotated[float, fact("largest of the levels' checks, above 1 with probability 0.3 % each")]
    levels: Annotated[Levels, nested(prefix="level_")]


class Compared(Described):
    """The check of the bias by another scheme, on the same noise."""

    reference: Annotated[str, fact("scheme that checks the bias", name="reference_scheme")]
    step: Annotated[float, fact("step of that check", "time", name="compared_step")]
    difference: Annotated[Array, array("function", "mean difference from the scheme that checks", "value")]
    left: Annotated[Array, array("function", "what is left of it as the step tends to 0", "value")]
    stderr: Annotated[Array, array("function", "standard error of what is left", "value", name="left_stderr")]
    agrees: Annotated[bool, fact("whether nothing is left but for errors")]


class Answer(Stored):
    """Expectations E phi(y(T)) with what is left of errors, and how they were found."""

    headline = ("value",)

    functions: Annotated[tuple[str, ...], axis("test function", name="function")]
    value: Annotated[Array, array("function", "expectation", "value", "E phi(y(T))")]
    half: Annotated[Array, array("function", "half the width of the 95 % interval, the bias included", "value")]
    bias: Annotated[Array, array("function", "of it the bias at most, or the numerical error", "value")]
    stderr: Annotated[Array, array("function", "standard error of sampling", "value")]
    accuracy: Annotated[float, fact("half the width that was asked for", "value", column=True)]
    aim: Annotated[float, fact("half the width that was aimed at, larger where time does not allow more", "value")]
    reached: Annotated[
        bool, fact("whether the interval is as narrow as was aimed at, and the check passed", column=True)
    ]
    why: Annotated[str, fact("what else might have been chosen, and what it would have taken")]
    warnings: Annotated[tuple[str, ...], fact("what a person should know")] = ()
    formulas: Annotated[tuple[str, ...], fact("formulas of the test functions in y1, y2, ...", name="functions")]
    cpu_seconds: Annotated[float, fact("processor time", "s", column=True)]
    pilot_seconds: Annotated[float, fact("of it for the pilot", "s")] = 0.0
    predicted_seconds: Annotated[float, fact("processor time that was predicted", "s", column=True)]
    next_digit_seconds: Annotated[float, fact("processor time of an answer to a tenth of the accuracy", "s")]
    chosen: Chosen | None = None
    compared: Compared | None = None

    def __str__(self) -> str:
        from .table import lines  # which imports this module

        return "\n".join(lines(self))

    @property
    def sampling(self) -> np.ndarray:
        """(F,) of the half width what sampling has."""
        return self.half - self.bias


Record = Answer


# ---------------------------------------------------------------------------------------------------------------------
# What a spec may expect of answers.
# ---------------------------------------------------------------------------------------------------------------------


def quantities(readings: Sequence[Answer]) -> Iterator[Quantity]:
    """The value of each function with its interval, and half the width of that."""
    for one in readings:
        for name, value, half in zip(one.functions, one.value, one.half, strict=True):
            yield quantity("value", one.about, value, half, name)
            lost = "" if np.isfinite(value) else "of a value that is not finite"
            yield quantity("interval", one.about, half, 0.0, name, lost=lost)
