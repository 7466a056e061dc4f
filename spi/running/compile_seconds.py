"""How long a kernel takes to compile, from its size: processor seconds of a quiet core, within a factor of 2.

The rule is a sum with few coefficients, fitted to what `tests/running/test_compile_seconds.py` records.  A flow of a
composition is one sweep over the lanes; other schemes write out the field of the whole step in all components.
"""

from typing import NamedTuple

from ..ensemble.protocol import dimension, large, noise_indices, pieces
from ..ensemble.scheme_protocol import judges
from ..ensemble.table_flows import drift_tables
from ..schemes.sweeps import sweeps

STARTING = 2.0  #: of the first kernel of a process, which loads the compiler
_LOOP = 1.8  # the loop over time, with increments and sums
_SWEEP, _COMPONENT = 0.25, 0.03  # a sweep, and each of its components
_SQUARE = 0.01  # of the field of a step, for the square of the number of components
_OTHER = 0.4  # a kernel that takes no steps
_ROW = 12  # components at most of what is compiled for a sweep with tables


class Size(NamedTuple):
    """Of the code of a step."""

    sweeps: int  #: flows of a composition
    components: int  #: of a sweep
    entries: int = 0  #: of the derivative of a field


def seconds_of(kernel, arguments):
    """Processor seconds for a kernel, given the arguments of a call, which for steps begin with scheme and model."""
    return steps_seconds(size_of(*arguments[:2])) if kernel.__name__ == "integrate" else _OTHER


def steps_seconds(size):
    """Processor seconds for the kernel of a step of this size."""
    return _LOOP + size.sweeps * (_SWEEP + _COMPONENT * size.components) + _SQUARE * size.entries


def size_of(scheme, model):
    """The :class:`Size` of a step."""
    if large(model):  # loops over arrays, whose sizes are no part of the code
        return Size(0, 0)
    stages = getattr(scheme, "stages", None)
    if stages is None and not judges(scheme):
        return Size(0, 0, dimension(model) ** 2)
    count = len(noise_indices(model)) + 2 * pieces(model) - 1 if stages is None else len(sweeps(stages, model))
    return Size(count, min(dimension(model), _ROW) if drift_tables(model) else dimension(model))
