"""Linear waves of spins about a state in which H has a minimum: their frequencies, which are drawn over S(q, omega).

With tangents t_1 and t_2 = s x t_1 at each spin s of the state, small turns u_1 t_1 + u_2 t_2 move by

    mu u_1' = -(K u)_2,    mu u_2' = (K u)_1,    K the second derivative of H on the spheres.

A wave with exp(i (q . x - omega t)) belongs to the peak of S(q, omega) at this omega > 0, since s_q is the sum of
exp(-i q . x_j) s_j.  That with -q and -omega is the same motion, so that omega(q) and omega(-q) may differ.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble import loop
from spi.ensemble.protocol import in_kernels
from spi.ensemble.random_states import RandomState
from spi.models.delegation import undamped
from spi.numerics.types import Array
from spi.plugins.spins.models import Spins
from spi.plugins.spins.models.observables import field_at
from spi.specs.keys import quantity, wrong

_MOST = 256  # spins of which linear waves are computed
_SMALL = 1e-4  # the angle by which a spin is turned for derivatives
_TURNED = 1e-6  # relative: a torque, or a second derivative, that is not 0
_SEEN = 1e-9  # relative: the weight of a wave that is seen at a wave vector
_KEYS = ("time_correlations", "about")


def check(case: Any) -> None:
    """Raise the error about a state that is none, or about which waves are no small ones."""
    model = undamped(case.model)
    if model.sites.sites > _MOST:
        mistake = f"is for at most {_MOST} spins, and there are {model.sites.sites}"
        raise wrong(mistake, "leave it out", *_KEYS)
    s = state_about(case)
    b = field_at(model, s.ravel())
    torque = float(np.linalg.norm(np.cross(b, s), axis=1).max())
    if torque > _TURNED * np.linalg.norm(b, axis=1).max():
        mistake = f"is no state at rest: the largest torque on a spin is {quantity(torque)}"
        raise wrong(mistake, "give directions in which H has a minimum", *_KEYS)
    bends = np.linalg.eigvalsh(_second_derivative(model, s, _tangents(s)))
    if bends[0] < -_TURNED * abs(bends).max():
        mistake = f"is a state in which H has no minimum: its least second derivative is {bends[0]:.6g}"
        raise wrong(mistake, "give one direction for each site of a cell or sublattice, as [[0,0,1], [0,0,-1]]", *_KEYS)


def state_about(case: Any) -> Array:
    """(sites, 3) the state about which there are waves; raises the error about it if there is none."""
    given, model = case.time_correlations.about, undamped(case.model)
    if given == "initial":
        if isinstance(case.initial, RandomState):
            raise wrong("is 'initial', but each path begins at a state of its own", "give directions", *_KEYS)
        return np.reshape(case.initial, (-1, 3))
    directions, lattice = np.reshape(given, (-1, 3)), model.sites
    per_cell, colours = len(model.cell.sites), int(lattice.site_colours.max()) + 1
    places = {1: np.zeros(lattice.sites, int), colours: lattice.site_colours, per_cell: lattice.of_cell}
    if len(directions) not in places:
        if len(directions) == 2 and per_cell == 1:  # two sublattices, and a way around the lattice has odd length
            fault = f"has 2 directions, and 2 sublattices do not fit a lattice of {' x '.join(map(str, model.size))}"
            raise wrong(fault, "take even lengths if the bonds allow it, or one direction", *_KEYS)
        of_cell = f", or {per_cell} for the sites of a cell" if per_cell > 1 else ""
        right = f"must be one{of_cell}, or {colours} for the sublattices"
        raise wrong(f"has {len(directions)} directions", right, *_KEYS)
    if not directions.any(axis=1).all():
        raise wrong("has a direction of length 0", "give a direction as [0, 0, 1]", *_KEYS)
    return (directions / np.linalg.norm(directions, axis=1, keepdims=True))[places[len(directions)]]


def _tangents(s: Array) -> Array:
    """(sites, 2, 3) two tangents at each spin, the second being s x the first."""
    away = np.eye(3)[abs(s).argmin(axis=1)]
    first = away - (away * s).sum(axis=1, keepdims=True) * s
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(s, first)], axis=1)


def _second_derivative(model: Spins, s: Array, tangents: Array) -> Array:
    """(2 sites, 2 sites) that of H on the spheres at a state at rest: minus that of the field, plus b . s."""
    sites = len(s)
    moved = np.zeros((sites, 3, sites, 2))
    moved[np.arange(sites), :, np.arange(sites)] = _SMALL * tangents.transpose(0, 2, 1)
    before, after = (field_at(model, s.reshape(-1, 1) + sign * moved.reshape(3 * sites, -1)) for sign in (-1, 1))
    change = np.einsum("jac,jcn->jan", tangents, (after - before) / (2 * _SMALL))
    along = np.repeat((field_at(model, s.ravel()) * s).sum(axis=1), 2)
    bent = np.diag(along) - change.reshape(2 * sites, -1)
    return (bent + bent.T) / 2


def linear_waves(case: Any, waves: Array) -> tuple[Array, Array]:
    """(Q, branches) of the equation, and of a step of the first scheme: the frequencies that are seen at wave vectors.

    `waves` (Q, vectors) are whole numbers of waves along the lattice.  Branches are in the order of their frequencies,
    NaN where a wave is not seen; their number is that of the sites of the smallest cell that repeats with the state.
    A wave of the step is the one that is most like that of the equation.
    """
    model = undamped(case.model)._replace(alpha=0.0, noise=None)
    s = state_about(case)
    tangents = _tangents(s)
    turning = np.array([[0.0, -1.0], [1.0, 0.0]])
    moment = in_kernels(model).moment
    bent = _second_derivative(model, s, tangents).reshape(len(s), 2, -1)
    rates = (np.einsum("uv,jvn->jun", turning, bent) / moment[:, np.newaxis, np.newaxis]).reshape(2 * len(s), -1)
    of_step, vectors = _waves_of_step(case, model, s, tangents)
    member, members = _repeating(model, s)
    places = _places(model)
    exact, nearest = np.full((2, len(waves), members), np.nan)
    for n, q in enumerate(waves / np.array(model.size)):
        each = np.zeros((len(s), 2, members, 2), complex)
        for u in range(2):
            each[np.arange(len(s)), u, member, u] = np.exp(2j * np.pi * places @ q) / math.sqrt(len(s) / members)
        bloch = each.reshape(2 * len(s), -1)
        values, modes = np.linalg.eig(np.conj(bloch.T) @ rates @ bloch)
        positive = np.argsort(-values.imag)[-members:]  # motions exp(-i omega t)
        modes = bloch @ modes[:, positive]
        seen = np.einsum("j,jun,juc->nc", np.exp(-2j * np.pi * places @ q), modes.reshape(len(s), 2, -1), tangents)
        weight = (abs(seen) ** 2).sum(axis=1) / len(s)
        there = weight > _SEEN * max(1.0, weight.max())
        exact[n] = np.where(there, -values.imag[positive], np.nan)
        like = abs(np.conj(modes.T) @ vectors).argmax(axis=1)
        nearest[n] = np.where(there, of_step[like], np.nan)
    return exact, nearest


def _waves_of_step(case: Any, model: Spins, s: Array, tangents: Array) -> tuple[Array, Array]:
    """(frequencies, vectors in columns) of positive frequency of the derivative of one step of the first scheme."""
    row, sites = case.row(case.schemes[0]), len(s)
    turned = np.zeros((2, sites, 2, sites, 3)) + s
    for sign, site, t in np.ndindex(2, sites, 2):
        turned[sign, site, t, site] += (1 - 2 * sign) * _SMALL * tangents[site, t]
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    ends = loop.one_step(row.record, in_kernels(model), case.step, turned.reshape(4 * sites, -1)).reshape(turned.shape)
    change = np.einsum("stjc,juc->just", (ends[0] - ends[1]) / (2 * _SMALL), tangents)
    values, vectors = np.linalg.eig(change.reshape(2 * sites, 2 * sites))
    frequencies = -np.angle(values) / case.step
    positive = np.argsort(frequencies)[-sites:]
    return frequencies[positive], vectors[:, positive]


def _places(model: Spins) -> Array:
    """(sites, vectors) the places of the sites, in cells."""
    cells = np.stack(np.unravel_index(np.arange(model.sites.sites) // len(model.cell.sites), model.size), axis=1)
    return cells + model.cell.fractions[model.sites.of_cell]


def _repeating(model: Spins, s: Array) -> tuple[Array, int]:
    """(number of each site in the smallest cell that repeats with the state, sites of that cell).

    Sites that translations which leave the state as it is carry into one another have one number.
    """
    axes, per_cell = tuple(range(len(model.size))), len(model.cell.sites)
    cells, numbers = s.reshape(*model.size, per_cell, 3), np.arange(len(s)).reshape(*model.size, per_cell)
    first = numbers
    for shift in np.ndindex(*model.size):
        if np.allclose(np.roll(cells, shift, axes), cells, rtol=0, atol=1e-9):
            first = np.minimum(first, np.roll(numbers, shift, axes))
    different, member = np.unique(first.ravel(), return_inverse=True)
    return member, len(different)


class Waves(NamedTuple):
    """Linear waves of a lattice, as the kind statistics asks for them."""

    check: Callable[[Any], None]
    frequencies: Callable[[Any, Array], tuple[Array, Array]]


WAVES = Waves(check, linear_waves)
