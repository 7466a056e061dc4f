"""Functions of the states of lattices of spins by name, in docs/spins.md: magnetisation, correlations, temperature."""

import functools
import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from scipy import sparse

from spi.ensemble.long_states import LONG
from spi.ensemble.protocol import dimension
from spi.numerics.types import Array

from .cells import bond_energy, neighbour_fields
from .driving import is_driven
from .lattices import lattice
from .tables import bond_matrices, tables, unit

_SLAB = 2**16  # spins of which the solid angles are computed at a time


def _components(states: Array) -> Array:
    """States (3 sites, ...) as (sites, 3, ...)."""
    return np.reshape(states, (-1, 3, *states.shape[1:]))


def _is_long(model: Any) -> bool:
    """Whether states are so long that they are looked at one by one, without tables of the sites."""
    return dimension(model) > LONG


def _of_cell(model: Any, given: Any, shape: tuple[int, ...] = ()) -> Array:
    """(sites of the cell, ...): what is given for all sites of the cell, or for each."""
    per_cell = len(model.cell.sites)
    values = np.reshape(np.array(given, float), (-1, *shape))
    return np.broadcast_to(values, (per_cell, *shape))


def _field(model: Any) -> Array:
    """(sites of the cell, 3): mu times the field."""
    return _of_cell(model, model.mu)[:, np.newaxis] * _of_cell(model, model.field, (3,))


@functools.lru_cache(4)
def _weights(model: Any, staggered: bool) -> Array:
    """(sites,): the moments over the number of sites, with the signs of the sublattices if `staggered`."""
    sites = dimension(model) // 3
    weights = np.tile(_of_cell(model, model.mu), math.prod(model.size)) / sites
    return weights * _signs(model) if staggered else weights


@functools.lru_cache(8)
def _sublattices(model: Any) -> Any:
    """A lattice of few cells with as many sublattices, as lengths that go around have the same parity, and its size."""
    reach = 2 + 2 * max(abs(step) for _, _, shift in model.cell.bonds for step in shift)
    size = tuple(min(length, reach + (length % 2 if model.is_periodic else 0)) for length in model.size)
    return lattice(model.cell, size, model.is_periodic), size


def _signs(model: Any) -> Array:
    """(sites,) 1 or -1: on which of two sublattices a site is."""
    few, size = _sublattices(model)
    signs = (1 - 2 * few.site_colours).reshape(*size, -1)
    for axis, (length, short) in enumerate(zip(model.size, size, strict=True)):
        signs = np.take(
            signs, np.arange(length) % (2 if short % 2 == 0 else 1) if length > short else range(short), axis
        )
    return signs.ravel()


def _sum(values: Array) -> Any:
    """Sum over the first axis, which is long, in pairs of neighbours."""
    return np.ascontiguousarray(np.moveaxis(values, 0, -1)).sum(axis=-1)


def _mean(model: Any, staggered: bool, c: int, states: Array) -> Any:
    weights, along = _weights(model, staggered), _components(states)[:, c]
    if _is_long(model):  # a sum whose bits depend on no library
        return _sum(weights.reshape(-1, *[1] * (along.ndim - 1)) * along)
    return np.tensordot(weights, along, axes=1)


def _correlation(model: Any, r: int, states: Array) -> Any:
    s = _components(states).reshape(model.size[0], -1, 3, *states.shape[1:])
    other = np.roll(s, -r, axis=0)
    if not model.is_periodic:
        s, other = s[:-r], other[:-r]
    return (s * other).sum(axis=2).mean(axis=(0, 1))


@functools.lru_cache(16)
def _couplings(model: Any, along: int | None = None) -> Any:
    """Sparse matrix (3 sites, 3 sites) that gives the field of the neighbours.

    With `along` each neighbour counts by how far away it is along that vector, in cells.
    """
    of = tables(model, np.inf)
    here, blocks = np.repeat(np.arange(len(of.moment)), np.diff(of.neighbours)), of.couplings[of.coupling]
    if along is not None:
        there = model.cell.displacements[:, along]
        blocks = blocks * np.stack([there, -there], axis=1).ravel()[of.coupling, np.newaxis]
    rows = 3 * here[:, np.newaxis] + np.repeat(np.arange(3), 3)
    columns = 3 * of.other[:, np.newaxis] + np.tile(np.arange(3), 3)
    size = 3 * len(of.moment)
    return sparse.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))


def _each(f: Callable[[Array], Any], states: Array) -> Array:
    """f of state after state of (d, ...), stacked along the last axes."""
    flat = np.reshape(states, (len(states), -1))
    values = np.stack([f(np.ascontiguousarray(flat[:, k])) for k in range(flat.shape[1])], axis=-1)
    return values.reshape((*values.shape[:-1], *states.shape[1:]))


