"""What readings tell beside their errors: how far those of a case agree, the largest over eps, the reference's own."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spi.printing.sentences import joined
from spi.printing.text import short
from spi.storage.records import in_standard_errors

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
                difference = reading.error[f, i] - exact.error[at]
                found.deviation[f, i] = in_standard_errors(difference, np.hypot(stderr, bounds.error_bound[at]))
                found.share[f, i] = stderr / np.abs(exact.error[at])
    return found


class OwnError(NamedTuple):
    """The reference's own error, which all errors of a reading contain; arrays (F,)."""

    value: np.ndarray  #: C h_ref^p by the smallest step, as it was added
    by_next: np.ndarray  #: by the step after it, as if that were the smallest
    differ: np.ndarray  #: whether the two differ, and by more than some of the standard errors


def own_error(reading: WeakErrors) -> OwnError | None:
    """The reference's own error by the two smallest steps; None where it was not added, or there is one step only.

    Where errors are C h^p + D h^q there, 2^q >= 2, and the steps differ by a factor of 2, what was added is off by at
    most about as much as the two differ.
    """
    from spi.statistics.estimators import PARTS, is_resolved, jackknife_stderr  # takes a while

    sampled, order = reading.sampled, reading.expected_order
    if sampled is None or sampled.error_without is None or not order or len(reading.h) < 2:
        return None
    if reading.reference_scheme or reading.differences:
        return None
    without = sampled.error_without
    share = (reading.reference_step / reading.h[:-3:-1]) ** order  # of the two smallest steps, the smallest first

    def by_both(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        added = errors[..., -1] * share[0]
        return added, (errors[..., -2] - added) * share[1] / (1.0 - share[1])

    value, by_next = by_both(reading.error)
    off, off_without = value - by_next, np.subtract(*by_both(without))
    clear = is_resolved(np.abs(off), jackknife_stderr(off, off_without, np.full(len(without), PARTS)))
    return OwnError(value, by_next, clear & (np.abs(off) > sampled.error_stderr.min(axis=-1)))


def cannot_do(estimators: str, schemes: Sequence[str]) -> str:
    """That there are no results of some schemes."""
    return f"{estimators} cannot do {joined(schemes)}: there are no such results"


def not_reached(reading: WeakErrors) -> str:
    """That numerical errors are larger than was asked for; empty if they are not, or if nothing was asked for."""
    known: dict[str, float] = {}
    if reading.unsampled:
        bounds = {"errors": reading.unsampled.error_bound, "expectations": reading.unsampled.expectation_bound}
        known |= {name: float(bound.max()) for name, bound in bounds.items()}
    if reading.levels and reading.levels.control:
        known["expectations of the control"] = reading.levels.control_bound
    if reading.accuracy is None:
        return ""
    poor = [f"{name} are known to {short(bound)}" for name, bound in known.items() if not bound <= reading.accuracy]
    return f"accuracy {short(reading.accuracy, 'g')} is not reached: {joined(poor)}" if poor else ""


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
