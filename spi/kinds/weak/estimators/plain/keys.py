"""The keys of plain Monte Carlo."""

from typing import Any

from spi.specs.checks import need
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import Samples, key_of

LABEL = "plain Monte Carlo"
LOOK = ("o", "#0072B2")


class Keys(BaseKeys):
    """The number of paths."""

    samples: key_of(Samples | None, "number of Brownian paths") = None


def check(case: Any) -> None:
    """Raise the error about a case without a number of paths."""
    need(case, "plain", "samples")
