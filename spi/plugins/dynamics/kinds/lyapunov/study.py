"""Lyapunov exponents by the method of Benettin: near paths on the same noise, made orthogonal again and again.

Beside each path y go m others, y + eps q_i, with q_1, ..., q_m an orthonormal basis of the tangent space of the Casimir
surface, at first one at random for each path: axes may be invariant, and vectors along them would never turn into the
directions that grow most.  After some steps of the scheme (z_i - z) / eps = Q R, the columns of Q are the next basis,
and the means of log R_ii over time are the exponents (G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica
15, 1980).
Nothing but the steps of the scheme is needed; their random numbers are drawn anew for each of the m + 1 paths.  The
distance eps is a fixed share of the larger of the states at both ends of these steps.

Lengths are Euclidean times w^(-1/m), with w from :func:`log_density`, so that the volume of m dimensions is the one
that Hamiltonian flows keep.  At a stationary law lengths do not matter in the limit; the sum is 0 at any time.
Damping leaves the surface, and that measure shrinks; lengths are Euclidean there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, partial
from typing import Any

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.increments import NoiseArrays, draw_noise, draw_paths, empty_noise
from spi.ensemble.loop import arguments_of, integrate, integrated, limited_threads, states_at
from spi.ensemble.protocol import casimirs, conserved, dimension, structure
from spi.ensemble.random_states import block_states
from spi.ensemble.random_states import normals as normal_numbers
from spi.exact.surfaces import at_states, spheres, structure_matrix
from spi.expressions.arithmetic import NumberError
from spi.kinds import blocks
from spi.kinds.blocks import BATCH_BYTES, SampledPlan, stderr_of_means
from spi.kinds.functions import path_function
from spi.kinds.plans import KernelCall, PartCost, State
from spi.models.delegation import undamped
from spi.numerics.arrays import exp, log
from spi.numerics.rng import LANES, STEPS_PER_TOSS, TANGENTS
from spi.plugins.dynamics.ensemble.counting import count_values
from spi.plugins.dynamics.exact.gibbs import mean_divergence
from spi.plugins.dynamics.kinds.maps import Cells
from spi.plugins.dynamics.statistics.cells import count_places
from spi.schemes import typical_ns
from spi.statistics.accumulators import Array, Sums, added, counted, largest, moments
from spi.statistics.estimators import (
    group_counts,
    jackknife_stderr,
    mean_over_paths,
    standard_deviation,
)
from spi.statistics.rounding import rounding, with_rounding
from spi.statistics.tallies import Batch, PathSet
from spi.storage.records import Part

from .results import EQUAL, PANELS, Exponents, Pictures, kaplan_yorke

# ---------------------------------------------------------------------------------------------------------------------
# Pull-back pictures: many states on one path of noise that ends now and began a time t ago, for several t.
#
# Steps of the noise are numbered backwards from now, number n being made of the increments that a run has in its step
# n.  So the noise from -t to 0 is the same in all pictures, whatever other times there are, and as t grows pictures
# converge to the random attractor of this path of noise (H. Crauel, F. Flandoli, Probability Theory and Related Fields
# 100, 1994; the numbering is that of coupling from the past, J. G. Propp, D. B. Wilson, Random Structures and
# Algorithms 9, 1996).
# ---------------------------------------------------------------------------------------------------------------------


_OF_SPHERE, _OF_PLANE = (192, 384), (256, 256)  # cells of a picture
_PILOT = 4  # blocks by which the ends of the cells are found, where they are not those of a sphere
_LEAST = 1e-16  # distance, relative to |y|, that counts as this one


class Counts(Sums):
    """Sums over the states of the pictures at T times."""

    cells: Array = added("time one count", int)  #: outside, in each cell, lost
    distances: Array = moments("time distance")  #: of two states, and the logarithm of that


@dataclass(frozen=True)
class Pulled:
    """Pictures of a plan."""

    plan: SampledPlan

    @property
    def _keys(self) -> Any:
        return self.plan.case.pullback

    @cached_property
    def steps(self) -> list[int]:
        """(T,) the number of steps of each picture."""
        return [round(t / self.plan.grid.reference_step) for t in self._keys.times]

    @property
    def path_set(self) -> PathSet:
        """States."""
        return PathSet(self._keys.points, blocks.chunk_blocks(sum(self.steps), dimension(self.plan.model)))

    @cached_property
    def _noise(self) -> NoiseArrays:
        """The first steps of path number 0, as many as the longest picture takes."""
        p = self.plan
        given = empty_noise(p.scheme, p.model, max(self.steps), 1)
        draw_noise(p.scheme, p.model, p.stream, p.grid.reference_step, p.grid.area_terms, 0, 0, given)
        return given

    def _until_now(self, steps: int) -> NoiseArrays:
        """Noise of `steps` steps, the last of which is number 0."""
        whole = self._noise
        parts = len(whole.dW) // max(self.steps)
        dW = whole.dW.reshape(-1, parts, *whole.dW.shape[1:])[:steps][::-1].reshape(steps * parts, *whole.dW.shape[1:])
        areas, coins = (np.ascontiguousarray(rows[:steps][::-1]) for rows in (whole.areas, whole.coins))
        return NoiseArrays(np.ascontiguousarray(dW), areas, coins, 0)

    def states(self, batch: Batch) -> np.ndarray:
        """(blocks, T, d, LANES) the states of a batch at the end of each picture."""
        p, d, blocks = self.plan, dimension(self.plan.model), (batch.first, batch.blocks)
        begin = block_states(p.case.points_law, p.stream, *blocks).reshape(batch.blocks, 1, d * LANES)
        states = np.empty((batch.blocks, len(self.steps), d, LANES))
        for i, steps in enumerate(self.steps):
            start = p.case.last_time - steps * p.grid.reference_step
            times = p.grid._replace(reference_steps=steps, start=start)
            moved, _ = integrated(p.scheme, p.model, begin, times, self._until_now(steps), *blocks, batch.end)
            states[:, i] = moved.reshape(batch.blocks, d, LANES)
        return states

    @cached_property
    def cells(self) -> Cells:
        """Those of the first sphere of the Casimir surface, or else of the first two components."""
        p, times = self.plan, len(self.steps)
        if surface := spheres(undamped(p.model), p.initial):
            return Cells.of_sphere(times, _OF_SPHERE, surface)
        values = self.states(Batch.of_first(_PILOT))[:, :, :2].transpose(1, 2, 0, 3).reshape(times, 2, -1)
        return Cells.around(values, (0, 1), _OF_PLANE)

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the axes of the sums."""
        return {"time": len(self.steps), "one": 1, "count": 2 + math.prod(self.cells.number), "distance": 2}

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Contributions of a batch; the partner of lane l is l + 32, which is in the same jackknife group.

        `cells` are (blocks, T, 1, LANES) the number of the cell and a half, -1 outside, NaN if lost.
        """
        y = self.states(batch)
        with np.errstate(all="ignore"):
            apart = y - np.roll(y, LANES // 2, axis=-1)
            distance = np.sqrt((apart * apart).sum(axis=2))
            size = np.sqrt((y * y).sum(axis=2))
        states = np.moveaxis(y, 2, 0)
        places = self.cells.places(states, states[:2])
        return {"cells": places, "distances": np.stack([distance, log(np.maximum(distance, _LEAST * size))], axis=2)}

    def added(self, sums: Counts, contributions: dict[str, Array], batch: Batch) -> Counts:
        """Sums with the contributions of a batch."""
        cells = sums.cells.copy()
        count_places(contributions["cells"], batch, cells)
        return sums.with_batch({"distances": contributions["distances"]}, batch)._replace(cells=cells)

    def results(self, sums: Counts) -> Pictures:
        """Pictures, from the sums over all states."""
        groups = group_counts(sums.paths)
        mean, without = mean_over_paths(sums.distances[0], groups)
        names = tuple(self.plan.case.variables[:2]) or ("y1", "y2")
        return Pictures(
            **self.cells.densities(sums.cells, np.array(self._keys.times), names, np.zeros(2)),
            distance=mean[:, 0],
            distance_stderr=jackknife_stderr(mean, without, groups)[:, 0],
            typical=exp(mean[:, 1]),
            points=sums.paths,
        )

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block on given noise, and nothing counted."""
        p = self.plan
        given, one = empty_noise(p.scheme, p.model, 1, 1), np.zeros((1, 1, 1, LANES))
        begin = np.zeros((1, 1))
        step = arguments_of(p.scheme, p.model, np.array(p.initial), p.grid._replace(reference_steps=1), given, 0, 1, 1)
        drawn = p.scheme, p.model, p.stream, p.grid.reference_step, p.grid.area_terms, 0, 0, given
        cells = np.zeros((1, 1, 3), np.int64)
        return [
            KernelCall(integrate, step),
            KernelCall(draw_noise, drawn),
            KernelCall(draw_paths, (p.stream, 1.0, 0, 0, np.empty((1, 1, 1)))),
            KernelCall(count_values, (one, 0, 0, begin, begin + 1, cells, (0, 1))),
        ]


