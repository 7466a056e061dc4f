"""How long a kernel takes to compile, from its size: processor seconds of a quiet core, within a factor of 2.

The rule is a sum with few coefficients, fitted to what `tests/running/test_compile_seconds.py` records.  A flow of a
composition is one sweep over the lanes; other schemes write out the field of the whole step in all components.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from ..ensemble.protocol import dimension, large, noise_indices, pieces
from ..ensemble.scheme_protocol import judges
from ..ensemble.table_flows import drift_tables
from ..schemes.isospectral import IsospectralMidpoint
from ..schemes.midpoint import Midpoint
from ..schemes.sweeps import sweeps

STARTING = 2.0  #: of the first kernel of a process, which loads the compiler
_LOOP = 1.9  # the loop over time, with increments and sums
_SWEEP, _COMPONENT = 0.35, 0.03  # a sweep, and each of its components
_SQUARE = 0.01  # of the field of a step, for the square of the number of components
_NEWTON = 3  # times as much for schemes that solve equations
_STAGE = 7.0  # of a composition for an array-state model, whose flows are loops over arrays
_OTHER = 0.4  # a kernel that takes no steps
_JUDGED = 3  # stages that a scheme with flows that are judged counts for
_ROW = 4  # components that a sweep with tables counts for, however many rows it has


class Size(NamedTuple):
    """Of the code of a step."""

    sweeps: int  #: flows of a composition
    components: int  #: of a sweep
    entries: int = 0  #: of the derivative of a field, thrice where it is solved for
    stages: int = 0  #: of a composition for an array-state model


def seconds_of(kernel: Callable, arguments: tuple) -> float:
    """Processor seconds for a kernel, given the arguments of a call, which for steps begin with scheme and model."""
    return steps_seconds(size_of(*arguments[:2])) if kernel.__name__ == "integrate" else _OTHER


def steps_seconds(size: Size) -> float:
    """Processor seconds for the kernel of a step of this size."""
    flows = size.sweeps * (_SWEEP + _COMPONENT * size.components) + _STAGE * size.stages
    return _LOOP + flows + _SQUARE * size.entries


def size_of(scheme: Any, model: Any) -> Size:
    """The :class:`Size` of a step."""
    stages = getattr(scheme, "stages", None)
    if large(model):
        return Size(0, 0, stages=_JUDGED if stages is None else len(stages))
    if stages is None and not judges(scheme):
        times = _NEWTON if isinstance(scheme, (Midpoint, IsospectralMidpoint)) else 1
        return Size(0, 0, times * dimension(model) ** 2)
    count = len(noise_indices(model)) + 2 * pieces(model) - 1 if stages is None else len(sweeps(stages, model))
    return Size(count, min(dimension(model), _ROW) if drift_tables(model) else dimension(model))
