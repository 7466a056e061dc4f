"""Results of weak errors without running any study: what all tests of tables and figures of them share."""

import json
from dataclasses import replace

import numpy as np
from made_up import group_of

from spi.kinds.weak.results import Differences, History, LevelEstimates, Prefixes, SampledFields, Unsampled, WeakErrors
from spi.storage import Order, StoredResults

H = 2.0 ** -np.arange(3, 9)
LEVELS = 2.0 ** -np.arange(9, 2, -1)
ORDER = {"splitting": 1.0, "splitting_order2": 2.0}
LABELS = {"splitting": "splitting", "splitting_order2": "splitting, weak order 2"}
MULTISCALE = {
    "ap_splitting": "AP splitting",
    "multiscale_euler": "explicit Euler-Maruyama",
    "multiscale_euler_semi_implicit": "semi-implicit Euler-Maruyama",
}
CONSTANT = np.array([0.5, -0.1])  # of the errors C h^p of the two functions
LIMIT = np.array([-0.285, 0.161])
TEXTS = ("sin(6.283185307179586*y1) + y2", "y1^2")
PER_POINT = ("function", "h")


def weak_group(scheme, estimator, case="main", stderr=1e-4, functions=2, prefixes=False, **attributes):
    """Errors C h^p, sampled ones off by their standard error and resolved if they are four times that."""
    order = ORDER[scheme]
    exact = CONSTANT[:functions, None] * H**order
    sampled = estimator != "kolmogorov"
    error = exact + stderr * np.array([1, -1, 1, -1, 1, -1]) if sampled else exact
    fields = {
        "functions": ("phi", "square")[:functions],
        "h": H,
        "error": error,
        "expectation": LIMIT[:functions, None] + error,
        "resolved": np.abs(error) >= (4 * stderr if sampled else 2e-9),
        "orders": (Order(order, order - 0.02, order + 0.02, 5),) * functions,
        "nonfinite": np.where(H == 0.125, 3, 0) if estimator == "plain" else None,
        "formulas": TEXTS[:functions],
        "expected_order": order,
        "reference_step": 2.0**-10,
        "cpu_seconds": 4.0,
        "sampled" if sampled else "unsampled": (_sampled if sampled else _unsampled)(error, stderr),
    }
    if prefixes:
        stderrs = stderr * np.array([10, 10**0.5, 1]).reshape(3, 1, 1)
        fields["prefixes"] = Prefixes(
            samples=np.array([10**4, 10**5, 10**6]),
            error=exact + stderrs * np.sign(error - exact),
            error_stderr=np.broadcast_to(stderrs, (3, *error.shape)).copy(),
            cpu_seconds=np.array([0.04, 0.4, 4.0]),
        )
    if estimator == "multilevel":
        fields["levels"] = attributes.pop("levels", None) or _levels(functions, order)
        fields["history"] = History(
            allocations=np.arange(1, 4),
            error=np.array([error] * 3),
            error_stderr=stderr * np.array([4, 2, 1]).reshape(3, 1, 1) * np.ones_like(error),
            cpu_seconds=np.array([0.25, 1.0, 4.0]),
        )
    told = {"scheme_label": LABELS[scheme], "case_title": f"case {case}, $5", "estimator": estimator}
    told |= {"model_sigma": (1.0, 1.0, 1.0), "initial": (1.0, 0.0, 0.0)} | attributes
    return group_of(WeakErrors, case, scheme, told, **fields)


def _sampled(error, stderr):
    return SampledFields(
        error_stderr=np.full(error.shape, stderr),
        expectation_stderr=np.full(error.shape, 5e-4),
        reference=LIMIT[: len(error)],
        sd=np.full(len(error), 1.5),
        samples=10**6,
        ns_per_step=6.25,
    )


def _unsampled(error, stderr):
    return Unsampled(
        error_bound=np.full(error.shape, 1e-10),
        expectation_bound=np.full(error.shape, 2e-10),
        limit=LIMIT[: len(error)],
        limit_bound=np.full(len(error), 1e-10),
        notes=json.dumps({"degree": 40, "seconds": 1.5, "limits_by_degree": {"20": [1.0] * 9}}),
    )


def _levels(functions, order):
    shape = (functions, len(LEVELS))
    return LevelEstimates(
        h=LEVELS,
        mean=np.outer(CONSTANT[:functions], LEVELS) / 2,
        variance=np.full(shape, 0.04) * LEVELS,
        kurtosis=np.full(shape, 5.0),
        consistency=np.full(shape, 0.25),
        samples=10 ** np.arange(7),
        nonfinite=np.zeros(7, np.int64),
        seconds=1e-8 / LEVELS,
        mean_rate=(Order(order, order - 0.1, order + 0.1, 7),) * functions,
        variance_rate=(Order(2.0, 1.9, 2.1, 7),) * functions,
        cost_rate=0.95,
        antithetic=order == 2,
    )


def by_differences():
    """The errors of the splitting found by differences to the scheme of weak order 2, of which the levels are."""
    shape = (2, len(H))
    differences = Differences(
        scheme="splitting_order2",
        mean=CONSTANT[:, None] * H / 2,
        variance=np.full(shape, 2.5) * H,
        kurtosis=np.full(shape, 6.0),
        consistency=np.full(shape, 0.5),
        samples=10 ** np.arange(6),
        nonfinite=np.zeros(6, np.int64),
        seconds=3e-8 / H,
        variance_rate=(Order(1.0, 0.9, 1.1, 6),) * 2,
    )
    levels = replace(_levels(2, ORDER["splitting"]), antithetic=True)
    return weak_group("splitting", "multilevel", differences=differences, levels=levels)


def at_eps(scheme, eps, functions=1, factor=1.0, **attributes):
    """Errors of a scheme for the multiscale system, those of "splitting" times a factor; NaN explodes."""
    group = weak_group("splitting", "multilevel", functions=functions, eps=eps, **attributes)
    error, stderr = factor * CONSTANT[:functions, None] * H, group.variables["error_stderr"][1]
    signs = np.where(np.arange(64) % 2, 1.0, -1.0)
    group.variables.update(
        error=(PER_POINT, error),
        resolved=(PER_POINT, np.abs(error) >= 4 * stderr),
        error_without=(("left_out", *PER_POINT), error + np.multiply.outer(signs, stderr) / 63**0.5),
    )
    group.attributes.update(scheme=scheme, scheme_label=MULTISCALE.get(scheme, scheme))
    return group._replace(variant=f"{scheme}_eps_{eps:g}", coordinates={**group.coordinates, "left_out": np.arange(64)})


def weak(*groups, **attributes):
    return StoredResults({"kind": "weak", "title": "Weak errors", **attributes}, groups)
