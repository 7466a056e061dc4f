"""One description of a result: a class whose annotated fields are the contents of a group of a results file.

    class Energies(Stored):
        \"\"\"Mean energies of one scheme.\"\"\"

        row_axes = ("h",)

        h: Annotated[Array, axis("step size")]
        energy: Annotated[Array, array("h", "mean of H(y(T))", claim="equal")]
        energy_stderr: Annotated[Array, array("h", "standard error of the mean")]
        order: Order
        samples: Annotated[int, fact("number of paths", column=True)]

        @derived("h", "mean of H(y(T)) by that of H(y(0))")
        def ratio(self) -> Array:
            return self.energy / self.energy[0]

A study makes such a record; ``record.group()`` is the group that stores it and ``Energies.of(group)`` the record again.
Long names, formulas and units go into the file with the arrays, and from there to xarray.  From the same fields come
the quantities that a spec may expect (``spi.statistics.claims``), rows of CSV and JSON (``spi.printing.rows``), tables
(``spi.printing.tables``) and the page docs/reference/results.md.

A field that is None is not stored.  Axes that no field describes, as "casimir", are numbered from 0.  A field that is a
:class:`Described` itself is stored field by field, under its prefix; an order, or a tuple of orders, as the arrays
``order``, ``order_low``, ``order_high`` and ``points_in_fit``.

The 95 % interval of a field ``x`` is that from ``x_low`` to ``x_high`` where there are such fields or properties, or
``x_half`` to both sides, or ``x_stderr`` times :attr:`Stored.interval`; see :func:`estimate`.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import MISSING, dataclass
from dataclasses import fields as dataclass_fields
from types import UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Generic,
    NamedTuple,
    Self,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np

from ..ensemble.random_states import RandomState
from .records import INTERVAL, Group, Order, Part, check_array, check_axis, check_fact

Array = np.ndarray

#: The axes that have no values of their own.
NUMBERED = {
    "casimir": "number of the Casimir function",
    "component": "number of the component",
    "bin": "number of the bin",
    "cell": "number of the cell",
    "row": "number of the row of cells",
    "column": "number of the column of cells",
    "left_out": "number of the group of paths that is left out",
}


EQUAL, AT_MOST, AT_LEAST = "equal", "at most", "at least"  #: the senses in which a number can be claimed


class Claimed(NamedTuple):
    """How specs may claim a field; texts are names of fields or properties of the record."""

    sense: str  #: in which a bare number is meant
    name: str = ""  #: of the quantity, if it is not that under which the field is stored
    widest: float = math.inf  #: half the width of an interval from which on it says nothing
    absolute: bool = False  #: whether it counts without its sign
    infinite: bool = False  #: whether NaN, which means that paths diverged, counts as infinite
    expected: str = ""  #: its value by theory, a reference or a solver without sampling
    where: str = ""  #: whether it is a quantity at all
    lost: str = ""  #: why no claim about it passes


class Meaning(NamedTuple):
    """The description of a field: its long name, unit, formula and axes, how it is stored and what may be claimed."""

    text: str = ""
    unit: str = ""
    formula: str = ""
    axes: tuple[str, ...] = ()
    name: str = ""  #: under which it is stored, if not under that of the field
    column: str = ""  #: its name in JSON and CSV; of each place along further axes where it has a {}; "" if it is none
    is_axis: bool = False
    prefix: str = ""  #: of the names of the fields of a nested record, or of the entries of a dictionary
    half: str = ""  #: the property with half the width of its interval, if that is not ``<field>_half``
    claim: Claimed | None = None  #: None: specs cannot expect it
    apart: bool = False  #: whether a nested record has no columns in JSON and CSV

    @property
    def notes(self) -> dict[str, str]:
        """The attributes of an array in a file."""
        texts = {"long_name": self.text, "formula": self.formula, "units": self.unit}
        return {name: text for name, text in texts.items() if text}


def axis(text: str, unit: str = "", name: str = "", column: str = "") -> Meaning:
    """The values along an axis, numbers or texts; `column` names the quantities at each of them."""
    return Meaning(text, unit, name=name, column=column, is_axis=True)


def array(
    axes: str,
    text: str,
    unit: str = "",
    formula: str = "",
    name: str = "",
    column: str = "",
    half: str = "",
    claim: Claimed | str | None = None,
) -> Meaning:
    """An array over `axes` (names separated by spaces); for an order or a nested record, the axes of all its arrays."""
    return Meaning(text, unit, formula, tuple(axes.split()), name, column, half=half, claim=_claimed(claim))


def fact(
    text: str,
    unit: str = "",
    name: str = "",
    column: bool = False,
    axes: str = "",
    prefix: str = "",
    claim: Claimed | str | None = None,
) -> Meaning:
    """A number, a text or a tuple of them that describes the whole; `column` says whether rows of numbers have it.

    A tuple of numbers may be over an axis; a dictionary is stored entry by entry under its `prefix`.
    """
    return Meaning(text, unit, "", tuple(axes.split()), name, "yes" * column, prefix=prefix, claim=_claimed(claim))


def nested(axes: str = "", prefix: str = "", apart: bool = False) -> Meaning:
    """A record within a record: the first axes of all its arrays, and the prefix of its names in a file."""
    return Meaning(axes=tuple(axes.split()), prefix=prefix, apart=apart)


def _claimed(claim: Claimed | str | None) -> Claimed | None:
    return Claimed(claim) if isinstance(claim, str) else claim


V = TypeVar("V")


class Derived(Generic[V]):
    """A property of a record that is described as its fields are."""

    def __init__(self, function: Callable[[Any], V], meaning: Meaning):
        self.function, self.meaning, self.__doc__ = function, meaning, meaning.text

    def __get__(self, record: Any, owner: Any = None) -> V:
        own: Any = self
        return own if record is None else self.function(record)


def derived(
    axes: str, text: str, half: str = "", column: str = "", claim: Claimed | str | None = None
) -> Callable[[Callable[[Any], V]], Derived[V]]:
    """Make a method a :class:`Derived` property, which follows from the fields of a record and is not stored."""
    meaning = array(axes, text, column=column, half=half, claim=claim)
    return lambda function: Derived(function, meaning)


class Field(NamedTuple):
    """One field of a record."""

    name: str
    type: Any  #: without None
    optional: bool
    default: Any  #: MISSING if it has none
    meaning: Meaning

    @property
    def is_array(self) -> bool:
        """Whether it is an axis or an array."""
        return self.meaning.is_axis or self.type is Array

    @property
    def is_order(self) -> bool:
        """Whether it is an order, or one for each place along an axis."""
        return self.type is Order or (get_origin(self.type) is tuple and get_args(self.type)[0] is Order)

    @property
    def is_mapping(self) -> bool:
        """Whether it is a dictionary of facts."""
        return get_origin(self.type) is dict

    @property
    def is_record(self) -> bool:
        """Whether it is a record of its own."""
        return isinstance(self.type, type) and issubclass(self.type, Described)


def _field(hint: Any, field: Any) -> Field:
    meaning = Meaning()
    if get_origin(hint) is Annotated:
        hint, meaning = get_args(hint)[:2]
    members = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    (kind,) = (member for member in members if member is not type(None))
    return Field(field.name, kind, len(members) > 1, field.default, meaning)


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Described:
    """A class whose fields say what they hold; each subclass is a frozen dataclass."""

    sparse: ClassVar[bool] = False  #: whether fields that have their default values are not stored
    described: ClassVar[tuple[Field, ...]]  #: its fields but for those that the name of the group tells, and `about`
    meanings: ClassVar[dict[str, Meaning]]  #: those of its fields, and of its :class:`Derived` properties after them

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True, eq=False)(cls)
        hints = get_type_hints(cls, include_extras=True)
        own: Any = cls  # mypy does not see that it is a dataclass by now
        cls.described = tuple(
            _field(hints[field.name], field) for field in dataclass_fields(own) if field.name not in _OF_GROUP
        )
        members = {name: member for base in reversed(cls.__mro__) for name, member in vars(base).items()}
        properties = {name: member.meaning for name, member in members.items() if isinstance(member, Derived)}
        cls.meanings = {field.name: field.meaning for field in cls.described} | properties


_OF_GROUP = ("about", "case", "variant")


class Swept(Described):
    """The value of a swept parameter that a case has."""

    sparse = True

    word: Annotated[str, fact("the swept parameter")]
    value: Annotated[float, fact("its value")]
    owner: Annotated[str, fact("the case of the spec that is swept", name="swept_case")]
    title: Annotated[str, fact("the title of that case")]
    of: Annotated[tuple[str, ...], fact("the quantities that are to be shown, if not those that suit the kind")] = ()
    second_word: Annotated[str, fact("another swept parameter")] = ""
    second_value: Annotated[float, fact("its value")] = math.nan

    @property
    def places(self) -> dict[str, float]:
        """The values by the names of the parameters."""
        return {self.word: self.value} | ({self.second_word: self.second_value} if self.second_word else {})


class Description(Described):
    """The system and scheme that were integrated.

    Of a whole sweep, a field that differs from value to value is None, or missing among the parameters.
    """

    sparse = True

    case: str
    variant: str  #: the scheme, at one eps if it has one, extrapolated so often: unique within a case
    case_title: Annotated[str, fact("title of the case")]
    scheme: Annotated[str, fact("name of the scheme in a spec file")]
    scheme_label: Annotated[str, fact("name of the scheme in print, without its eps")]
    eps: Annotated[float | None, fact("scale of the fast processes of the multiscale system")]
    estimator: Annotated[str, fact("estimator, where a study has several")] = ""
    seed: Annotated[int, fact("seed of the random numbers")]
    model: Annotated[str, fact("name of the model in a spec file")]
    parameters: Annotated[dict[str, Any], fact("parameters of the model", prefix="model_")]
    variables: Annotated[tuple[str, ...], fact("names of the components in the system, if it gives them any")] = ()
    initial: Annotated[tuple[float, ...] | None, fact("initial state")]
    final_time: Annotated[float | None, fact("final time", "time")]
    truncate_noise: Annotated[bool, fact("whether large increments of the noises are cut off")]
    extrapolate: Annotated[int, fact("levels of Richardson extrapolation of weak errors")] = 0
    areas: Annotated[str, fact("how Lévy areas were drawn, if they were")] = "exact"
    driver: Annotated[str, fact("what drove the noises in place of Brownian motion")] = ""
    initial_law: Annotated[str | None, fact("law of initial states, where each path has its own")] = None
    swept: Annotated[Swept | None, nested(prefix="swept_")] = None

    @property
    def owner(self) -> str:
        """The name of the case in the spec, which is another one than that of the group if a parameter is swept."""
        return self.swept.owner if self.swept else self.case

    @property
    def label(self) -> str:
        """The name of the scheme in print, with its eps if it has one and with its extrapolation."""
        return self.subject(with_estimator=False)

    def subject(self, function: str = "", with_estimator: bool = True) -> str:
        """The scheme, its eps and extrapolation, the estimator and a test function, as text."""
        eps = "" if self.eps is None else f"eps = {self.eps:g}"
        return ", ".join(
            filter(None, (self.scheme_label, eps, self.extrapolation, self.estimator * with_estimator, function))
        )

    @property
    def extrapolation(self) -> str:
        """``extrapolated twice``; empty if it is not."""
        times = {0: "", 1: "extrapolated", 2: "extrapolated twice"}
        return times.get(self.extrapolate, f"extrapolated {self.extrapolate} times")

    @classmethod
    def describe(cls, case: Any, row: Any, part: Part) -> Self:
        """The description of `part` of `case`; `row` is its scheme's row of SCHEMES."""
        random, sweep = isinstance(case.initial, RandomState), getattr(case, "sweep", None)
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
            initial=None if random else case.initial,
            final_time=getattr(case, "final_time", None),
            truncate_noise=case.truncate_noise,
            extrapolate=part.extrapolate,
            areas=getattr(case, "areas", "exact"),
            driver=getattr(case, "driver", ""),
            initial_law=case.initial.text if random else None,
            swept=None if sweep is None or sweep.value is None else _swept(sweep),
        )

    def attributes(self) -> dict[str, Any]:
        """The attributes of a group that store it, without the names of the case and the variant."""
        group = Group(self.case, self.variant, {}, {}, {})
        _put(self, group, Meaning())
        return group.attributes

    @classmethod
    def of(cls, group: Group) -> Self:
        """The description of a group; KeyError, with the name, if it lacks a needed attribute."""
        fields = _taken(cls, group, Meaning()) | {"estimator": group.estimator}
        return cls(case=group.case, variant=group.variant, **fields)


