"""What the readings of one case tell together: sampled errors beside deterministic ones, and the largest over eps."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .results import WeakErrors

if TYPE_CHECKING:
    from spi.statistics.estimators import Largest


class Agreement(NamedTuple):
    """A sampled estimate beside the deterministic one; arrays (F, S), NaN where nothing is known."""

    deviation: np.ndarray  #: sampled minus deterministic error, in standard errors
    share: np.ndarray  #: the standard error over the deterministic error


def agreement(reading: WeakErrors, readings: Iterable[WeakErrors]) -> Agreement | None:
    """How a sampled estimate compares with the one without sampling among `readings`; None if there is none."""
    whose = reading.about.case, reading.about.variant
    same = [one for one in readings if (one.about.case, one.about.variant) == whose]
    exact, bounds = next(((one, one.unsampled) for one in same if one.unsampled), (None, None))
    if reading.sampled is None or exact is None or bounds is None:
        return None
    found = Agreement(*np.full((2, *reading.error.shape), np.nan))
    for f, name in enumerate(reading.functions):
        for i, h in enumerate(reading.h):
            if name not in exact.functions or h not in exact.h:
                continue
            at = exact.functions.index(name), int(np.flatnonzero(exact.h == h)[0])
            stderr = reading.sampled.error_stderr[f, i]
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                spread = np.hypot(stderr, bounds.error_bound[at])
                found.deviation[f, i] = (reading.error[f, i] - exact.error[at]) / spread
                found.share[f, i] = stderr / np.abs(exact.error[at])
    return found


def sweeps(readings: Iterable[WeakErrors]) -> dict[tuple[str, str], list[WeakErrors]]:
    """(scheme, estimator) -> readings of a scheme for the multiscale system, from large to small eps."""
    found: dict[tuple[str, str], list] = {}
    for reading in sorted(readings, key=lambda reading: -(reading.about.eps or 0.0)):
        if reading.about.eps is not None:
            found.setdefault((reading.about.scheme, reading.about.estimator), []).append(reading)
    return found


def comparable_sweeps(readings: Iterable[WeakErrors]) -> dict[tuple[str, str], list[WeakErrors]]:
    """The sweeps of several eps at the same step sizes, of which :func:`largest_over_eps` can be asked."""
    return {
        key: members
        for key, members in sweeps(readings).items()
        if len(members) > 1
        and all(one.sampled and one.sampled.error_without is not None for one in members)
        and all(np.array_equal(one.h, members[0].h) for one in members)
    }


def largest_over_eps(members: Sequence[WeakErrors], f: int) -> "Largest":
    """The ``spi.statistics.estimators.Largest`` over the readings of a comparable sweep, of test function number f."""
    from spi.statistics.estimators import largest_over  # takes a while

    errors = np.array([one.error[f] for one in members])
    withouts = [one.sampled.error_without for one in members if one.sampled]
    return largest_over(members[0].h, errors, np.array([without[:, f] for without in withouts if without is not None]))
