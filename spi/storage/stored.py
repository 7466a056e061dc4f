"""One description of a result: a class whose fields are the contents of a group of a results file.

    class Energies(Stored):
        \"\"\"Mean energies of one scheme.\"\"\"

        row_axes = ("h",)

        h: Array = axis("step size")
        energy: Array = array("h", "mean of H(y(T))", claim="equal")
        energy_stderr: Array = array("h", "standard error of the mean")
        order: Order
        samples: int = fact("number of paths", column=True)

        @derived("h", "mean of H(y(T)) by that of H(y(0))")
        def ratio(self) -> Array:
            return self.energy / self.energy[0]

A study makes such a record; ``record.group()`` is the group that stores it and ``Energies.of(group)`` the record again.
Long names, formulas and units go into the file with the arrays, and from there to xarray.  From the same fields come
the quantities that a spec may expect (``spi.statistics.claims``), tables of exports (``spi.printing.rows``), tables
(``spi.printing.tables``) and the page docs/reference/results.md.

A field that is None is not stored.  Axes that no field describes, as "casimir", are numbered from 0.  A field that is a
:class:`Described` itself is stored field by field, under its prefix; an order, or a tuple of orders, as the arrays
``order``, ``order_low``, ``order_high`` and ``points_in_fit``.

The 95 % interval of a field ``x`` is that from ``x_low`` to ``x_high`` where there are such fields or properties, or
``x_half`` or ``x_bound`` to both sides, or ``x_stderr`` times Student's factor for :meth:`Stored.freedom`; see
:meth:`Stored.estimate`.

The file is long because declaring, storing, reading and estimating are one mechanism.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import MISSING, dataclass, replace
from dataclasses import field as dataclass_field
from dataclasses import fields as dataclass_fields
from types import UnionType
from typing import (
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

from spi.numerics.types import Array

from ..ensemble.long_states import LongState
from ..ensemble.random_states import RandomState
from ..numerics.groups import filled_groups
from .records import Group, Order, Part, Variables, student

#: The axes that have no values of their own.
NUMBERED = {
    "casimir": "number of the Casimir function",
    "component": "number of the component",
    "bin": "number of the bin",
    "cell": "number of the cell",
    "row": "number of the row of cells",
    "column": "number of the column of cells",
    "vector": "number of the vector of the lattice",
    "branch": "number of the branch of linear waves, by frequency",
    "left_out": "number of the group of paths that is left out",
}


EQUAL, AT_MOST, AT_LEAST = "equal", "at most", "at least"  #: the senses in which a number can be claimed


class Claimed(NamedTuple):
    """A quantity that specs may make claims about, and how it is written and drawn.

    ``expected``, ``where`` and ``lost`` are names of fields or properties of the record.
    """

    sense: str  #: in which a bare number is meant
    name: str = ""  #: of the quantity, if it is not that under which the field is stored
    widest: float = math.inf  #: half the width of an interval from which on it says nothing
    absolute: bool = False  #: whether it counts without its sign
    infinite: bool = False  #: whether NaN, which means that paths diverged, counts as infinite
    expected: str = ""  #: its value by theory, a reference or a solver without sampling
    where: str = ""  #: whether it is a quantity at all
    lost: str = ""  #: why no claim about it is confirmed
    title: str = ""  #: its name in print, if it is another one
    further: str = ""  #: what is said of it behind its scheme and test function where orders stand in a list
    symbol: str = ""  #: LaTeX of the operator on a test function that it is, as of an expectation
    ends: str = ""  #: the form of the ends of an interval that is written by these; "" of one that is written with ±
    is_order: bool = False  #: whether it is an order of convergence, of which theory speaks as h -> 0
    is_named: bool = False  #: whether each of its numbers has a name of its own, which says what it is
    is_fit: bool = False  #: whether it is left out of a headline where it could not be fitted
    none_diverged: float = math.nan  #: its number if no path diverged, where it says how many did, or did not
    per_step: bool = False  #: whether it belongs to a step size, as the axes of its field say

    @property
    def counts_paths(self) -> bool:
        """Whether it says how many paths diverged, or did not."""
        return not math.isnan(self.none_diverged)


#: How many paths diverged.
DIVERGED = Claimed(AT_MOST, title="diverged", none_diverged=0.0)


class Meaning(NamedTuple):
    """Description of a field: its long name, unit, formula and axes, how it is stored and what may be claimed."""

    text: str = ""
    unit: str = ""
    formula: str = ""
    axes: tuple[str, ...] = ()
    name: str = ""  #: under which it is stored, if not under that of the field
    column: str = ""  #: its name in exports; of each place along an axis where it has a {}; "" if it is none
    is_axis: bool = False
    prefix: str = ""  #: of the names of the fields of a nested record, or of the entries of a dictionary
    claims: tuple[Claimed, ...] = ()  #: what specs may expect of it

    @property
    def notes(self) -> dict[str, str]:
        """Attributes of an array in a file."""
        texts = {"long_name": self.text, "formula": self.formula, "units": self.unit}
        return {name: text for name, text in texts.items() if text}

    @property
    def label(self) -> str:
        """Template that names a quantity at a place along an axis; empty if it has no such name."""
        return self.column or ("{}" if self.name == "function" else "")


_Claims = Claimed | str | tuple[Claimed, ...]


def _claims(claim: _Claims) -> tuple[Claimed, ...]:
    """Claims in short form: the sense of the only one, or nothing for none."""
    if isinstance(claim, str):
        return (Claimed(claim),) if claim else ()
    return (claim,) if isinstance(claim, Claimed) else claim


def _described(meaning: Meaning, default: Any) -> Any:
    """Field of a dataclass with this description."""
    return dataclass_field(default=default, metadata={"meaning": meaning})


def axis(text: str, unit: str = "", name: str = "", column: str = "", default: Any = MISSING) -> Any:
    """Values along an axis, numbers or texts; `column` names the quantities at each of them."""
    return _described(Meaning(text, unit, name=name, column=column, is_axis=True), default)


def array(
    axes: str,
    text: str,
    unit: str = "",
    formula: str = "",
    name: str = "",
    column: str = "",
    claim: _Claims = "",
    default: Any = MISSING,
) -> Any:
    """An array over `axes` (names separated by spaces); for an order or a nested record, the axes of all its arrays."""
    return _described(Meaning(text, unit, formula, tuple(axes.split()), name, column, claims=_claims(claim)), default)


def fact(
    text: str,
    unit: str = "",
    name: str = "",
    column: bool = False,
    axes: str = "",
    prefix: str = "",
    claim: _Claims = "",
    default: Any = MISSING,
) -> Any:
    """A number, a text or a tuple of them that describes the whole; `column` says whether rows of numbers have it.

    A tuple of numbers may be over an axis; a dictionary is stored entry by entry under its `prefix`.
    """
    spread = "yes" if column else ""
    meaning = Meaning(text, unit, "", tuple(axes.split()), name, spread, prefix=prefix, claims=_claims(claim))
    return _described(meaning, default)


def nested(axes: str = "", prefix: str = "", default: Any = MISSING) -> Any:
    """A record within a record: the first axes of all its arrays, and the prefix of its names in a file."""
    return _described(Meaning(axes=tuple(axes.split()), prefix=prefix), default)


V = TypeVar("V")


class Derived(Generic[V]):
    """A property of a record that is described as its fields are."""

    def __init__(self, function: Callable[[Any], V], meaning: Meaning):
        self.function, self.meaning, self.__doc__ = function, meaning, meaning.text

    def __get__(self, record: Any, owner: Any = None) -> V:
        own: Any = self
        return own if record is None else self.function(record)


def derived(
    axes: str, text: str, name: str = "", column: str = "", claim: _Claims = ""
) -> Callable[[Callable[[Any], V]], Derived[V]]:
    """Make a method a :class:`Derived` property, which follows from the fields of a record and is not stored."""
    meaning = Meaning(text, axes=tuple(axes.split()), name=name, column=column, claims=_claims(claim))
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
    members = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    (kind,) = (member for member in members if member is not type(None))
    return Field(field.name, kind, len(members) > 1, field.default, field.metadata.get("meaning", Meaning()))


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(axis, array, fact, nested))
class Described:
    """A class whose fields say what they hold; each subclass is a frozen dataclass."""

    described: ClassVar[tuple[Field, ...]]  #: its fields but for those that the name of the group tells, and `about`

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True, eq=False)(cls)
        hints = get_type_hints(cls)
        own: Any = cls  # mypy does not see that it is a dataclass by now
        cls.described = tuple(
            _field(hints[field.name], field) for field in dataclass_fields(own) if field.name not in _OF_GROUP
        )


_OF_GROUP = ("about", "case", "variant")


WIDEST = 0.25  #: half the width of the interval of an order from which on it says nothing

#: What may be claimed of an order, and the description of one whose field has none.
CLAIMED_ORDER = Claimed(EQUAL, widest=WIDEST, expected="expected_order", ends=".3f", is_order=True)
ORDER = Meaning("fitted order of convergence", formula="p in error = C h^p", claims=(CLAIMED_ORDER,))
ENDS = tuple(map(Meaning, ("lower end of the 95 % interval", "upper end of the 95 % interval", "points in the fit")))


class Entry(NamedTuple):
    """An array, axis or attribute of a file, or a derived property, by its name."""

    name: str
    axes: tuple[str, ...]
    meaning: Meaning
    always: bool
    is_fact: bool
    path: tuple[str, ...]  #: from the record to its value
    field: Field | None = None  #: None of a derived property

    @property
    def is_exported(self) -> bool:
        """Whether it is numbers of a table: an array, a fact over axes, or a derived property with a column."""
        if self.meaning.is_axis:
            return False
        return not self.is_fact or bool(self.meaning.axes) if self.field else bool(self.meaning.column)

    def of(self, record: Any) -> Any:
        """Its value in a record; None if there is none."""
        for name in self.path:
            if isinstance(record, tuple) and not isinstance(record, Order):  # orders along an axis
                return np.array([getattr(order, name) for order in record])
            record = getattr(record, name, None)
        return record


def layout(
    cls: type[Described],
    outer: Meaning = Meaning(),  # noqa: B008
    always: bool = True,
    path: tuple[str, ...] = (),
) -> Iterator[Entry]:
    """Entries of a file that store a record, name by name."""
    for field in cls.described:
        needed, here = always and not field.optional and field.default is MISSING, (*path, field.name)
        if field.is_record:
            yield from layout(field.type, field.meaning, needed, here)
            continue
        name, *ends = stored_names(field, outer.prefix)
        axes = (name,) if field.meaning.is_axis else (*outer.axes, *field.meaning.axes)
        meaning, is_fact = field.meaning, not (field.is_array or field.is_order)
        if field.is_order:
            meaning = meaning if meaning.text else ORDER
            here = (*here, "order")
        yield Entry(name, axes, meaning, needed, is_fact, here, field)
        for end, part, attribute in zip(ends, ENDS, Order._fields[1:], strict=False):
            yield Entry(end, axes, part, needed, False, (*here[:-1], attribute), field)


def properties(
    cls: type[Described],
    outer: Meaning = Meaning(),  # noqa: B008
    path: tuple[str, ...] = (),
) -> Iterator[Entry]:
    """Derived properties of a record and of those within it."""
    members = {name: member for base in reversed(cls.__mro__) for name, member in vars(base).items()}
    for name, member in members.items():
        if isinstance(member, Derived):
            meaning = member.meaning
            axes, stored = (*outer.axes, *meaning.axes), meaning.name or outer.prefix + name
            yield Entry(stored, axes, meaning, False, False, (*path, name))
    for field in cls.described:
        if field.is_record:
            yield from properties(field.type, field.meaning, (*path, field.name))


class Swept(Described):
    """Value of a swept parameter that a case has."""

    word: str = fact("the swept parameter")
    value: float = fact("its value")
    owner: str = fact("the case of the spec that is swept", name="swept_case")
    title: str = fact("the title of that case")
    of: tuple[str, ...] = fact("the quantities that are to be shown, if not those that suit the kind", default=())
    second_word: str = fact("another swept parameter", default="")
    second_value: float = fact("its value", default=math.nan)

    @property
    def places(self) -> dict[str, float]:
        """Values by the names of the parameters."""
        return {self.word: self.value} | ({self.second_word: self.second_value} if self.second_word else {})


class Description(Described):
    """System and scheme that were integrated.

    Of a whole sweep, a field that differs from value to value is None, or missing among the parameters.
    """

    case: str
    variant: str  #: the scheme, at one eps if it has one, extrapolated so often: unique within a case
    case_title: str = fact("title of the case")
    scheme: str = fact("name of the scheme in a spec file")
    scheme_label: str = fact("name of the scheme in print, without its eps")
    eps: float | None = fact("scale of the fast processes of the multiscale system")
    estimator: str = fact("estimator, where a study has several", default="")
    seed: int = fact("seed of the random numbers")
    model: str = fact("name of the model in a spec file")
    parameters: dict[str, Any] = fact("parameters of the model", prefix="model_")
    variables: tuple[str, ...] = fact("names of the components in the system, if it gives them any", default=())
    initial: tuple[float, ...] | None = fact("initial state")
    final_time: float | None = fact("final time", "time")
    truncate_noise: bool = fact("whether large increments of the noises are cut off")
    extrapolate: int = fact("levels of Richardson extrapolation of weak errors", default=0)
    areas: str = fact("how Lévy areas were drawn, if they were", default="exact")
    driver: str = fact("what drove the noises in place of Brownian motion", default="")
    initial_law: str | None = fact("law of initial states, where each path has its own", default=None)
    swept: Swept | None = nested(prefix="swept_", default=None)

    @property
    def owner(self) -> str:
        """Name of the case in the spec, which is another one than that of the group if a parameter is swept."""
        return self.swept.owner if self.swept else self.case

    @property
    def label(self) -> str:
        """Name of the scheme in print, with its eps if it has one and with its extrapolation."""
        return self.subject(with_estimator=False)

    def subject(self, function: str = "", with_estimator: bool = True) -> str:
        """Parts of the name with a test function, divided by commas."""
        return ", ".join(self.parts(function, with_estimator))

    def parts(self, function: str = "", with_estimator: bool = True) -> list[str]:
        """Scheme, its eps and extrapolation, the estimator and a test function, as far as it has them."""
        eps = "" if self.eps is None else f"eps = {self.eps:g}"
        parts = self.scheme_label, eps, self.extrapolation, self.estimator * with_estimator, function
        return [part for part in parts if part]

    @property
    def extrapolation(self) -> str:
        """``extrapolated twice``; empty if it is not."""
        times = {0: "", 1: "extrapolated", 2: "extrapolated twice"}
        return times.get(self.extrapolate, f"extrapolated {self.extrapolate} times")

    @classmethod
    def describe(cls, case: Any, row: Any, part: Part) -> Self:
        """Description of `part` of `case`; `row` is its scheme's row of SCHEMES."""
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
            parameters={name: value for name, value in case.parameters.items() if name != "constants" and value != ()},
            variables=tuple(getattr(case, "variables", ())),
            initial=None if random or isinstance(case.initial, LongState) else case.initial,
            final_time=getattr(case, "final_time", None),
            truncate_noise=case.truncate_noise,
            extrapolate=part.extrapolate,
            areas=getattr(case, "areas", "exact"),
            driver=getattr(case, "driver", ""),
            initial_law=case.initial.text if random else None,
            swept=None if sweep is None else _swept(sweep),
        )

    def attributes(self) -> dict[str, Any]:
        """Attributes of a group that store it, but for what is as by default, and for the names in its path."""
        stored: dict[str, Any] = {}
        for entry in layout(type(self)):
            value, field = entry.of(self), entry.field
            if field and field.is_mapping:
                stored |= {entry.meaning.prefix + name: it for name, it in value.items()}
            elif field and value is not None and value is not field.default and value != field.default:
                stored[entry.name] = value
        return stored

    @classmethod
    def of(cls, group: Group) -> Self:
        """Description of a group; KeyError, with the name, if it lacks a needed attribute."""
        fields = _taken(cls, group, Meaning()) | {"estimator": group.estimator}
        return cls(case=group.case, variant=group.variant, **fields)

    @classmethod
    def common(cls, each: Sequence[Self]) -> Self:
        """Description of a whole sweep, of those with each value."""
        first, *others = each
        names = [field.name for field in first.described]
        differing = [name for name in names if any(getattr(other, name) != getattr(first, name) for other in others)]
        alike = dict(item for item in first.parameters.items() if all(item in o.parameters.items() for o in others))
        title = first.swept.title if first.swept else first.case_title
        own = {"case": first.owner, "case_title": title, "swept": None, "parameters": alike}
        return replace(first, **dict.fromkeys(differing) | own)


