"""What plain Monte Carlo adds to a spec."""

from typing import Any

from spi.specs.checks import need
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import Samples, key_of

LABEL = "plain Monte Carlo"
LOOK = ("o", "#0072B2")


class Keys(BaseKeys):
    """How many paths there are."""

    samples: key_of(Samples | None, "number of Brownian paths") = None


def check(case: Any) -> None:
    """There must be a number of paths."""
    need(case, "plain", "samples")
