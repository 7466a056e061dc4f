"""Pull-back pictures: many states on one path of noise that ends now and began a time t ago, for several t.

Steps of the noise are numbered backwards from now, number n being made of the increments that a run has in its step n.
So the noise from -t to 0 is the same in all pictures, whatever other times there are, and as t grows pictures converge
to the random attractor of this path of noise (H. Crauel, F. Flandoli, Probability Theory and Related Fields 100, 1994;
the numbering is that of coupling from the past, J. G. Propp, D. B. Wilson, Random Structures and Algorithms 9, 1996).
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spi.ensemble.increments import Given, draw_noise, draw_paths, empty_noise
from spi.ensemble.loop import arguments_of, integrate, integrated
from spi.ensemble.observer import count_values
from spi.ensemble.protocol import dimension
from spi.ensemble.random_states import block_states
from spi.exact.surfaces import spheres
from spi.kinds import blocks
from spi.kinds.plans import KernelCall, PathsPlan
from spi.models.delegation import undamped
from spi.numerics.arrays import exp, log
from spi.numerics.rng import LANES
from spi.statistics.accumulators import Array, Sums, added, moments
from spi.statistics.cells import HALF_HEIGHT, HALF_WIDTH, cells_around, count_places, mollweide, places_in_cells
from spi.statistics.estimators import group_counts, jackknife_stderr, mean_over_paths
from spi.statistics.tallies import PathSet

from .results import SPHERE_SIDES, Pictures

_OF_SPHERE, _OF_PLANE = (192, 384), (256, 256)  # cells of a picture
_PILOT = 4  # blocks by which the ends of the cells are found, where they are not those of a sphere
_MARGIN = 0.125  # of their range on each side
_LEAST = 1e-16  # distance, relative to |y|, that counts as this one


class Counts(Sums):
    """Sums over the states of the pictures at T times."""

    cells: Array = added("time one count", int)  #: outside, in each cell, lost
    distances: Array = moments("time distance")  #: of two states, and the logarithm of that


@dataclass(frozen=True)
class Pulled:
    """The pictures of a plan."""

    plan: PathsPlan

    @property
    def _keys(self) -> Any:
        return self.plan.case.pullback

    @cached_property
    def steps(self) -> list[int]:
        """(T,) the number of steps of each picture."""
        return [round(t / self.plan.grid.reference_step) for t in self._keys.times]

    @property
    def path_set(self) -> PathSet:
        """The states."""
        return PathSet(self._keys.points, blocks.chunk_blocks(sum(self.steps), dimension(self.plan.model)))

    @cached_property
    def _noise(self) -> Given:
        """The first steps of path number 0, as many as the longest picture takes."""
        p = self.plan
        given = empty_noise(p.scheme, p.model, max(self.steps), 1)
        draw_noise(p.scheme, p.model, p.stream, p.grid.reference_step, p.grid.area_terms, 0, 0, given)
        return given

    def _until_now(self, steps: int) -> Given:
        """The noise of `steps` steps, the last of which is number 0."""
        whole = self._noise
        parts = len(whole.dW) // max(self.steps)
        dW = whole.dW.reshape(-1, parts, *whole.dW.shape[1:])[:steps][::-1].reshape(steps * parts, *whole.dW.shape[1:])
        areas, coins = (np.ascontiguousarray(rows[:steps][::-1]) for rows in (whole.areas, whole.coins))
        return Given(np.ascontiguousarray(dW), areas, coins, 0)

    def states(self, first: int, count: int, end: int) -> np.ndarray:
        """(blocks, T, d, LANES) the states of some blocks at the end of each picture."""
        p, d = self.plan, dimension(self.plan.model)
        begin = block_states(p.case.points_law, p.stream, first, count).reshape(count, 1, d * LANES)
        states = np.empty((count, len(self.steps), d, LANES))
        for i, steps in enumerate(self.steps):
            start = p.case.last_time - steps * p.grid.reference_step
            times = p.grid._replace(reference_steps=steps, start=start)
            moved, _ = integrated(p.scheme, p.model, begin, times, self._until_now(steps), first, count, end)
            states[:, i] = moved.reshape(count, d, LANES)
        return states

    def sides(self, states: np.ndarray) -> np.ndarray:
        """(2, ...) the coordinates of states (blocks, T, d, LANES) in the plane of the picture."""
        y = np.moveaxis(states, 2, 0)
        if self._sphere is None:
            return y[:2]
        at, lengths = self._sphere
        with np.errstate(all="ignore"):
            a, b, c = (y[i] / length for i, length in zip(at, lengths, strict=True))
            x, height = mollweide(c / np.sqrt(a * a + b * b + c * c), np.arctan2(b, a))
        return np.array([height, x])

    @cached_property
    def _sphere(self) -> tuple[tuple[int, ...], tuple[float, ...]] | None:
        """The first sphere of the Casimir surface: its components, and half the axes where it is an ellipsoid."""
        p = self.plan
        surface = spheres(undamped(p.model), p.initial)
        if surface is None:
            return None
        at = surface.triples[0]
        return at, tuple(surface.lengths[i] for i in at)

    @property
    def _number(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        return _OF_PLANE if self._sphere is None else _OF_SPHERE

    @cached_property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(T, 2) the lower ends of the first cell, and (T, 2) the widths of a cell."""
        shape = len(self.steps), 2
        if self._sphere is not None:
            half = np.array([HALF_HEIGHT, HALF_WIDTH])
            return np.broadcast_to(-half, shape), np.broadcast_to(2 * half / self._number, shape)
        values = self.sides(self.states(0, _PILOT, _PILOT * LANES)).transpose(2, 0, 1, 3).reshape(*shape, -1)
        return cells_around(values, self._number, _MARGIN)

    @property
    def lengths(self) -> dict[str, int]:
        """The lengths of the axes of the sums."""
        return {"time": len(self.steps), "one": 1, "count": 2 + math.prod(self._number), "distance": 2}

    def observe(self, first: int, count: int, end: int) -> dict[str, Array]:
        """The contributions of some blocks; the partner of lane l is l + 32, which is in the same jackknife group.

        `cells` are (blocks, T, 1, LANES) the number of the cell and a half, -1 outside, NaN if lost.
        """
        y = self.states(first, count, end)
        with np.errstate(all="ignore"):
            apart = y - np.roll(y, LANES // 2, axis=-1)
            distance = np.sqrt((apart * apart).sum(axis=2))
            size = np.sqrt((y * y).sum(axis=2))
        places = places_in_cells(self.sides(y), *self.ends, self._number, closed=self._sphere is not None)
        return {"cells": places, "distances": np.stack([distance, log(np.maximum(distance, _LEAST * size))], axis=2)}

    def added(self, sums: Counts, contributions: dict[str, Array], at: slice, first: int, end: int) -> Counts:
        """The sums with the contributions `at`, of which the first is that of block `first`."""
        cells = sums.cells.copy()
        count_places(contributions["cells"][at], first, end, cells)
        return sums.with_blocks({"distances": contributions["distances"]}, at, first, end)._replace(cells=cells)

    def results(self, sums: Counts) -> Pictures:
        """The pictures, from the sums over all states."""
        low, width = self.ends
        groups = group_counts(sums.paths)
        mean, without = mean_over_paths(sums.distances[0], groups)
        names = self.plan.case.variables[:2] or ("y1", "y2")
        return Pictures(
            t=np.array(self._keys.times),
            sides=SPHERE_SIDES if self._sphere is not None else tuple(names),
            low=low.copy(),
            width=width.copy(),
            count=sums.cells[:, 0, 1:-1].reshape(-1, *self._number),
            outside=(sums.cells[:, 0, 0] + sums.cells[:, 0, -1]) / sums.paths,
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
