"""Records that a study hands to storage, tables and figures: plain arrays with names."""

import math
import sys
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from types import MappingProxyType, NoneType, UnionType
from typing import Any, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np

from ..ensemble.random_states import RandomState

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


class Swept(NamedTuple):
    """The value of a swept parameter that a case has."""

    word: str  #: the parameter
    value: float
    case: str  #: the name of the case that is swept
    title: str  #: its title
    of: tuple[str, ...] = ()  #: the quantities that are to be shown; () for those that suit the kind
    second_word: str = ""  #: another parameter, if there are two
    second_value: float = math.nan

    @property
    def places(self) -> dict[str, float]:
        """The values by the names of the parameters."""
        return {self.word: self.value} | ({self.second_word: self.second_value} if self.second_word else {})


class Description(NamedTuple):
    """The system and scheme that were integrated, from the attributes of a group.

    Of a whole sweep, a field that differs from value to value is None, or missing among the parameters.
    """

    case: str
    case_title: str
    variant: str  #: the scheme, at one eps if it has one, extrapolated so often: unique within a case
    scheme: str  #: its name in ``spi.schemes.SCHEMES``
    scheme_label: str  #: the name of the scheme in print, without its eps
    eps: float | None
    estimator: str  #: "" where a study has no estimators
    seed: int
    model: str  #: its name in a spec file
    parameters: dict[str, Any]  #: of the model
    variables: tuple[str, ...]  #: the names of the components in the system, () if it gives them none
    initial: tuple[float, ...] | None
    final_time: float | None
    truncate_noise: bool
    extrapolate: int = 0  #: levels of Richardson extrapolation of weak errors
    areas: str = "exact"  #: how Lévy areas were drawn, if they were
    driver: str = ""  #: what drove the noises in place of Brownian motion
    initial_law: str | None = None  #: the law of initial states, where each path has its own
    swept: Swept | None = None  #: where the case has one of the values of a swept parameter

    @property
    def owner(self) -> str:
        """The name of the case in the spec, which is another one than that of the group if a parameter is swept."""
        return self.swept.case if self.swept else self.case

    @property
    def label(self) -> str:
        """The name of the scheme in print, with its eps if it has one and with its extrapolation."""
        text = self.scheme_label if self.eps is None else f"{self.scheme_label}, eps = {self.eps:g}"
        return ", ".join([text, *[self.extrapolation] * (self.extrapolate > 0)])

    @property
    def extrapolation(self) -> str:
        """``extrapolated twice``; empty if it is not."""
        times = {0: "", 1: "extrapolated", 2: "extrapolated twice"}
        return times.get(self.extrapolate, f"extrapolated {self.extrapolate} times")

    @classmethod
    def describe(cls, case: Any, row: Any, part: Part) -> "Description":
        """The description of `part` of `case`; `row` is its scheme's row of SCHEMES."""
        return cls(
            case=case.name,
            case_title=case.title,
            variant=part.variant,
            scheme=part.scheme,
            scheme_label=row.label,
            eps=part.eps,
            estimator=part.estimator,
            seed=case.seed,
            model=case.model_name,
            parameters={name: value for name, value in case.parameters.items() if name != "constants"},
            variables=tuple(getattr(case, "variables", ())),
            initial=None if isinstance(case.initial, RandomState) else case.initial,
            final_time=getattr(case, "final_time", None),
            truncate_noise=case.truncate_noise,
            extrapolate=part.extrapolate,
            areas=getattr(case, "areas", "exact"),
            driver=getattr(case, "driver", ""),
            initial_law=case.initial.text if isinstance(case.initial, RandomState) else None,
            swept=_swept_of(getattr(case, "sweep", None)),
        )

    def attributes(self) -> dict[str, Any]:
        """The attributes of a group that store it, without the names of the case and the variant."""
        plain = self._asdict()
        parameters = {f"{_MODEL}{name}": value for name, value in plain.pop("parameters").items()}
        empty = {name: plain[name] or None for name in ("variables", "extrapolate", "estimator", "driver")}
        empty["areas"] = None if self.areas == "exact" else self.areas
        swept = {} if self.swept is None else {f"{_SWEPT}{name}": it for name, it in self.swept._asdict().items()}
        lacking = [name for name in ("of", "second_word") if not swept.get(f"{_SWEPT}{name}")]
        for name in lacking + ["second_value"] * ("second_word" in lacking):
            swept.pop(f"{_SWEPT}{name}", None)
        del plain["swept"]
        return {k: value for k, value in (plain | empty | parameters | swept).items() if k not in ("case", "variant")}

    @classmethod
    def of(cls, group: Group) -> "Description":
        """The description of a group, from its attributes; KeyError if these are not of this layout."""
        a = group.attributes
        parameters = {key.removeprefix(_MODEL): value for key, value in a.items() if key.startswith(_MODEL)}
        description = cls(
            case=group.case,
            variant=group.variant,
            estimator=group.estimator,
            parameters=parameters,
            case_title=a["case_title"],
            scheme=a["scheme"],
            scheme_label=a["scheme_label"],
            seed=a["seed"],
            model=a["model"],
            eps=a.get("eps"),
            initial=a.get("initial"),
            final_time=a.get("final_time"),
            variables=tuple(a.get("variables") or ()),
            truncate_noise=bool(a.get("truncate_noise")),
            extrapolate=a.get("extrapolate") or 0,
            areas=a.get("areas") or "exact",
            driver=a.get("driver") or "",
            initial_law=a.get("initial_law"),
            swept=_swept(a),
        )
        for name, hint in get_type_hints(cls).items():
            check_fact(name, getattr(description, name), hint)
        for name, value in parameters.items():
            check_fact(f"{_MODEL}{name}", value, float | str | bool | tuple[Any, ...])
        return description


_MODEL = "model_"  # prefix of the attributes that are parameters of the model
_SWEPT = "swept_"  # prefix of those about a swept parameter


def _swept_of(sweep: Any) -> Swept | None:
    """The record of the key ``sweep`` of a case; None where the case is none of its values."""
    if sweep is None or sweep.value is None:
        return None
    swept = Swept(sweep.word, sweep.value, sweep.case, sweep.title, sweep.of)
    return (
        swept._replace(second_word=sweep.second_word, second_value=sweep.second_value) if sweep.second_word else swept
    )


def _swept(attributes: dict[str, Any]) -> Swept | None:
    """The swept parameter in the attributes of a group; KeyError if some of them are missing."""
    if f"{_SWEPT}word" not in attributes:
        return None
    of = tuple(attributes.get(f"{_SWEPT}of") or ())
    word, value, case, title = (attributes[f"{_SWEPT}{name}"] for name in ("word", "value", "case", "title"))
    second = attributes.get(f"{_SWEPT}second_word", ""), attributes.get(f"{_SWEPT}second_value", math.nan)
    swept = Swept(word, value, case, title, of, *second)
    for name, hint in get_type_hints(Swept).items():
        check_fact(f"{_SWEPT}{name}", getattr(swept, name), hint)
    return swept
