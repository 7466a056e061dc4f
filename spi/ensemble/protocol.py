"""Methods and traits of a model; for those of a scheme see ``scheme_protocol.py``.  Read this file first.

The problem (the paper's eq. (1)): a stochastic Poisson system in Stratonovich form,

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) ∘ dW_k(t),      H = H_1 + ... + H_p,

with independent Wiener processes W_1, ..., W_m.  In the program indices start at 0.

A **model** is a NamedTuple of parameters with a field ``sigma`` (one entry per noise; None = that noise is off and is
neither drawn nor applied).  In its class body stand its traits (``dimension = 3``) and the methods below
(``def drift_flow(model, k, t, y, angles)``).  A **scheme** is a NamedTuple of options with the methods of schemes; its
orders and what it preserves stand in ``schemes.SCHEMES``.

A class must implement the methods marked ``@method``; those marked ``@method(default=True)`` have a default, and those
marked ``@method(optional=True)`` only some models have; one with ``compiled=False`` is called in Python only.  A
``@trait`` is required unless it has a default.  ``registration.py`` checks classes against this file.

A state y is a tuple of d floats, of an array-state model an array.  In kernels LANES paths travel together: their
states are one array of d * LANES floats, component i of lane l at [i * LANES + l] (see ``lanes.py``).
"""

import itertools
from typing import Annotated

import annotated_types

from ..compiler import instructions
from ..compiler.dispatch import device, intrinsic, method, trait
from ..compiler.records import field, is_array, is_none
from ..numerics.elementary import expm1

#: Bounds of the fields of a record, checked when a spec file is read.
Positive = Annotated[float, annotated_types.Gt(0)]
NonNegative = Annotated[float, annotated_types.Ge(0)]

# ---------------------------------------------------------------------------------------------------------------------
# Traits of a model: constants in compiled code
# ---------------------------------------------------------------------------------------------------------------------


@trait(int)
def dimension(model):
    """d, the number of components of the state."""


@trait(int)
def pieces(model):
    """p, the number of pieces H_1, ..., H_p into which the Hamiltonian is split."""


@trait(int)
def noises(model):
    """m, the number of Wiener processes, those with sigma_k = None included."""


@trait(int)
def conserved(model):
    """Number of Casimir functions."""


@trait(tuple, default=())
def casimir_degrees(model):
    """Degrees k of the Casimir functions where all are homogeneous, C(c y) = c^k C(y); otherwise empty."""


@trait(bool, default=True)
def exact_flows(model):
    """Whether the flows are exact; if not, the stated orders of splitting schemes do not hold."""


@trait(bool, default=False)
def squared_length_is_casimir(model):
    """Whether the first Casimir function is |y|^2."""


@trait(int, default=0)
def sphere_size(model):
    """Components of each sphere on which the state moves, one sphere after the other; 0 if it is not of spheres."""


@trait(bool, default=False)
def structure_is_cross_product(model):
    """Whether B(y) v = y x v; also so of every model that answers ``axis_inertias``."""


@trait(bool, default=False)
def populations(model):
    """Whether the components are to stay positive."""


@trait(float, default=0.0)
def flow_ns(model):
    """Nanoseconds of one flow per path, on a processor with AVX-512 at about 4 GHz, for estimates of run time.

    0: not stated; then 0.15 for each component, see ``schemes/table.py``.
    """


@trait(tuple, default=())
def commuting_noises(model):
    """Pairs (k, l), k < l, of noises whose flows commute; schemes need no Lévy areas of theirs."""


@trait(str, default="")
def equation(model):
    """Structure and Hamiltonians in LaTeX, for reports."""


@trait(dict, default={})
def symbols(model):
    """Parameter -> its symbol in mathtext where the name is none; empty for one that is not shown."""


@trait(tuple, default=())
def complex_modes(model):
    """(symbol, names of the modes) where the components are the real and imaginary parts of complex modes."""


@trait(bool, default=False)
def large(model):
    """Whether states are arrays, of any length, and flows move whole blocks; see the methods of such a model below."""


@trait(bool, default=False)
def generated(model):
    """Whether a program wrote the class, from formulas that it has checked: it compiles, and nobody knows its lines."""


@trait(bool, default=False)
def in_place(model):
    """Whether the flows of an array-state model move all LANES states of a block as they are, with `width` LANES."""


