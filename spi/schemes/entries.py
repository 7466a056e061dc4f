"""The entries of the table of schemes: orders, properties and costs of each."""

from collections.abc import Callable
from typing import NamedTuple

from ..checks.registration import check_class
from ..compiler.dispatch import answers
from ..ensemble.protocol import area_pairs, dimension, flow_ns, inexact_noises, inexact_pieces, noise_indices
from ..ensemble.scheme_protocol import advance_large, needs_areas, substeps
from .stages import has_joint, has_loops, has_shared
from .sweeps import sweeps

# ---------------------------------------------------------------------------------------------------------------------
# The cost of a step before anything is measured: for estimates of run time, and for budgets in seconds.
#
# A simple rule, so that an estimate depends on nothing but the scheme and the model; the time left of a run is
# measured.
# ---------------------------------------------------------------------------------------------------------------------

_DRAW_NS = 0.85  # an increment
_COMPONENT_NS = 0.15  # of a flow, where the model does not state ``flow_ns``
_TYPICAL_TERMS = 1  # of the Fourier series of areas
_INNER_FLOWS = 8  # an inner step of three components


def _flows(stages, model):
    """The number of flows of a composition; an inner step counts as 8 flows for each three components."""
    inexact = {"drift": inexact_pieces(model), "noise": inexact_noises(model)}
    return sum(
        _INNER_FLOWS * dimension(model) / 3 if k in inexact.get(part, ()) else 1
        for _, part, k, *_ in sweeps(stages, model)
    )


def typical_ns(entry, model):
    """Nanoseconds per step and path on one thread of a processor with AVX-512 at about 4 GHz, within a factor of 3.

    overhead * (0.85 draws + flows * ns of a flow), where a flow takes ``flow_ns`` of the model, or 0.15 ns a component.
    """
    flows = entry.work if entry.composition is None else _flows(entry.composition, model)
    if entry.solves:
        flows *= dimension(model) / 3
    draws = len(noise_indices(model)) * substeps(entry.record)
    if needs_areas(entry.record) and area_pairs(model):
        draws *= 1 + 2 * _TYPICAL_TERMS
    return entry.overhead * (_DRAW_NS * draws + flows * (flow_ns(model) or _COMPONENT_NS * dimension(model)))


class Scheme(NamedTuple):
    """One entry of the table of orders, those of theory where the coefficients are smooth and bounded.

    A composition of the user has no look, figures choose one, and its orders are NaN without theory.
    """

    record: NamedTuple
    label: str
    formula: str  #: of a step from y to z, one line of plain text
    reference: str  #: an equation of the paper, or a DOI
    look: tuple[str, str]  #: marker and colour in figures: the paper's markers, colours of Okabe and Ito, and of Tol
    strong_order: float  #: with several noises that do not commute
    strong_order_commuting: float  #: with one noise, or several that commute
    weak_order: float
    preserves: str
    work: float = 0.0  #: of a step that is no composition, in flows of the model, for estimates of run time
    solves: bool = False  #: whether this work is that for three components, and grows with their number
    overhead: float = 1.0  #: the factor by which a step takes longer than its flows and increments
    needs_truncation: bool = False  #: whether its equation is solvable only with bounded increments
    multiscale: bool = False  #: whether it is for the system with fast processes, and its record has a field ``eps``
    needs_eps: bool = False  #: whether eps must not be 0
    needs: Callable | None = None  #: a condition that the model must satisfy
    left_out: Callable | None = None  #: (model, k, y, v): the part of f_k'(y) v that a step has only in the mean

    @property
    def composition(self):
        """The stages of which a step consists, None for a scheme that is no composition of flows."""
        return getattr(self.record, "stages", None)

    @property
    def solvable_without_sampling(self):
        """Whether ``spi.exact.kolmogorov`` can do it: a composition, each noise flow with an increment of its own."""
        stages = self.composition
        return stages is not None and not self.multiscale and not has_loops(stages) and not has_shared(stages)

    @property
    def for_large_models(self):
        """Whether it can be used with models whose states are arrays."""
        stages = self.composition or ()
        return answers(advance_large, self.record) and not (has_loops(stages) or has_joint(stages))


SCHEMES: dict[str, Scheme] = {}


def register_scheme(name, **entry):
    """Register a scheme, given the fields of :class:`Scheme`; TypeError if it does not fit ``scheme_protocol.py``."""
    scheme = Scheme(**entry)
    check_class(type(scheme.record), "scheme", name)
    SCHEMES[name] = scheme
