"""Record of a lattice of spins for kernels: its terms divided into pieces with exact flows.

A bond has the energy -s . A s'.  With A = U diag(a) V^T, U and V rotations, it is a sum of terms with exact flows: a
part K U V^T of A, by which s and U V^T s' turn about their sum, and products -(a_c - K)(u_c . s)(v_c . s'), by which
either spin turns about its own axis.  The K is taken with which there are the fewest.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from spi.numerics.rng import LANES

from .driving import DrivenTables, courses_of
from .kernels import Form, SpinTables
from .lattices import neighbours


class Move(NamedTuple):
    """A part of the energy of a bond that has an exact flow."""

    form: int
    strength: float  #: K
    frame: np.ndarray  #: (9,)


_EPSILON = 1e-14


def moves(matrix: np.ndarray) -> list[Move]:
    """Parts of -s . A s', their sum; none where A is 0."""
    u, a, vt = np.linalg.svd(matrix)
    signs = np.sign([np.linalg.det(u), np.linalg.det(vt)])
    u[:, 2], vt[2], a[2] = u[:, 2] * signs[0], vt[2] * signs[1], a[2] * signs.prod()
    if np.allclose(matrix, matrix[0, 0] * np.eye(3), rtol=0, atol=_EPSILON * abs(matrix).max()):
        u, a, vt = np.eye(3), np.full(3, matrix[0, 0]), np.eye(3)  # also where it is negative
    elif np.allclose(matrix, np.diag(np.diag(matrix)), rtol=0, atol=_EPSILON * abs(matrix).max()):
        u, a, vt = np.eye(3), np.diag(matrix).copy(), np.eye(3)
    small = _EPSILON * abs(a).max()

    def products(common: float) -> list[int]:
        return [c for c in range(3) if abs(a[c] - common) > small]

    common = min((0.0, *a), key=lambda k: len(products(k)) + (abs(k) > small))
    parts = [
        Move(Form.PRODUCTS, a[c] - common, np.concatenate([u[:, c], vt[c], np.zeros(3)])) for c in products(common)
    ]
    if abs(common) > small:
        turn = u @ vt
        form = Form.PAIRS if np.array_equal(turn, np.eye(3)) else Form.TURNED_PAIRS
        parts.insert(0, Move(form, common, turn.ravel()))
    return parts


class Pieces:
    """Pieces of a splitting, collected one after the other."""

    def __init__(self) -> None:
        self.forms: list[int] = []
        self.members: list[np.ndarray] = []
        self.rates: list[np.ndarray] = []
        self.frames: list[np.ndarray] = []
        self.rows: list[np.ndarray] = []
        self.lanes: list[np.ndarray] = []
        self.fastest: list[float] = []

    def add(self, form: int, member: np.ndarray, rate: Any, frame: np.ndarray, fastest: float, lanes: Any = 0) -> None:
        """A piece with members (n,) or (n, 2), their rates, frames and lanes, one for all or one for each."""
        if not len(member):
            return
        count = len(member)
        self.forms.append(form)
        self.members.append(member if member.ndim > 1 else np.stack([member, member], axis=1))
        self.rates.append(np.broadcast_to(np.asarray(rate, float), (count,)))
        different, which = np.unique(np.atleast_2d(frame), axis=0, return_inverse=True)
        first = sum(map(len, self.frames))
        self.rows.append(np.broadcast_to(first + which.ravel(), (count,)))
        self.frames.append(different)
        self.lanes.append(np.broadcast_to(np.asarray(lanes, np.int64), (count,)))
        self.fastest.append(fastest)


def bond_matrices(model: Any) -> np.ndarray:
    """(types, 3, 3): A of each bond of the cell, the exchange and the Dzyaloshinskii-Moriya vector D of its terms.

    D . (s x s') = -s . [D]_x s' with [D]_x v = D x v, so that the energy -D . (s x s') = -s . A s' has A = -[D]_x, of
    which column a is e_a x D.
    """
    matrices = np.zeros((len(model.cell.bonds), 3, 3))
    for terms in model.bonds:
        for kind in terms.types or range(len(matrices)):
            exchange = np.broadcast_to(np.asarray(terms.exchange, float), (3,))
            d = np.asarray(terms.dm, float)
            d = d * model.cell.direction(kind) if d.ndim == 0 else d
            matrices[kind] += np.diag(exchange) + np.cross(np.eye(3), d).T
            matrices[kind] += 0.0 if terms.matrix is None else np.array(terms.matrix)
    return matrices