def piece_indices(model):
    """(0, ..., p-1)."""
    return tuple(range(pieces(model)))


@trait
def component_indices(model):
    """(0, ..., d-1)."""
    return tuple(range(dimension(model)))


def casimir_indices(model):
    """Numbers of the Casimir functions, from 0."""
    return tuple(range(conserved(model)))


def noise_indices(model):
    """Noises that are on, those whose sigma_k is not None; all of an array-state model."""
    if large(model):
        return tuple(range(noises(model)))
    return tuple(k for k, sigma in enumerate(field(model, "sigma")) if not is_none(sigma))


piece_indices.count, component_indices.count = pieces, dimension
casimir_indices.count, noise_indices.count = conserved, noises


def area_pairs(model):
    """((k, l), ...), k < l: the pairs of noises that are on and do not commute, whose Lévy areas schemes may need.

    None of an array-state model, for which no scheme has areas.
    """
    if large(model):
        return ()
    commuting = commuting_noises(model)
    return tuple(pair for pair in itertools.combinations(noise_indices(model), 2) if pair not in commuting)


def strengths(model):
    """(sigma_0, ..., sigma_{m-1}) as floats, 0 for a noise that is off; an array of an array-state model."""
    return model.sigma if is_array(model.sigma) else tuple(0.0 if sigma is None else sigma for sigma in model.sigma)


@intrinsic(strengths)
def _(model):
    return instructions.floats(model, "sigma")


# ---------------------------------------------------------------------------------------------------------------------
# Methods of a model
# ---------------------------------------------------------------------------------------------------------------------


@method
def drift_flow(model, k, t, y, angles):
    """exp(t Y_{H_k})(y), the exact flow of y' = B(y) grad H_k(y); `angles` is passed on to ``angles.sin_versine``."""


@method
def noise_flow(model, k, t, y, angles):
    """exp(t Y_{Ĥ_k})(y), the exact flow of y' = B(y) grad Ĥ_k(y), for any real t (sigma_k is not included)."""


@method(default=True)
def drift_angle(model, k, t, y):
    """Largest |angle| whose sine ``drift_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""
    return 0.0


@method(default=True)
def noise_angle(model, k, t, y):
    """Largest |angle| whose sine ``noise_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""
    return 0.0


@method
def structure(model, y, v):
    """B(y) v."""


@method(default=True)
def structure_derivative(model, y, u, v):
    """(DB(y)[u]) v, the derivative of B at y along u, applied to v.

    The default holds for Lie-Poisson systems, where B is linear in y.
    """
    return structure(model, u, v)


@method(default=True)
def noise_structure(model, k, y, v):
    """B(y) v for a v that is 0 wherever grad Ĥ_k always is: a model may leave out the terms that vanish."""
    return structure(model, y, v)


@method(default=True)
def noise_structure_derivative(model, k, y, u, v):
    """(DB(y)[u]) v for a v that is 0 wherever grad Ĥ_k always is."""
    return structure_derivative(model, y, u, v)


@method
def hamiltonian(model, y):
    """H(y)."""


@method
def drift_gradient(model, y):
    """grad H(y)."""


@method
def drift_hessian(model, y, v):
    """Hess H(y) v."""


@method
def noise_gradient(model, k, y):
    """grad Ĥ_k(y)."""


@method
def noise_hessian(model, k, y, v):
    """Hess Ĥ_k(y) v."""


@method
def casimirs(model, y):
    """Casimir functions at y, a tuple (empty if there are none)."""


@method(default=True)
def add_dissipation(model, value, h, y):
    """value + h g(y), where the linear function g is the dissipation: the drift is B(y) grad H(y) + g(y)."""
    return value


@method(default=True, compiled=False)
def decay_rates(model):
    """Rates at which the Casimir functions decay; empty where they are preserved."""
    return ()


@method(default=True, compiled=False)
def in_kernels(model):
    """Record that kernels are given; of an array-state model one with its tables, of a class with methods below."""
    return model


@method(default=True, compiled=False)
def fault(model):
    """(key, fault, advice) of an invalid parameter, or None."""
    return None


@method(optional=True, compiled=False)
def at_temperature(model, temperature):
    """Record at a temperature of a model whose friction is a part of its own flows, None without friction."""


