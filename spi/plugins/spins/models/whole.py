"""One path of one large lattice: the lanes of a block are parts of the lattice, and threads share its sites.

A lattice of L_1 x L_2 x L_3 cells is cut into 64 equal parts, one in each lane, so that the flows of ``kernels.py``
move 64 sites in vector instructions as they move 64 paths; a bond that leaves a part leads to another lane.  Random
numbers are made where they are used: those of a site and step are one evaluation of the generator.  So the state is all
that is stored, 24 bytes a spin.
"""

import functools
import itertools
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numba import get_num_threads, prange

from spi.compiler.dispatch import device, kernel
from spi.compiler.pointers import in_memory
from spi.compiler.vectors import without_refcount
from spi.ensemble.loop import add_reports, limited_threads
from spi.ensemble.scheme_protocol import DRIFT, FLOW, FRICTION, NOISE, REPORT, judges, of_arrays
from spi.numerics.elementary import SMALL
from spi.numerics.rng import LANES, SITES, STEPS_PER_TOSS, draw_increments, draw_words, uniform

from .flows import versines_of_noise
from .kernels import (
    SPIN,
    Form,
    add_field,
    judge_turns,
    largest_angle,
    move_members,
    spin_of,
    take_away_roundings,
    turn_about_random_axes,
    turn_at_random,
)
from .parts import copy_parts
from .tables import tables

#: Further kinds of flows: judged noise of a colour of sites, and roundings of lengths that are taken away.
JUDGED, ROUNDINGS = FRICTION + 1, FRICTION + 2
_NS = {DRIFT: 5.0, FRICTION: 5.0, NOISE: 5.0, JUDGED: 60.0, ROUNDINGS: 1.0}  # of a member or site, typically
_MOST_SITES = 2**16  # channels of the random numbers, sites of a part
_MOST_SHARES = 64  # into which sites are divided among threads
_NS_OF_A_THREAD = 2e5  # of a step on one thread: to wake another one for less takes longer than its share


class Program(NamedTuple):
    """Flows of a step, one after the other."""

    flows: np.ndarray  #: of type FLOW; k is the piece, or the number of the draw of noise, and the share the time
    draws: int  #: evaluations of the generator for each site and step
    alpha: float  #: the damping of flows, 0 where noise is judged with its friction
    joined: bool  #: whether the last flow of a step and the first of the next one are one flow


@functools.lru_cache(8)
def parts_of(model: Any) -> tuple[int, int, int] | None:
    """Number of parts along each vector, 64 in all, with the smallest faces; None if there is no such division."""
    size = (*model.size, 1, 1)[:3]
    if not model.is_periodic:
        return None
    best, least = None, math.inf
    for parts in itertools.product((1, 2, 4, 8, 16, 32, 64), repeat=3):
        lengths = [length / part for length, part in zip(size, parts, strict=True)]
        if math.prod(parts) != LANES or any(length % 1 for length in lengths):
            continue
        faces = sum(1 / length for length, part in zip(lengths, parts, strict=True) if part > 1)
        faces += sum(10.0 for length in lengths if length % 2 and length > 1)  # odd lengths need more colours
        if faces < least and not _part(model, parts).fault():
            best, least = parts, faces
    return best


