"""One description of a result: a class whose annotated fields are the contents of a group of a results file.

    class Energies(Stored):
        \"\"\"Mean energies of one scheme.\"\"\"

        h: Annotated[Array, axis("step size")]
        energy: Annotated[Array, array("h", "mean of H(y(T))")]
        order: Order
        samples: Annotated[int, fact("number of paths", column=True)]

A study makes such a record; ``record.group()`` is the group that stores it and ``Energies.of(group)`` the record again.
Long names, formulas and units go into the file with the arrays, and from there to xarray; the columns of tables
(``spi.printing.rows``) and the page docs/reference/results.md come from the same fields.

A field that is None is not stored.  Axes that no field describes, as "casimir", are numbered from 0.  A field that is a
:class:`Described` itself is stored field by field, under its prefix; an order, or a tuple of orders, as the arrays
``order``, ``order_low``, ``order_high`` and ``points_in_fit``.
"""

from collections.abc import Iterable, Iterator
from dataclasses import MISSING, dataclass
from dataclasses import fields as dataclass_fields
from types import UnionType
from typing import (
    Annotated,
    Any,
    ClassVar,
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

from .records import Description, Group, Order, check_array, check_axis, check_fact

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


class Meaning(NamedTuple):
    """The description of a field: its long name, unit, formula and axes, and how it is stored."""

    text: str = ""
    unit: str = ""
    formula: str = ""
    axes: tuple[str, ...] = ()
    name: str = ""  #: under which it is stored, if not under that of the field
    column: str = ""  #: its name in JSON and CSV; of each place along further axes where it has a {}; "" if it is none
    is_axis: bool = False
    prefix: str = ""  #: of the names of the fields of a nested record

    @property
    def notes(self) -> dict[str, str]:
        """The attributes of an array in a file."""
        texts = {"long_name": self.text, "formula": self.formula, "units": self.unit}
        return {name: text for name, text in texts.items() if text}


def axis(text: str, unit: str = "", name: str = "") -> Meaning:
    """The values along an axis, numbers or texts."""
    return Meaning(text, unit, name=name, is_axis=True)


def array(axes: str, text: str, unit: str = "", formula: str = "", name: str = "", column: str = "") -> Meaning:
    """An array over `axes`, names divided by blanks; of an order or a nested record, the axes of all arrays in it."""
    return Meaning(text, unit, formula, tuple(axes.split()), name, column)


def fact(text: str, unit: str = "", name: str = "", column: bool = False) -> Meaning:
    """A number, a text or a tuple of them that describes the whole; `column` says whether rows of numbers have it."""
    return Meaning(text, unit, name=name, column="yes" * column)


def nested(axes: str = "", prefix: str = "") -> Meaning:
    """A record within a record: the first axes of all its arrays, and the prefix of its names in a file."""
    return Meaning(axes=tuple(axes.split()), prefix=prefix)


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

    described: ClassVar[tuple[Field, ...]]  #: its fields but `about`

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True, eq=False)(cls)
        hints = get_type_hints(cls, include_extras=True)
        own: Any = cls  # mypy does not see that it is a dataclass by now
        cls.described = tuple(
            _field(hints[field.name], field) for field in dataclass_fields(own) if field.name != "about"
        )


class Stored(Described):
    """The results of one part of an experiment, stored as a group of a results file."""

    headline: ClassVar[tuple[str, ...]] = ()  #: the quantities that reports, and figures over a parameter, show first

    about: Description
    wall_seconds: Annotated[float, fact("wall-clock time of the part", "s")] = 0.0
    threads: Annotated[int, fact("number of threads")] = 1

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
    def facts(cls) -> list[str]:
        """The names of the fields that hold a number, a text or a tuple of them."""
        return [field.name for field in cls.described if not (field.is_array or field.is_order or field.is_record)]

    @classmethod
    def of(cls, group: Group) -> Self:
        """The record in a group; KeyError, with the name, if the group lacks a field that the record needs."""
        return cls(about=Description.of(group), **_taken(cls, group, Meaning()))


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
        if value is None:
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