def _energy_of(model: Any, y: Array) -> float:
    """H of one long state."""
    s = y.reshape(-1, 3)
    of_fields = s.reshape(-1, len(model.cell.sites), 3).sum(axis=0)
    energy = bond_energy(model, y) - float((_field(model) * of_fields).sum())
    if model.anisotropy.uniaxial:
        axis = unit(model.anisotropy.axis)
        along = s[:, 0] * axis[0] + s[:, 1] * axis[1] + s[:, 2] * axis[2]
        energy -= model.anisotropy.uniaxial * float(np.square(along, out=along).sum())
    return energy - (0.5 * model.anisotropy.cubic * float((y**4).sum()) if model.anisotropy.cubic else 0.0)


def _energy(model: Any, states: Array) -> Any:
    if _is_long(model):
        return _each(functools.partial(_energy_of, model), states)
    of, flat = tables(model, np.inf), np.reshape(states, (len(states), -1))
    bonds = 0.5 * (flat * (_couplings(model) @ flat)).sum(axis=0) + of.field.ravel() @ flat
    s = flat.reshape(-1, 3, flat.shape[1])
    own = of.uniaxial * (np.tensordot(of.axes[0], s, axes=(0, 1)) ** 2).sum(axis=0)
    own += 0.5 * of.cubic * (s**4).sum(axis=(0, 1)) if of.cubic else 0.0
    return -(bonds + own).reshape(states.shape[1:])


def _fields(model: Any, states: Array, along: int | None = None) -> Array:
    """(sites, 3, ...) the fields of the neighbours of states (3 sites, ...), see :func:`_couplings`."""
    if _is_long(model):
        return _each(lambda y: neighbour_fields(model, y, along), states)
    flat = np.reshape(states, (len(states), -1))
    return _components((_couplings(model, along) @ flat).reshape(states.shape))


def _own_fields(model: Any, states: Array) -> Array:
    """(sites, 3, ...) the constant field and those of the anisotropies."""
    s, axis, own = _components(states), unit(model.anisotropy.axis), model.anisotropy
    more = [1] * (s.ndim - 2)
    along = np.tensordot(axis, s, axes=(0, 1))[:, np.newaxis] * axis.reshape(1, 3, *more)
    field = np.tile(_field(model), (math.prod(model.size), 1))
    return field.reshape(-1, 3, *more) + 2 * own.uniaxial * along + 2 * own.cubic * s**3


def field_at(model: Any, states: Array) -> Array:
    """(sites, 3, ...) the field b = -grad_s H at each spin of states (3 sites, ...)."""
    return _fields(model, states) + _own_fields(model, states)


def _energy_current(model: Any, along: int, states: Array) -> Any:
    """Time derivative of the sum of x e over bonds, at their middles, and sites, x along a vector of the cell.

    Bonds that share site i exchange {e, e'}; their sum by pairs is -s . (B x b) / (2 mu), B the fields of neighbours
    weighted by how far away they are, b the field.
    """
    s, weighted = _components(states), _fields(model, states, along)
    field = field_at(model, states)
    moment = np.tile(_of_cell(model, model.mu), math.prod(model.size))
    return np.tensordot(-0.5 / moment, (s * np.cross(weighted, field, axis=1)).sum(axis=1), axes=1)


def _spin_current(model: Any, along: int, c: int, states: Array) -> Any:
    """Time derivative of the sum of x mu s_c, where the total of mu s_c is conserved."""
    s, weighted = _components(states), _fields(model, states, along)
    return 0.5 * np.cross(s, weighted, axis=1)[:, c].sum(axis=0)


def _torques(model: Any, states: Array) -> Any:
    """Sum over the sites of |s x b|^2, the square of the gradient of H on the spheres."""
    return (np.cross(_components(states), field_at(model, states), axis=1) ** 2).sum(axis=(0, 1))


def _laplacian(model: Any, states: Array) -> Any:
    """Laplacian of H on the spheres: 2 s . b of bonds and the field, and 6 K u^2 - 2 K, 10 K_4 s_c^4 - 6 K_4.

    A homogeneous polynomial h of degree l has the Laplacian of space less l (l + 1) h.
    """
    s, more, own = _components(states), [1] * (np.ndim(states) - 1), model.anisotropy
    linear = _fields(model, states) + np.tile(_field(model), (math.prod(model.size), 1)).reshape(-1, 3, *more)
    u = np.tensordot(unit(own.axis), s, axes=(0, 1))
    of_sites = own.uniaxial * (6 * u**2 - 2) + own.cubic * (10 * (s**4).sum(axis=1) - 6)
    return 2 * (s * linear).sum(axis=(0, 1)) + of_sites.sum(axis=0)


def _spin_temperature(model: Any, states: Array) -> Any:
    return _torques(model, states) / _laplacian(model, states)


