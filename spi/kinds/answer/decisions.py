"""What an answer has decided, and the samples of its pilot."""

from typing import Any, NamedTuple

import numpy as np

from spi.numerics.rng import LANES
from spi.statistics.estimators import ROUND

from .keys import PILOT_LEVELS, PILOT_SAMPLES
from .levels import ALONG, LEVELS, SETS
from .planner import Choice

#: The stages: the pilot, a share of the work, the whole of it and what its checks ask for; and the end.
PILOTING, BEGINNING, WHOLE, DONE = 0, 1, 2, 99

#: The samples of what comes before the pilot, and its levels, those of the larger steps alone.
GLANCE, GLANCE_LEVELS = ROUND * LANES, 4


class Decisions(NamedTuple):
    """What is known besides sums over paths, for F functions."""

    seconds: float  #: wall clock, of what needs no paths
    cpu_seconds: float
    stage: int
    wanted: np.ndarray  #: (path sets,) samples
    piloted: int  #: of how many schemes there is a pilot
    looked: int  #: whether it is known if the pilot needs its small steps
    pointed: int  #: whether there is one along quasi-random points
    points: int  #: whether the largest step follows such points
    scheme: int  #: the number of the scheme that was chosen; -1 for the solution without sampling
    levels: int  #: of extrapolation
    base: int  #: the level that is sampled alone
    finest: int
    compared: int  #: level at whose step the reference scheme is compared, 0 before that
    order: float  #: of the bias, where it is not that of theory; NaN else
    aim: float  #: half the width of the interval that is aimed at
    work: float  #: predicted, in seconds of typical speed
    pilot_cpu_seconds: float
    predicted_cpu_seconds: float
    next_cpu_seconds: float  #: of an answer to a tenth of the accuracy
    works: np.ndarray  #: (schemes, 4) predicted work by levels of extrapolation, NaN where it is not known
    known: np.ndarray  #: (F,) expectations that were found without sampling
    known_bound: np.ndarray  #: (F,)
    solving: int  #: whether it is solved for, see :mod:`.solving`
    refined: np.ndarray  #: (refinements, F) expectations without sampling
    uncertain: np.ndarray  #: (refinements, F) of it what each refinement has of its own
    solving_seconds: float  #: predicted, of typical speed; NaN before
    sampling_seconds: float

    @classmethod
    def initial(cls, sets: int, functions: int, sampling: bool) -> "Decisions":
        """The pilot of the first scheme is wanted, if anything is sampled."""
        nothing, nan = np.full(functions, np.nan), float("nan")
        wanted = glance(sets) if sampling else np.zeros(sets, np.int64)
        fields: dict[str, Any] = dict.fromkeys(("seconds", "cpu_seconds", "work", "pilot_cpu_seconds"), 0.0)
        fields |= dict.fromkeys(("order", "aim", "predicted_cpu_seconds", "next_cpu_seconds"), nan)
        fields |= dict.fromkeys(("solving_seconds", "sampling_seconds"), nan)
        fields |= dict.fromkeys(("levels", "base", "finest", "scheme", "pointed", "points", "looked", "compared"), 0)
        return cls(
            **fields,
            stage=PILOTING,
            wanted=wanted,
            piloted=1,
            works=np.full((sets // SETS, 4), nan),
            known=nothing,
            known_bound=nothing,
            solving=int(not sampling),
            refined=np.zeros((0, functions)),
            uncertain=np.zeros((0, functions)),
        )

    @property
    def set_of_base(self) -> int:
        """Which of the path sets of the scheme the largest step alone has."""
        return (ALONG if self.points else LEVELS) + self.base

    def with_choice(self, choice: Choice, order: float | None) -> "Decisions":
        """With other levels."""
        levels, base, finest, work, _ = choice
        of_order = float("nan") if order is None else order
        return self._replace(levels=levels, base=base, finest=finest, work=work, order=of_order)


def pilot_of(scheme: int, sets: int) -> np.ndarray:
    """(sets,) the samples of the pilot of a scheme: of differences, and of the largest step alone."""
    wanted = np.zeros(sets, np.int64)
    wanted[scheme * SETS + 1 : scheme * SETS + PILOT_LEVELS + 1] = PILOT_SAMPLES
    wanted[scheme * SETS + LEVELS] = PILOT_SAMPLES
    return wanted


def glance(sets: int) -> np.ndarray:
    """(sets,) the samples of the first steps of the pilot of the first scheme."""
    wanted = np.zeros(sets, np.int64)
    wanted[[*range(1, GLANCE_LEVELS + 1), LEVELS]] = GLANCE
    return wanted
