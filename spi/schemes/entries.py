"""What is known of a scheme, as an entry of the table."""

from collections.abc import Callable
from typing import NamedTuple

from ..checks.registration import check_class
from ..compiler.dispatch import answers
from ..ensemble.scheme_protocol import advance_large
from .stages import has_joint, has_loops, has_shared


class Scheme(NamedTuple):
    """One entry of the table of orders; what theory says where the coefficients are smooth and bounded.

    A composition of the user's own has no look, figures choose one, and its orders are NaN where theory states none.
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
    overhead: float = 1.0  #: by what factor a step takes longer than its flows and increments
    needs_truncation: bool = False  #: whether its equation is solvable only with bounded increments
    multiscale: bool = False  #: whether it is for the system with fast processes, and its record has a field ``eps``
    needs_eps: bool = False  #: whether eps must not be 0
    needs: Callable | None = None  #: a fact that must hold for the model
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
    """Make a scheme known, given the fields of :class:`Scheme`; TypeError if it does not fit ``scheme_protocol.py``."""
    scheme = Scheme(**entry)
    check_class(type(scheme.record), "scheme", name)
    SCHEMES[name] = scheme