def _swept(sweep: Any) -> Swept:
    """Record of the key ``sweep`` of a case that has one of its values."""
    (word, value), *others = sweep.places.items()
    second = dict(zip(("second_word", "second_value"), others[0], strict=True)) if others else {}
    return Swept(word=word, value=value, owner=sweep.case, title=sweep.title, of=sweep.of, **second)


class Stored(Described):
    """Results of one part of an experiment, stored as a group of a results file."""

    headline: ClassVar[tuple[str, ...]] = ()  #: the quantities that reports, and figures over a parameter, show first
    measures: ClassVar[str] = ""  #: a sentence that defines them, with LaTeX between dollars
    over_swept: ClassVar[str] = ""  #: the axis over which one record has the values of a swept parameter, if one does
    row_axes: ClassVar[tuple[str, ...]] = ()  #: those of the main table of exports, see ``spi.printing.rows``
    row_columns: ClassVar[tuple[str, ...]] = ()  #: those that are spread over columns there
    row_largest: ClassVar[tuple[str, ...]] = ()  #: those along which the largest value counts there

    tables: ClassVar[Sequence[Any]] = ()  #: those of a case, see ``spi.printing.tables``

    entries: ClassVar[tuple[Entry, ...]]  #: all that a file holds of it, and its derived properties
    by_name: ClassVar[dict[str, Entry]]  #: the same; facts go before arrays of the same name

    about: Description
    wall_seconds: float = fact("wall-clock time of the part", "s", default=0.0)
    threads: int = fact("number of threads", default=1)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.entries = (*layout(cls), *properties(cls))
        cls.by_name = {entry.name: entry for entry in sorted(cls.entries, key=lambda entry: entry.is_fact)}

    def freedom(self, name: str) -> float:
        """Degrees of freedom of the standard error of a field, by its name in files.

        By default one less than the number of jackknife groups that `samples` paths fill, as most standard errors are
        those of the jackknife; infinite of a record without `samples`, which overrides it if its errors come from few.
        """
        samples = getattr(self, "samples", None)
        return math.inf if samples is None else filled_groups(samples) - 1

    def interval(self, name: str = "") -> float:
        """Half the width of a 95 % interval in standard errors, Student's for :meth:`freedom`; NaN of too few paths."""
        return float(student(self.freedom(name)))

    def group(self) -> Group:
        """Group of a results file that stores it."""
        about = self.about
        group = Group(about.case, about.variant, {}, {}, about.attributes(), about.estimator, {})
        for entry in layout(type(self)):
            if (value := entry.of(self)) is None:
                continue
            if entry.is_fact:
                group.attributes[entry.name] = value
                continue
            if entry.meaning.is_axis:
                group.coordinates[entry.name] = np.asarray(value)
            else:
                group.variables[entry.name] = entry.axes, np.asarray(value)
            group.notes[entry.name] = entry.meaning.notes
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
    def facts(cls) -> list[str]:
        """Names of the fields that hold a number, a text or a tuple of them."""
        return [field.name for field in cls.described if not (field.is_array or field.is_order or field.is_record)]

    @classmethod
    def of(cls, group: Group) -> Self:
        """Record in a group; KeyError, with the name, if the group lacks a field that the record needs."""
        return cls(about=Description.of(group), **_taken(cls, group, Meaning()))

    def get(self, name: str) -> Any:
        """A field, or a derived property, by its name in files; None if there is none."""
        return self.by_name[name].of(self) if name in self.by_name else None

    def estimate(self, name: str) -> "Estimate | None":
        """Numbers of a field or derived property with their intervals; None if there are none."""
        if (value := self.get(name)) is None:
            return None
        axes, numbers = self.by_name[name].axes, np.asarray(value)
        low, high, half, stderr = (self.get(f"{name}_{end}") for end in ("low", "high", "half", "stderr"))
        half = self.get(f"{name}_bound") if half is None else half
        if (ends := interval_ends(numbers, low, high, half, stderr, self.interval(name))) is None:
            return Estimate(axes, numbers, numbers, numbers)
        certain = np.isinf(numbers)  # as that paths diverged
        return Estimate(axes, numbers, *(np.where(certain, numbers, end) for end in ends))

    def exported(self) -> Variables:
        """All that is in a table of exports: arrays and properties with a column, each with its 95 % interval.

        That of ``x`` goes from ``x_low`` to ``x_high``, which follow where the record has no fields of these names.  A
        record that adds to them adds the values along an axis as an array over itself.
        """
        there = ((entry, entry.of(self)) for entry in self.entries if entry.is_exported)
        own: Variables = {entry.name: (entry.axes, np.asarray(value)) for entry, value in there if value is not None}
        found: Variables = {}
        for name, column in own.items():
            found[name] = column
            numbers = self.estimate(name)
            if numbers is not None and not numbers.exact:
                ends = {f"{name}_low": (numbers.axes, numbers.low), f"{name}_high": (numbers.axes, numbers.high)}
                found |= {end: column for end, column in ends.items() if end not in own}
        return found

    @property
    def axes(self) -> dict[str, Array | tuple[str, ...]]:
        """Values along the axes that have any, by name."""
        values = {entry.name: entry.of(self) for entry in self.entries if entry.meaning.is_axis}
        return {name: value for name, value in values.items() if value is not None}

    def beside(self, readings: Any) -> Variables:
        """Further columns of the main table, which follow from several records of a file."""
        return {}

    def along(self, name: str, numbers: "Estimate", default: Any) -> Array:
        """A field or derived property over the axes of `numbers`, the last along others; `default` if there is none."""
        shape = numbers.value.shape
        if (value := self.get(name)) is None:
            return np.full(shape, default)
        own, values = self.by_name[name].axes, np.asarray(value)
        for axis in [axis for axis in own if axis not in numbers.axes]:
            values, own = last(values, own.index(axis)), tuple(other for other in own if other != axis)
        sizes = [values.shape[own.index(axis)] if axis in own else 1 for axis in numbers.axes]
        return np.broadcast_to(values.reshape(sizes), shape)

    @classmethod
    def over_values(cls, each: Any) -> Self:
        """One record of those for each value of the parameter, of a class that is :attr:`over_swept`."""
        raise NotImplementedError

    @classmethod
    def quantities_of_case(cls, readings: Any) -> Iterator[Any]:
        """Quantities (``spi.statistics.claims.Quantity``) that follow from several records of a case."""
        yield from ()

    @classmethod
    def answers(cls, readings: Any) -> Iterator[str]:
        """Sentences that answer the question of a case; without any those on the headline do."""
        yield from ()

    def titled(self, title: str, readings: Any) -> str:
        """Title of all records, of which the experiment states `title`."""
        return title

    def remarks(self) -> Iterator[str]:
        """Lines under the tables, behind those on what records have in common."""
        yield from ()

    @classmethod
    def remarks_of_case(cls, readings: Any) -> Iterator[str]:
        """Lines on all records of a case."""
        yield from ()


