"""Richardson extrapolation: values at the steps h, 2h, 4h, ... combined so that the first powers of h cancel.

Where v(h) = v(0) + a h^p + b h^q + ..., the combination (2^p v(h) - v(2h)) / (2^p - 1) is v(0) + b' h^q + ...; doing
the same with q, and so on, is one linear combination of v(h), v(2h), v(4h), ... whose weights add up to 1.

Sums are no matrix products, because in these the order of summation, so the last digits, depends on the processor.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


def weights(exponents: Sequence[float]) -> np.ndarray:
    """w with sum_i w_i = 1 and sum_i w_i 2^(i q) = 0 for each q in `exponents`, shape (len(exponents) + 1,).

    sum_i w_i v(2^i h) then has no term of these powers of h.
    """
    found = np.ones(1)
    for q in exponents:
        found = (2.0**q * np.append(found, 0.0) - np.append(0.0, found)) / (2.0**q - 1.0)
    return found


def places(steps: Sequence[float], levels: int) -> np.ndarray:
    """Where h, 2h, ..., 2^levels h stand among `steps`, (S', levels + 1): a row for each h of which all of these do."""
    at = {h: i for i, h in enumerate(steps)}
    multiples = [[h * 2.0**i for i in range(levels + 1)] for h in steps]
    found = [[at[step] for step in row] for row in multiples if all(step in at for step in row)]
    return np.array(found, np.int64).reshape(-1, levels + 1)


class Extrapolation(NamedTuple):
    """How values at S steps make those at S' <= S steps that are extrapolated; without levels they are the same."""

    places: np.ndarray  #: (S', levels + 1), see :func:`places`
    weights: np.ndarray  #: (levels + 1,), see :func:`weights`

    @classmethod
    def of(cls, steps: Sequence[float], exponents: Sequence[float]) -> "Extrapolation":
        """The extrapolation that removes the powers `exponents` of h, one for each level."""
        return cls(places(steps, len(exponents)), weights(exponents))

    @property
    def levels(self) -> int:
        """How many powers of h are removed."""
        return len(self.weights) - 1

    @property
    def chosen(self) -> np.ndarray:
        """(S',) where the steps that are extrapolated stand."""
        return self.places[:, 0]

    def combined(self, values: np.ndarray) -> np.ndarray:
        """The values (..., S) extrapolated, (..., S')."""
        return (values[..., self.places] * self.weights).sum(axis=-1) if self.levels else values

    def combined_bounds(self, bounds: np.ndarray) -> np.ndarray:
        """Bounds of the errors of the combined values, (..., S'), from those of the values, (..., S)."""
        return (bounds[..., self.places] * np.abs(self.weights)).sum(axis=-1) if self.levels else bounds
