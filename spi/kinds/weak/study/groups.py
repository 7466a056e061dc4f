"""The group of results that every estimator of weak errors hands out, and the parts that groups have in common."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from spi.ensemble.loop import thread_count
from spi.expressions import canonical
from spi.kinds.plans import PartPlan
from spi.schemes import has_theory, weak_exponents
from spi.statistics.estimators import fit_order, is_resolved, jackknife_stderr
from spi.statistics.richardson import Extrapolation
from spi.storage.records import Group, Order, Variables

PER_POINT = ("function", "h")  #: the axes of an array (F, S)


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


def error_variables(h: np.ndarray, error: np.ndarray, without: np.ndarray, counts: np.ndarray) -> Variables:
    """The variables that estimators which sample share, of errors (F, S); `without` is (groups, F, S)."""
    stderr = jackknife_stderr(error, without, counts)
    resolved = is_resolved(np.abs(error), stderr)
    orders = [
        fit_order(h, np.abs(error[f]), np.abs(without[:, f]), counts, resolved[f], stderr=stderr[f])
        for f in range(len(error))
    ]
    return {
        "error": (PER_POINT, error),
        "error_stderr": (PER_POINT, stderr),
        "resolved": (PER_POINT, resolved),
        "error_without": (("left_out", *PER_POINT), without),  # for what is fitted across schemes and eps
        **order_variables(orders),
    }


def order_variables(orders: Sequence[Order], name: str = "order") -> Variables:
    """Fitted orders, one per test function, as variables."""
    values = np.array(orders, float).reshape(-1, 4)
    variables = {name: values[:, 0], f"{name}_low": values[:, 1], f"{name}_high": values[:, 2]}
    variables[f"{name}_points"] = values[:, 3].astype(np.int64)
    return {key: (("function",), v) for key, v in variables.items()}


def weak_group(
    p: PartPlan, coordinates: dict[str, np.ndarray], variables: Variables, attributes: dict[str, Any]
) -> Group:
    """The results of a plan: what the estimator found, and what all estimators say of a case."""
    case = p.case
    axes = {"h": result_steps(p), **coordinates, "function": np.array(list(case.functions))}
    if "error_without" in variables:
        axes["left_out"] = np.arange(len(variables["error_without"][1]))
    return Group(
        case.name,
        p.part.variant,
        axes,
        variables,
        {
            **p.description(),
            "estimator": p.part.estimator,
            "functions": tuple(canonical(e) for e in case.expressions),
            "expected_order": expected_order(p),
            "reference_step": case.reference_step,
            "reference_scheme": case.reference_scheme,
            "panels": case.panels or None,
            "threads": thread_count(),
            **attributes,
        },
        p.part.estimator,
    )