# ---------------------------------------------------------------------------------------------------------------------
# Tangent vectors of the Casimir surface, by differences of paths on the same noise.
# ---------------------------------------------------------------------------------------------------------------------

#: Distance of near paths, relative to the state: the neglected terms are of this size, rounding errors 1e-9 of it.
NEAR = 1e-7
_BY = 1e-6  # relative, by which a state is moved for the gradient of a Casimir function
_RANK = 1e-10  # singular values of B(y_0), relative to the largest, that are 0


def size_of(*states: np.ndarray) -> np.ndarray:
    """(blocks, 1, LANES) the largest component of any of some states (blocks, d, LANES), 1 where all are 0."""
    largest = np.maximum.reduce([np.abs(y).max(axis=1, keepdims=True) for y in states])
    return np.where(largest > 0.0, largest, 1.0)


def leaf_dimension(model: Any, y: Any) -> int:
    """Dimension of the Casimir surface through y: the rank of B(y)."""
    with uncompiled():
        matrix = structure_matrix(model, np.array(y))
    sizes = np.linalg.svd(matrix, compute_uv=False)
    return int((sizes > _RANK * max(sizes[0], 1e-300)).sum())


def normals_at(model: Any, y: np.ndarray) -> np.ndarray:
    """(C, blocks, d, LANES) orthonormal vectors that span the gradients of the C Casimir functions at states y.

    Gradients are central differences, y (blocks, d, LANES) being moved by 1e-6 of its size.
    """
    count, (blocks, d, lanes) = conserved(model), y.shape
    if not count:
        return np.empty((0, *y.shape))
    by = _BY * size_of(y)[:, 0]
    to = np.array([1.0, -1.0])[:, np.newaxis, np.newaxis] * np.eye(d)  # (2, j, i) by which component i is moved
    states = np.moveaxis(y, 1, 0)[:, np.newaxis, np.newaxis] + np.multiply.outer(to.transpose(2, 0, 1), by)
    values = at_states(partial(casimirs, model), states.reshape(d, -1)).reshape(count, 2, d, blocks, lanes)
    gradients = np.ascontiguousarray(np.moveaxis((values[:, 0] - values[:, 1]) / (2.0 * by), 1, 2))
    orthonormalise(gradients)
    return gradients


