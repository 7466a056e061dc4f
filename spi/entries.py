"""Values of a spec file that know where they stand, and how they are read as the annotations of a record ask.

An annotation is ``float``, ``int``, ``bool``, ``str``, a ``Literal``, a tuple of fixed or any length, or one of these
or None; ``Annotated`` adds limits (Gt, Ge, Le, MinLen), RANGE, and a text that describes the field.
"""

import difflib
import math
import operator
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, MinLen

from .numbers import NumberError, parse

#: Beside a tuple of numbers: a range such as ``2^-5 .. 2^-13`` may stand for all powers of two between.
RANGE = object()

#: limit -> (its attribute, how it compares, in words, in JSON Schema)
LIMITS = {
    Gt: ("gt", operator.gt, "greater than", "exclusiveMinimum"),
    Ge: ("ge", operator.ge, "at least", "minimum"),
    Le: ("le", operator.le, "at most", "maximum"),
}
_NUMBER = "a number or arithmetic such as 2/3, 2^-16 or cos(1.1)"


class SpecError(ValueError):
    """An invalid spec: one line ``path:line: key: what is wrong; what would be right``."""

    def __init__(self, message):
        super().__init__("".join(c if c.isprintable() else " " for c in message))


class Entry(NamedTuple):
    """A value of a spec: a dict or list of entries, a text (numbers too), True, False or None."""

    value: Any
    place: str  #: "path:line:" or "path: --set"
    key: str  #: with dots; empty for the whole file
    item: str = ""  #: "entry 2 " within a list

    def inner(self, name):
        """The key of a value within this mapping."""
        return f"{self.key}.{name}" if self.key else name

    def shown(self):
        """The value in a message."""
        if isinstance(self.value, str):
            return f"'{self.value}'" if len(self.value) <= 60 else f"'{self.value[:57]}...'"
        if isinstance(self.value, dict | list):
            return ("a " if self.value else "an empty ") + ("mapping" if isinstance(self.value, dict) else "list")
        return {None: "empty", True: "true", False: "false"}[self.value]


def fail(entry, what, right):
    """Raise the SpecError that belongs to an entry."""
    head = f"{entry.place} {entry.key}:" if entry.key else entry.place
    raise SpecError(f"{head} {entry.item}{what}; {right}")


def fail_missing(owner, name, doc):
    """Raise the SpecError that says that the mapping `owner` has no key `name`."""
    fail(Entry(None, owner.place, owner.inner(name)), f"missing key '{name}'", f"add {name}: {doc}")


def suggestion(word, known):
    """What to write instead of an unknown word."""
    near = difflib.get_close_matches(word, known, 1)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"


def mapping(entry, known=None, what="key"):
    """The dict of a mapping entry, all of whose keys are in `known`."""
    if not isinstance(entry.value, dict):
        fail(entry, f"is {entry.shown()}", "must be a mapping, lines of key: value")
    for name, child in entry.value.items():
        if known is not None and name not in known:
            fail(child, f"is no known {what}", suggestion(name, known))
    return entry.value


def read_fields(record, names, entries, owner):
    """name -> value for the fields `names` of a record that have an entry or else no default."""
    hints, values = get_type_hints(record, include_extras=True), {}
    for name in names:
        if name in entries:
            values[name] = read(hints[name], entries[name])
        elif name not in record._field_defaults:
            fail_missing(owner, name, doc(hints[name]))
    return values


def read(hint, entry):
    """The value of an entry as an annotation asks; SpecError if it does not fit."""
    kind, notes = split(hint)
    if RANGE in notes and isinstance(entry.value, str) and ".." in entry.value:
        entry = entry._replace(value=_powers_of_two(entry))
    value = _value(kind, entry)
    for note in notes:
        if isinstance(note, MinLen) and len(value) < note.min_length:
            item = get_args(kind)[0]
            one = "one of " + ", ".join(get_args(item)) if get_origin(item) is Literal else "one number"
            fail(entry, "is empty", f"must hold at least {one}")
        if type(note) in LIMITS:
            name, holds, words, _ = LIMITS[type(note)]
            if not holds(value, getattr(note, name)):
                fail(entry, f"is {entry.value}", f"must be {words} {getattr(note, name)}")
    return value


def doc(hint):
    """The description in an annotation."""
    return next((note for note in split(hint)[1] if isinstance(note, str)), "")


def split(hint):
    """The type in an annotation and what is annotated to it."""
    return (hint.__origin__, hint.__metadata__) if get_origin(hint) is Annotated else (hint, ())