@method(optional=True, compiled=False)
def one_path(model, scheme, h):
    """A mover of one path of an array-state model in parts that threads share, None if there is none for the scheme.

    It has ``moved(states (d,), first, steps, every, seed, path)``, the states (stored, d) after each `every` steps from
    t = 0 on, the last state, and the report (1, len(REPORT)) of its steps; ``along`` has the same arguments and gives
    each of these states on the way.
    """


@method(optional=True, compiled=False)
def bath_fault(model):
    """(fault, advice) where the model has no bath at a temperature, or None."""


@method(optional=True, compiled=False)
def function_calls(model):
    """(kernel, arguments) of calls that only compile what functions of one long state need."""


@method(default=True, compiled=False)
def component_names(model):
    """Names of the components in formulas, besides y1, y2, ...; () if they have none."""
    return ()


@method(default=True, compiled=False)
def named_numbers(model):
    """{name: number} that formulas may name, whole ones also ranges such as i = 1..n.

    Here the fields that are numbers.
    """
    return {key: x for key, x in model._asdict().items() if isinstance(x, float | int) and not isinstance(x, bool)}


@method(default=True, compiled=False)
def parameters(model):
    """{name: value} of what results state as parameters, here all fields."""
    return model._asdict()


@method(default=True, compiled=False)
def report(model, y):
    """Lines for people about a model, and about it at the initial state y, for `spi check`."""
    return []


@method(optional=True, compiled=False)
def gibbs_law(model, temperature, sweeps):
    """Law of initial states with density exp(-H/T), drawn in some sweeps; None for the usual number of them.

    It has ``numbers``, ``sweeps``, ``states(z)`` and ``moved(states, seed, stream, first)``.
    """


@method(optional=True, compiled=False)
def state_fault(model, y):
    """(fault, advice) of a state at which the model cannot begin, or None."""


@method(default=True, compiled=False)
def geometry(model):
    """What the components of a state belong to: a mapping that JSON can hold, whose entry ``on`` says on what they are.

    {"on": "torus", "modes": N}: modes of a field, in the order of ``sine_euler``, and of as many others as ``tracers``
    says.  {"on": "lattice", ...}: three components for each site; ``sites`` of a cell, the same as ``fractions`` of the
    ``vectors``, ``size`` in cells, and whether it is ``periodic``.
    """
    return {}


@method(optional=True, compiled=False)
def observables(model):
    """{name: function of states (d, ...)} besides H and the Casimir functions.

    A ``spi.numerics.types.FunctionFamily`` in place of a function has numbers as arguments in formulas.
    """


@method(optional=True)
def lie_bracket(model, v, w):
    """[v, w] where B is linear in y: the gradient of w . B(y) v, a function that is linear in y.

    ``fields.add_lie_bracket`` computes it component by component where a model lacks this method, which takes longer.
    """


@method(optional=True)
def noise_bracket_gradient(model, j, k, y):
    """Gradient of {Ĥ_j, Ĥ_k} = grad Ĥ_j . B grad Ĥ_k at y, j > k.

    ``fields.add_noise_bracket_gradient`` computes it from Hessians and the bracket above otherwise, which takes longer.
    """


@method(optional=True)
def axis_inertias(model):
    """((I_1, I_2, I_3), (Î_1, Î_2, Î_3)) where B(y) v = y x v, H_k = y_k^2 / (2 I_k) and Ĥ_k = y_k^2 / (2 Î_k).

    The flows turn y about axis k, at the rates y_k / I_k and y_k / Î_k: rotations of spheres.  An inertia may be
    infinite.  Inertias and not their inverses, so that no rate is rounded twice.
    """


@method(optional=True)
def rotation_shear_rates(model):
    """((a, c), (â, ĉ)) where B(y) v = (y2 v3 - y3 v2, y3 v1, -y2 v1), H_1 = a y1^2 / 2, H_2 = c y3, hats alike.

    The flows of H_1 turn (y2, y3) by the angle -a t y1, those of H_2 move y1 by c t y2: motions of cylinders.
    """