def _swept(sweep: Any) -> Swept:
    """The record of the key ``sweep`` of a case that has one of its values."""
    second = {"second_word": sweep.second_word, "second_value": sweep.second_value} if sweep.second_word else {}
    return Swept(word=sweep.word, value=sweep.value, owner=sweep.case, title=sweep.title, of=sweep.of, **second)


class Stored(Described):
    """The results of one part of an experiment, stored as a group of a results file."""

    headline: ClassVar[tuple[str, ...]] = ()  #: the quantities that reports, and figures over a parameter, show first
    row_axes: ClassVar[tuple[str, ...]] = ()  #: the axes whose points are the rows of CSV and JSON
    row_columns: ClassVar[tuple[str, ...]] = ()  #: those that are spread over columns
    row_largest: ClassVar[tuple[str, ...]] = ()  #: those along which the largest value counts
    row_last: ClassVar[tuple[str, ...]] = ()  #: those at whose end alone a row has what is not over them

    tables: ClassVar[Sequence[Any]] = ()  #: those of a case, see ``spi.printing.tables``

    about: Description
    wall_seconds: Annotated[float, fact("wall-clock time of the part", "s")] = 0.0
    threads: Annotated[int, fact("number of threads")] = 1

    @property
    def interval(self) -> float:
        """Half the width of a 95 % interval in standard errors."""
        return INTERVAL

    def group(self) -> Group:
        """The group of a results file that stores it."""
        about = self.about
        group = Group(about.case, about.variant, {}, {}, about.attributes(), about.estimator, {})
        _put(self, group, Meaning())
        used = {
            name: size
            for axes, values in group.variables.values()
            for name, size in zip(axes, values.shape, strict=True)
        }
        for name in NUMBERED.keys() & used.keys():
            group.coordinates[name] = np.arange(used[name])
            group.notes[name] = {"long_name": NUMBERED[name]}
        return group

    @classmethod
    def of(cls, group: Group) -> Self:
        """The record in a group; KeyError, with the name, if the group lacks a field that the record needs."""
        return cls(about=Description.of(group), **_taken(cls, group, Meaning()))

    @classmethod
    def quantities_of_case(cls, readings: Any) -> Iterator[Any]:
        """The quantities (``spi.statistics.claims.Quantity``) that follow from several records of a case."""
        yield from ()

    def remarks(self) -> Iterator[str]:
        """Lines under the tables, behind those on what records have in common."""
        yield from ()

    @classmethod
    def remarks_of_case(cls, readings: Any) -> Iterator[str]:
        """Lines on all records of a case."""
        yield from ()


