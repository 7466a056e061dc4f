"""Which of two schemes makes a step: the scheme of a study, or the one that makes its reference, if there is one."""

from numba import types
from numba.extending import overload

from .dispatch import INDICES, INLINED
from .protocol import advance, memory_size, substeps, tosses, work_size


def largest_sizes(reference_scheme, scheme, model):
    """Scratch and memory for either scheme."""
    used = [s for s in (reference_scheme, scheme) if s is not None]
    return max(work_size(s, model) for s in used), max(memory_size(s, model) for s in used)


@overload(largest_sizes, jit_options=INLINED)
def _(reference_scheme, scheme, model):
    if reference_scheme == types.none:
        return lambda reference_scheme, scheme, model: (work_size(scheme, model), memory_size(scheme, model))
    return lambda reference_scheme, scheme, model: (
        max(work_size(reference_scheme, model), work_size(scheme, model)),
        max(memory_size(reference_scheme, model), memory_size(scheme, model)),
    )


def tosses_any(reference_scheme, scheme):
    """Whether either scheme needs coins."""
    return any(tosses(s) for s in (reference_scheme, scheme) if s is not None)


@overload(tosses_any, jit_options=INLINED)
def _(reference_scheme, scheme):
    either = tosses(scheme) or (reference_scheme != types.none and tosses(reference_scheme))
    return lambda reference_scheme, scheme: either


def most_substeps(reference_scheme, scheme):
    """Into how many sub-steps the increments of a step must be resolved for either scheme, as one of INDICES."""
    return INDICES[max(substeps(s) for s in (reference_scheme, scheme) if s is not None)]()


@overload(most_substeps, jit_options=INLINED)
def _(reference_scheme, scheme):
    most = INDICES[max(substeps(s) for s in (reference_scheme, scheme) if s != types.none)]()
    return lambda reference_scheme, scheme: most


def advance_path(reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report):
    """One step of the scheme, or by the reference scheme if there is one."""
    stepper = reference_scheme if by_reference and reference_scheme is not None else scheme
    advance(stepper, model, h, dW, coins, y, work, report)


@overload(advance_path, jit_options=INLINED)
def _(reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report):
    if reference_scheme == types.none:
        return lambda reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report: advance(
            scheme, model, h, dW, coins, y, work, report
        )

    def either(reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report):
        if by_reference:
            advance(reference_scheme, model, h, dW, coins, y, work, report)
        else:
            advance(scheme, model, h, dW, coins, y, work, report)

    return either
