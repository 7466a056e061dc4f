"""Records that a study hands to storage, tables and figures: plain arrays with names."""

from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

CONFIDENCE = 0.95  #: of all intervals
INTERVAL = 1.96  #: half the width of a 95 % interval in standard errors that are known, or come from very many values
HEAVY_TAILS = 100.0  #: a kurtosis that is worth a warning: few samples carry the variance, whose estimate is poor


def student(freedom: Any, confidence: float = CONFIDENCE) -> Any:
    """Half the width of an interval in standard errors: Student's quantile for `freedom` degrees of freedom.

    NaN for less than one, where no error is known.  All intervals that are made of standard errors have this factor.
    """
    from scipy.special import stdtrit  # not needed to start the program

    freedom = np.asarray(freedom, float)
    return np.where(freedom >= 1.0, stdtrit(np.minimum(freedom, 1e9), 0.5 * (1.0 + confidence)), np.nan)[()]


def in_standard_errors(difference: np.ndarray, stderr: np.ndarray) -> np.ndarray:
    """Differences in standard errors; NaN where a standard error is not finite and so says nothing."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(difference / np.where(np.isfinite(stderr), stderr, np.nan))


Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


class Part(NamedTuple):
    """Part of a case that is computed at a time: one scheme, with one estimator where a study has several."""

    scheme: str  #: its name in ``spi.schemes.SCHEMES``
    estimator: str = ""
    eps: float | None = None  #: of a scheme for the multiscale system
    extrapolate: int = 0  #: levels of Richardson extrapolation of weak errors

    @property
    def variant(self) -> str:
        """Name in a file of the scheme, with its eps if it has one and its levels of extrapolation."""
        name = self.scheme if self.eps is None else f"{self.scheme}_eps_{self.eps:g}"
        return f"{name}_extrapolated_{self.extrapolate}" if self.extrapolate else name

    @property
    def name(self) -> str:
        """Name of the part in progress and checkpoints."""
        return f"{self.variant}/{self.estimator}" if self.estimator else self.variant


class Group(NamedTuple):
    """Results of one part, in a file ``/<case>/<variant>`` or ``/<case>/<variant>/<estimator>``."""

    case: str
    variant: str
    coordinates: dict[str, np.ndarray]  #: name of an axis -> its values, a 1-D array (a dimension scale)
    variables: Variables
    attributes: dict[str, Any]  #: numbers, texts and tuples of them that describe the whole group
    estimator: str = ""
    notes: Any = MappingProxyType({})  #: name of an array or axis -> its "long_name", "formula" and "units"

    @property
    def name(self) -> str:
        """``case/variant``, or ``case/variant/estimator``."""
        return "/".join(filter(None, (self.case, self.variant, self.estimator)))

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """name -> array, without the names of its axes."""
        return {name: values for name, (_, values) in self.variables.items()}


class StoredResults(NamedTuple):
    """One results file."""

    attributes: dict[str, Any]  #: of the whole experiment: kind, title, figure, spec, spec_hash, profile, seed, ...
    groups: tuple[Group, ...]
    #: one for each chunk of paths: its part, path set, index, number of paths, and a digest of what they summed up to
    chunks: tuple[str, ...] = ()


class Order(NamedTuple):
    """A fitted order of convergence with its 95 % interval; NaN where fewer than three points are resolved."""

    order: float
    low: float
    high: float
    points: int  #: in the fit