def interval_ends(
    values: Array, low: Array | None, high: Array | None, half: Array | None, stderr: Array | None, factor: float
) -> tuple[Array, Array] | None:
    """Ends of 95 % intervals: those given, else by half the widths, else `factor` standard errors; None without."""
    if low is not None and high is not None:
        return low, high
    with np.errstate(invalid="ignore", over="ignore"):
        if half is None and stderr is not None:
            half = np.where(np.asarray(stderr) == 0, 0.0, factor * np.asarray(stderr))
        return None if half is None else (values - half, values + half)


R = TypeVar("R", bound=Stored)


def by_case(readings: Iterable[R]) -> list[list[R]]:
    """Records of each case, in the order of the file."""
    cases: dict[str, list[R]] = {}
    for reading in readings:
        cases.setdefault(reading.about.case, []).append(reading)
    return list(cases.values())


def gathered(records: Iterable[Stored]) -> list[Stored]:
    """Records with one for all values of a swept parameter in place of each, where these are an axis of theirs."""
    by_part: dict[tuple[str, str, str], list[Stored]] = {}
    for one in records:
        case = one.about.owner if one.over_swept else one.about.case
        by_part.setdefault((case, one.about.variant, one.about.estimator), []).append(one)
    return [type(each[0]).over_values(each) if each[0].over_swept else each[0] for each in by_part.values()]