R = TypeVar("R", bound=Stored)


def by_case(readings: Iterable[R]) -> list[list[R]]:
    """The records of each case, in the order of the file."""
    cases: dict[str, list[R]] = {}
    for reading in readings:
        cases.setdefault(reading.about.case, []).append(reading)
    return list(cases.values())


def stored_names(field: Field, prefix: str = "") -> tuple[str, ...]:
    """The names under which a field is stored; of an order those of its four arrays."""
    name = field.meaning.name or prefix + field.name
    if not field.is_order:
        return (name,)
    return name, f"{name}_low", f"{name}_high", "points_in_fit" if name == "order" else f"{name}_points"


def _put(record: Described, group: Group, outer: Meaning) -> None:
    """Add the fields of a record to a group."""
    for field in record.described:
        value, meaning = getattr(record, field.name), field.meaning
        if value is None or (record.sparse and (value is field.default or value == field.default)):
            continue
        names = stored_names(field, outer.prefix)
        axes = (*outer.axes, *meaning.axes)
        if field.is_record:
            _put(value, group, meaning)
        elif field.is_order:
            columns = np.array(value, float).reshape(-1, len(Order._fields)).T
            shape = (-1,) if axes else ()
            for name, values, kind in zip(names, columns, (float, float, float, np.int64), strict=True):
                group.variables[name] = axes, values.astype(kind).reshape(shape)
            meanings = meaning if meaning.text else ORDER, *ENDS
            group.notes.update((name, part.notes) for name, part in zip(names, meanings, strict=True))
        elif field.is_array:
            if meaning.is_axis:
                group.coordinates[names[0]] = np.asarray(value)
            else:
                group.variables[names[0]] = axes, np.asarray(value)
            group.notes[names[0]] = meaning.notes
        elif field.is_mapping:
            group.attributes.update((meaning.prefix + key, entry) for key, entry in value.items())
        else:
            group.attributes[names[0]] = value


