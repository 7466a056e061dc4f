"""Weak errors E phi(y_h(T)) - E phi(y(T)) of test functions phi, by three estimators that check one another.

``plain`` and ``multilevel`` sample and measure against the scheme itself at the reference step; what that reference
lacks is extrapolated by the scheme's known order.  ``kolmogorov`` does not sample and measures against the law of the
equation.
"""

import numpy as np

from ...ensemble import thread_count
from ...expressions import canonical
from ...records import Group, Part, describe
from ...schemes import SCHEMES, scheme_row
from ...schemes.splitting import Splitting
from . import exact, multilevel, plain
from .sums import expected_order

ESTIMATORS = {"plain": plain, "multilevel": multilevel, "kolmogorov": exact}
_MODULE = {module.Plan: module for module in ESTIMATORS.values()}


def parts(case):
    """What is run one after the other: each scheme with each estimator that can do it."""
    return [
        Part(scheme, estimator, eps)
        for scheme, eps in case.runs
        for estimator in case.estimators
        if estimator != "kolmogorov" or isinstance(SCHEMES[scheme].record, Splitting)
    ]


def plan(case, part):
    """The plan for one part of a case."""
    return ESTIMATORS[part.estimator].plan(case, part.scheme, part.eps)


def cost(case, part):
    """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
    return ESTIMATORS[part.estimator].cost(case, part.scheme, part.eps)


def start(p):
    """The state before anything is done."""
    return _MODULE[type(p)].start(p)


def batches(p, state):
    """Run what is left; yields the state after each batch."""
    return _MODULE[type(p)].batches(p, state)


def progress(p, state):
    """How much is done, of how much, and the standard error of the error at the largest step."""
    return _MODULE[type(p)].progress(p, state)


def _groups_left_out(variables):
    """The axis of the leave-one-out values, if there are any."""
    return {"left_out": np.arange(len(variables["error_without"][1]))} if "error_without" in variables else {}


def group(case, part, state):
    """The results of one part of a case, from its final state."""
    p = plan(case, part)
    row = scheme_row(part.scheme, part.eps)
    coordinates, variables, attributes = _MODULE[type(p)].results(p, state)
    return Group(
        case.name,
        part.group,
        {**coordinates, "function": np.array(list(case.functions)), **_groups_left_out(variables)},
        variables,
        {
            **describe(case, row, part.eps),
            "estimator": part.estimator,
            "functions": tuple(canonical(e) for e in case.expressions),
            "expected_order": expected_order(case, row),
            "reference_step": case.reference_step,
            "reference_scheme": case.reference_scheme,
            "panels": " ".join(case.panels),
            "threads": thread_count(),
            **attributes,
        },
        part.estimator,
    )