# ---------------------------------------------------------------------------------------------------------------------
# Further methods of an array-state model, of the record that ``in_kernels`` returns.
#
# Its traits may be fields (``dimension = FieldOf("d")``), so that one compilation serves all sizes, and its field sigma
# is an array of strengths.  It has ``hamiltonian`` and ``casimirs`` for a state that is an array, the latter with
# an array.  Its flows move `width` states at once, 1 or ``vectors.WIDTH`` or LANES, component i of state j at
# y[i * width + j].
# Noises whose flows are made as one, because they commute, are a group.
# ---------------------------------------------------------------------------------------------------------------------


@method
def block_drift_flow(array_state_model, k, t, width, y, work):
    """Flow of H_k for the time t, in place; returns the largest |angle| of a rotation, or a bound of it."""


@method
def block_noise_flow(array_state_model, group, times, width, y, work):
    """Flow of the noises of a group, noise k of state j for the time times[k * width + j], in place; likewise."""


@method
def noise_groups(array_state_model):
    """Number of groups of noises, at most that of noises."""


@method(default=True, compiled=False)
def noises_commute(array_state_model):
    """Whether the fields of all noises commute, not only those of one group, on which strong orders depend.

    Of other models it follows from their fields.
    """
    return noises(array_state_model) <= 1


@method
def block_work(array_state_model):
    """Floats of scratch for the methods of a block."""


@method
def add_block_drift(array_state_model, t, width, y, out, work):
    """out + t B(y) grad H(y), in place."""


@method
def add_block_noises(array_state_model, times, width, y, out, work):
    """out + sum_k t_k B(y) grad Ĥ_k(y), in place, noise k of state j with t_k = times[k * width + j]."""


@method
def add_block_ito_correction(array_state_model, h, width, y, out, work):
    """out + h/2 sum_k sigma_k^2 f_k'(y) f_k(y), f_k = B grad Ĥ_k, in place."""


@method(optional=True)
def block_noise_slopes(array_state_model, width, y, slopes, work):
    """(X_k H)(y) with X_k = B grad Ĥ_k, of noise k and state j in slopes[k * width + j]; for friction."""


@method(default=True)
def block_friction_times(array_state_model, t, width, y, times, work):
    """Times of the noise flows that replace friction over the time t, as ``block_noise_flow`` takes them.

    To order 2 the flow of all friction together, where these flows act in one order in one half of a step and in the
    reverse order in the other half.
    """


@trait(int, default=0)
def frictions(array_state_model):
    """Number of flows of friction of a model whose friction is not along its noises."""


@method(default=True)
def block_friction_flow(array_state_model, k, t, width, y, work):
    """Flow number k of these for the time t, in place."""


@method(optional=True)
def block_energy_flow(array_state_model, k, t, width, y, work):
    """``block_drift_flow`` without friction, where that is a part of it."""


@method(optional=True)
def block_energies(array_state_model, y, energies, work):
    """Put H of all lanes into `energies`, of a model whose flows are in place."""


@method(optional=True)
def block_judged_noises(array_state_model, h, dW, uniforms, first, end, y, work):
    """All noises with their friction, in place, each accepted or not by the energy that it alone changes.

    Returns the number of accepted flows in the lanes from `first` to before `end`.
    """


# ---------------------------------------------------------------------------------------------------------------------
# Models whose flows are not all known in closed form.
#
# Schemes that are no compositions of flows need none of these methods.  A composition replaces the flow of such a piece
# or noise by another method, the inner one, if the model names one, and cannot be used if it names none.
# ---------------------------------------------------------------------------------------------------------------------

#: The methods that may replace an exact flow, see ``schemes/midpoint.py``.
INNER_METHODS = ("midpoint", "munthe_kaas")


@trait(tuple, default=())
def inexact_pieces(model):
    """Numbers k of the pieces H_k whose flows are not known in closed form; ``drift_flow`` is not called for them.

    Such a model has ``piece_gradient`` and ``piece_hessian`` for them.
    """


@trait(tuple, default=())
def inexact_noises(model):
    """Numbers k of the noises whose flows are not known in closed form; ``noise_flow`` is not called for them."""


@trait(str, default="")
def inner(model):
    """The one of :data:`INNER_METHODS` that compositions use for these pieces and noises, "" for none."""


@trait(bool, default=False)
def structure_is_kept(model):
    """Whether B is the same along every flow, its entries being numbers or Casimir functions.

    Then the implicit midpoint rule is a Poisson map, since B has the same value before and after a step.
    """