def _taken(cls: type[Described], group: Group, outer: Meaning) -> dict[str, Any]:
    """The fields of a record from a group, by name."""
    return {field.name: _value(field, group, outer) for field in cls.described}


def _value(field: Field, group: Group, outer: Meaning) -> Any:
    """The value of a field in a group; KeyError if it is missing and needed."""
    if field.is_record:
        there = _is_there(field, group)
        return field.type(**_taken(field.type, group, field.meaning)) if there or not field.optional else None
    if field.is_mapping:
        prefix = field.meaning.prefix
        entries = {key.removeprefix(prefix): it for key, it in group.attributes.items() if key.startswith(prefix)}
        for name, entry in entries.items():
            check_fact(prefix + name, entry, float | str | bool | tuple[Any, ...])
        return entries
    names = stored_names(field, outer.prefix)
    held: Any = group.arrays | group.coordinates if field.is_array or field.is_order else group.attributes
    if names[0] not in held and (field.optional or field.default is not MISSING):
        return None if field.default is MISSING else field.default
    _check(field, group, names, (*outer.axes, *field.meaning.axes))
    if field.is_order:
        columns = [held[name].tolist() for name in names]
        return Order(*columns) if field.type is Order else tuple(Order(*each) for each in zip(*columns, strict=True))
    value = held[names[0]]
    return tuple(value.tolist()) if field.is_array and field.type is not Array else value


