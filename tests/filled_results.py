"""Results of any kind in which every field holds something, made from what the record says of its fields."""

import numpy as np
from made_up import group_of

from spi.kinds import KINDS
from spi.storage import Order
from spi.storage.stored import Meaning, stored_names

#: What the fields of a type hold that are no arrays.
FACTS = {int: 3, float: 0.5, bool: True, str: "a text", tuple[float, ...]: (0.5, 1.0), tuple[int, ...]: (1, 2)}
SIZE = 4  # of every axis but those of texts
TEXTS = ("a", "b")  # which are the names of what such an axis has
WORDS = {"measure": "strong", "reference_formulas": ("y1", "2*y1")}  # texts of which not all are possible


def sizes_of(cls, outer=Meaning()):  # noqa: B008
    """axis -> how many values it has, of those that the fields of a record name."""
    found = {}
    for field in cls.described:
        if field.is_record:
            found |= sizes_of(field.type, field.meaning)
        elif field.meaning.is_axis:
            found[stored_names(field, outer.prefix)[0]] = SIZE if field.type is np.ndarray else len(TEXTS)
    return found


def fields_of(cls, sizes, panels, outer=Meaning()):  # noqa: B008
    """Something for each field of a record."""
    found, rise = {}, iter(range(1, 1000))
    for field in cls.described:
        axes = (*outer.axes, *field.meaning.axes)
        shape = tuple(sizes.get(axis, SIZE) for axis in axes)
        if field.is_record:
            value = field.type(**fields_of(field.type, sizes, panels, field.meaning))
        elif field.name == "panels":
            value = panels
        elif field.is_order:
            value = Order(1.0, 0.9, 1.1, 5)
            value = value if field.type is Order else (value,) * shape[0]
        elif field.meaning.is_axis:
            value = np.arange(1.0, SIZE + 1) if field.type is np.ndarray else TEXTS
        elif field.name == "resolved":
            value = np.ones(shape, bool)
        elif field.name == "rounding":
            value = np.full(shape, np.inf)  # a panel shows nothing of what is constant
        elif field.name == "nonfinite":
            value = np.zeros(shape, int) if field.type is np.ndarray else 0
        elif field.type is np.ndarray:
            value = next(rise) * (1.0 + np.arange(np.prod(shape, dtype=int)).reshape(shape))
        else:
            value = WORDS.get(field.name, FACTS.get(field.type, TEXTS))
        found[field.name] = value
    return found


#: Panels for which the filled records lack something: several eps, prefixes of paths, a third component, a fluid.
SPECIAL = {
    "trajectory": ("spins", "sphere", "vorticity", "spectrum", "enstrophy"),
    "weak": ("seconds", "eps"),
    "statistics": ("variance",),
    "equilibrium": ("histogram",),
}


def panels_of(kind):
    """The names of the panels of a kind that show something of filled records, () of one that has no choice."""
    names = getattr(KINDS[kind].results, "PANELS", getattr(KINDS[kind].keys, "PANELS", ()))
    return tuple(name for name in names if name not in SPECIAL.get(kind, ()))


def filled(kind, scheme="splitting", **others):
    """A group of a kind, with what differs from that."""
    record = KINDS[kind].results.Record
    fields = fields_of(record, sizes_of(record), panels_of(kind) or TEXTS)
    fields = {name: value for name, value in fields.items() if name not in ("wall_seconds", "threads")}
    return group_of(record, "main", scheme, {"scheme_label": scheme}, **(fields | others))