@method(default=True, compiled=False)
def why_inexact(model, part, k):
    """(formula, reason) of number k of the "pieces" or "noises" without an exact flow."""
    return f"{part}[{k}]", "as the model says"


@method(optional=True)
def piece_gradient(model, k, y):
    """grad H_k(y) of a piece without an exact flow."""


@method(optional=True)
def piece_hessian(model, k, y, v):
    """Hess H_k(y) v of such a piece."""


def flows_lacking(model):
    """(("pieces" or "noises", k), ...) without an exact flow, noises that are off left out."""
    noises = (k for k in inexact_noises(model) if k in noise_indices(model))
    return (*(("pieces", k) for k in inexact_pieces(model)), *(("noises", k) for k in noises))


# ---------------------------------------------------------------------------------------------------------------------
# Models with exact flows of a piece together with noises, or with brackets of noises in common.
#
# Compositions use them in stages of joint flows and of areas.
# ---------------------------------------------------------------------------------------------------------------------


@trait(tuple, default=())
def joint_noises(model):
    """For each piece of H, in order, a tuple of the noises that :func:`joint_flow` moves together with it.

    The flows of these noises commute with that of the piece and are of one family with it, as two rotations about one
    axis are; no noise appears twice.
    """


def joined_noises(model, k):
    """Noises of :func:`joint_noises` of piece k, the ones that are off included."""
    noises_of_pieces = joint_noises(model)
    return noises_of_pieces[k] if k < len(noises_of_pieces) else ()


@trait
def most_joined(model):
    """Largest number of noises of one piece in :func:`joint_noises`."""
    return max(map(len, joint_noises(model)), default=0)


def joint_parts(model):
    """(("joint", k), ("drift", k), ("noise", l), ...): the pieces in order, then the noises joined to none.

    A piece is "joint" where a noise that is on is joined to it, otherwise "drift".
    """
    on = noise_indices(model)
    joined = {k: [j for j in joined_noises(model, k) if j in on] for k in piece_indices(model)}
    of_pieces = [("joint" if joined[k] else "drift", k) for k in joined]
    together = {j for noises_of in joined.values() for j in noises_of}
    return (*of_pieces, *(("noise", j) for j in on if j not in together))


@method(optional=True)
def joint_flow(model, k, t, s, y, angles):
    """exp(t Y_{H_k} + sum_i s[i] Y_{Ĥ_l(i)})(y), l(i) being noise number i of ``joint_noises(model)[k]``.

    For a piece with :func:`joint_noises`.  The tuple s is as long as the longest of those, filled up with 0.
    """


@method(optional=True)
def joint_angle(model, k, t, s, y):
    """Largest |angle| whose sine ``joint_flow(model, k, t, s, y, ...)`` takes; 0 for a flow without angles."""


@method(optional=True)
def bracket_factors(model):
    """(c, ...): {Ĥ_j, Ĥ_i} is c times a function that is the same for all pairs (i, j), i < j, of noises.

    In the order of ``itertools.combinations``; 0 only where the noises commute.
    """


# ---------------------------------------------------------------------------------------------------------------------
# Models at a temperature: the friction that belongs to their noises, see docs/temperature.md.
#
# With X_k = B grad Ĥ_k the equation has the fields -c_k (X_k H) X_k besides, c_k = sigma_k^2 / (2 T).  Along such a
# field the state moves as exp(s(t) X_k) y with s' = -c_k g'(s), g(s) = H(exp(s X_k) y), so that the flow of the noise
# can be used.
# ---------------------------------------------------------------------------------------------------------------------


@trait(bool, default=False)
def has_friction(model):
    """Whether noises come with friction."""


def has_bath(model):
    """Whether friction and noise belong to one another, as at a temperature: together they keep exp(-H/T).

    Friction may be there without noise, as that of a lattice with ``alpha`` alone.
    """
    return has_friction(model) and bool(noise_indices(model))


@method(optional=True)
def friction_time(model, k, t, y):
    """s(t): exp(s(t) X_k) y is the state y after friction along noise k for the time t."""


@device
def friction_rate(model, k):
    """c_k = sigma_k^2 / (2 T) of a model at a temperature."""
    return strengths(model)[k] * strengths(model)[k] / (2.0 * model.temperature)


