"""Jackknife groups of paths, of which only sums are kept.

Lane l of block b is in group (b mod ROUND) * PARTS + l mod PARTS.
"""

import numpy as np

from .rng import LANES, PARTS

#: Number of jackknife groups.
GROUPS = 64
ROUND = GROUPS // PARTS  #: blocks after which all groups have had equally many paths


def group_counts(samples: int) -> np.ndarray:
    """Numbers of paths among 0, ..., samples - 1 that are in each group, shape (GROUPS,)."""
    rounds, rest = divmod(samples, GROUPS * PARTS)
    blocks, lanes = divmod(rest, LANES)
    counts = np.full((GROUPS // PARTS, PARTS), rounds * (LANES // PARTS))
    counts[:blocks] += LANES // PARTS
    counts[blocks] += lanes // PARTS + (np.arange(PARTS) < lanes % PARTS)
    return counts.ravel()


def filled_groups(samples: int) -> int:
    """Number of groups that `samples` paths fill."""
    return int(np.count_nonzero(group_counts(samples)))