def make_tangent(vectors: np.ndarray, normals: np.ndarray) -> None:
    """Subtract from vectors (m, blocks, d, LANES), in place, their parts normal to the Casimir surfaces.

    The normal direction neither grows nor shrinks, so that of a vector that shrinks nothing else would be left in the
    end.
    """
    for normal in normals:
        vectors -= (normal * vectors).sum(axis=2, keepdims=True) * normal


def log_density(model: Any, y: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(blocks, LANES) log of the Euclidean area by the area that Hamiltonian flows keep, at states (blocks, d, LANES).

    On the tangent space of the Casimir surface B(y) is, in an orthonormal basis, an antisymmetric matrix b.  There the
    symplectic form is b^-1, and the volume that it makes, the Liouville measure, is the Euclidean one by det(b)^(1/2).
    The Casimir gradients are the kernel of B, so that det(b) = det(B + sum_c n_c n_c^T).  Where B has no divergence,
    sum_i d_i B_ij = 0, this is |grad C_1 ^ grad C_2 ^ ...| up to a constant on the surface.
    """
    blocks, d, lanes = y.shape
    states = np.repeat(np.moveaxis(y, 1, 0)[:, np.newaxis], d, axis=1)
    units = np.repeat(np.eye(d)[..., np.newaxis], blocks * lanes, axis=2)
    columns = at_states(partial(structure, model), states.reshape(d, -1), units.reshape(d, -1))
    columns = np.ascontiguousarray(columns.reshape(d, d, blocks, lanes).transpose(1, 2, 0, 3))
    for normal in normals:
        columns += np.moveaxis(normal, 1, 0)[:, :, np.newaxis] * normal
    half_log_determinant: np.ndarray = 0.5 * orthonormalise(columns).sum(axis=0)
    return half_log_determinant


def orthonormalise(vectors: np.ndarray) -> np.ndarray:
    """Make vectors (m, blocks, d, LANES) orthonormal in place; returns the logarithms of their lengths before scaling.

    By Gram and Schmidt, one vector after the other; the result is (m, blocks, LANES), the logarithms of the diagonal
    of R in vectors = Q R.
    """
    sizes = np.empty((len(vectors), vectors.shape[1], vectors.shape[3]))
    with np.errstate(all="ignore"):
        for i, vector in enumerate(vectors):
            for before in vectors[:i]:
                vector -= (before * vector).sum(axis=1, keepdims=True) * before
            sizes[i] = np.sqrt((vector * vector).sum(axis=1))
            vector /= sizes[i][:, np.newaxis]
    return log(sizes)


_TIMES = 16  # at which results are stored
_LEAST_NS = 1e5  # of work of a thread in a call
_FURTHER = 3  # columns behind those of the exponents: their sum, H, and how H changes


class PathRole(IntEnum):
    """What the paths of a set are for, by its number."""

    EXPONENTS = 0
    PICTURES = 1  #: many states on one path of noise


class LyapunovSums(Sums):
    """Sums over some paths of the exponents, their sum, H, and the change of H at T times."""

    values: Array = moments("time column")
    change: Array = largest()  #: |log| of a factor by which a vector changed before it was scaled
    nonfinite: Array = counted()


def parts(case: Any) -> list[Part]:
    """Parts of a case, one for each scheme, which are run one after the other."""
    return [Part(scheme) for scheme in case.schemes]


@dataclass(frozen=True, kw_only=True)
class LyapunovPlan(SampledPlan):
    """Lyapunov exponents of one scheme."""

    record = Exponents
    sums = LyapunovSums

    @cached_property
    def pulled(self) -> Pulled | None:
        """Pull-back pictures, if there are any."""
        return Pulled(self) if self.case.pullback else None

    def _pictures_of(self, number: int | None) -> Pulled | None:
        """Pictures, where the number is that of their path set."""
        return self.pulled if number == PathRole.PICTURES else None

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """Paths of the exponents, and the states of the pictures, in the order of :class:`PathRole`."""
        return [*super().path_sets(extra), *([self.pulled.path_set] if self.pulled else [])]

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; for the states of the pictures also their times and axes."""
        entries = super().deciding(number)
        if not self._pictures_of(number):
            return entries
        return entries | {"pullback": self.case.pullback.model_dump(exclude={"points"})}

    def kernel_calls(self) -> list[KernelCall]:
        """Calls of the exponents and of the pictures."""
        return [*super().kernel_calls(), *(self.pulled.kernel_calls() if self.pulled else [])]

    @cached_property
    def _leaf(self) -> int:
        """Dimension of the Casimir surface."""
        return leaf_dimension(self.model, self.initial)

    def first_vectors(self, batch: Batch, normals: np.ndarray) -> np.ndarray:
        """(m, blocks, d, LANES) orthonormal tangent vectors of the paths of a batch, uniformly at random.

        `normals` are those of :func:`normals_at` at their states.
        """
        m, d = self.case.count, len(self.initial)
        z = normal_numbers(m * d, self.stream, 0, 1, batch.first, batch.blocks, TANGENTS)
        q = np.ascontiguousarray(z.reshape(m, d, batch.blocks, LANES).swapaxes(1, 2))
        make_tangent(q, normals)
        orthonormalise(q)
        return q

    @cached_property
    def stops(self) -> np.ndarray:
        """Numbers of steps after which vectors are made orthogonal."""
        steps, every = self.grid.reference_steps, self.case.every
        return np.append(np.arange(every, steps, every), steps)

    @cached_property
    def begin(self) -> int:
        """Number of the stop at which averages begin, 0 for the beginning."""
        return int(np.searchsorted(self.stops * self.grid.reference_step, self.case.warm_up * (1 + 1e-12), "right"))

    @cached_property
    def stored(self) -> np.ndarray:
        """Numbers of stops until which averages are stored, the last among them."""
        count = len(self.stops)
        return np.unique(np.ceil(np.linspace(count, self.begin, _TIMES, endpoint=False)).astype(int))

    @cached_property
    def resolution(self) -> np.ndarray:
        """(times,) the size for :mod:`spi.statistics.rounding` of exponents at the times that are stored.

        The roundings of n steps change the logarithm of a distance by (1 + sqrt(n)) / NEAR of one, and its mean over
        time by that over n h.
        """
        n = self.stops[self.stored - 1] - np.append(0, self.stops)[self.begin]
        return (1.0 + np.sqrt(n)) / (NEAR * n * self.grid.reference_step)

    def cost(self) -> PartCost:
        """Steps of all paths and the near ones, seconds of one thread at typical speed, and bytes of memory."""
        steps = self.grid.reference_steps * self.blocks * LANES * (1 + self.case.count)
        if self.pulled:
            steps += sum(self.pulled.steps) * self.case.pullback.points
        return PartCost(steps, steps * 1e-9 * typical_ns(self.row, self.model), int(BATCH_BYTES))

    def lengths(self, number: int) -> dict[str, int]:
        """Lengths of the axes of the sums over paths, or over states of pictures."""
        if pictures := self._pictures_of(number):
            return pictures.lengths
        return {"time": len(self.stored), "column": self.case.count + _FURTHER}

    def empty(self, number: int) -> Sums:
        """Sums over no paths, or no states of pictures."""
        return (Counts if number == PathRole.PICTURES else self.sums).empty(self.lengths(number))

    def most_blocks(self, number: int) -> int:
        """Largest number of blocks in a batch, because of memory."""
        copies = 4 * (1 + self.case.count) * (len(self.initial) + self.lengths(number)["time"])
        return max(1, int(BATCH_BYTES / (8 * LANES * copies)))

    def stderr(self, sums: Sums) -> float:
        """Standard error of the largest exponent."""
        return stderr_of_means(sums)

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Exponents of a batch of paths, or the pictures of a batch of states."""
        if pictures := self._pictures_of(batch.path_set):
            return pictures.observe(batch)
        m, d, blocks = self.case.count, len(self.initial), batch.blocks
        y = states_at(self.initial, self.scheme, self.model, self.grid, blocks, self.stream, batch.first)
        y = y.reshape(blocks, d, LANES)
        normals = normals_at(self.model, y)  # random initial states have tangent spaces of their own
        q = self.first_vectors(batch, normals)
        total, change = np.zeros((m, blocks, LANES)), np.zeros(blocks)
        values = np.zeros((blocks, len(self.stored), m + _FURTHER, LANES))
        before, begun = np.append(0, self.stops), self._log_lengths(y, normals)
        with (
            limited_threads(self._threads(blocks)),
            np.errstate(all="ignore"),
        ):  # errors are those of paths that diverge
            for number_of_stop, stop in enumerate(self.stops, 1):
                moved = self._moved(y, number_of_stop, batch)
                near = (NEAR if number_of_stop % 2 else -NEAR) * size_of(y, moved)
                others = [self._moved(y + near * each, number_of_stop, batch) for each in q]
                y, q = moved, (np.array(others) - moved) / near
                normals = normals_at(self.model, y)
                make_tangent(q, normals)
                grown = orthonormalise(q)
                change = np.fmax(change, np.abs(grown).max(axis=(0, 2)))
                if number_of_stop == self.begin:
                    begun = self._log_lengths(y, normals)
                if number_of_stop > self.begin:
                    total += grown
                at = np.searchsorted(self.stored, number_of_stop)
                if at < len(self.stored) and self.stored[at] == number_of_stop:
                    since = (stop - before[self.begin]) * self.grid.reference_step
                    means = (total + (self._log_lengths(y, normals) - begun)) / since
                    values[:, at, :m] = np.moveaxis(means, 0, 1)
                    values[:, at, m] = means.sum(axis=0)
                    values[:, at, m + 1] = self._energies(y)
            half = len(self.stored) // 2
            if half:
                energies = values[:, :, m + 1]
                values[:, -1, m + 2] = energies[:, half:].mean(axis=1) - energies[:, :half].mean(axis=1)
        return {
            "values": values,
            "change": change,
            "nonfinite": np.logical_not(np.isfinite(values[:, -1, : m + 1]).all(axis=1)),
        }

    def _threads(self, blocks: int) -> int:
        """Number of threads that are worth waiting for in each of many short calls."""
        work = blocks * LANES * self.case.every * typical_ns(self.row, self.model)
        return max(1, min(blocks, int(work / _LEAST_NS)))

    def _log_lengths(self, y: np.ndarray, normals: np.ndarray) -> np.ndarray | float:
        """Logarithm of the length at y of a vector of Euclidean length 1."""
        if self.case.damping:
            return 0.0
        return -log_density(self.model, y, normals) / self._leaf

    @cached_property
    def _energy(self) -> Any:
        """H as a function of states (d, blocks, LANES); None where it depends on time."""
        try:
            return path_function(self.model, (), "H").values
        except NumberError:
            return None

    def _energies(self, y: np.ndarray) -> np.ndarray | float:
        """(blocks, LANES) H of states (blocks, d, LANES); NaN where it depends on time."""
        return np.nan if self._energy is None else self._energy(np.moveaxis(y, 1, 0))

    @cached_property
    def _kernel_records(self) -> tuple[Any, Any]:
        """Scheme and the model; looked up once, because there are many short calls."""
        return self.scheme, self.model

    def _moved(self, y: np.ndarray, stop: int, batch: Batch) -> np.ndarray:
        """States (blocks, d, LANES) at a stop, from those at the one before; each stop has random numbers of its own.

        They begin at a multiple of STEPS_PER_TOSS, since coins are drawn for so many steps at a time.
        """
        h, unit = self.grid.reference_step, STEPS_PER_TOSS * (stop - 1)
        done = self.stops[stop - 2] if stop > 1 else 0
        times = self.grid._replace(
            reference_steps=int(self.stops[stop - 1] - done), first_step=unit, start=(int(done) - unit) * h
        )
        states = np.array(y).reshape(len(y), 1, -1)
        run = *self._kernel_records, states, times, self.stream
        moved, _ = integrated(*run, batch.first, batch.blocks, batch.end)
        return moved.reshape(y.shape)

    def added(self, sums: Any, contributions: dict[str, Array], batch: Batch) -> Any:
        """Sums with the contributions of a batch, see :class:`BatchedPlan`."""
        if pictures := self._pictures_of(batch.path_set):
            return pictures.added(sums, contributions, batch)
        return super().added(sums, contributions, batch)

    def _known_sum(self) -> float | None:
        """Sum of the exponents of the equation; None where it is not known."""
        case = self.case
        if case.count < self._leaf or case.damping:
            return None
        if math.isinf(case.temperature):
            return 0.0
        return mean_divergence(undamped(case.model), case.temperature, self.initial)

    def whole(self, state: State) -> dict[str, Any]:
        """Also the pictures."""
        pictures = self.pulled.results(state.total(PathRole.PICTURES)) if self.pulled else None
        return super().whole(state) | {"pictures": pictures}

    def estimates(self, sums: LyapunovSums) -> dict[str, Any]:
        """Exponents and what follows from them."""
        groups, m = group_counts(self.samples), self.case.count
        mean, without = mean_over_paths(sums.values[0], groups)
        order = np.argsort(-mean[-1, :m], kind="stable")  # vectors need not have settled in their order
        columns = np.append(order, np.arange(m, m + _FURTHER))
        mean, without = mean[:, columns], without[..., columns]
        with np.errstate(all="ignore"):
            spread = standard_deviation(mean, mean_over_paths(sums.values[1], groups)[0][:, columns])
            stderr = spread / np.sqrt(self.samples - 1)  # paths are independent of one another
            alike = ~(spread > EQUAL * np.abs(mean))  # squares of values that are nearly equal leave no digits
            stderr = np.where(alike, jackknife_stderr(mean, without, groups), stderr)
        total = mean[:, m] - (self._known_sum() or 0.0)
        exponent_stderr = with_rounding(stderr[:, :m].T, mean[:, :m].T, self.resolution)
        dimension, others = (kaplan_yorke(np.moveaxis(rows[..., -1, :m], -1, 0)) for rows in (mean, without))
        is_known = m == self._leaf or dimension < m
        of_energy: dict[str, Any] = {}
        if self._energy is not None:
            of_energy = {"energy": mean[:, m + 1], "energy_stderr": stderr[:, m + 1]}
            of_energy |= {"energy_change": float(mean[-1, m + 2]), "energy_change_stderr": float(stderr[-1, m + 2])}
        return {
            "number": np.arange(1, m + 1),
            "t": self.stops[self.stored - 1] * self.grid.reference_step,
            "exponent": mean[:, :m].T,
            "exponent_stderr": exponent_stderr,
            "total": mean[:, m],
            "total_stderr": with_rounding(stderr[:, m], total, self.resolution),
            "rounding": rounding(self.resolution),
            "total_known": self._known_sum(),
            "dimension_stderr": float(jackknife_stderr(dimension, others, groups)) if is_known else None,
            **of_energy,
            "change": float(np.exp(sums.change)),
            "nonfinite": int(sums.nonfinite),
            "panels": self.case.panels or PANELS,
            "ns_per_step": self.ns_per_step(sums),
        }


plan = LyapunovPlan.of
