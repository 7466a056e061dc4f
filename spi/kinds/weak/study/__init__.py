"""Weak errors E phi(y_h(T)) - E phi(y(T)) of test functions phi, by estimators that check one another.

``plain`` and ``multilevel`` sample and measure against the scheme itself at the reference step, ``multilevel`` against
that of weak order 2 where it takes differences to it; what that reference lacks is extrapolated by the scheme's known
order.  ``kolmogorov`` does not sample and measures against the law of the equation.
"""

from collections.abc import Iterator
from typing import Any

from spi.storage.records import Part

from ..comparisons import cannot_do
from ..estimators import ESTIMATORS, left_out


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme with each estimator that can do it, extrapolated or not."""
    each = [
        Part(scheme, name, eps)
        for scheme, eps in case.runs
        for name in case.estimators
        if ESTIMATORS[name].keys.can_do(case, scheme)
    ]
    return [
        part._replace(extrapolate=first, also=tuple(others))
        for part in each
        for first, *others in ESTIMATORS[part.estimator].together(case, part)
    ]


def remarks(case: Any) -> Iterator[str]:
    """What of a case will not be computed, or not as it was asked for."""
    for name in case.estimators:
        if schemes := left_out(case, name):
            yield cannot_do(name, schemes)
        yield from ESTIMATORS[name].remarks(case)


def plan(case: Any, part: Part) -> Any:
    """The plan for one scheme of a case with one estimator."""
    return ESTIMATORS[part.estimator].study.plan(case, part)