def _check(field: Field, group: Group, names: tuple[str, ...], axes: tuple[str, ...]) -> None:
    """Raise an error, with the name, if the value in a group has another type or shape than the field."""
    for name in names:
        if field.meaning.is_axis:
            check_axis(name, group.coordinates[name], field.type is not Array)
        elif field.is_array or field.is_order:
            check_array(name, group.variables[name], axes, group.coordinates)
        else:
            check_fact(name, group.attributes[name], field.type)


def _is_there(field: Field, group: Group) -> bool:
    """Whether a group holds a nested record: whether it has the first of the fields that this cannot lack."""
    needed = next(inner for inner in field.type.described if not inner.optional and inner.default is MISSING)
    if needed.is_record:
        return _is_there(needed, group)
    return stored_names(needed, field.meaning.prefix)[0] in {**group.coordinates, **group.variables, **group.attributes}


#: The description of an order whose field has none.
ORDER = Meaning("fitted order of convergence", formula="p in error = C h^p")
ENDS = tuple(map(Meaning, ("lower end of the 95 % interval", "upper end of the 95 % interval", "points in the fit")))


class Entry(NamedTuple):
    """An array, axis or attribute of a file, by its name."""

    name: str
    axes: tuple[str, ...]
    meaning: Meaning
    always: bool
    is_fact: bool


def layout(cls: type[Described], outer: Meaning = Meaning(), always: bool = True) -> Iterator[Entry]:  # noqa: B008
    """The entries of a file that store a record, name by name."""
    for field in cls.described:
        needed = always and not field.optional and field.default is MISSING
        if field.is_record:
            yield from layout(field.type, field.meaning, needed)
            continue
        name, *ends = stored_names(field, outer.prefix)
        axes = (name,) if field.meaning.is_axis else (*outer.axes, *field.meaning.axes)
        meaning = ORDER if field.is_order and not field.meaning.text else field.meaning
        yield Entry(name, axes, meaning, needed, not (field.is_array or field.is_order))
        yield from (Entry(end, axes, part, needed, False) for end, part in zip(ends, ENDS, strict=False))


# ---------------------------------------------------------------------------------------------------------------------
# Numbers of a record with their intervals, by the names of their fields
# ---------------------------------------------------------------------------------------------------------------------


class Estimate(NamedTuple):
    """Numbers over some axes with the ends of their 95 % intervals; both are the numbers themselves where exact."""

    axes: tuple[str, ...]
    value: Array
    low: Array
    high: Array

    @property
    def exact(self) -> bool:
        """Whether the numbers have no intervals."""
        return self.low is self.value

    @property
    def absolute(self) -> "Estimate":
        """The numbers without their signs."""
        value, negative = np.abs(self.value), self.value < 0
        if self.exact:
            return Estimate(self.axes, value, value, value)
        low, high = np.where(negative, -self.high, self.low), np.where(negative, -self.low, self.high)
        return Estimate(self.axes, value, low, high)

    def map(self, function: Callable[[Array], Array], axes: tuple[str, ...]) -> "Estimate":
        """The numbers and ends after a function that leaves these axes."""
        value = function(self.value)
        return Estimate(axes, value, *((value, value) if self.exact else (function(self.low), function(self.high))))

    def without(self, axis: str, function: Callable[..., Array]) -> "Estimate":
        """With one number in place of those along an axis, such as the largest: ``function(values, axis=...)``."""
        at = self.axes.index(axis)
        return self.map(lambda values: function(values, axis=at), tuple(name for name in self.axes if name != axis))


