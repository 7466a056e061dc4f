"""The schemes, by the names that experiments use."""

from typing import NamedTuple

from .euler_maruyama import EulerMaruyama
from .midpoint import Midpoint
from .splitting import LIE_TROTTER, LIE_TROTTER_EXCHANGED


class Scheme(NamedTuple):
    """One row of the table of orders; what theory says where the coefficients are smooth and bounded."""

    record: NamedTuple
    label: str
    strong_order: float  #: with several noises that do not commute
    strong_order_commuting: float  #: with one noise, or several that commute
    weak_order: float
    preserves: str
    typical_ns: float  #: per step and path on one thread, for the rigid body; for estimates of run time
    needs_truncation: bool = False  #: whether its equation is solvable only with bounded increments


SCHEMES = {
    "splitting": Scheme(LIE_TROTTER, "splitting", 0.5, 1.0, 1.0, "Casimirs, Poisson structure", 9.0),
    "splitting_drift_first": Scheme(
        LIE_TROTTER_EXCHANGED, "splitting, drift first", 0.5, 1.0, 1.0, "Casimirs, Poisson structure", 9.0
    ),
    "euler_maruyama": Scheme(EulerMaruyama(), "Euler-Maruyama", 0.5, 0.5, 1.0, "nothing", 7.0),
    "midpoint": Scheme(Midpoint(), "midpoint", 0.5, 1.0, 1.0, "quadratic Casimirs", 18.0, needs_truncation=True),
}