def _part(model: Any, parts: tuple[int, ...]) -> Any:
    """Model of one part."""
    return model._replace(size=tuple(length // part for length, part in zip(model.size, parts, strict=False)))


class WholeLattice(NamedTuple):
    """A lattice in parts, and the program of a step of a scheme with the step size h."""

    model: Any  #: the record of a part for kernels
    sites: np.ndarray  #: (sites of a part, LANES): the number of each site in the lattice
    program: Program

    @classmethod
    def of(cls, model: Any, temperature: float, scheme: Any, h: float) -> "WholeLattice | None":
        """Program of a composition of flows, or of judged ones; None if the lattice or the scheme has none."""
        parts = parts_of(model)
        if parts is None:
            return None
        part = _part(model, parts)
        record = tables(part, temperature, parts)
        program = program_of(scheme, record, h)
        if program is None or len(record.moment) > _MOST_SITES:
            return None
        return cls(record, _places(model, part, parts), program)

    def block(self, state: np.ndarray) -> np.ndarray:
        """Parts of a state (3 sites,)."""
        block = np.empty(3 * self.sites.size)
        copy_parts(self.sites, np.require(state, float, "CW"), block, True)
        return block

    def state(self, block: np.ndarray) -> np.ndarray:
        """State of its parts."""
        state = np.empty(3 * self.sites.size)
        copy_parts(self.sites, state, block, False)
        return state

    def along(
        self, state: Any, first: int, steps: int, every: int, seed: int, path: int
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """(n, state, report) after each `every` steps from t = 0 on, none of them for 0, and at the end.

        The report (1, 1, len(REPORT)) is that of the steps since the one before.
        """
        y, n, end = self.block(state), first, first + steps
        del state  # perhaps the last reference to very many numbers
        while n < end:
            stop = min(end, (n // every + 1) * every) if every else end
            report = self.move(y, n, stop - n, seed, path)
            n = stop
            yield n, self.state(y), report

    def moved(self, state: Any, first: int, steps: int, every: int, seed: int, path: int) -> tuple[Any, Any, Any]:
        """(states (stored, d) after each `every` steps from t = 0 on, or none for 0, last state, report)."""
        last, stored, report = np.asarray(state), [], np.zeros((1, len(REPORT)))
        for n, last, added in self.along(state, first, steps, every, seed, path):
            report = add_reports(report, added)
            if every and n % every == 0:
                stored.append(last)
        return np.reshape(stored, (-1, len(last))), last, report

    @property
    def call(self) -> tuple[Any, tuple[Any, ...]]:
        """Kernel and the arguments of a call of no steps, which only has it compiled."""
        return move_lattice, self._arguments(self.block(np.zeros(3 * self.sites.size)), 0, 0, 0, 0)

    @property
    def ns(self) -> float:
        """Nanoseconds of a step of the lattice on one thread, at typical speed."""
        members, sites, program = np.diff(self.model.first), len(self.sites), self.program
        each = [(kind, sites if kind in (NOISE, ROUNDINGS) else members[k]) for kind, k, *_ in program.flows.tolist()]
        return LANES * float(sum(_NS[kind] * count for kind, count in each[1 if program.joined else 0 :]))

    @property
    def most_threads(self) -> int:
        """Number of threads from which on further ones do not help."""
        return 1 + int(self.ns / _NS_OF_A_THREAD)

    @property
    def calls(self) -> tuple[tuple[Any, tuple[Any, ...]], ...]:
        """:attr:`call`, and that of the kernel that copies states."""
        nothing = np.empty(0)
        return self.call, (copy_parts, (self.sites[:0], nothing, nothing, True))

    def _arguments(self, y: np.ndarray, first: int, steps: int, seed: int, path: int) -> tuple[Any, ...]:
        threads = get_num_threads()
        shares = 1 if threads == 1 else min(_MOST_SHARES, 4 * threads)
        return self.model, self.program, y, first, steps, np.uint64(seed), np.uint64(path), shares

    def move(self, y: np.ndarray, first: int, steps: int, seed: int, path: int = 0) -> np.ndarray:
        """Move the parts `y` on in place, by `steps` steps from number `first` on; (1, 1, len(REPORT)): their report.

        A drift between judged noises conserves H and is accepted without being judged, which the report counts as such.
        """
        with limited_threads(self.most_threads):
            accepted, angle = move_lattice(*self._arguments(y, first, steps, seed, path))
        members, flows = np.diff(self.model.first), self.program.flows
        turns = steps * 3 * LANES * int(members[flows["k"][flows["kind"] == JUDGED]].sum())
        found = dict.fromkeys(REPORT, 0.0) | {"largest_angle": angle if angle > SMALL else 0.0}
        if turns:
            drifts = {"drift_judged": steps, "drift_accepted": steps}
            found |= {"noise_judged": turns, "noise_accepted": accepted} | drifts
        return np.array([[[found[name] for name in REPORT]]], float)


class SampledGibbs(NamedTuple):
    """Gibbs law of a lattice at a temperature: states after some sweeps of judged turns, see :func:`sweep_of`.

    A path begins in random directions.
    """

    model: Any  #: a :class:`~spi.plugins.spins.models.Spins`
    temperature: float
    sweeps: int
    surface: None = None

    @property
    def numbers(self) -> int:
        """Number of normal numbers for the directions in which a path begins."""
        return 3 * self.model.sites.sites

    def states(self, z: np.ndarray) -> np.ndarray:
        """Directions (d, paths) of numbers (numbers, paths)."""
        vectors = z.reshape(-1, 3, z.shape[1])
        return (vectors / np.sqrt((vectors**2).sum(axis=1, keepdims=True))).reshape(z.shape)

    def of_one_lattice(self, y: np.ndarray, seed: int, stream: int, path: int) -> np.ndarray:
        """State (d,) of one path of a lattice in parts after all sweeps, from the state y."""
        parts = parts_of(self.model)
        if parts is None:
            raise ValueError("the lattice does not divide into parts")
        part = _part(self.model, parts)
        record, program = sweep_of(part, self.temperature, parts)
        whole = WholeLattice(record, _places(self.model, part, parts), program)
        block = whole.block(y)
        whole.move(block, 0, self.sweeps, seed, path | (1 + stream) << 40)
        return whole.state(block)

    def moved(self, y: np.ndarray, seed: int, stream: int, first: int) -> np.ndarray:
        """States (d, paths) of whole blocks, the first of them number `first`, after all sweeps."""
        blocks = np.ascontiguousarray(y.reshape(len(y), -1, LANES).transpose(1, 0, 2)).reshape(-1, len(y) * LANES)
        paths = np.arange(first, first + len(blocks), dtype=np.uint64) | np.uint64((1 + stream) << 40)
        move_blocks(*sweep_of(self.model, self.temperature), blocks, self.sweeps, np.uint64(seed), paths)
        return blocks.reshape(len(blocks), len(y), LANES).transpose(1, 0, 2).reshape(y.shape)


@functools.lru_cache(4)
def _places(model: Any, part: Any, parts: tuple[int, ...]) -> np.ndarray:
    """Number in the lattice of each site of a part in each lane."""
    per_cell = len(model.cell.sites)
    size, lengths = (*model.size, 1, 1)[:3], (*part.size, 1, 1)[:3]
    cell, within = np.divmod(np.arange(math.prod(lengths) * per_cell, dtype=np.int32), np.int32(per_cell))
    here = np.unravel_index(cell, lengths)
    lane = np.unravel_index(np.arange(LANES), parts)
    places = np.zeros((len(cell), LANES), np.int32)
    for x, y, length, along in zip(here, lane, lengths, size, strict=True):
        places = along * places + (x[:, np.newaxis] + length * y).astype(np.int32)
    return per_cell * places + within[:, np.newaxis]


# ---------------------------------------------------------------------------------------------------------------------
# Programs.
# ---------------------------------------------------------------------------------------------------------------------


def program_of(scheme: Any, record: Any, h: float) -> Program | None:
    """Program of a step of size h; None for a scheme that has none, tosses coins or shares increments.

    That of a judged scheme is noise judged site by site and the drift, if that conserves H and need not be judged.
    """
    if judges(scheme):
        conserves = (record.form[: record.p] == Form.SITES).all() and record.m > 0
        there, back = range(record.p), range(record.p - 1)[::-1]
        rows = [_flow(JUDGED, k) for k in there]
        rows += [_flow(DRIFT, k, 1.0 if k == record.p - 1 else 0.5) for k in (*there, *back)]
        return _program(np.array(rows, FLOW), h, 2, 0.0) if conserves else None
    flows = getattr(of_arrays(scheme, record), "program", ())
    if len(flows) != 1 or (flows["share"][flows["kind"] == NOISE] != 1).any():
        return None
    (flows,) = flows.copy()
    noise = flows["kind"] == NOISE
    flows["k"][noise] = np.arange(noise.sum())
    flows["k"][flows["kind"] == FRICTION] += record.p
    flows["share"][noise] = ((flows["stop"] - flows["first"]) / flows["n"])[noise]
    return _program(flows, h, int(noise.sum()), record.alpha)


def _flow(kind: int, k: int, share: float = 1.0) -> tuple[Any, ...]:
    return kind, k, 0, 1, 1, 0, share


@functools.lru_cache(8)
def sweep_of(model: Any, temperature: float, parts: tuple[int, int, int] = (1, 1, 1)) -> tuple[Any, Program]:
    """Record of many lattices and the program of a sweep that keeps their Gibbs law: judged noise.

    With `parts` the model is a part of one lattice, as in :func:`~.tables.tables`.

    Over the time 1 / (b + T / mu), b the largest field over mu, the turns are about as large as the law allows.  Where
    the drift conserves H it turns the spins by angles of about 1 besides.
    """
    record = tables(model._replace(by="sites", alpha=1.0, noise=None), temperature, parts)
    colours = np.flatnonzero(record.form[: record.p] == Form.SITES)
    rate = record.fastest[: record.p].sum() + abs(temperature) / record.moment.min()
    rows = [_flow(JUDGED, k, 1 / rate) for k in colours]
    if len(colours) == record.p:
        rows += [_flow(DRIFT, k, 1 / record.fastest[: record.p].max()) for k in colours if record.fastest[k] > 0]
    return record, _program(np.array(rows, FLOW), 1.0, 2, 0.0)


def _program(flows: np.ndarray, h: float, draws: int, alpha: float) -> Program:
    if NOISE not in flows["kind"]:
        flows = np.append(flows, np.array([_flow(ROUNDINGS, 0)], FLOW))
    first, last = flows[["kind", "k"]][[0, -1]].tolist()
    joined = len(flows) > 1 and first == last and first[0] in (DRIFT, FRICTION)
    flows["share"] *= h
    return Program(flows, draws, alpha, joined)


# ---------------------------------------------------------------------------------------------------------------------
# The loop over time.
# ---------------------------------------------------------------------------------------------------------------------


@kernel(parallel=True)
def move_lattice(model, program, y, first, steps, seed, path, shares):
    """Move a lattice in parts on in place; returns the number of accepted turns and the largest |angle| of a flow.

    The sites of a flow do not touch each other and go in `shares` to threads: the bits are the same for any number.
    Steps end at multiples of STEPS_PER_TOSS and at the last one; between them two flows of a piece become one.
    """
    records = [(in_memory(model), program)]
    rows, accepted, angles, largest = len(program.flows), np.zeros(shares, np.int64), np.zeros(shares), 0.0
    for n in range(first, first + steps):
        ends = not program.joined or (n + 1) % STEPS_PER_TOSS == 0 or n + 1 == first + steps
        begins = not program.joined or n % STEPS_PER_TOSS == 0 or n == first
        for row in range(rows if ends else rows - 1):
            flow = program.flows[row]
            t = flow["share"]
            if row == 0 and not begins:
                t = t + program.flows[rows - 1]["share"]
            for share in prange(shares):
                of_share, its_program = records[0]  # Numba's prange cannot take nested tuples, but a list
                count, angle = _run_share(of_share, its_program, row, t, share, shares, y, n, seed, path)
                accepted[share] += count
                angles[share] = max(angles[share], angle)
            if flow["kind"] == DRIFT:
                largest = max(largest, largest_angle(model, flow["k"], t, y))
    return accepted.sum(), max(largest, angles.max())


@kernel(parallel=True)
def move_blocks(model, program, y, steps, seed, paths):
    """Move blocks of lattices (blocks, d * LANES) on in place, block b with the random numbers of path paths[b]."""
    records = [(in_memory(model), program)]
    for b in prange(len(y)):
        of_block, its_program = records[0]
        for n in range(steps):
            for row in range(len(its_program.flows)):
                _run_share(of_block, its_program, row, its_program.flows[row]["share"], 0, 1, y[b], n, seed, paths[b])


@device(inline=False)
def _run_share(model, program, row, t, share, shares, y, n, seed, path):
    """One share of the members, or sites, of one row of a program.

    Returns the number of accepted turns, and the largest |angle| of noise about an axis.
    """
    kind, k, accepted, angle = program.flows[row]["kind"], program.flows[row]["k"], 0, 0.0
    first, last = (0, len(model.moment)) if kind in (NOISE, ROUNDINGS) else (model.first[k], model.first[k + 1])
    begin, end = first + (last - first) * share // shares, first + (last - first) * (share + 1) // shares
    work = np.empty(2 * SPIN)
    if kind in (DRIFT, FRICTION):
        move_members(model, k, t, program.alpha, begin, end, y, work)
    elif kind == NOISE:
        angle = turn_sites_at_random(model, t, begin, end, y, np.uint64(n * program.draws + k), seed, path)
    elif kind == JUDGED:
        accepted = judge_sites(model, t, begin, end, y, np.uint64(2 * n), seed, path, work)
    else:
        take_away_roundings(model, begin, end, y)
    return accepted, angle


@device(inline=False)
def turn_sites_at_random(model, t, begin, end, y, draw, seed, path):
    """Noise of the sites of a part from `begin` to before `end` over the time t.

    One evaluation of the generator serves two sites, which turn about random axes; about a given axis, one.  Returns
    the largest |angle| about that.
    """
    largest = 0.0
    words, normals = np.empty(4 * LANES, np.uint64), np.empty(4 * LANES)
    if len(model.noise_axis) > 0:
        for i in range(begin, end):
            scale = model.strength[i] * np.sqrt(t)
            draw_increments(seed, np.uint64(SITES), np.uint64(i), draw, path, scale, words, normals, LANES)
            largest = max(largest, turn_at_random(model, i, i + 1, normals, y))
        take_away_roundings(model, begin, end, y)
    else:
        for i in range(begin, end):
            if i == begin or i % 2 == 0:
                draw_words(seed, np.uint64(SITES), np.uint64(i // 2), draw, path, words)
            low, high = versines_of_noise(t * model.strength[i] * model.strength[i])
            own = without_refcount(words[2 * LANES :] if i % 2 else words[: 2 * LANES])
            turn_about_random_axes(low, high, own, spin_of(y, i))
    return largest


@device(inline=False)
def judge_sites(model, h, begin, end, y, draw, seed, path, work):
    """Turns of sites of a colour about the three axes, with their friction, each accepted or not.

    Returns the number of accepted ones.
    """
    accepted = 0
    words, normals, uniforms = np.empty(4 * LANES, np.uint64), np.empty(4 * LANES), np.empty(4 * LANES)
    for e in range(begin, end):
        i = model.member[e, 0]
        draw_increments(seed, np.uint64(SITES), np.uint64(i), draw, path, np.sqrt(h), words, normals, LANES)
        draw_words(seed, np.uint64(SITES), np.uint64(i), draw + np.uint64(1), path, words)
        for lane in range(3 * LANES):
            uniforms[lane] = uniform(words[lane])
        add_field(model, i, y, work)
        for a in range(3):  # rows 0, 2 and 1 of the normals, two of which are made of the same two words
            noise, drawn = normals[2 * a % 3 * LANES :], uniforms[a * LANES :]
            accepted += judge_turns(model, i, a, h, noise, drawn, 0, LANES, spin_of(y, i), work)
    return accepted
