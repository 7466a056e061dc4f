"""Functions of the states of lattices of spins by name, in docs/spins.md: magnetisation, correlations, temperature."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

from .tables import tables

Array = np.ndarray


def _components(states: Array) -> Array:
    """States (3 sites, ...) as (sites, 3, ...)."""
    return np.reshape(states, (-1, 3, *states.shape[1:]))


def _mean(weights: Array, c: int, states: Array) -> Any:
    return np.tensordot(weights, _components(states)[:, c], axes=1)


def _correlation(model: Any, r: int, states: Array) -> Any:
    s = _components(states).reshape(model.size[0], -1, 3, *states.shape[1:])
    other = np.roll(s, -r, axis=0)
    if not model.is_periodic:
        s, other = s[:-r], other[:-r]
    return (s * other).sum(axis=2).mean(axis=(0, 1))


@functools.lru_cache(16)
def _couplings(model: Any, along: int | None = None) -> Any:
    """The sparse matrix (3 sites, 3 sites) that gives the field of the neighbours.

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


def _energy(model: Any, states: Array) -> Any:
    of, flat = tables(model, np.inf), np.reshape(states, (len(states), -1))
    bonds = 0.5 * (flat * (_couplings(model) @ flat)).sum(axis=0) + of.field.ravel() @ flat
    s = flat.reshape(-1, 3, flat.shape[1])
    own = of.uniaxial * (np.tensordot(of.axes[0], s, axes=(0, 1)) ** 2).sum(axis=0)
    own += 0.5 * of.cubic * (s**4).sum(axis=(0, 1)) if of.cubic else 0.0
    return -(bonds + own).reshape(states.shape[1:])


def _fields(model: Any, states: Array, along: int | None = None) -> Array:
    """(sites, 3, ...) the fields of the neighbours of states (3 sites, ...), see :func:`_couplings`."""
    flat = np.reshape(states, (len(states), -1))
    return _components((_couplings(model, along) @ flat).reshape(states.shape))


def _own_fields(model: Any, states: Array) -> Array:
    """(sites, 3, ...) the constant field and those of the anisotropies."""
    of, s = tables(model, np.inf), _components(states)
    more = [1] * (s.ndim - 2)
    along = np.tensordot(of.axes[0], s, axes=(0, 1))[:, np.newaxis] * of.axes[0].reshape(1, 3, *more)
    return of.field.reshape(-1, 3, *more) + 2 * of.uniaxial * along + 2 * of.cubic * s**3


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
    moment = tables(model, np.inf).moment
    return np.tensordot(-0.5 / moment, (s * np.cross(weighted, field, axis=1)).sum(axis=1), axes=1)


def _spin_current(model: Any, along: int, c: int, states: Array) -> Any:
    """Time derivative of the sum of x mu s_c, where the total of mu s_c is conserved."""
    s, weighted = _components(states), _fields(model, states, along)
    return 0.5 * np.cross(s, weighted, axis=1)[:, c].sum(axis=0)


def _torques(model: Any, states: Array) -> Any:
    """Sum over the sites of |s x b|^2, the square of the gradient of H on the spheres."""
    return (np.cross(_components(states), field_at(model, states), axis=1) ** 2).sum(axis=(0, 1))


def _laplacian(model: Any, states: Array) -> Any:
    """The Laplacian of H on the spheres: 2 s . b of bonds and the field, and 6 K u^2 - 2 K, 10 K_4 s_c^4 - 6 K_4.

    A homogeneous polynomial h of degree l has the Laplacian of space less l (l + 1) h.
    """
    of, s, more = tables(model, np.inf), _components(states), [1] * (np.ndim(states) - 1)
    linear = _fields(model, states) + of.field.reshape(-1, 3, *more)
    u = np.tensordot(of.axes[0], s, axes=(0, 1))
    own = of.uniaxial * (6 * u**2 - 2) + of.cubic * (10 * (s**4).sum(axis=1) - 6)
    return 2 * (s * linear).sum(axis=(0, 1)) + own.sum(axis=0)


def _spin_temperature(model: Any, states: Array) -> Any:
    return _torques(model, states) / _laplacian(model, states)


def _charge(model: Any, states: Array) -> Any:
    """The topological charge in two dimensions: the solid angles of both triangles of each cell over 4 pi.

    tan of half an angle is a . (b x c) / (1 + a . b + b . c + c . a) (Berg and Luescher, Nuclear Physics B 190, 1981).
    """
    s = np.moveaxis(_components(states).reshape(*model.size, 3, *np.shape(states)[1:]), 2, 0)
    right, above = np.roll(s, -1, axis=1), np.roll(s, -1, axis=2)
    corner, total = np.roll(above, -1, axis=1), 0.0
    for a, b, c in ((s, right, corner), (s, corner, above)):
        volume = (a * np.cross(b, c, axis=0)).sum(axis=0)
        total = total + np.arctan2(volume, 1 + (a * b + b * c + c * a).sum(axis=0)).sum(axis=(0, 1))
    return total / (2 * np.pi)


def _conserves(model: Any, c: int) -> bool:
    """Whether the total of mu s_c is conserved: a turn about axis c changes neither a bond nor the energy of a site."""
    of, turn = tables(model, np.inf), np.cross(np.eye(3)[c], np.eye(3))
    bonds = all(np.allclose(turn @ a, a @ turn, atol=1e-14) for a in of.couplings.reshape(-1, 3, 3))
    axis_is_kept = not of.uniaxial or np.allclose(turn @ of.axes[0], 0)
    return bonds and axis_is_kept and not of.cubic and np.allclose(of.field @ turn, 0)


@functools.lru_cache(8)
def observables_of(model: Any) -> dict[str, Callable[[Array], Any]]:
    """The observables of a lattice by name."""
    lattice = model.sites
    moment = tables(model, np.inf).moment / lattice.sites
    named: dict[str, Callable[[Array], Any]] = {
        f"m{x}": functools.partial(_mean, moment, c) for c, x in enumerate("xyz")
    }
    if lattice.site_colours.max() == 1:
        staggered = moment * (1 - 2 * lattice.site_colours)
        named |= {f"n{x}": functools.partial(_mean, staggered, c) for c, x in enumerate("xyz")}
    farthest = model.size[0] // 2 if model.is_periodic else model.size[0] - 1
    named |= {f"corr{r}": functools.partial(_correlation, model, r) for r in range(1, farthest + 1)}
    for along in range(len(model.size)):
        number = along + 1 if len(model.size) > 1 else ""
        named[f"energy_current{number}"] = functools.partial(_energy_current, model, along)
        named |= {
            f"spin_current_{x}{number}": functools.partial(_spin_current, model, along, c)
            for c, x in enumerate("xyz")
            if _conserves(model, c)
        }
    if model.is_periodic and len(model.size) == 2 and len(model.cell.sites) == 1:
        named["charge"] = functools.partial(_charge, model)
    named["H"] = functools.partial(_energy, model)
    named["torque2"] = functools.partial(_torques, model)
    named["laplacian"] = functools.partial(_laplacian, model)
    named["spin_temperature"] = functools.partial(_spin_temperature, model)
    return named
