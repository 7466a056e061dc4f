"""The system of which a model is generated."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .driving import Driving
from .splitting import Flow
from .symbolics import Symbolics


class Function(NamedTuple):
    """A Casimir function."""

    text: str  #: in the words of the user
    expression: Any
    degree: int | None  #: of a homogeneous polynomial


class System(NamedTuple):
    """A system of which a model is generated."""

    world: Symbolics
    hamiltonian: Any
    flows: tuple[Flow, ...]
    noises: tuple[Flow, ...]
    casimirs: tuple[Function, ...]
    squared_length_first: bool  #: whether the first Casimir function is |y|^2
    constants: Mapping[Any, mpmath.mpf]  #: of the diagonalised forms: symbol -> value
    inner: str = ""  #: how compositions move by terms that have no exact flow
    driving: Driving | None = None  #: how time enters; None where nothing depends on it


def poisson_bracket(f: Any, g: Any, world: Symbolics) -> Any:
    """{f, g} = sum_ij df/dy_i {y_i, y_j} dg/dy_j, expanded."""
    bracket, y = world.bracket, world.variables
    factor = [y[i] if i in bracket.logarithmic else sympy.Integer(1) for i in range(bracket.dimension)]
    slopes_f, slopes_g = ({i: sympy.diff(h, y[i]) for i in world.used(h)} for h in (f, g))
    terms = []
    for i, j, polynomial in bracket.entries(symbolic=True):
        if not {i, j} & {*slopes_f} or not {i, j} & {*slopes_g}:
            continue
        entry = sympy.Add(*(c * sympy.Mul(*(y[k] for k in monomial)) for monomial, c in polynomial.items()))
        turned = slopes_f.get(i, 0) * slopes_g.get(j, 0) - slopes_f.get(j, 0) * slopes_g.get(i, 0)
        terms.append(factor[i] * factor[j] * entry * turned)
    return sympy.expand(sympy.Add(*terms))


# ---------------------------------------------------------------------------------------------------------------------
# Systems that the solvers without sampling know: a rigid body, and Maxwell-Bloch, with any constants.
#
# On so(3) a Hamiltonian and noises that are sums of squares of the components, at most one for each; on e(2) with the
# variables (L, g1, g2) multiples of L^2 and of g2.
# ---------------------------------------------------------------------------------------------------------------------

_E2 = {(0, 1): {2: -1}, (0, 2): {1: 1}}
Rates = dict[int, Any]  #: place -> rate or inertia of the flow there
Read = Callable[[Flow, System], tuple[int, Any] | None]


def lines(system: System, code: Callable[[Any], str]) -> list[str]:
    """Lines of the class of a system by which a solver knows it; none if it is no such system."""
    bracket = system.world.bracket
    if system.driving or bracket.formulas:
        return []
    if bracket.is_cross_product:
        word, count, nothing, read = "axis_inertias", 3, "np.inf", _inertia
    elif bracket.dimension == 3 and bracket.is_lie and dict(bracket.constants) == _E2:
        word, count, nothing, read = "rotation_shear_rates", 2, "0.0", _rate
    else:
        return []
    drift, noise = _placed(system.flows, system, read), _placed(system.noises, system, read)
    if drift is None or noise is None:
        return []
    both = ", ".join(
        f"({', '.join(code(rates[place]) if place in rates else nothing for place in range(count))})"
        for rates in (drift, noise)
    )
    places = tuple(drift), tuple(noise)
    return ["", f"flow_places = {places!r}", "", f"def {word}(model):", f"    return {both}"]


def _placed(flows: Sequence[Flow], system: System, read: Read) -> Rates | None:
    """The rates of flows, in their order; None if a flow has none, or two have the same place."""
    rates = [None if flow.lacking else read(flow, system) for flow in flows]
    by_place = dict(rate for rate in rates if rate)
    return by_place if len(by_place) == len(flows) else None


def _power(flow: Flow, system: System) -> tuple[int, int, Any] | None:
    """(component, exponent, factor) of a multiple of a power of one component."""
    used = system.world.used(flow.expression)
    variable = system.world.variables[used[0]] if len(used) == 1 else None
    if variable is None or not flow.expression.is_polynomial(variable):
        return None
    powers = [(exponent, c) for (exponent,), c in sympy.Poly(flow.expression, variable).terms() if exponent]
    return (used[0], *powers[0]) if len(powers) == 1 else None


def _inertia(flow: Flow, system: System) -> tuple[int, Any] | None:
    """(axis k, I) of y_k^2 / (2 I)."""
    match _power(flow, system):
        case k, 2, c:
            return k, 1 / (2 * c)
    return None


def _rate(flow: Flow, system: System) -> tuple[int, Any] | None:
    """(0, a) of a L^2 / 2, (1, c) of c g2."""
    match _power(flow, system):
        case 0, 2, c:
            return 0, 2 * c
        case 2, 1, c:
            return 1, c
    return None
