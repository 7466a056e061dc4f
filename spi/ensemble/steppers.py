"""One step by the scheme of a study, or by the scheme that makes its reference, if there is one."""

from ..compiler.dispatch import INDICES, device
from ..compiler.records import is_none
from .areas import Areas, NoAreas
from .increments import Coins, Kept, NoCoins, Uniforms
from .protocol import area_pairs, large
from .scheme_protocol import advance, advance_large, judges, memory_size, needs_areas, substeps, tosses, work_size


@device(by_type=True)
def largest_sizes(reference_scheme, scheme, model):
    """Scratch and memory for either scheme."""
    if is_none(reference_scheme):
        return lambda reference_scheme, scheme, model: (work_size(scheme, model), memory_size(scheme, model))
    return lambda reference_scheme, scheme, model: (
        max(work_size(reference_scheme, model), work_size(scheme, model)),
        max(memory_size(reference_scheme, model), memory_size(scheme, model)),
    )


def _keeps_areas(scheme, model):
    return needs_areas(scheme) and bool(area_pairs(model))


@device(by_type=True)
def kept_of_steps(reference_scheme, scheme, model):
    """The :class:`~spi.ensemble.increments.Kept` of the rows that serve either scheme."""
    schemes = [each for each in (reference_scheme, scheme) if not is_none(each)]
    areas = any(_keeps_areas(s, model) for s in schemes)
    coins = Coins() if areas or any(tosses(s) for s in schemes) else NoCoins()
    coins = Uniforms() if any(judges(s) for s in schemes) else coins
    finest = INDICES[max(substeps(s) for s in schemes)]()
    layout = Kept(finest, Areas() if areas else NoAreas(), coins)
    return lambda reference_scheme, scheme, model: layout


@device(by_type=True)
def _advance(scheme, model, paths, h, dW, coins, y, work, report):
    """One step of at least the first `paths` paths of a block."""
    if large(model):
        return lambda scheme, model, paths, h, dW, coins, y, work, report: advance_large(
            scheme, model, paths, h, dW, coins, y, work, report
        )
    return lambda scheme, model, paths, h, dW, coins, y, work, report: advance(
        scheme, model, h, dW, coins, y, work, report
    )


@device(by_type=True)
def advance_path(reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report):
    """One step of the scheme, or by the reference scheme if there is one."""
    if is_none(reference_scheme):
        return lambda reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report: _advance(
            scheme, model, paths, h, dW, coins, y, work, report
        )

    def either(reference_scheme, scheme, by_reference, model, paths, h, dW, coins, y, work, report):
        if by_reference:
            _advance(reference_scheme, model, paths, h, dW, coins, y, work, report)
        else:
            _advance(scheme, model, paths, h, dW, coins, y, work, report)

    return either
