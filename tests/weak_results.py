"""Results of weak errors without running any study: what all tests of tables and figures of them share."""

import json

import numpy as np
from helpers import DESCRIBED

from spi.storage.records import Group, Results

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
PER_POINT, PER_FUNCTION, PER_LEVEL = ("function", "h"), ("function",), ("function", "level")


def weak_group(scheme, estimator, case="main", stderr=1e-4, functions=2, prefixes=False, **attributes):
    """Errors C h^p, sampled ones off by their standard error and resolved if they are four times that."""
    order = ORDER[scheme]
    exact = CONSTANT[:functions, None] * H**order
    sampled = estimator != "kolmogorov"
    error = exact + stderr * np.array([1, -1, 1, -1, 1, -1]) if sampled else exact
    coordinates = {"h": H, "function": np.array(["phi", "square"][:functions])}
    variables = {
        "error": (PER_POINT, error),
        "resolved": (PER_POINT, np.abs(error) >= (4 * stderr if sampled else 2e-9)),
        "expectation": (PER_POINT, LIMIT[:functions, None] + error),
        "order": (PER_FUNCTION, np.full(functions, order)),
        "order_low": (PER_FUNCTION, np.full(functions, order - 0.02)),
        "order_high": (PER_FUNCTION, np.full(functions, order + 0.02)),
        "order_points": (PER_FUNCTION, np.full(functions, 5)),
    }
    attributes = {
        **DESCRIBED,
        "scheme": scheme,
        "scheme_label": LABELS[scheme],
        "case_title": f"case {case}, $5",
        "estimator": estimator,
        "functions": TEXTS[:functions],
        "expected_order": order,
        "reference_step": 2.0**-10,
        "cpu_seconds": 4.0,
        "model_sigma": (1.0, 1.0, 1.0),
        "initial": (1.0, 0.0, 0.0),
        **attributes,
    }
    if sampled:
        variables |= {
            "error_stderr": (PER_POINT, np.full(error.shape, stderr)),
            "expectation_stderr": (PER_POINT, np.full(error.shape, 5e-4)),
            "reference": (PER_FUNCTION, LIMIT[:functions]),
            "sd": (PER_FUNCTION, np.full(functions, 1.5)),
        }
        attributes |= {"samples": 10**6, "ns_per_step": 6.25}
    else:
        variables |= {
            "error_bound": (PER_POINT, np.full(error.shape, 1e-10)),
            "expectation_bound": (PER_POINT, np.full(error.shape, 2e-10)),
            "limit": (PER_FUNCTION, LIMIT[:functions]),
            "limit_bound": (PER_FUNCTION, np.full(functions, 1e-10)),
        }
        attributes["notes"] = json.dumps({"degree": 40, "seconds": 1.5, "limits_by_degree": {"20": [1.0] * 9}})
    if estimator == "plain":
        lost = np.where(H == 0.125, 3, 0)
        variables["nonfinite"] = (("h",), lost)
    if prefixes:
        coordinates["samples"] = np.array([10**4, 10**5, 10**6])
        axes, stderrs = ("samples", *PER_POINT), stderr * np.array([10, 10**0.5, 1]).reshape(3, 1, 1)
        variables |= {
            "prefix_error": (axes, exact + stderrs * np.sign(error - exact)),
            "prefix_error_stderr": (axes, np.broadcast_to(stderrs, (3, *error.shape)).copy()),
            "prefix_cpu_seconds": (("samples",), np.array([0.04, 0.4, 4.0])),
        }
    if estimator == "multilevel":
        coordinates |= {"level": LEVELS, "allocation": np.arange(1, 4)}
        shape = (functions, len(LEVELS))
        halves = np.array([4, 2, 1]).reshape(3, 1, 1)
        variables |= {
            "level_mean": (PER_LEVEL, np.outer(CONSTANT[:functions], LEVELS) / 2),
            "level_variance": (PER_LEVEL, np.full(shape, 0.04) * LEVELS),
            "level_kurtosis": (PER_LEVEL, np.full(shape, 5.0)),
            "level_consistency": (PER_LEVEL, np.full(shape, 0.25)),
            "level_samples": (("level",), 10 ** np.arange(7)),
            "level_nonfinite": (("level",), np.zeros(7, np.int64)),
            "level_seconds": (("level",), 1e-8 / LEVELS),
            "history_error": (("allocation", *PER_POINT), np.array([error] * 3)),
            "history_error_stderr": (("allocation", *PER_POINT), stderr * halves * np.ones_like(error)),
            "history_cpu_seconds": (("allocation",), np.array([0.25, 1.0, 4.0])),
        }
        for name, rate in (("level_mean_rate", order), ("level_variance_rate", 2.0)):
            for end, value in (("", rate), ("_low", rate - 0.1), ("_high", rate + 0.1)):
                variables[name + end] = (PER_FUNCTION, np.full(functions, value))
        attributes |= {"twins": order == 2, "level_cost_rate": 0.95}
    return Group(case, scheme, coordinates, variables, attributes, estimator)


def by_differences(scheme="splitting", functions=2, **attributes):
    """The errors of a scheme found by differences to the scheme of weak order 2, of which the levels are."""
    group = weak_group(scheme, "multilevel", functions=functions, compared_with="splitting_order2", **attributes)
    shape = (functions, len(H))
    group.variables.update(
        difference_mean=(PER_POINT, group.variables["error"][1] / 2),
        difference_variance=(PER_POINT, np.full(shape, 2.5) * H),
        difference_kurtosis=(PER_POINT, np.full(shape, 6.0)),
        difference_consistency=(PER_POINT, np.full(shape, 0.5)),
        difference_samples=(("h",), 10 ** np.arange(6)),
        difference_nonfinite=(("h",), np.zeros(6, np.int64)),
        difference_seconds=(("h",), 3e-8 / H),
    )
    for end, value in (("", 1.0), ("_low", 0.9), ("_high", 1.1)):
        group.variables[f"difference_variance_rate{end}"] = (PER_FUNCTION, np.full(functions, value))
    return group


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
    return Results({"kind": "weak", "title": "Weak errors", **attributes}, groups)
