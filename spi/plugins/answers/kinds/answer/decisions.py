"""Decisions on an answer and their records: stages, pilots, the choice of levels, and what came out."""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from spi.numerics.rng import LANES
from spi.statistics.estimators import ROUND
from spi.storage.records import INTERVAL

from . import planner
from .keys import PILOT_LEVELS, PILOT_SAMPLES
from .sets import LEVELS, Role, SetOf, no_samples

#: The samples of each level of a first glance before the pilot, and the number of its levels, of larger steps.
GLANCE, GLANCE_LEVELS = ROUND * LANES, 4


class Stage(IntEnum):
    """How far the samples are."""

    PILOT = 0
    BEGINNING = 1  #: a share of the work
    WHOLE = 2  #: all of it, and more for its checks
    DONE = 3


class SolveOrSample(IntEnum):
    """Whether the expectation is solved for or sampled; not decided as long as the pilot goes on."""

    UNDECIDED = 0
    SOLVING = 1
    SAMPLING = 2


class Best(NamedTuple):
    """Best choice of levels of a scheme, from the estimates of its levels."""

    choice: planner.Choice
    measured: planner.Measured
    exponents: tuple[float, ...]  #: powers of h in the weak error
    order: float  #: of the means, where it is not that of theory; NaN else

    def samples(self, accuracy: float, bias: float | None = None, factor: float = INTERVAL) -> np.ndarray:
        """(2, levels) the samples of differences and values for an accuracy, see :func:`.planner.allocation`."""
        each = planner.allocation(self.measured, self.exponents, self.choice, accuracy, bias, factor)
        return each.reshape(2, LEVELS)


class Decisions(NamedTuple):
    """Results besides sums over paths, for F functions."""

    wanted: np.ndarray  #: (schemes, roles, levels) samples
    refined: np.ndarray  #: (refinements, F) expectations without sampling
    uncertain: np.ndarray  #: (refinements, F) the uncertainty of each refinement by itself
    efforts: np.ndarray  #: (refinements,) that each of them took
    way: SolveOrSample
    solving_seconds: float = math.nan  #: predicted, of typical speed
    sampling_seconds: float = math.nan
    seconds: float = 0.0  #: wall clock, of what needs no paths
    cpu_seconds: float = 0.0
    stage: Stage = Stage.PILOT
    checks: int = 0  #: how often there were more samples after the whole work
    schemes_piloted: int = 1  #: the number of schemes with a pilot
    glance_done: bool = False  #: whether it is decided if the pilot needs its small steps
    quasi_pilot_done: bool = False  #: whether there is a pilot along quasi-random points
    follows_points: bool = False  #: whether the largest step follows such points
    scheme: int = 0  #: the number of the scheme that was chosen
    levels: int = 0  #: of extrapolation
    base: int = 0  #: the level that is sampled alone
    finest: int = 0
    compared_level: int = 0  #: level at whose step the reference scheme is compared, 0 before that
    order: float = math.nan  #: of the bias, where it is not that of theory
    aim: float = math.nan  #: half the width of the interval that is aimed at
    work: float = 0.0  #: predicted, in seconds of typical speed
    pilot_cpu_seconds: float = 0.0
    predicted_cpu_seconds: float = math.nan
    next_cpu_seconds: float = math.nan  #: of an answer to a tenth of the accuracy

    @classmethod
    def initial(cls, schemes: int, functions: int, sampling: bool) -> "Decisions":
        """The pilot of the first scheme is wanted, if anything is sampled."""
        wanted, none = glance(schemes) if sampling else no_samples(schemes), np.zeros((0, functions))
        return cls(wanted, none, none, np.zeros(0), SolveOrSample.UNDECIDED if sampling else SolveOrSample.SOLVING)

    @property
    def base_set(self) -> SetOf:
        """Path set with the largest step alone."""
        return SetOf(self.scheme, Role.POINTS if self.follows_points else Role.VALUES, self.base)

    def with_best(self, best: Best) -> "Decisions":
        """Decisions with other levels."""
        levels, base, finest, work, _ = best.choice
        points = bool(best.measured.along[base] > 0)
        return self._replace(
            levels=levels, base=base, finest=finest, work=work, order=best.order, follows_points=points
        )


def pilot_of(scheme: int, schemes: int) -> np.ndarray:
    """(schemes, roles, levels) the samples of the pilot of a scheme: differences, and the largest step alone."""
    return _first_steps(scheme, schemes, PILOT_LEVELS, PILOT_SAMPLES)


def glance(schemes: int) -> np.ndarray:
    """(schemes, roles, levels) the samples of the first steps of the pilot of the first scheme."""
    return _first_steps(0, schemes, GLANCE_LEVELS, GLANCE)


def _first_steps(scheme: int, schemes: int, levels: int, samples: int) -> np.ndarray:
    wanted = no_samples(schemes)
    wanted[scheme, Role.DIFFERENCES, 1 : levels + 1] = samples
    wanted[scheme, Role.VALUES, 0] = samples
    return wanted


class Outcome(NamedTuple):
    """Estimates from all sums, arrays (F,)."""

    value: np.ndarray
    half: np.ndarray  #: half the width of the 95 % interval, the bias included
    bias: np.ndarray
    stderr: np.ndarray
    order: float  #: of the bias
    check: np.ndarray  #: the difference to one step finer
    check_stderr: np.ndarray
    passed: bool
    share: np.ndarray  #: (levels,) weights of the differences in the value
    unresolved: np.ndarray  #: whether all values of a mean are equal, and may lie anywhere, or
    few: np.ndarray  #: a few samples have the variance, and others may lie anywhere

    @property
    def factor(self) -> float:
        """(half width without the bias) / standard error, 1.96 unless few samples decide."""
        with np.errstate(all="ignore"):
            factor = np.nan_to_num((self.half - self.bias) / self.stderr, nan=INTERVAL).max()
        return float(np.clip(factor, INTERVAL, 10.0))


class Prediction(NamedTuple):
    """Prediction of an answer, from its pilot alone."""

    how: str  #: the choice, in words
    seconds: float  #: of processor time; NaN where nothing would be sampled
    next_digit: float  #: the same to a tenth of the accuracy