@device
def friction_after(c, t, slope, bend):
    """s(t) to order 2, given g' = slope and g'' = bend at s = 0; where g is quadratic s = s' t (1 - exp(-q)) / q.

    With s' = -c g' and q = c g'' t.  That quotient is taken as 1 / (1 + q/2 + q^2/12), which is right to third order,
    and never large: friction over long times, or near a maximum of g, is too weak, but cannot carry the state away.
    """
    q = c * t * bend
    return -c * t * slope / (1.0 + q * (0.5 + q * (1.0 / 12.0)))


@trait(tuple, default=())
def linear_friction(model):
    """Numbers of the noises along which friction is linear: X_k X_k H is a number, the same at all states.

    With g'' = X_k X_k H friction and noise over the time t are then one Ornstein-Uhlenbeck flow, s' = -c_k (g'(0) +
    g'' s) + sigma_k dW_k / dt.
    """


@method(optional=True)
def friction_bend(model, k):
    """X_k X_k H of a noise of :func:`linear_friction`."""


@method(optional=True)
def friction_slope(model, k, y):
    """(X_k H)(y) of a model at a temperature."""


@device
def decayed(q):
    """(1 - exp(-q)) / q, the mean of exp(-q s) for s from 0 to 1; 1 for q = 0."""
    q = q if abs(q) > 1e-150 else 1e-150
    return -expm1(-q) / q


# ---------------------------------------------------------------------------------------------------------------------
# Models that depend on time, and models that the solvers without sampling can treat.
# ---------------------------------------------------------------------------------------------------------------------


@method(default=True)
def frozen(model, begin, h):
    """Model as a step from the time `begin` on takes it, where time stands still: itself if nothing depends on it.

    A coefficient c(t) in which H or a noise is linear takes its mean over the step, which is its value for h = 0, a
    strength sigma_k(t) its root mean square; any other t is the middle of the step.  A step of a scheme
    for the model that does not change is then one of the same order, up to 2, for the one that does, see
    docs/driving.md.  (In flows t is their duration.)
    """
    return model


@method(default=True, compiled=False)
def initial_time(model):
    """Time t of formulas at the beginning of an experiment, whose own times begin at 0: a field with that name."""
    return float(getattr(model, "initial_time", getattr(model, "time", 0.0)))  # that of a system in YAML is `time`


@trait(tuple, default=())
def flow_places(model):
    """((place of each piece), (place of each noise)) where these are not their numbers.

    The place is the number of the axis for ``axis_inertias``, 0 of the rotation and 1 of the shear for
    ``rotation_shear_rates``.
    """


# ---------------------------------------------------------------------------------------------------------------------
# Optional methods of a model of many components.
#
# A flow of many components mostly moves few of them at a time, and each few in the same way: by one *shape*, a flow of
# its own in a few components.  Such a flow is a loop over a table of components, of which the code is compiled once,
# where straight-line code in all components takes minutes.  A table is a tuple of groups (shape, count, rows): the
# shape with this number takes the components of each row and moves the first `count` of them.  No row moves a component
# that another one reads.
# ---------------------------------------------------------------------------------------------------------------------

#: The loops over lanes of a model of more components are called, not inlined: the function of a step would become long,
#: and the compiler takes longer than in proportion to the length of a function.
INLINED = 12


def is_inlined(model):
    """Whether the loops over lanes of a model are inlined."""
    return large(model) or dimension(model) <= INLINED


@trait(tuple, default=())
def drift_tables(model):
    """Table of each piece; () for one that ``drift_flow`` moves as a whole."""


@trait(tuple, default=())
def noise_tables(model):
    """Table of each noise, likewise."""


@trait(tuple, default=())
def friction_tables(model):
    """(shape, row) of each noise: the number k of :func:`shape_slopes` and the components on which it depends."""


@trait(int, default=0)
def row_length(model):
    """Length of the tuples y and of the results of :func:`shape_flow`: that of the longest row; the rest is 0."""


@method(optional=True)
def shape_flow(model, k, t, y, angles):
    """Components that shape number k moves, after the time t, given the components of a row as a tuple y."""


@method(optional=True)
def shape_angle(model, k, t, y):
    """Largest |angle| whose sine ``shape_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""


@method(optional=True)
def shape_slopes(model, k, y):
    """(X H, X (X H)) for the field X of a noise, given the components of a row as a tuple y."""