def _frame(axis: np.ndarray) -> np.ndarray:
    return np.concatenate([axis, np.zeros(6)])


def lanes_of(around: np.ndarray, parts: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(row of each bond, rows of lanes): the lane in which the neighbour stands of a site in each lane.

    The lanes are parts of a lattice, `parts` along each vector, and a bond that goes around one part leads to the next.
    Without parts every lane is a lattice of its own.
    """
    if math.prod(parts) == 1:
        return np.zeros(len(around), np.int64), np.arange(LANES)[np.newaxis]
    shifts = around % parts
    different, rows = np.unique(np.concatenate([np.zeros((1, 3), np.int64), shifts]), axis=0, return_inverse=True)
    lane = np.stack(np.unravel_index(np.arange(LANES), parts), axis=1)
    moved = (lane + different[:, np.newaxis]) % parts
    return rows.ravel()[1:], np.ravel_multi_index(tuple(np.moveaxis(moved, -1, 0)), parts)


def in_kernels(model: Any, temperature: float) -> Any:
    """Record of a :class:`~spi.plugins.spins.models.Spins` at a temperature, one that is driven if its field is."""
    _, which, texts = courses_of(model.field)
    rest = tables(model, temperature)
    if not texts:
        return rest
    of_cell = model.sites.of_cell
    of_site = which[of_cell if len(which) > 1 else np.zeros_like(of_cell)]
    return DrivenTables.of(rest, of_site, texts, float(model.initial_time))


@functools.lru_cache(8)
def tables(model: Any, temperature: float, parts_of: tuple[int, int, int] = (1, 1, 1)) -> SpinTables:
    """Record of a :class:`~spi.plugins.spins.models.Spins` at a temperature, infinite without one.

    A field that depends on time is left out.

    With `parts_of` the lanes are parts of one lattice, of which the model is one part.
    """
    lattice, matrices = model.sites, bond_matrices(model)
    sites = np.arange(lattice.sites)
    moment = np.asarray(np.broadcast_to(np.array(model.mu, float), (len(model.cell.sites),)))[lattice.of_cell]
    given, courses, _ = courses_of(model.field)
    of_given = lattice.of_cell if len(given) > 1 else np.zeros_like(sites)
    field, driven = moment[:, np.newaxis] * given[of_given], (courses[of_given] >= 0).any(axis=1)
    first, other, of_bond = neighbours(lattice.sites, lattice.bonds)
    axes = np.concatenate([[unit(model.anisotropy.axis)], np.eye(3)])
    own = (
        (Form.AXES, Form.DAMPED_AXES, model.anisotropy.uniaxial, axes[:1]),
        (Form.CUBES, Form.DAMPED_CUBES, model.anisotropy.cubic, axes[1:]),
    )
    size = np.linalg.norm(matrices, axis=(1, 2), ord=2)[lattice.types]
    fields = np.bincount(lattice.bonds.ravel(), np.repeat(size, 2), lattice.sites) + np.linalg.norm(field, axis=1)
    parts, colours = Pieces(), [sites[lattice.site_colours == c] for c in range(lattice.site_colours.max() + 1)]
    lanes_there, lanes = lanes_of(np.concatenate([lattice.around, -lattice.around]), parts_of)
    if model.by == "bonds":
        _add_bonds(parts, lattice, matrices, moment, lanes_there)
        strength = np.linalg.norm(field, axis=1)
        if len(there := np.flatnonzero((strength > 0) | driven)):
            away = np.where(
                driven[there], 2.0 + lattice.of_cell[there], strength[there]
            )  # a row for each site of a cell
            along = np.where(
                driven[there, np.newaxis], np.eye(1, 3) * away[:, np.newaxis], field[there] / away[:, np.newaxis]
            )
            along = np.pad(along, ((0, 0), (0, 6)))
            parts.add(Form.FIELDS, there, strength[there], along, (strength / moment).max())
    else:
        for colour in colours:
            parts.add(Form.SITES, colour, 1.0, np.zeros(9), (fields / moment)[colour].max())
    for form, _, strength, along in own:
        for axis in along if strength else ():
            parts.add(form, sites, strength, _frame(axis), 2 * abs(strength) / moment.min())
    if not parts.forms:  # a free spin
        parts.add(Form.FIELDS, sites, 0.0, _frame(axes[0]), 0.0)
    pieces = len(parts.forms)
    if model.alpha > 0:
        for colour in colours if (fields.any() or driven.any()) and model.by == "bonds" else ():
            parts.add(Form.DAMPED_SITES, colour, 1.0, np.zeros(9), (fields / moment)[colour].max())
        for _, form, strength, along in own:
            for axis in along if strength else ():
                parts.add(form, sites, strength, _frame(axis), 0.0)
    sigma, axis = strengths_of(model, temperature, moment)
    couplings = np.stack([matrices, matrices.transpose(0, 2, 1)], axis=1).reshape(-1, 9)
    scalar = [[np.array_equal(a, a[0, 0] * np.eye(3))] * 2 for a in matrices]
    member = np.concatenate(parts.members)
    return SpinTables(
        form=np.array(parts.forms, np.int64),
        first=np.cumsum([0, *map(len, parts.members)]),
        member=member,
        rate=np.concatenate(parts.rates),
        frame=np.concatenate(parts.rows),
        member_lanes=np.concatenate(parts.lanes),
        frames=np.concatenate(parts.frames),
        fastest=np.array(parts.fastest, float),
        neighbours=first,
        other=other,
        coupling=2 * lattice.types[of_bond // 2] + of_bond % 2,
        other_lanes=lanes_there.reshape(2, -1)[of_bond % 2, of_bond // 2],
        lane_table=np.ascontiguousarray(lanes).ravel(),
        couplings=couplings,
        isotropic=np.array(scalar, bool).ravel(),
        field=field,
        axes=axes,
        uniaxial=float(model.anisotropy.uniaxial),
        cubic=float(model.anisotropy.cubic),
        moment=moment,
        strength=sigma,
        noise_axis=axis,
        noise_rows=np.array(model.noise.order if model.noise and not math.isfinite(temperature) else (), np.int64),
        alpha=math.copysign(model.alpha, temperature),
        temperature=float(temperature),
        sigma=np.repeat(sigma, 1 if len(axis) else 3) if sigma.any() else np.zeros(0),
        d=3 * lattice.sites,
        p=pieces,
        q=len(parts.forms) - pieces,
        m=len(sites) * (1 if len(axis) else 3) if sigma.any() else 0,
    )


def unit(vector: Any) -> np.ndarray:
    """A vector of length 1 in its direction."""
    return np.array(vector, float) / np.linalg.norm(vector)


def strengths_of(model: Any, temperature: float, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(sigma of each site, the axis of the noise or nothing): sqrt(2 alpha T / mu) at a temperature."""
    if math.isfinite(temperature):
        return np.sqrt(2 * model.alpha * abs(temperature) / moment), np.zeros(0)
    if model.noise is None:
        return np.zeros(len(moment)), np.zeros(0)
    axis = np.zeros(0) if model.noise.axis is None else unit(model.noise.axis)
    return np.full(len(moment), float(model.noise.sigma)), axis


def _add_bonds(parts: Pieces, lattice: Any, matrices: np.ndarray, moment: np.ndarray, lanes: np.ndarray) -> None:
    """A piece for each colour of bonds and each move of theirs; equal forms of different bonds go together."""
    of_type = [moves(matrix) for matrix in matrices]
    for colour in range(lattice.bond_colours.max(initial=-1) + 1):
        here = np.flatnonzero(lattice.bond_colours == colour)
        for number in range(max(map(len, of_type))):
            for form in (Form.PAIRS, Form.TURNED_PAIRS, Form.PRODUCTS):
                kinds = [k for k, m in enumerate(of_type) if number < len(m) and m[number].form == form]
                some = here[np.isin(lattice.types[here], kinds)]
                if not len(some):
                    continue
                those = [of_type[k][number] for k in lattice.types[some]]
                pair, strength = lattice.bonds[some], np.array([move.strength for move in those])
                frame, mu = np.array([move.frame for move in those]), moment[pair]
                if form == Form.PRODUCTS:
                    parts.add(form, pair, strength, frame, float((abs(strength) / mu.min(axis=1)).max()), lanes[some])
                else:
                    rate = strength / mu.prod(axis=1)
                    parts.add(form, pair, rate, frame, float((abs(rate) * mu.sum(axis=1)).max()), lanes[some])
