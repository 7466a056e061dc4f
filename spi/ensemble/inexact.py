"""What a model is asked whose flows are not all known in closed form; see ``protocol.py`` for all else.

Schemes that are no compositions of flows need nothing of this.  A composition moves by such a piece or noise with
another method, the inner one, if the model names one, and cannot be used if it names none.
"""

from ..compiler.dispatch import method, trait
from .protocol import noise_indices

#: What may stand in the place of an exact flow, see ``schemes/inner_steps.py``.
INNER_METHODS = ("midpoint", "munthe_kaas")


@trait(tuple, default=())
def inexact_pieces(model):
    """The numbers k of the pieces H_k whose flows are not known in closed form; ``drift_flow`` is not asked for them.

    Such a model answers ``piece_gradient`` and ``piece_hessian`` for them.
    """


@trait(tuple, default=())
def inexact_noises(model):
    """The numbers k of the noises whose flows are not known in closed form; ``noise_flow`` is not asked for them."""


@trait(str, default="")
def inner(model):
    """By which of :data:`INNER_METHODS` compositions move by these pieces and noises, "" if by none."""


@trait(bool, default=False)
def structure_is_kept(model):
    """Whether B is the same along every flow, its entries being numbers or Casimir functions.

    Then the implicit midpoint rule is a Poisson map, since B has the same value before a step and behind it.
    """


@method(optional=True)
def piece_gradient(model, k, y):
    """grad H_k(y) of a piece without an exact flow."""


@method(optional=True)
def piece_hessian(model, k, y, v):
    """Hess H_k(y) v of such a piece."""


def flows_lacking(model):
    """(("pieces" or "noises", k), ...): those without an exact flow, noises that are off left out."""
    noises = (k for k in inexact_noises(model) if k in noise_indices(model))
    return (*(("pieces", k) for k in inexact_pieces(model)), *(("noises", k) for k in noises))