def stored_names(field: Field, prefix: str = "") -> tuple[str, ...]:
    """Names under which a field is stored; of an order those of its four arrays."""
    name = field.meaning.name or prefix + field.name
    if not field.is_order:
        return (name,)
    return name, f"{name}_low", f"{name}_high", "points_in_fit" if name == "order" else f"{name}_points"


def _taken(cls: type[Described], group: Group, outer: Meaning) -> dict[str, Any]:
    """Fields of a record from a group, by name."""
    return {field.name: _value(field, group, outer) for field in cls.described}


def _value(field: Field, group: Group, outer: Meaning) -> Any:
    """Value of a field in a group; KeyError if it is missing and needed."""
    if field.is_record:
        there = _is_there(field, group)
        return field.type(**_taken(field.type, group, field.meaning)) if there or not field.optional else None
    return _entries(group, field.meaning.prefix) if field.is_mapping else _stored(field, group, outer)


def _entries(group: Group, prefix: str) -> dict[str, Any]:
    """Attributes whose names begin alike, in whose tuples None, a noise that is off, is stored as NaN."""

    def read(value: Any) -> Any:
        return tuple(None if x != x else x for x in value) if isinstance(value, tuple) else value

    return {name.removeprefix(prefix): read(it) for name, it in group.attributes.items() if name.startswith(prefix)}


