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


@functools.lru_cache(8)
def _couplings(model: Any) -> Any:
    """The sparse matrix (3 sites, 3 sites) that gives the field of the neighbours."""
    of = tables(model, np.inf)
    here, blocks = np.repeat(np.arange(len(of.moment)), np.diff(of.neighbours)), of.couplings[of.coupling]
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


def _fields(model: Any, states: Array) -> Array:
    """(sites, 3, ...) the fields b of states (3 sites, ...), without that of the anisotropies."""
    flat = np.reshape(states, (len(states), -1))
    b = _couplings(model) @ flat + tables(model, np.inf).field.reshape(-1, 1)
    return _components(b.reshape(states.shape))


def _spin_temperature(model: Any, states: Array) -> Any:
    s, b = _components(states), _fields(model, states)
    turning = np.cross(s, b, axis=1)
    return (turning**2).sum(axis=(0, 1)) / (2 * (s * b).sum(axis=(0, 1)))


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
    named["H"] = functools.partial(_energy, model)
    named["spin_temperature"] = functools.partial(_spin_temperature, model)
    return named
