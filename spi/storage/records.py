"""What a study hands to storage, tables and figures: plain arrays with names."""

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

INTERVAL = 1.96  #: half the width of a 95 % interval in standard errors

Variables = dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


class Part(NamedTuple):
    """What of a case is computed at a time: one scheme, with one estimator where a study has several."""

    scheme: str  #: its name in ``spi.schemes.SCHEMES``
    estimator: str = ""
    eps: float | None = None  #: of a scheme for the multiscale system
    extrapolate: int = 0  #: levels of Richardson extrapolation of weak errors

    @property
    def variant(self) -> str:
        """What the scheme, at this eps if it has one and extrapolated so often, is called in a file."""
        name = self.scheme if self.eps is None else f"{self.scheme}_eps_{self.eps:g}"
        return f"{name}_extrapolated_{self.extrapolate}" if self.extrapolate else name

    @property
    def name(self) -> str:
        """What the part is called in progress and checkpoints."""
        return f"{self.variant}/{self.estimator}" if self.estimator else self.variant


class Group(NamedTuple):
    """The results of one part, in a file ``/<case>/<variant>`` or ``/<case>/<variant>/<estimator>``."""

    case: str
    variant: str
    coordinates: dict[str, np.ndarray]  #: name of an axis -> its values, a 1-D array (a dimension scale)
    variables: Variables
    attributes: dict[str, Any]  #: numbers, texts and tuples of them that describe the whole group
    estimator: str = ""

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

    @classmethod
    def of(cls, attributes: dict[str, Any]) -> "Order":
        """What the attributes of a group tell; KeyError if they tell no order."""
        low, high = attributes["order_ci"]
        return cls(attributes["order"], low, high, attributes["points_in_fit"])


class Solver(NamedTuple):
    """What an implicit scheme reports of its equations, per step size; arrays of one shape."""

    solves: np.ndarray
    iterations: np.ndarray
    failures: np.ndarray
    largest_residual: np.ndarray  #: relative

    @classmethod
    def of(cls, arrays: dict[str, np.ndarray]) -> "Solver | None":
        """What the arrays of a group tell, name -> array; None if its scheme is explicit."""
        return cls(**{name: arrays[name] for name in cls._fields}) if "solves" in arrays else None

    @property
    def failing_fraction(self) -> np.ndarray:
        """Failures over solves, in the shape of the fields; 0 where nothing was solved."""
        return _ratio(self.failures, self.solves, 0.0)

    @property
    def iterations_per_solve(self) -> np.ndarray:
        """Iterations over solves, in the shape of the fields; NaN where nothing was solved."""
        return _ratio(self.iterations, self.solves, np.nan)


def _ratio(part: np.ndarray, whole: np.ndarray, otherwise: float) -> np.ndarray:
    """`part` over `whole`, and `otherwise` where the whole is 0."""
    whole = np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(whole.shape, otherwise), where=whole > 0)


class Description(NamedTuple):
    """What was integrated, as the attributes of every group tell it.

    Of a sweep, what differs from value to value is None, or missing among the parameters.
    """

    case: str
    case_title: str
    variant: str  #: the scheme, at one eps if it has one, extrapolated so often: unique within a case
    scheme: str  #: its name in ``spi.schemes.SCHEMES``
    scheme_label: str  #: what the scheme is called in print, whatever its eps
    eps: float | None
    estimator: str  #: "" where a study has no estimators
    seed: int
    model: str  #: its name in a spec file
    parameters: dict[str, Any]  #: of the model
    variables: tuple[str, ...]  #: what the system calls its components, () if it gives them no names
    initial: tuple[float, ...] | None
    final_time: float | None
    truncate_noise: bool
    extrapolate: int = 0  #: levels of Richardson extrapolation of weak errors

    @property
    def label(self) -> str:
        """What the scheme is called in print, with its eps if it has one and with its extrapolation."""
        text = self.scheme_label if self.eps is None else f"{self.scheme_label}, eps = {self.eps:g}"
        return ", ".join([text, *[self.extrapolation] * (self.extrapolate > 0)])

    @property
    def extrapolation(self) -> str:
        """``extrapolated twice``; empty if it is not."""
        times = {0: "", 1: "extrapolated", 2: "extrapolated twice"}
        return times.get(self.extrapolate, f"extrapolated {self.extrapolate} times")

    @classmethod
    def of(cls, group: Group) -> "Description":
        """What a group tells; KeyError if it is not of this layout."""
        a = group.attributes
        return cls(
            case=group.case,
            case_title=a["case_title"],
            variant=group.variant,
            scheme=a["scheme"],
            scheme_label=a["scheme_label"],
            eps=a.get("eps"),
            estimator=group.estimator,
            seed=a["seed"],
            model=a["model"],
            parameters={key.removeprefix(_MODEL): value for key, value in a.items() if key.startswith(_MODEL)},
            variables=tuple(a.get("variables") or ()),
            initial=a.get("initial"),
            final_time=a.get("final_time"),
            truncate_noise=bool(a.get("truncate_noise")),
            extrapolate=int(a.get("extrapolate") or 0),
        )


_MODEL = "model_"  # what the attributes begin with that are parameters of the model


def describe(case: Any, row: Any, part: Part) -> dict[str, Any]:
    """The attributes that :meth:`Description.of` reads, of `part` of `case`; `row` is its scheme's row of SCHEMES."""
    return {
        "scheme": part.scheme,
        "scheme_label": row.label,
        "eps": part.eps,
        "extrapolate": part.extrapolate or None,
        "case_title": case.title,
        "seed": case.seed,
        "final_time": getattr(case, "final_time", None),
        "initial": case.initial,
        "truncate_noise": case.truncate_noise,
        "model": case.model_name,
        **{f"{_MODEL}{name}": value for name, value in case.parameters.items() if name != "constants"},
        **({"variables": names} if (names := getattr(case, "variables", ())) else {}),
    }


class Reading(Protocol):
    """What a kind makes of a group: a record with named fields."""

    @property
    def about(self) -> Description:
        """What was integrated."""


R = TypeVar("R", bound=Reading)


def by_case(readings: Iterable[R]) -> list[list[R]]:
    """The readings of each case, in the order of the file."""
    cases: dict[str, list[R]] = {}
    for reading in readings:
        cases.setdefault(reading.about.case, []).append(reading)
    return list(cases.values())