def _value(kind, entry):
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        inner = next(a for a in arguments if a is not NoneType)
        return None if entry.value is None else read(inner, entry)
    if origin is tuple:
        return _tuple(arguments, entry)
    if origin is Literal:
        if entry.value not in arguments or not isinstance(entry.value, str):
            word = entry.value if isinstance(entry.value, str) else ""
            fail(entry, f"is {entry.shown()}", suggestion(word, arguments))
        return entry.value
    if kind is str:
        if not isinstance(entry.value, str):
            fail(entry, f"is {entry.shown()}", "must be text")
        return entry.value
    if kind is bool:
        if not isinstance(entry.value, bool):
            fail(entry, f"is {entry.shown()}", "must be true or false")
        return entry.value
    return _whole(entry) if kind is int else _real(entry)


def _tuple(arguments, entry):
    many = arguments[-1] is Ellipsis
    if not isinstance(entry.value, list):
        fail(entry, f"is {entry.shown()}", "must be a list in square brackets")
    count = len(entry.value)
    if not many and count != len(arguments):
        fail(entry, f"has {entries_in(count)}", f"must have {len(arguments)}")
    kinds = [arguments[0]] * count if many else arguments
    return tuple(read(kind, item) for kind, item in zip(kinds, entry.value, strict=True))


def entries_in(count):
    """'3 entries'."""
    return "1 entry" if count == 1 else f"{count} entries"


def _number(entry, right):
    if not isinstance(entry.value, str):
        fail(entry, f"is {entry.shown()}", f"must be {right}")
    try:
        value = parse(entry.value)
    except NumberError as error:
        fail(entry, f"is {entry.shown()} ({error})", f"must be {right}")
    if isinstance(value, complex):
        fail(entry, f"is {entry.shown()}, which is complex", f"must be {right}")
    return value


def _real(entry):
    return float(_number(entry, _NUMBER))


def _whole(entry):
    value = _number(entry, "a whole number such as 500 or 10^6")
    if value != int(value):
        fail(entry, f"is {entry.shown()}", "must be a whole number such as 500 or 10^6")
    return int(value)


def _powers_of_two(entry):
    """The entries that a range such as 2^-5 .. 2^-13 stands for."""
    ends = [_real(entry._replace(value=end)) for end in entry.value.split("..")]
    if len(ends) != 2 or any(math.frexp(end)[0] != 0.5 for end in ends):
        fail(entry, f"is {entry.shown()}", "a range must have powers of two at both ends, such as 2^-5 .. 2^-13")
    first, last = (math.frexp(end)[1] - 1 for end in ends)
    sign = 1 if last >= first else -1
    return [entry._replace(value=repr(2.0**k)) for k in range(first, last + sign, sign)]


# ---------------------------------------------------------------------------------------------------------------------
# JSON Schema
# ---------------------------------------------------------------------------------------------------------------------


def schema(hint):
    """The JSON Schema of what :func:`read` accepts; arithmetic and ranges are plain strings there."""
    kind, notes = split(hint)
    result = _bare_schema(kind, notes)
    for note in notes:
        if isinstance(note, MinLen):
            result["minItems"] = note.min_length
    if RANGE in notes:
        result = {"anyOf": [result, {"type": "string"}]}
    return {**result, "description": doc(hint)} if doc(hint) else result


def schema_of_fields(record, names):
    """name -> schema, with defaults, for the fields `names` of a record."""
    hints = get_type_hints(record, include_extras=True)
    schemas = {name: schema(hints[name]) for name in names}
    for name, default in record._field_defaults.items():
        schemas[name]["default"] = list(default) if isinstance(default, tuple) else default
    return schemas


def _bare_schema(kind, notes):
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return {"anyOf": [schema(a) if a is not NoneType else {"type": "null"} for a in arguments]}
    if origin is tuple:
        many = arguments[-1] is Ellipsis
        items = schema(arguments[0])
        length = {} if many else {"minItems": len(arguments), "maxItems": len(arguments)}
        return {"type": "array", "items": items, **length}
    if origin is Literal:
        return {"enum": list(arguments)}
    if kind in (str, bool):
        return {"type": "string" if kind is str else "boolean"}
    limits = {LIMITS[type(n)][3]: getattr(n, LIMITS[type(n)][0]) for n in notes if type(n) in LIMITS}
    return {"anyOf": [{"type": "integer" if kind is int else "number", **limits}, {"type": "string"}]}
