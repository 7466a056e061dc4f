"""The estimators of weak errors, one folder each: the only place that lists them.

An estimator consists of two modules of its folder, imported when they are first needed: ``keys``, its keys in a spec
with their conditions, its label, marker and colour; and ``study``, the plan that computes a scheme.
A new estimator is such a folder and a line in ESTIMATORS.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol

from spi.kinds import Folder
from spi.storage.records import Part

if TYPE_CHECKING:
    from spi.kinds.plans import Plan


class KeysModule(Protocol):
    """``keys``: what an estimator adds to a spec file."""

    Keys: Any  #: its keys, a subclass of ``spi.specs.keys.Keys``
    LABEL: str  #: what it is called in figures
    LOOK: tuple[str, str]  #: marker and colour

    def check(self, case: Any) -> None:
        """Raise :func:`spi.specs.keys.wrong` if a case that names the estimator cannot have it."""

    # and perhaps
    # def can_do(case: Any, scheme: str) -> bool
    # whether it can estimate the errors of a scheme of such a case; other schemes are left out
    # def remarks(case: Any) -> Iterator[str]
    # warnings about such a case before it is run


class StudyModule(Protocol):
    """``study``: what is computed."""

    def plan(self, case: Any, part: Part) -> "Plan":
        """One scheme, ready to run."""

    # and perhaps
    # def together(case: Any, part: Part) -> list[tuple[int, ...]]
    # the levels of extrapolation of a case, grouped by common paths, unless all have the same paths


class Estimator(Folder):
    """The modules of an estimator, and what they may leave out."""

    keys: KeysModule
    study: StudyModule

    MODULES = ("keys", "study")

    def can_do(self, case: Any, scheme: str) -> bool:
        """Whether it can estimate the errors of a scheme of a case."""
        by_keys: Any = getattr(self.keys, "can_do", None)
        return by_keys is None or bool(by_keys(case, scheme))

    def together(self, case: Any, part: Part) -> list[tuple[int, ...]]:
        """The levels of extrapolation of a case, grouped by common paths of a part."""
        by_study: Any = getattr(self.study, "together", None)
        return by_study(case, part) if by_study else [case.extrapolate]

    def remarks(self, case: Any) -> Iterator[str]:
        """Warnings about a case before it is run."""
        by_keys: Any = getattr(self.keys, "remarks", None)
        yield from by_keys(case) if by_keys else ()


#: name in a spec file -> estimator
ESTIMATORS = {
    "plain": Estimator("spi.kinds.weak.estimators.plain"),
    "multilevel": Estimator("spi.kinds.weak.estimators.multilevel"),
    "quasi": Estimator("spi.kinds.weak.estimators.quasi"),
    "kolmogorov": Estimator("spi.kinds.weak.estimators.kolmogorov"),
}


def left_out(case: Any, estimator: str) -> tuple[str, ...]:
    """The schemes of a case that an estimator cannot do."""
    return tuple(scheme for scheme in case.schemes if not ESTIMATORS[estimator].can_do(case, scheme))


def label_of(name: str) -> str:
    """The label of an estimator in figures; its name if there is no such estimator."""
    return ESTIMATORS[name].keys.LABEL if name in ESTIMATORS else name