def _charge(model: Any, states: Array) -> Any:
    """Topological charge in two dimensions: the solid angles of both triangles of each cell over 4 pi.

    tan of half an angle is a . (b x c) / (1 + a . b + b . c + c . a) (Berg and Luescher, Nuclear Physics B 190, 1981).
    On an open lattice there is a cell between each four sites, and the sum is no whole number.
    """
    s = np.moveaxis(_components(states).reshape(*model.size, 3, *np.shape(states)[1:]), 2, 0)
    length, total = model.size[0] - (not model.is_periodic), 0.0
    rows = max(1, _SLAB // model.size[1]) if _is_long(model) else length
    for begin in range(0, length, rows):
        here = s[:, begin : min(begin + rows, length)]
        there = np.take(s, np.arange(begin + 1, begin + 1 + here.shape[1]) % model.size[0], axis=1)
        total = total + _angles(here, there, model.is_periodic)
    return total / (2 * np.pi)


def _angles(here: Array, right: Array, periodic: bool) -> Any:
    """Half of the solid angles of the cells between rows and the next ones."""
    above, corner = np.roll(here, -1, axis=2), np.roll(right, -1, axis=2)
    if not periodic:
        here, right, above, corner = (rows[:, :, :-1] for rows in (here, right, above, corner))
    total = 0.0
    for a, b, c in ((here, right, corner), (here, corner, above)):
        volume = (a * np.cross(b, c, axis=0)).sum(axis=0)
        total = total + np.arctan2(volume, 1 + (a * b + b * c + c * a).sum(axis=0)).sum(axis=(0, 1))
    return total


def _lengths(model: Any, states: Array) -> Any:
    """The mean of |s|^2, the Casimir function."""
    if _is_long(model):
        return _each(lambda y: np.square(y).sum() / (len(y) // 3), states)
    return _sum(states**2) / (len(states) // 3)


def _conserves(model: Any, c: int) -> bool:
    """Whether the total of mu s_c is conserved: a turn about axis c changes neither a bond nor the energy of a site."""
    own, turn = model.anisotropy, np.cross(np.eye(3)[c], np.eye(3))
    bonds = all(np.allclose(turn @ a, a @ turn, atol=1e-14) for a in bond_matrices(model))
    axis_is_kept = not own.uniaxial or np.allclose(turn @ unit(own.axis), 0)
    return bonds and axis_is_kept and not own.cubic and np.allclose(_field(model) @ turn, 0)


_CORRELATION = re.compile(r"corr([1-9]\d*)")


class Observables(Mapping[str, Callable[[Array], Any]]):
    """Observables of a lattice by name; those of all distances are made when they are asked for."""

    def __init__(self, model: Any) -> None:
        self.model, self.named = model, _named(model)
        self.farthest = model.size[0] // 2 if model.is_periodic else model.size[0] - 1

    def __getitem__(self, name: str) -> Callable[[Array], Any]:
        match = _CORRELATION.fullmatch(name)
        if match and int(match[1]) <= self.farthest:
            return functools.partial(_correlation, self.model, int(match[1]))
        return self.named[name]

    def __iter__(self) -> Iterator[str]:
        return itertools.chain(self.named, (f"corr{r}" for r in range(1, self.farthest + 1)))

    def __len__(self) -> int:
        return len(self.named) + self.farthest


@functools.lru_cache(8)
def observables_of(model: Any) -> Mapping[str, Callable[[Array], Any]]:
    """Observables of a lattice by name."""
    return Observables(model)


def _named(model: Any) -> dict[str, Callable[[Array], Any]]:
    """Observables but those of all distances."""
    named: dict[str, Callable[[Array], Any]] = {
        f"m{x}": functools.partial(_mean, model, False, c) for c, x in enumerate("xyz")
    }
    driven = is_driven(model)  # then what has the field in it is no function of the state
    if _sublattices(model)[0].site_colours.max() == 1:
        named |= {f"n{x}": functools.partial(_mean, model, True, c) for c, x in enumerate("xyz")}
    for along in range(len(model.size) if not driven else 0):
        number = along + 1 if len(model.size) > 1 else ""
        named[f"energy_current{number}"] = functools.partial(_energy_current, model, along)
        named |= {
            f"spin_current_{x}{number}": functools.partial(_spin_current, model, along, c)
            for c, x in enumerate("xyz")
            if _conserves(model, c)
        }
    if len(model.size) == 2 and len(model.cell.sites) == 1:
        named["charge"] = functools.partial(_charge, model)
    if _is_long(model):
        named |= dict.fromkeys(("C", "C1"), functools.partial(_lengths, model))
    if driven:
        return named
    named["H"] = functools.partial(_energy, model)
    named["torque2"] = functools.partial(_torques, model)
    named["laplacian"] = functools.partial(_laplacian, model)
    named["spin_temperature"] = functools.partial(_spin_temperature, model)
    return named
