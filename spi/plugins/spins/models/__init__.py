"""Lattices of classical spins |s_i| = 1 of moments mu_i, with damping and noise: so(3)^n with brackets over mu_i.

    H = -sum over bonds (s . J s' + D . (s x s')) - sum over sites (mu B . s + K (a . s)^2 + K_4 / 2 sum_c s_c^4),

    mu s' = b x s + alpha (b - (s . b) s) + noise,    b = -grad_s H.

With a temperature T every spin turns by the noise sigma dW x s, sigma^2 = 2 alpha T / mu, in three independent Wiener
processes a spin, for which exp(-H/T) is stationary.  The signs are those of the program Spirit.
"""

import math
from itertools import chain
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Gt, Le, Len

from spi.ensemble.protocol import dimension, flow_ns, noises, parameters, pieces
from spi.models.delegation import answering_as_inner

from .cells import call_of_sums
from .driving import Course, is_driven
from .lattices import LATTICES, Cell, Lattice, lattice
from .observables import observables_of
from .tables import in_kernels
from .whole import SampledGibbs, WholeLattice

Vector = tuple[float, float, float]
SiteField = tuple[Course, Course, Course]
_MOST_NAMED = 4096  # sites whose components have names in formulas
_MOST_SITES = 2**24  # channels of the random numbers
_SWEEPS = 1000  # over a lattice, by which a state of the Gibbs law is drawn


def in_words(record: Any) -> str:
    """Fields of a record that are not as by default."""
    fields = record._asdict().items()
    return ", ".join(f"{key} {value}" for key, value in fields if value != record._field_defaults.get(key))


class Terms(NamedTuple):
    """Terms of some bonds of the cell."""

    exchange: Annotated[float | Vector, "J, or [Jx, Jy, Jz]"] = 0.0
    dm: Annotated[float | Vector, "the Dzyaloshinskii-Moriya vector D, or its length along the bond"] = 0.0
    matrix: Annotated[tuple[Vector, Vector, Vector] | None, "J as a matrix, in -s . J s', besides these"] = None
    types: Annotated[tuple[int, ...], "numbers of bonds of the cell, from 0 on; default: all"] = ()

    __str__ = in_words


class Anisotropy(NamedTuple):
    """Anisotropy of all sites."""

    uniaxial: Annotated[float, "K of -K (a . s)^2"] = 0.0
    axis: Annotated[Vector, "its axis a"] = (0.0, 0.0, 1.0)
    cubic: Annotated[float, "K_4 of -K_4 / 2 (s_x^4 + s_y^4 + s_z^4)"] = 0.0

    __str__ = in_words


class Transport(NamedTuple):
    """Noise without a temperature: every spin turns at random."""

    sigma: Annotated[float, Gt(0), "its strength"]
    axis: Annotated[Vector | None, "the axis about which spins turn; default: any, by three Wiener processes"] = None
    order: Annotated[tuple[int, ...], "numbers of the Wiener processes, site after site; default: 0, 1, ..."] = ()

    __str__ = in_words


