"""Base of the estimators of weak errors: keys, the schemes they can do, and the errors that follow from means."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from spi.expressions import as_numpy, canonical, is_step, range_of
from spi.kinds.plans import Plan, State
from spi.schemes import weak_exponents, weak_order
from spi.statistics.estimators import Extrapolation, fit_order, is_resolved, jackknife_stderr
from spi.statistics.intervals import student_factor, zero_share_bound
from spi.statistics.rounding import is_rounding, note_exact, size_of_values, with_rounding

from .results import WeakErrors


@dataclass(frozen=True, kw_only=True)
class WeakPlan(Plan):
    """Base of all estimators: plans of weak errors of one scheme, extrapolated or not."""

    record = WeakErrors

    LABEL: ClassVar[str]  #: its name in figures
    LOOK: ClassVar[tuple[str, str]]  #: marker and colour
    of_others: ClassVar[frozenset[str]] = frozenset()  #: keys of the case that are for other estimators

    @classmethod
    def check(cls, case: Any) -> None:
        """Raise :func:`spi.specs.keys.wrong` if a case that names the estimator cannot have it."""

    @classmethod
    def can_do(cls, case: Any, scheme: str) -> bool:
        """Whether it can estimate the errors of a scheme of a case; other schemes are left out."""
        return True

    @classmethod
    def left_out(cls, case: Any) -> tuple[str, ...]:
        """Schemes of a case that it cannot do."""
        return tuple(scheme for scheme in case.schemes if not cls.can_do(case, scheme))

    @classmethod
    def remarks(cls, case: Any) -> Iterator[str]:
        """Warnings about a case before it is run."""
        yield from ()

    def deciding(self, number: int | None) -> dict[str, Any]:
        """Without the keys of other estimators; the part names its own, and the extrapolation."""
        without = {"estimators", "extrapolate", *self.of_others}
        return {key: value for key, value in super().deciding(number).items() if key not in without}

    @property
    def extrapolation(self) -> Extrapolation:
        """Combination of values at the steps of the case into those of the results, at the steps :attr:`h`."""
        count = self.part.extrapolate
        exponents = weak_exponents(self.row, self.model, count) if count else None
        return Extrapolation.of(self.case.steps, exponents or ())

    @property
    def h(self) -> np.ndarray:
        """(S,) the steps of the results, from large to small; with extrapolation 2h, ... are steps of the case, too."""
        return np.array(self.case.steps)[self.extrapolation.chosen]

    @property
    def expected_order(self) -> float | None:
        """Weak order of the scheme, after extrapolation; None where theory says nothing."""
        return weak_order(self.row, self.model, self.part.extrapolate, self.case.noise)

    @property
    def reference_share(self) -> float:
        """e(h_ref) / (E phi(y_h) - E phi(y_ref)) at the smallest step h, where errors are e(h) = C h^p.

        That is 1 / ((h/h_ref)^p - 1).  With extrapolation both are extrapolated, and p is the order that they have
        then.  0 where the reference is another scheme, whose own error is not of this form, or where theory states no
        order p.
        """
        order = None if self.case.reference_scheme else self.expected_order
        return 1.0 / ((self.h[-1] / self.case.reference_step) ** order - 1.0) if order else 0.0

    @property
    def function_sizes(self) -> np.ndarray:
        """(F, 1) the sizes of the test functions, relative to which their errors are rounding."""
        return np.array([[size_of_values(as_numpy(tree), self.case.initial)] for tree in self.case.expressions])

    def completed(self, differences: np.ndarray) -> np.ndarray:
        """Errors (..., S) from differences E phi(y_h) - E phi(y_ref), which lack the reference's own error.

        That is **one** number for all steps, C h_ref^p, with C from the smallest step alone, since at large steps
        errors need not be C h^p.  Leave-one-out values are completed alike, so that standard errors contain it.
        """
        share = self.reference_share
        return differences + share * differences[..., -1:] if share else differences

    def unseen(self, value: np.ndarray, stderr: np.ndarray, samples: np.ndarray | int) -> np.ndarray:
        """(..., F) half the width of an interval for the part of means over `samples` that no sample shows.

        Where all values are alike that is the share that could differ, by the rule of three, times the range of the
        function; NaN where the range is infinite, and 0 where nothing is random.  Functions that are constant but for
        jumps have the same where few values differ.
        """
        width = np.array([np.ptp(range_of(tree)) if self.is_random else 0.0 for tree in self.case.expressions])
        jumps = np.array([is_step(tree) for tree in self.case.expressions])
        with np.errstate(invalid="ignore"):
            bound = zero_share_bound(samples) * np.where(np.isfinite(width), width, 0.0)
            alike = (stderr == 0.0) | (np.isfinite(width) & (stderr <= _SAME * np.abs(value)))
        lacking = np.where(alike | jumps, bound, 0.0)
        return np.where(alike & ~np.isfinite(width), np.nan, lacking)

    def whole(self, state: State) -> dict[str, Any]:
        """Also the facts that all estimators state of a case."""
        case = self.case
        return super().whole(state) | {
            "functions": tuple(case.functions),
            "h": self.h,
            "formulas": tuple(canonical(e) for e in case.expressions),
            "expected_order": self.expected_order,
            "panels": case.panels or ("errors",),
            "left_out": self.left_out(case),
            "accuracy": None,
        }


_SAME = 1e-12  # relative: values that differ by less differ by rounding


def stderr_of(error: np.ndarray, without: np.ndarray, counts: np.ndarray, unseen: np.ndarray | float) -> np.ndarray:
    """Standard errors of errors by the jackknife, with the `unseen` part of them, see :meth:`WeakPlan.unseen`."""
    return np.hypot(jackknife_stderr(error, without, counts), unseen / student_factor(int(np.count_nonzero(counts))))


def sampled_errors(
    plan: WeakPlan, error: np.ndarray, without: np.ndarray, counts: np.ndarray, unseen: np.ndarray
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Fits to errors (F, S) of every estimator that samples: fields of WeakErrors, and of Sampled.

    `without` is (groups, F, S), and `unseen` (F, S) as in :func:`stderr_of`.
    """
    of = plan.function_sizes, plan.case.final_time / plan.case.reference_step
    stderr = with_rounding(stderr_of(error, without, counts, unseen), error, *of)
    resolved, exact = is_resolved(np.abs(error), stderr), is_rounding(error, *of)
    each = zip(plan.case.functions, error, exact, strict=True)
    notes = [f"{name}: {note}" for name, *which in each if (note := note_exact(*which))]
    orders = tuple(
        fit_order(plan.h, np.abs(error[f]), np.abs(without[:, f]), counts, resolved[f], stderr=stderr[f])
        for f in range(len(error))
    )
    fields = {"error": error, "resolved": resolved, "orders": orders, "note": "; ".join(notes)}
    return fields, {"error_stderr": stderr, "error_without": without}
