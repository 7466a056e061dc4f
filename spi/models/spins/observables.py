"""Functions of the states of lattices of spins by name: magnetisation, correlations, the temperature of the spins."""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np

from ...ensemble.protocol import hamiltonian
from .tables import tables

Array = np.ndarray

#: name -> meaning; ``corr`` is followed by the distance.
OBSERVABLES = {
    "mx my mz": "components of the magnetisation, the mean of mu s over the sites",
    "nx ny nz": "the same with the signs of two sublattices, where every bond joins one to the other",
    "corr1 corr2 ...": "the mean of s_i . s_j over sites that are so many cells apart along the first vector",
    "spin_temperature": "sum |s x b|^2 / (2 sum s . b), whose mean is about T where there is no anisotropy",
}


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


def fields(model: Any, states: Array) -> Array:
    """(sites, 3, ...) the fields b of states (3 sites, ...), without that of the anisotropies."""
    of, s = tables(model, np.inf), _components(states)
    here = np.repeat(np.arange(len(of.moment)), np.diff(of.neighbours))
    out = np.broadcast_to(of.field.reshape(*of.field.shape, *[1] * (s.ndim - 2)), s.shape).copy()
    couplings = of.couplings.reshape(-1, 3, 3)
    for row in range(len(couplings)):
        some = of.coupling == row
        np.add.at(out, here[some], np.einsum("ab,ib...->ia...", couplings[row], s[of.other[some]]))
    return out


def _energy(record: Any, states: Array) -> Any:
    rows = np.ascontiguousarray(np.reshape(states, (len(states), -1)).T)
    return np.reshape([hamiltonian(record, row) for row in rows], np.shape(states)[1:])


def _spin_temperature(model: Any, states: Array) -> Any:
    s, b = _components(states), fields(model, states)
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
    named["H"] = functools.partial(_energy, tables(model, np.inf))
    named["spin_temperature"] = functools.partial(_spin_temperature, model)
    return named
