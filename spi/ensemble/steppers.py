"""Which of two schemes makes a step: the scheme of a study, or the one that makes its reference, if there is one."""

from numba import types
from numba.extending import overload

from ..compiler.dispatch import INDICES, INLINED
from .areas import Areas, NoAreas
from .increments import Coins, Kept, NoCoins
from .protocol import advance, advance_large, area_pairs, large, memory_size, needs_areas, substeps, tosses, work_size


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


def _tosses(scheme, model):
    return tosses(scheme) or _keeps_areas(scheme, model)


def _keeps_areas(scheme, model):
    return needs_areas(scheme) and bool(area_pairs(model))


def kept_of_steps(reference_scheme, scheme, model):
    """What either scheme must know of a step besides its increments: :class:`~spi.ensemble.increments.Kept`."""
    return _kept([s for s in (reference_scheme, scheme) if s is not None], model)


@overload(kept_of_steps, jit_options=INLINED)
def _(reference_scheme, scheme, model):
    kept = _kept([s for s in (reference_scheme, scheme) if s != types.none], model)
    return lambda reference_scheme, scheme, model: kept


def _kept(schemes, model):
    areas = any(_keeps_areas(s, model) for s in schemes)
    coins = any(_tosses(s, model) for s in schemes)
    finest = INDICES[max(substeps(s) for s in schemes)]()
    return Kept(finest, Areas() if areas else NoAreas(), Coins() if coins else NoCoins())


def advance_path(reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report):
    """One step of the scheme, or by the reference scheme if there is one."""
    stepper = reference_scheme if by_reference and reference_scheme is not None else scheme
    _advance(stepper, model, paths, h, dW, coins, y, work, report)


def _advance(scheme, model, paths, h, dW, coins, y, work, report):
    """One step of at least the first `paths` paths of a block."""
    if large(model):
        advance_large(scheme, model, paths, h, dW, coins, y, work, report)
    else:
        advance(scheme, model, h, dW, coins, y, work, report)


@overload(_advance, jit_options=INLINED)
def _(scheme, model, paths, h, dW, coins, y, work, report):
    if large(model):
        return lambda scheme, model, paths, h, dW, coins, y, work, report: advance_large(
            scheme, model, paths, h, dW, coins, y, work, report
        )
    return lambda scheme, model, paths, h, dW, coins, y, work, report: advance(
        scheme, model, h, dW, coins, y, work, report
    )


@overload(advance_path, jit_options=INLINED)
def _(reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report):
    if reference_scheme == types.none:
        return lambda reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report: _advance(
            scheme, model, paths, h, dW, coins, y, work, report
        )

    def either(reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report):
        if by_reference:
            _advance(reference_scheme, model, paths, h, dW, coins, y, work, report)
        else:
            _advance(scheme, model, paths, h, dW, coins, y, work, report)

    return either
