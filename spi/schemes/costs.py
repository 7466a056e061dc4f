"""What a step costs before anything is measured: for estimates of run time, and for budgets in seconds.

A simple rule, so that an estimate depends on nothing but the scheme and the model; the time left of a run is measured.
"""

from ..ensemble.inexact import inexact_noises, inexact_pieces
from ..ensemble.protocol import area_pairs, dimension, flow_ns, noise_indices
from ..ensemble.scheme_protocol import needs_areas, substeps
from .sweeps import sweeps

_DRAW_NS = 0.85  # an increment
_COMPONENT_NS = 0.15  # of a flow, where the model does not state ``flow_ns``
_TYPICAL_TERMS = 1  # of the Fourier series of areas
_INNER_FLOWS = 8  # an inner step of three components


def _flows(stages, model):
    """The flows of a composition; an inner step counts as some, the more the more components there are."""
    inexact = {"drift": inexact_pieces(model), "noise": inexact_noises(model)}
    return sum(
        _INNER_FLOWS * dimension(model) / 3 if k in inexact.get(part, ()) else 1
        for _, part, k, *_ in sweeps(stages, model)
    )


def typical_ns(entry, model):
    """Nanoseconds per step and path on one thread of a processor with AVX-512 at about 4 GHz, within a factor of 3.

    overhead * (0.85 draws + flows * ns of a flow), where a flow takes what the model states, or 0.15 ns a component.
    """
    flows = entry.work if entry.composition is None else _flows(entry.composition, model)
    if entry.solves:
        flows *= dimension(model) / 3
    draws = len(noise_indices(model)) * substeps(entry.record)
    if needs_areas(entry.record) and area_pairs(model):
        draws *= 1 + 2 * _TYPICAL_TERMS
    return entry.overhead * (_DRAW_NS * draws + flows * (flow_ns(model) or _COMPONENT_NS * dimension(model)))
