"""The schemes, by the names that experiments use."""

import math

from ..ensemble.protocol import exact_flows, flows_lacking, has_friction, inner
from ..ensemble.protocol import large as has_arrays
from ..ensemble.scheme_protocol import judges
from .entries import SCHEMES, Scheme, register_scheme, typical_ns
from .inner_steps import is_reversible, preserved
from .splitting import splitting
from .stages import has_loops, is_own_reverse, with_friction
from .table import POISSON

__all__ = [
    "SCHEMES",
    "Scheme",
    "composed",
    "has_theory",
    "of_model",
    "register_scheme",
    "scheme_entry",
    "typical_ns",
    "weak_exponents",
    "with_eps",
]


def has_theory(entry, model):
    """Whether an entry has orders that hold for a model; not for a splitting without exact flows."""
    return not math.isnan(entry.weak_order) and (exact_flows(model) or entry.composition is None)


def weak_exponents(entry, model, count):
    """The first powers of h in the weak error of a scheme at smooth functions, `count` of them; None without theory.

    p, p + 1, ... (Talay and Tubaro, Stochastic Analysis and Applications 8, 1990), and p, p + 2, ... of a composition
    that equals itself reversed.  None for a scheme of the multiscale system, since they would not be uniform in eps.
    """
    if entry.multiscale or judges(entry.record) or not has_theory(entry, model):
        return None
    reversible = is_reversible(model) and not has_friction(model)  # which is exact to order 2
    symmetric = entry.composition is not None and is_own_reverse(entry.composition, model) and reversible
    apart = 2 if symmetric else 1
    return tuple(entry.weak_order + apart * i for i in range(count))


def of_model(entry, model):
    """An entry as it holds for a model, which may have inner steps in place of flows without a closed form.

    Inner steps leave the strong orders as they are, and the weak order where no noise needs them.  A composition has
    friction among its stages where the model is at a temperature.
    """
    if entry.composition is not None and has_friction(model):
        entry = entry._replace(record=entry.record._replace(stages=with_friction(entry.composition)))
    if judges(entry.record) and has_arrays(model):  # flows of such models are judged without friction
        return entry._replace(strong_order=0.25, strong_order_commuting=0.25, weak_order=0.5)
    lacking = flows_lacking(model)
    if entry.composition is None or not lacking or not inner(model):
        return entry
    entry = entry._replace(preserves=preserved(model))
    if all(part == "pieces" for part, _ in lacking):
        return entry
    implicit = inner(model) == "midpoint"
    return entry._replace(weak_order=min(1.0, entry.weak_order), needs_truncation=implicit)


def composed(name, stages, weak_order):
    """An entry for a composition of flows that is not in the table, without orders if `weak_order` is NaN.

    Its strong orders are those of all compositions that are whole steps: their errors of first order are brackets of a
    noise with the drift, of mean 0, and, without loops, of noises with one another.
    """
    has_order = not math.isnan(weak_order)
    orders = {"strong_order": 1.0 if has_loops(stages) else 0.5, "strong_order_commuting": 1.0}
    return Scheme(
        record=splitting(*stages),
        label=name,
        formula="z = the flows of its stages one after the other",
        reference="the experiment",
        look=("", ""),
        weak_order=weak_order,
        **(POISSON | (orders if has_order else dict.fromkeys(orders, math.nan))),
    )


def with_eps(entry, eps):
    """An entry with this eps in its record if it is for the multiscale system."""
    return entry._replace(record=entry.record._replace(eps=eps)) if entry.multiscale else entry


def scheme_entry(name, eps=None):
    """The entry of a scheme in the table, for the multiscale system with this eps in its record."""
    return with_eps(SCHEMES[name], eps)
