"""The schemes, by the names that experiments use."""

from typing import NamedTuple

from ..protocol import noise_indices
from .asymptotic import AsymptoticPreserving, ExplicitEuler, ImplicitEuler, ImplicitMidpoint, MultiscaleEuler
from .euler_maruyama import EulerMaruyama, RenormalisedEulerMaruyama
from .midpoint import Midpoint
from .splitting import LIE_TROTTER, LIE_TROTTER_EXCHANGED, ORDER_2, Splitting, compositions


class Scheme(NamedTuple):
    """One row of the table of orders; what theory says where the coefficients are smooth and bounded."""

    record: NamedTuple
    label: str
    strong_order: float  #: with several noises that do not commute
    strong_order_commuting: float  #: with one noise, or several that commute
    weak_order: float
    preserves: str
    work: float | None  #: of a step, in flows of the model, for estimates of run time; None where flows are counted
    needs_truncation: bool = False  #: whether its equation is solvable only with bounded increments
    multiscale: bool = False  #: whether it is for the system with fast processes, and its record has a field ``eps``
    needs_eps: bool = False  #: whether eps must not be 0
    needs_sphere: bool = False  #: whether the first Casimir function of the model must be |y|^2


SCHEMES = {
    "splitting": Scheme(LIE_TROTTER, "splitting", 0.5, 1.0, 1.0, "Casimirs, Poisson structure", None),
    "splitting_drift_first": Scheme(
        LIE_TROTTER_EXCHANGED, "splitting, drift first", 0.5, 1.0, 1.0, "Casimirs, Poisson structure", None
    ),
    "splitting_order2": Scheme(ORDER_2, "splitting, weak order 2", 0.5, 1.0, 2.0, "Casimirs, Poisson structure", None),
    "euler_maruyama": Scheme(EulerMaruyama(), "Euler-Maruyama", 0.5, 0.5, 1.0, "nothing", 5.0),
    "euler_maruyama_renormalised": Scheme(
        RenormalisedEulerMaruyama(), "Euler-Maruyama, renormalised", 0.5, 0.5, 1.0, "|y|", 5.5, needs_sphere=True
    ),
    "midpoint": Scheme(Midpoint(), "midpoint", 0.5, 1.0, 1.0, "quadratic Casimirs", 25.0, needs_truncation=True),
    "ap_splitting": Scheme(
        *(AsymptoticPreserving(0.0, ImplicitEuler()), "AP splitting"),
        *(0.5, 1.0, 1.0, "Casimirs, Poisson structure", None),
        multiscale=True,
    ),
    "ap_splitting_midpoint": Scheme(
        *(AsymptoticPreserving(0.0, ImplicitMidpoint()), "AP splitting, midpoint"),
        *(0.5, 1.0, 1.0, "Casimirs, Poisson structure", None),
        multiscale=True,
    ),
    "multiscale_euler": Scheme(
        *(MultiscaleEuler(0.0, ExplicitEuler()), "explicit Euler-Maruyama"),
        *(1.0, 1.0, 1.0, "nothing", 4.0),
        multiscale=True,
        needs_eps=True,
    ),
    "multiscale_euler_semi_implicit": Scheme(
        *(MultiscaleEuler(0.0, ImplicitEuler()), "semi-implicit Euler-Maruyama"),
        *(1.0, 1.0, 1.0, "nothing", 4.0),
        multiscale=True,
    ),
}


def has_theory(row, model):
    """Whether the orders of a row hold for a model; not those of a splitting that is not made of exact flows."""
    return getattr(type(model), "exact_flows", True) or not isinstance(row.record, Splitting)


def scheme_row(name, eps=None):
    """The row of a scheme, for the multiscale system with this eps in its record and label."""
    row = SCHEMES[name]
    if not row.multiscale:
        return row
    return row._replace(record=row.record._replace(eps=eps), label=f"{row.label}, eps = {eps:g}")


def reference_record(name, eps):
    """The record of the scheme that makes a reference, with the eps of the scheme it is for; None without a name."""
    return scheme_row(name, eps or 0.0).record if name else None


_DRAW_NS = 0.85  # an increment
_FLOW_NS = 0.5  # a flow of a model that does not say


def typical_ns(name, model):
    """Nanoseconds per step and path on one thread of a processor with AVX-512 at about 4 GHz, for estimates."""
    row = SCHEMES[name]
    flows = row.work
    if isinstance(row.record, AsymptoticPreserving):
        return 1.15 * typical_ns("splitting", model)
    if isinstance(row.record, Splitting):
        several = compositions(row.record, model)
        masked = max(len(noise_indices(model)) - 1, 0) if len(several) > 1 else 0
        flows = len(several[0][1]) + masked
    return _DRAW_NS * len(noise_indices(model)) + getattr(type(model), "flow_ns", _FLOW_NS) * flows
