"""The results that every estimator of weak errors hands out, and what they have in common."""

from typing import Any

import numpy as np

from spi.ensemble.loop import thread_count
from spi.expressions import canonical
from spi.kinds.plans import PartPlan
from spi.schemes import has_theory, weak_exponents
from spi.statistics.estimators import fit_order, is_resolved, jackknife_stderr
from spi.statistics.richardson import Extrapolation

from ..results import WeakErrors


def extrapolation(p: PartPlan) -> Extrapolation:
    """How the values at the steps of the case make those of the results, whose steps are :func:`result_steps`."""
    count = p.part.extrapolate
    exponents = weak_exponents(p.row, p.model, count) if count else None
    return Extrapolation.of(p.case.steps, exponents or ())


def result_steps(p: PartPlan) -> np.ndarray:
    """(S,) the steps h of the results, from large to small; of extrapolated ones 2h, ... are steps of the case, too."""
    return np.array(p.case.steps)[extrapolation(p).chosen]


def expected_order(p: PartPlan) -> float | None:
    """The weak order of the scheme of a plan, after extrapolation; None where theory says nothing."""
    if not p.part.extrapolate:
        return p.row.weak_order if has_theory(p.row, p.model) else None
    exponents = weak_exponents(p.row, p.model, p.part.extrapolate + 1)
    return exponents[-1] if exponents else None


def extension(p: PartPlan) -> np.ndarray:
    """(S,) by how much to multiply E phi(y_h) - E phi(y_ref), which is (1 - (h_ref/h)^p) C h^p, to have C h^p.

    With extrapolation both are extrapolated, and p is the order that they have then.  1 where the reference is another
    scheme, whose own error is not of this form, or where theory knows no order p.
    """
    h, order = result_steps(p), None if p.case.reference_scheme else expected_order(p)
    return 1.0 / (1.0 - (p.case.reference_step / h) ** order) if order else np.ones_like(h)


def sampled_errors(
    h: np.ndarray, error: np.ndarray, without: np.ndarray, counts: np.ndarray
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is fitted to errors (F, S) by every estimator that samples: fields of WeakErrors, and of Sampled.

    `without` is (groups, F, S).
    """
    stderr = jackknife_stderr(error, without, counts)
    resolved = is_resolved(np.abs(error), stderr)
    orders = tuple(
        fit_order(h, np.abs(error[f]), np.abs(without[:, f]), counts, resolved[f], stderr=stderr[f])
        for f in range(len(error))
    )
    return {"error": error, "resolved": resolved, "orders": orders}, {"error_stderr": stderr, "error_without": without}


def weak_errors(p: PartPlan, seconds: float, **found: Any) -> WeakErrors:
    """What the estimator found, and what all estimators say of a case; `seconds` is the wall-clock time spent."""
    case = p.case
    return WeakErrors(
        about=p.description(),
        functions=tuple(case.functions),
        h=result_steps(p),
        formulas=tuple(canonical(e) for e in case.expressions),
        expected_order=expected_order(p),
        reference_step=case.reference_step,
        reference_scheme=case.reference_scheme,
        panels=case.panels or ("errors",),
        wall_seconds=seconds,
        threads=thread_count(),
        **found,
    )
