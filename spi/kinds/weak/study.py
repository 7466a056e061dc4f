"""Weak errors E phi(y_h(T)) - E phi(y(T)) of test functions phi, by estimators that check one another.

``plain`` and ``multilevel`` sample and measure against the scheme itself at the reference step, ``multilevel`` against
that of weak order 2 where it takes differences to it; what that reference lacks is extrapolated by the scheme's known
order.  Those of plug-ins need not sample, and may measure against the law of the equation.  An estimator is a class
derived from ``WeakPlan``, and a line in ESTIMATORS or of a plug-in.
"""

from collections.abc import Iterator
from typing import Any

from spi.plugins import Registry
from spi.storage.records import Part

from .multilevel import MultilevelPlan
from .plain import PlainPlan, QuasiPlan
from .plans import WeakPlan
from .results import cannot_do

#: name in a spec file -> estimator
ESTIMATORS = Registry("estimators", {"plain": PlainPlan, "multilevel": MultilevelPlan, "quasi": QuasiPlan})


def label_of(name: str) -> str:
    """Label of an estimator in figures; its name if there is no such estimator."""
    return ESTIMATORS[name].LABEL if name in ESTIMATORS else name


def parts(case: Any) -> list[Part]:
    """Parts of a case in their order: each scheme with each estimator that can do it, extrapolated or not."""
    return [
        Part(scheme, name, eps, levels)
        for scheme, eps in case.runs
        for name in case.estimators
        if ESTIMATORS[name].can_do(case, scheme)
        for levels in sorted(case.extrapolate)
    ]


def remarks(case: Any) -> Iterator[str]:
    """Warnings: parts of a case that are left out or changed."""
    for name in case.estimators:
        if schemes := ESTIMATORS[name].left_out(case):
            yield cannot_do(name, schemes)
        yield from ESTIMATORS[name].remarks(case)


def plan(case: Any, part: Part) -> WeakPlan:
    """Plan for one scheme of a case with one estimator."""
    return ESTIMATORS[part.estimator].of(case, part)
