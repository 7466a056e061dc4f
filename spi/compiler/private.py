"""The private parts of Numba that this room uses, and how to do without them.

Only files of this room import names that Numba may change (``numba.core``); ``tests/compiler/test_private.py`` states
for each name what would break without it.  The environment variable SPI_WITHOUT names parts, with commas between
them, that are then neither used nor imported, at the same results:

* ``libraries`` (``libraries.py``): every function that is inlined becomes machine code as well, and compiling takes
  about three times as long;
* ``cache`` (``caching.py``): kernels are compiled anew in every process;
* ``refcounts`` (``vectors.without_refcount``): steps of models whose states are arrays take longer.
"""

import os

PARTS = ("libraries", "cache", "refcounts")
VARIABLE = "SPI_WITHOUT"


def left_out():
    """The parts that SPI_WITHOUT names; the program ends with one line if one of them is unknown."""
    parts = tuple(filter(None, os.environ.get(VARIABLE, "").split(",")))
    if unknown := [part for part in parts if part not in PARTS]:
        raise SystemExit(f"spi: {VARIABLE} names {unknown[0]!r}, which is none of {', '.join(PARTS)}")
    return parts


def uses(part):
    """Whether a part is used."""
    return part not in left_out()
