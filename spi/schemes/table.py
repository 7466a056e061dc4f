"""Table of the schemes: orders, properties and costs of each, an entry for each name that experiments use."""

import math
from collections.abc import Callable
from typing import NamedTuple

from ..checks.registration import check_class
from ..compiler.dispatch import answers
from ..ensemble.fields import lie_poisson, noise_field_derivative
from ..ensemble.protocol import (
    area_pairs,
    dimension,
    flow_ns,
    has_bath,
    in_place,
    inexact_noises,
    inexact_pieces,
    large,
    noise_indices,
    noises,
    sphere_size,
    squared_length_is_casimir,
)
from ..ensemble.scheme_protocol import advance_large, needs_areas, of_arrays, substeps
from .asymptotic import AsymptoticPreserving, ExplicitEuler, ImplicitEuler, ImplicitMidpoint, MultiscaleEuler
from .explicit import EulerMaruyama, RenormalisedEulerMaruyama, RenormalisedHeun, RoesslerRS2
from .metropolis import Metropolis
from .midpoint import IsospectralMidpoint, Midpoint, turns_alone
from .munthe_kaas import MuntheKaasAreas, MuntheKaasEuler, MuntheKaasMidpoint, left_out_by_euler
from .splitting import (
    JOINT,
    JOINT_AREAS,
    JOINT_LIE,
    LIE_TROTTER,
    LIE_TROTTER_AREAS,
    LIE_TROTTER_EXCHANGED,
    ORDER_2,
    SYMMETRIC,
)
from .stages import flow_counts, has_joint, has_loops, has_shared, sweeps

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
_LARGE_SOLVE = 4  # iterations of an array-state model, over those of Newton's method for three components


def _flows(stages, model):
    """Number of flows of a composition; an inner step counts as 8 flows for each three components.

    The noises of a model whose flows move a lattice in place are together one flow, and so is their friction.
    """
    if large(model):
        together = 1 / max(1, noises(model)) if in_place(model) else 1
        return sum(count * (1 if part == "drift" else together) for part, count in flow_counts(stages, model))
    inexact = {"drift": inexact_pieces(model), "noise": inexact_noises(model)}
    return sum(
        _INNER_FLOWS * dimension(model) / 3 if of.k in inexact.get(of.part, ()) else 1 for of in sweeps(stages, model)
    )


def typical_ns(entry, model):
    """Nanoseconds per step and path on one thread of a processor with AVX-512 at about 4 GHz, within a factor of 3.

    overhead * (0.85 draws + flows * ns of a flow), where a flow takes ``flow_ns`` of the model, or 0.15 ns a component.
    """
    flows = entry.work if entry.composition is None else _flows(entry.composition, model)
    if entry.solves:
        flows *= _LARGE_SOLVE if large(model) else dimension(model) / 3
    draws = (noises(model) if large(model) else len(noise_indices(model))) * substeps(entry.record)
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
    order_without_noise: float = math.nan  #: for ordinary differential equations, of a step that is no composition
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
        """Stages of which a step consists, None for a scheme that is no composition of flows."""
        return getattr(self.record, "stages", None)

    @property
    def solvable_without_sampling(self):
        """Whether solvers can be asked for it: a composition, each noise flow with an increment of its own."""
        stages = self.composition
        return stages is not None and not self.multiscale and not has_loops(stages) and not has_shared(stages)

    @property
    def for_large_models(self):
        """Whether it can be used with models whose states are arrays."""
        stages = self.composition or ()
        if has_loops(stages) or has_joint(stages):
            return False
        return answers(of_arrays, self.record) or answers(advance_large, self.record)


SCHEMES: dict[str, Scheme] = {}


def on_spheres(model):
    """Whether states can be scaled back to spheres: that of |y|, or those of the sites of a lattice."""
    return sphere_size(model) > 0 or (squared_length_is_casimir(model) and not large(model))


def register_scheme(name, **entry):
    """Register a scheme, given the fields of :class:`Scheme`; TypeError if it does not fit ``scheme_protocol.py``."""
    scheme = Scheme(**entry)
    check_class(type(scheme.record), "scheme", name)
    SCHEMES[name] = scheme


