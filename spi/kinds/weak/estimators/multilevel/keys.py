"""The keys of the multilevel estimator."""

from typing import Any

from spi.ensemble.protocol import Positive
from spi.ensemble.random_states import RandomState
from spi.exact.kolmogorov import can_solve
from spi.specs.checks import check_areas, need
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import key_of, wrong

from ..kolmogorov.keys import check_demands

LABEL = "multilevel"
LOOK = ("D", "#D55E00")


class Keys(BaseKeys):
    """A target or a budget."""

    standard_error: key_of(
        Positive | None, "what multilevel aims at for the weak error at the largest step", "value"
    ) = None
    seconds: key_of(Positive | None, "budget of multilevel, in seconds of one thread of typical speed", "seconds") = (
        None
    )


def check(case: Any) -> None:
    """Raise the error about a case without target and budget, with a reference scheme, or an unsolvable control."""
    need(case, "multilevel", "standard_error", "seconds")
    if case.reference_scheme:
        mistake = "has 'multilevel', which has references of its own, and reference_scheme is set"
        raise wrong(mistake, "use plain or leave out reference_scheme", "estimators")
    check_areas(case, case.reference_step, "reference_step")  # each level draws its own
    if can_solve(case.model) and not case.truncate_noise and not isinstance(case.initial, RandomState):
        check_demands(case, "multilevel", multiscale=True)
