"""Records that a study hands to storage, tables and figures: plain arrays with names."""

import sys
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from types import MappingProxyType, NoneType, UnionType
from typing import Any, NamedTuple, Union, get_args, get_origin

import numpy as np

# ---------------------------------------------------------------------------------------------------------------------
# Checks that the contents of a file have the types and shapes of a record; checksums only identify the last writer.
# ---------------------------------------------------------------------------------------------------------------------


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotated type: a number, a text, None, a tuple or a union of these."""
    if hint is Any:
        return True
    if get_origin(hint) in (Union, UnionType):
        return any(fits(value, member) for member in get_args(hint))
    if hint in (None, NoneType):
        return value is None
    if get_origin(hint) is tuple:
        is_row = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
        return is_row and all(fits(entry, get_args(hint)[0]) for entry in value)
    if get_origin(hint) is dict:
        return isinstance(value, Mapping)
    if hint in (int, float):
        number = isinstance(value, Integral if hint is int else Real) and not isinstance(value, bool | np.bool_)
        return number and not (isinstance(value, Integral) and abs(int(value)) > sys.float_info.max)
    return isinstance(value, bool | np.bool_ if hint is bool else hint)


def check_fact(name: str, value: Any, hint: Any) -> None:
    """Raise TypeError if a fact is not of its type."""
    if not fits(value, hint):
        expected = getattr(hint, "__name__", str(hint)) if get_origin(hint) is None else str(hint)
        raise TypeError(f"{name!r} is {type(value).__name__}, not {expected}")


def check_axis(name: str, values: np.ndarray, is_text: bool) -> None:
    """Raise ValueError if the values along an axis are missing, of a wrong type, or not one-dimensional."""
    if values.ndim != 1 or not values.size or (values.dtype.kind == "U") != is_text:
        raise ValueError(f"{name!r} is an axis of {values.dtype} of shape {values.shape}")


def check_array(name: str, variable: tuple[tuple[str, ...], np.ndarray], axes: tuple[str, ...], sizes: Any) -> None:
    """Raise ValueError if an array does not hold numbers over its axes; `sizes` has the values along each axis."""
    own, values = variable
    if values.dtype.kind not in "iufb":
        raise ValueError(f"{name!r} holds no numbers but {values.dtype}")
    shape = tuple(len(sizes[axis]) for axis in axes if axis in sizes)
    if tuple(own) != axes or len(shape) != len(axes) or values.shape != shape:
        raise ValueError(f"{name!r} is over {own} and of shape {values.shape}, not over {axes}")


INTERVAL = 1.96  #: half the width of a 95 % interval in standard errors
HEAVY_TAILS = 100.0  #: a kurtosis that is worth a warning: few samples carry the variance, whose estimate is poor


def in_standard_errors(difference: np.ndarray, stderr: np.ndarray) -> np.ndarray:
    """Differences in standard errors; NaN where a standard error is not finite and so says nothing."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.asarray(difference / np.where(np.isfinite(stderr), stderr, np.nan))


#: Kinds of experiment by the names that they had in files of earlier versions.
RENAMED_KINDS = {"long_time": "equilibrium"}

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


class Part(NamedTuple):
    """The part of a case that is computed at a time: one scheme, with one estimator where a study has several."""

    scheme: str  #: its name in ``spi.schemes.SCHEMES``
    estimator: str = ""
    eps: float | None = None  #: of a scheme for the multiscale system
    extrapolate: int = 0  #: levels of Richardson extrapolation of weak errors
    also: tuple[int, ...] = ()  #: further levels, whose results come from the same paths

    def each(self) -> tuple["Part", ...]:
        """One part for each level of extrapolation, with the other levels as its `also`."""
        levels = self.extrapolate, *self.also
        return tuple(self._replace(extrapolate=n, also=tuple(k for k in levels if k != n)) for n in levels)

    @property
    def variant(self) -> str:
        """The name in a file of the scheme, with its eps if it has one and its levels of extrapolation."""
        name = self.scheme if self.eps is None else f"{self.scheme}_eps_{self.eps:g}"
        return f"{name}_extrapolated_{self.extrapolate}" if self.extrapolate else name

    @property
    def name(self) -> str:
        """The name of the part in progress and checkpoints."""
        return f"{self.variant}/{self.estimator}" if self.estimator else self.variant


class Group(NamedTuple):
    """The results of one part, in a file ``/<case>/<variant>`` or ``/<case>/<variant>/<estimator>``."""

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


class Results(NamedTuple):
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