def _stored(field: Field, group: Group, outer: Meaning) -> Any:
    """Value of a field that is no record of its own."""
    names = stored_names(field, outer.prefix)
    held: Any = group.arrays | group.coordinates if field.is_array or field.is_order else group.attributes
    if names[0] not in held and (field.optional or field.default is not MISSING):
        return None if field.default is MISSING else field.default
    if field.is_order:
        columns = [held[name].tolist() for name in names]
        return Order(*columns) if field.type is Order else tuple(Order(*each) for each in zip(*columns, strict=True))
    value = held[names[0]]
    return tuple(value.tolist()) if field.is_array and field.type is not Array else value


def _is_there(field: Field, group: Group) -> bool:
    """Whether a group holds a nested record: whether it has the first of the fields that this cannot lack."""
    needed = next(inner for inner in field.type.described if not inner.optional and inner.default is MISSING)
    if needed.is_record:
        return _is_there(needed, group)
    return stored_names(needed, field.meaning.prefix)[0] in {**group.coordinates, **group.variables, **group.attributes}


# ---------------------------------------------------------------------------------------------------------------------
# Numbers with their intervals
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
        """Numbers without their signs."""
        negative = self.value < 0
        low, high = np.where(negative, -self.high, self.low), np.where(negative, -self.low, self.high)
        value = np.abs(self.value)
        return Estimate(self.axes, value, *((value, value) if self.exact else (low, high)))

    def map(self, function: Callable[[Array], Array]) -> "Estimate":
        """Numbers and the ends after a function."""
        value = function(self.value)
        return self._replace(
            value=value,
            low=value if self.exact else function(self.low),
            high=value if self.exact else function(self.high),
        )

    def without(self, axis: str, function: Callable[..., Array]) -> "Estimate":
        """With one number in place of those along an axis, such as the largest: ``function(values, axis=...)``."""
        at = self.axes.index(axis)
        rest = self._replace(axes=(*self.axes[:at], *self.axes[at + 1 :]))
        return rest.map(lambda values: function(values, axis=at))


def last(values: Array, axis: int) -> Array:
    """The last numbers along an axis."""
    return np.take(values, -1, axis)