def estimate(record: Stored, path: str) -> Estimate | None:
    """A field or property of a record, or as in ``law.distance`` of one within it; None if there is none."""
    owner, axes, name = _owner(record, path)
    value = getattr(owner, name, None)
    if value is None:
        return None
    meaning = type(owner).meanings.get(name, Meaning())
    axes = (*axes, *((meaning.name or name,) if meaning.is_axis else meaning.axes))
    if isinstance(value, Order) or (isinstance(value, tuple) and value and isinstance(value[0], Order)):
        columns = np.moveaxis(np.array(value, float), -1, 0)
        return Estimate(axes, *columns[:3])
    values = np.asarray(value)
    half, stderr = getattr(owner, meaning.half or f"{name}_half", None), getattr(owner, f"{name}_stderr", None)
    low, high = getattr(owner, f"{name}_low", None), getattr(owner, f"{name}_high", None)
    with np.errstate(invalid="ignore", over="ignore"):
        if low is None or high is None:
            if half is None and stderr is None:
                return Estimate(axes, values, values, values)
            half = _half(record, stderr) if half is None else half
            low, high = values - half, values + half
        certain = np.isinf(values)  # as that paths diverged
        return Estimate(axes, values, np.where(certain, values, low), np.where(certain, values, high))


def _half(record: Stored, stderr: Any) -> Array:
    """Half the widths of intervals by standard errors: 0 of errors that are 0, whatever the factor."""
    errors = np.asarray(stderr)
    return np.where(errors == 0, 0.0, record.interval * errors)


def _owner(record: Stored, path: str) -> tuple[Any, tuple[str, ...], str]:
    """The record that has the last field of a path, the axes of all that is in it, and the name of the field."""
    owner: Any = record
    axes: tuple[str, ...] = ()
    *outer, name = path.split(".")
    for step in outer:
        axes += type(owner).meanings[step].axes if owner is not None else ()
        owner = getattr(owner, step, None)
    return owner, axes, name


def beside(record: Stored, path: str, name: str, numbers: Estimate, default: Any) -> Array:
    """A field or property beside that at `path`, or else of the whole record, over the axes of `numbers`.

    `default` where there is none.
    """
    axes, shape = numbers.axes, numbers.value.shape
    owner: Any = _owner(record, path)[0] if name else None
    owner = owner if hasattr(owner, name) else record
    value = getattr(owner, name, None) if name else None
    if value is None:
        return np.broadcast_to(np.asarray(default), shape)
    own = type(owner).meanings.get(name, Meaning()).axes
    values = np.asarray(value)
    return np.broadcast_to(
        values.reshape([values.shape[own.index(axis)] if axis in own else 1 for axis in axes]), shape
    )


class Axis(NamedTuple):
    """The values along an axis."""

    values: Any  #: an array of numbers or a tuple of texts
    label: str  #: a template that names a quantity at one of them; empty if quantities have no such names


def axes_of(record: Described) -> dict[str, Axis]:
    """The axes that a record describes, by name."""
    axes: dict[str, Axis] = {}
    for field in record.described:
        value = getattr(record, field.name)
        if field.is_record and value is not None:
            axes |= axes_of(value)
        elif field.meaning.is_axis and value is not None:
            name = field.meaning.name or field.name
            axes[name] = Axis(value, field.meaning.column or "{}" * (name == "function"))
    return axes


WIDEST = 0.25  #: half the width of the interval of an order from which on it says nothing
_ORDER = Claimed(EQUAL, widest=WIDEST, expected="expected_order")


def claimed(
    cls: type[Described],
    outer: Meaning = Meaning(),  # noqa: B008
    path: str = "",
) -> Iterator[tuple[str, str, tuple[str, ...], Claimed]]:
    """(name, path of the field, axes, sense and so on) of all quantities of a record that specs may claim."""
    fields = {field.name: field for field in cls.described}
    for name, meaning in cls.meanings.items():
        field, stored = fields.get(name), meaning.name or outer.prefix + name
        if field and field.is_record:
            yield from claimed(field.type, meaning, f"{path}{name}.")
        claim = _ORDER if field and field.is_order and stored == "order" else meaning.claim
        if claim:
            yield claim.name or stored, path + name, (*outer.axes, *meaning.axes), claim
