"""Questions about values and about Numba types of values alike: so one function serves Python and the compiler."""

import numpy as np
from numba import types


class InMemory(types.Type):
    """Numba type of a record that lies in memory, see ``pointers.py``: what is asked of a record is asked of it."""

    def __init__(self, record):
        self.record = record
        self.instance_class, self.fields, self.types = record.instance_class, record.fields, record.types
        super().__init__(f"InMemory({record.name})")

    @property
    def key(self):
        return self.record

    def part(self, name):
        """Type of a field: of a record within it that of a record in memory."""
        inner = self.types[self.fields.index(name)]
        return InMemory(inner) if record_class(inner) else inner


def record_class(numba_type):
    """``NamedTuple`` class behind a Numba type, or None if it is not a record."""
    if isinstance(numba_type, types.NamedTuple | types.NamedUniTuple | InMemory):
        return numba_type.instance_class
    return None


def class_of(record):
    """Class of a record, given the record, its class, or the Numba type of one."""
    if isinstance(record, types.Type):
        return record_class(record)
    return record if isinstance(record, type) else type(record)


def field(record, name):
    """Field `name` of a record, or the Numba type of the field of a Numba type of records."""
    if isinstance(record, types.Type):
        return record.types[record.fields.index(name)]
    return getattr(record, name)


def is_array(value):
    """Whether a value, or one of a Numba type, is an array."""
    return isinstance(value, np.ndarray | types.Array)


def is_integer(value):
    """Whether a value, or one of a Numba type, is an integer."""
    return isinstance(value, int | np.integer | types.Integer)


def is_none(value):
    """Whether a value, or one of a Numba type, is None."""
    return value is None or isinstance(value, types.NoneType)


def is_some(value):
    """Whether a value, or one of a Numba type, is not None."""
    return not is_none(value)


def record_classes(numba_type):
    """Classes of all records in a type of Numba: its own, and those of the elements of a tuple, list or array."""
    classes = {numba_type.instance_class} if isinstance(numba_type, types.BaseNamedTuple) else set()
    if isinstance(numba_type, types.BaseTuple):
        inner = numba_type.types
    else:  # a container's or an optional value's
        inner = [getattr(numba_type, name, None) for name in ("dtype", "type")]
    return classes.union(*(record_classes(part) for part in inner if isinstance(part, types.Type)))


def is_tuple_of_floats(numba_type, length):
    """Whether a type of Numba is that of a tuple of `length` floats."""
    return isinstance(numba_type, types.BaseTuple) and tuple(numba_type.types) == (types.float64,) * length


def is_float(numba_type):
    """Whether a type of Numba is that of a float."""
    return numba_type == types.float64