#: What several schemes have: compositions without and with areas, schemes that have f_k' f_k only in the mean, midpoint
#: rules and Heun's, and those of the fast processes, which are explicit in y.
POISSON = {"strong_order": 0.5, "strong_order_commuting": 1.0, "preserves": "Casimirs, Poisson structure"}
_WITH_AREAS = POISSON | {"strong_order": 1.0}
_EULER = {"strong_order": 0.5, "strong_order_commuting": 0.5, "weak_order": 1.0, "order_without_noise": 1.0}
_MIDPOINT = {"strong_order": 0.5, "strong_order_commuting": 1.0, "weak_order": 1.0, "order_without_noise": 2.0}
_MULTISCALE_EULER = {"strong_order": 1.0, "strong_order_commuting": 1.0, "weak_order": 1.0, "order_without_noise": 1.0}
_MULTISCALE_EULER |= {"reference": "ours, for comparison", "preserves": "nothing", "work": 4.0, "multiscale": True}
_DRIFT, _NOISE = "exp(h Y_{H_p})...exp(h Y_{H_1})", "exp(sigma_m dW_m Y_{Ĥ_m})...exp(sigma_1 dW_1 Y_{Ĥ_1})"

register_scheme(
    "splitting",
    record=LIE_TROTTER,
    label="splitting",
    formula=f"z = {_DRIFT} {_NOISE} y",
    reference="eq. (18)",
    look=("D", "#009E73"),
    weak_order=1.0,
    **POISSON,
)
register_scheme(
    "splitting_drift_first",
    record=LIE_TROTTER_EXCHANGED,
    label="splitting, drift first",
    formula=f"z = {_NOISE} {_DRIFT} y",
    reference="remark 2",
    look=("s", "#CC79A7"),
    weak_order=1.0,
    **POISSON,
)
register_scheme(
    "splitting_areas",
    record=LIE_TROTTER_AREAS,
    label="splitting with Lévy areas",
    formula=f"z = {_DRIFT} L {_NOISE} y, L a loop exp(-b Y_l) exp(-a Y_k) exp(b Y_l) exp(a Y_k) for each pair k < l, "
    "a b = -sigma_k sigma_l J_lk",
    reference="ours; areas as in doi:10.1214/aoap/1015345301",
    look=("*", "#000000"),
    weak_order=1.0,
    **_WITH_AREAS,
)
register_scheme(
    "splitting_joint_lie",
    record=JOINT_LIE,
    label="joint splitting, once",
    formula="z = J_p...J_1 y, J_k = exp(h Y_{H_k} + sigma_k dW_k Y_{Ĥ_k}), the noises with their pieces of H",
    reference="docs/joint.md",
    look=("P", "#56B4E9"),
    weak_order=1.0,
    **POISSON,
)
register_scheme(
    "splitting_joint",
    record=JOINT,
    label="joint splitting",
    formula="z = J_1...J_p J_p...J_1 y, J_k = exp(h/2 Y_{H_k} + sigma_k dW_k/2 Y_{Ĥ_k}), the same dW_k there and back",
    reference="docs/joint.md",
    look=("X", "#999933"),
    weak_order=1.0,
    **POISSON,
)
register_scheme(
    "splitting_joint_areas",
    record=JOINT_AREAS,
    label="joint splitting with Lévy areas",
    formula="z = J_1...J_p L J_p...J_1 y, J_k as in splitting_joint, L the flows of sigma_k sigma_l A_kl {Ĥ_l, Ĥ_k}, "
    "or loops in their place",
    reference="docs/joint.md; areas as in doi:10.1214/aoap/1015345301",
    look=("H", "#332288"),
    weak_order=1.0,
    **_WITH_AREAS,
)
register_scheme(
    "splitting_order2",
    record=ORDER_2,
    label="splitting, weak order 2",
    formula="z = S(h/2) N S(h/2) y, S the symmetric composition of the drift flows, N the noise flows in random order",
    reference="eq. (19)",
    look=("^", "#E69F00"),
    weak_order=2.0,
    **POISSON,
)
register_scheme(
    "splitting_symmetric",
    record=SYMMETRIC,
    label="splitting, symmetric",
    formula="z = D* N D y, D the drift flows over h/2, N the symmetric composition of the noise flows, D* = D reversed",
    reference="docs/extrapolation.md",
    look=("8", "#000000"),
    weak_order=2.0,
    **POISSON,
)
register_scheme(
    "splitting_metropolis",
    record=Metropolis(),
    label="splitting, Metropolis",
    formula="z = D N y, each flow of N = exp(s_m Y_{Ĥ_m})...exp(s_1 Y_{Ĥ_1}), s_k = friction + sigma_k dW_k, and the "
    "palindrome D of the drift flows accepted or not, D turned over where it is not",
    reference="docs/temperature.md",
    look=("X", "#882255"),
    strong_order=0.5,
    strong_order_commuting=0.75,
    weak_order=1.0,
    preserves="Casimirs, the Gibbs law",
    work=16.0,
    needs=has_bath,
)
register_scheme(
    "euler_maruyama",
    record=EulerMaruyama(),
    label="Euler-Maruyama",
    formula="z = y + h (f(y) + 1/2 sum_k sigma_k^2 f_k'(y) f_k(y)) + sum_k sigma_k dW_k f_k(y)",
    reference="doi:10.1007/978-3-662-12616-5",
    look=("x", "#D55E00"),
    preserves="nothing",
    work=5.0,
    left_out=noise_field_derivative,
    **_EULER,
)
register_scheme(
    "euler_maruyama_renormalised",
    record=RenormalisedEulerMaruyama(),
    label="Euler-Maruyama, renormalised",
    formula="|y| z / |z| with the z of Euler-Maruyama",
    reference="ours, for comparison",
    look=("v", "#56B4E9"),
    preserves="|y|",
    work=5.5,
    needs=squared_length_is_casimir,
    left_out=noise_field_derivative,
    **_EULER,
)
register_scheme(
    "heun_renormalised",
    record=RenormalisedHeun(),
    label="Heun, renormalised",
    formula="|y| z / |z|, z = y + (F(y) + F(y + F(y))) / 2, F = h f + sum_k sigma_k dW_k f_k; of a lattice each site",
    reference="doi:10.1007/978-3-662-12616-5",
    look=("P", "#E69F00"),
    preserves="|y|",
    work=6.0,
    needs=on_spheres,
    **_MIDPOINT,
)
register_scheme(
    "midpoint",
    record=Midpoint(),
    label="midpoint",
    formula="z = y + h f((y+z)/2) + sum_k sigma_k dW_k f_k((y+z)/2)",
    reference="doi:10.1137/S0036142901395588",
    look=("o", "#0072B2"),
    preserves="quadratic Casimirs",
    work=25.0,
    solves=True,
    needs_truncation=True,
    **_MIDPOINT,
)
register_scheme(
    "munthe_kaas_euler",
    record=MuntheKaasEuler(),
    label="Munthe-Kaas, Euler",
    formula="z = exp(M(v)) y, v = h (grad H + 1/2 sum_k sigma_k^2 Hess Ĥ_k f_k) + sum_k sigma_k dW_k grad Ĥ_k at y",
    reference="doi:10.1137/060666743, its Euler type; see docs/literature_schemes.md",
    look=(">", "#CC79A7"),
    preserves="Casimirs",
    work=6.0,
    solves=True,
    needs=lie_poisson,
    left_out=left_out_by_euler,
    **_EULER,
)
register_scheme(
    "munthe_kaas_midpoint",
    record=MuntheKaasMidpoint(),
    label="Munthe-Kaas, midpoint",
    formula="z = exp(M(v(x))) y, x = exp(M(v(y)) / 2) y, v = h grad H + sum_k sigma_k dW_k grad Ĥ_k",
    reference="doi:10.1186/s13662-023-03796-y, with the explicit midpoint rule; see docs/literature_schemes.md",
    look=("<", "#AA4499"),
    preserves="Casimirs",
    work=10.0,
    solves=True,
    needs=lie_poisson,
    **_MIDPOINT,
)
register_scheme(
    "munthe_kaas_areas",
    record=MuntheKaasAreas(),
    label="Munthe-Kaas with Lévy areas",
    formula="z = exp(M(v(x))) y, x = exp(M(v(y)) / 2) y to second order, v = h grad H + sum_k sigma_k dW_k grad Ĥ_k "
    "+ sum_{k < l} sigma_k sigma_l A_kl grad {Ĥ_l, Ĥ_k}",
    reference="doi:10.1137/060666743, its Castell-Gaines type; see docs/literature_schemes.md",
    look=("2", "#882255"),
    strong_order=1.0,
    strong_order_commuting=1.0,
    weak_order=1.0,
    order_without_noise=2.0,
    preserves="Casimirs",
    work=12.0,
    solves=True,
    needs=lie_poisson,
)
register_scheme(
    "isospectral_midpoint",
    record=IsospectralMidpoint(),
    label="isospectral midpoint",
    formula="y = u - u x v/2 + (v.u) v/4, z = u + u x v/2 + (v.u) v/4, v = h grad H + sum_k sigma_k dW_k grad Ĥ_k at u",
    reference="doi:10.1007/s10543-019-00792-1; with noise arXiv:2408.16701",
    look=("d", "#E69F00"),
    weak_order=1.0,
    order_without_noise=2.0,
    work=16.0,
    needs_truncation=True,
    needs=turns_alone,
    **POISSON,
)
register_scheme(
    "roessler_rs2",
    record=RoesslerRS2(),
    label="Rößler RS2",
    formula="z = y + h (f(y) + f(u) + 2 f(v))/4 + sum_k sigma_k dW_k (f_k(y) + 3 f_k(y_k) + 3 f_k(v_k) + f_k(w_k))/8 "
    "- sum_k sigma_k h^(1/2) (f_k(y + G_k) - f_k(y - G_k))/4, see docs/literature_schemes.md",
    reference="doi:10.1007/s10543-007-0130-3",
    look=("4", "#CC79A7"),
    strong_order=0.5,
    strong_order_commuting=1.0,
    weak_order=2.0,
    order_without_noise=3.0,
    preserves="nothing",
    work=18.0,
)
register_scheme(
    "ap_splitting",
    record=AsymptoticPreserving(0.0, ImplicitEuler()),
    label="AP splitting",
    formula="splitting with h xi_k^n / eps for dW_k, xi^n = xi^(n-1) - h/eps^2 xi^n + dW/eps",
    reference="eq. (24)",
    look=("h", "#0072B2"),
    weak_order=1.0,
    overhead=1.15,
    multiscale=True,
    **POISSON,
)
register_scheme(
    "ap_splitting_midpoint",
    record=AsymptoticPreserving(0.0, ImplicitMidpoint()),
    label="AP splitting, midpoint",
    formula="splitting with h (xi_k^(n-1) + xi_k^n) / (2 eps) for dW_k, xi^n by the midpoint rule",
    reference="remark 5, the variant of eq. (24)",
    look=("p", "#56B4E9"),
    weak_order=1.0,
    overhead=1.15,
    multiscale=True,
    **POISSON,
)
register_scheme(
    "multiscale_euler",
    record=MultiscaleEuler(0.0, ExplicitEuler()),
    label="explicit Euler-Maruyama",
    formula="z = y + h f(y) + sum_k sigma_k f_k(y) h xi_k^(n-1) / eps, xi^n = xi^(n-1) - h/eps^2 xi^(n-1) + dW/eps",
    look=("+", "#D55E00"),
    needs_eps=True,
    **_MULTISCALE_EULER,
)
register_scheme(
    "multiscale_euler_semi_implicit",
    record=MultiscaleEuler(0.0, ImplicitEuler()),
    label="semi-implicit Euler-Maruyama",
    formula="z = y + h f(y) + sum_k sigma_k f_k(y) h xi_k^n / eps, xi^n = xi^(n-1) - h/eps^2 xi^n + dW/eps",
    look=("1", "#CC79A7"),
    **_MULTISCALE_EULER,
)
