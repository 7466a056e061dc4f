"""Weak errors E phi(y_h(T)) - E phi(y(T)) of test functions phi, by estimators that check one another.

``plain`` and ``multilevel`` sample and measure against the scheme itself at the reference step, ``multilevel`` against
that of weak order 2 where it takes differences to it; what that reference lacks is extrapolated by the scheme's known
order.  ``kolmogorov`` does not sample and measures against the law of the equation.
"""

from typing import Any

from spi.storage.records import Part

from ..estimators import ESTIMATORS


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme with each estimator that can do it."""
    return [
        Part(scheme, estimator, eps, levels)
        for scheme, eps in case.runs
        for levels in case.extrapolate
        for estimator in case.estimators
        if ESTIMATORS[estimator].keys.can_do(case, scheme)
    ]


def plan(case: Any, part: Part) -> Any:
    """The plan for one scheme of a case with one estimator."""
    return ESTIMATORS[part.estimator].study.plan(case, part)
