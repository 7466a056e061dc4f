"""What guessing adds to a spec."""

from typing import Any

from spi.ensemble.protocol import Positive
from spi.specs.checks import need
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import key_of

LABEL = "guess"
LOOK = ("s", "#000000")


class Keys(BaseKeys):
    """What is guessed."""

    per_step: key_of(Positive | None, "the weak error over the step size", "value") = None


def check(case: Any) -> None:
    """There must be a guess."""
    need(case, "guess", "per_step")