class Spins(NamedTuple):
    """A lattice of classical spins, states (x, y, z) of site after site, of length 1."""

    lattice: Annotated[
        Literal[
            *("chain", "ring", "square", "triangular", "honeycomb", "cubic", "bcc", "kagome"),
            *("ring_j1_j2", "square_j1_j2", "honeycomb_j1_j2"),
        ]
        | Cell,
        "the lattice, or a cell of your own with sites, vectors and bonds",
    ]
    size: Annotated[tuple[Annotated[int, Ge(1)], ...], Len(1, 3), "cells along each vector"]
    bonds: Annotated[tuple[Terms, ...], "terms of bonds, as in {exchange: 1}, or a list by types of bonds"] = ()
    field: Annotated[
        SiteField | tuple[SiteField, ...],
        "the field B of every site, or of the sites of a cell; numbers, or functions of t",
    ] = (
        0.0,
        0.0,
        0.0,
    )
    anisotropy: Annotated[Anisotropy, "as in {uniaxial: 0.1, axis: [0, 0, 1]}"] = Anisotropy()
    mu: Annotated[
        Annotated[float, Gt(0)] | tuple[Annotated[float, Gt(0)], ...], "moment of every site, or of the sites of a cell"
    ] = 1.0
    alpha: Annotated[float, Ge(0), Le(100), "damping; at a temperature the noise belongs to it"] = 0.0
    noise: Annotated[Transport | None, "noise without a temperature, as in {sigma: 0.1}"] = None
    boundary: Annotated[Literal["periodic", "open"] | None, "default: open for a chain, periodic for the others"] = None
    by: Annotated[
        Literal["bonds", "sites"], "pieces of H: bonds, which conserve the total spin, or sites, which conserve H"
    ] = "bonds"

    variables: Annotated[
        tuple[str, ...], "names of the components, by default x(1), y(1), z(1), x(2), ...; at most those of 4096 sites"
    ] = ()
    initial_time: Annotated[float, "t of a field in time at the beginning of the experiment"] = 0.0

    large, in_place = True, True
    conserved, sphere_size = 1, 3

    def has_friction(model):
        return isinstance(model, Spins) and model.alpha > 0  # of the class it is not known

    def dimension(model):
        return 3 * len(model.cell.sites) * math.prod(model.size)

    def pieces(model):
        return pieces(model.in_kernels())

    def flow_ns(model):
        return flow_ns(model.in_kernels())

    def noises(model):
        if model.noise is None:
            return 0
        return dimension(model) // (1 if model.noise.axis is None else 3)

    def in_kernels(model):
        return in_kernels(model, math.inf)

    def at_temperature(model, temperature):
        return ThermalSpins(model, temperature)

    def bath_fault(model):
        if model.alpha > 0:
            return None
        if model.variables:
            return "is given beside lattice, whose flows have no friction", "leave out one of them"
        if noises(model):
            right = "leave out one of them; at a temperature noise belongs to alpha, a number above 0"
            return "is given beside a noise that does not belong to it", right
        right = "leave it out, or give alpha a number above 0"
        return "is given to a model without noise, which nothing would bring to it", right

    def function_calls(model):
        return [call_of_sums(model)]

    def one_path(model, scheme, h):
        return None if is_driven(model) else WholeLattice.of(model, math.inf, scheme, h)

    def gibbs_law(model, temperature, sweeps):
        return SampledGibbs(model, temperature, sweeps or _SWEEPS)

    def fault(model):
        return _fault(model)

    def state_fault(model, y):
        s = np.reshape(np.asarray(y), (-1, 3))
        lengths = np.sqrt(np.einsum("ij,ij->i", s, s))
        away = abs(lengths - 1)
        if away.max() < 1e-9:
            return None
        worst = int(np.argmax(away))
        return f"has the spin {worst + 1} of length {lengths[worst]:.6g}", "spins must have length 1"

    def parameters(model):
        """All fields, but a time only where something depends on it."""
        return {key: value for key, value in model._asdict().items() if key != "initial_time" or is_driven(model)}

    def geometry(model):
        cell = model.cell
        place = {"sites": cell.sites, "vectors": cell.vectors, "fractions": cell.fractions.tolist()}
        return {"on": "lattice", **place, "size": model.size, "periodic": model.is_periodic}

    def observables(model):
        return observables_of(model)

    def component_names(model):
        """None of very many."""
        count = dimension(model) // 3
        if model.variables or count > _MOST_NAMED:
            return model.variables
        return tuple(f"{x}({i})" for i in range(1, count + 1) for x in "xyz")

    def named_numbers(model):
        """Fields that are numbers, n sites, and the numbers of a definition."""
        numbers = {key: x for key, x in parameters(model).items() if isinstance(x, float)}
        return numbers | {"n": dimension(model) // 3} | _NAMED.get(model, {})

    @property
    def cell(model) -> Cell:
        """Cell that repeats."""
        return LATTICES[model.lattice] if isinstance(model.lattice, str) else model.lattice

    @property
    def is_periodic(model) -> bool:
        """Whether bonds go around."""
        return (model.boundary or ("open" if model.lattice == "chain" else "periodic")) == "periodic"

    @property
    def sites(model) -> Lattice:
        """Sites and bonds."""
        return lattice(model.cell, model.size, model.is_periodic)


_NAMED: dict[Spins, dict[str, float]] = {}


def name_numbers(model: Spins, numbers: dict[str, float]) -> None:
    """Have formulas about a model name further numbers in this process, those of the definition that it was made of."""
    _NAMED[model] = numbers


@answering_as_inner()
class ThermalSpins(NamedTuple):
    """Spins at a temperature."""

    model: Spins
    temperature: float

    large = True

    def has_friction(model):
        return True

    def noises(model):
        return dimension(model.model)

    def in_kernels(model):
        return in_kernels(model.model, model.temperature)

    def one_path(model, scheme, h):
        return None if is_driven(model.model) else WholeLattice.of(model.model, model.temperature, scheme, h)


def _fault(model):
    parts = (_faults_of_lattice, _faults_of_terms, _faults_of_noise, _faults_of_bonds)
    return next(chain.from_iterable(part(model) for part in parts), None)


def _faults_of_lattice(model):
    cell = model.cell
    if len(model.size) != len(cell.vectors):
        yield "size", f"has {len(model.size)} numbers", f"must have {len(cell.vectors)}, one for each vector"
    if math.prod(model.size) * len(cell.sites) > _MOST_SITES:
        memory = 9 * 8 * 64 * math.prod(model.size) * len(cell.sites) / 2**30
        yield "size", f"has more than 2^24 spins, which take {memory:.3g} GiB", "must be smaller"
    for number, (first, second, shift) in enumerate(cell.bonds):
        if not (0 <= first < len(cell.sites) and 0 <= second < len(cell.sites)):
            yield "lattice", f"has bond {number} to a site that is not there", f"sites are 0 .. {len(cell.sites) - 1}"
        if any(shift[len(cell.vectors) :]):
            yield "lattice", f"has bond {number} along a vector that is not there", "give 0 for it"


def _faults_of_terms(model):
    sites, types = len(model.cell.sites), range(len(model.cell.bonds))
    for number, terms in enumerate(model.bonds):
        if any(kind not in types for kind in terms.types):
            yield "bonds", f"has types that are not there in entry {number}", f"types are 0 .. {len(types) - 1}"
    if len(np.shape(model.field)) > 1 and len(model.field) != sites:
        yield "field", f"has {len(model.field)} vectors", f"must be one, or have {sites}"
    if model.initial_time and not is_driven(model):
        yield "initial_time", f"is {model.initial_time:g}, and no field depends on the time t", "leave it out"
    if model.variables and len(set(model.variables)) != dimension(model):
        yield "variables", f"has {len(set(model.variables))} different names", f"must have {dimension(model)}"
    if not isinstance(model.mu, float) and len(model.mu) != sites:
        yield "mu", f"has {len(model.mu)} numbers", f"must have one, or {sites}"
    if not any(model.anisotropy.axis):
        yield "anisotropy", "has an axis of length 0", "give a direction"


def _faults_of_noise(model):
    if not model.noise:
        return
    if model.noise.axis is not None and not any(model.noise.axis):
        yield "noise", "has an axis of length 0", "give a direction"
    if model.noise.order and sorted(model.noise.order) != [*range(noises(model))]:
        yield "noise", "has an order that does not name each Wiener process once", f"they are 0 .. {noises(model) - 1}"
    if model.alpha > 0:
        yield "noise", "is given beside alpha", "leave out one of them; at a temperature noise belongs to alpha"


def _faults_of_bonds(model):
    reach = 2 + 2 * max(abs(step) for _, _, shift in model.cell.bonds for step in shift)
    try:  # of a small lattice, which has the same faults
        lattice(model.cell, tuple(min(length, reach) for length in model.size), model.is_periodic)
    except ValueError as error:
        yield "lattice", f"{error}", "take a larger size, or other bonds"
