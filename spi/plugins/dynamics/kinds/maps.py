"""Maps of densities: cells of equal size on a sphere or of two functions, and the record of a map."""

from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.random_states import RandomState, Spheres
from spi.kinds.functions import path_function
from spi.models.delegation import depends_on_time
from spi.plugins.dynamics.statistics.cells import cells_around, places_in_cells, share_stderr
from spi.storage.stored import Array, Described, array, axis, derived

#: The sides of cells of equal area on a sphere, by Archimedes.
SPHERE_SIDES = "y3 / |y|", "longitude"

_MARGIN = 0.125  # of the range of the first paths on each side
_WITHIN = 8  # points along a side of a cell, over which a known density is averaged


class DensityMap(Described):
    """Densities in cells of equal size, on a sphere by steradian or of two functions."""

    sides: tuple[str, ...] = axis("what the cells divide: their rows and their columns", name="side")
    t: Array = axis("time of the map", "time", name="map_t")
    low: Array = array("map_t side", "lower end of the first cell")
    width: Array = array("map_t side", "width of a cell")
    density: Array = array("map_t row column", "share of the paths in the cell, by its area")
    stderr: Array = array("map_t row column", "standard error of the density")
    outside: Array = array("map_t", "share of the paths outside of all cells")
    law: Array | None = array("row column", "the Gibbs law in the cells of a sphere, as a density", default=None)

    @derived("map_t row column", "standard error of the density")
    def density_stderr(self) -> Array:
        """(times, rows, columns) of the field `stderr`."""
        return self.stderr

    @derived("map_t row column", "middle of the cell on the first side", column="{}")
    def row_middle(self) -> Array:
        """(times, rows, columns) the same in a row."""
        return np.broadcast_to(self._middles(0)[:, :, np.newaxis], self.density.shape)

    @derived("map_t row column", "middle of the cell on the second side", column="{}")
    def column_middle(self) -> Array:
        """(times, rows, columns) the same in a column."""
        return np.broadcast_to(self._middles(1)[:, np.newaxis], self.density.shape)

    def _middles(self, side: int) -> Array:
        """(times, cells) of a side."""
        places = np.arange(self.density.shape[1 + side]) + 0.5
        return self.low[:, side, np.newaxis] + self.width[:, side, np.newaxis] * places

    @property
    def is_sphere(self) -> bool:
        """Whether the cells are those of a sphere."""
        return self.sides == SPHERE_SIDES


class Cells(NamedTuple):
    """Cells of equal size at some times, by two sides."""

    low: Array  #: (times, 2)
    width: Array  #: (times, 2)
    number: tuple[int, int]
    pair: tuple[int, ...]  #: the functions of the sides; () for the sphere
    axes: tuple[tuple[int, float], ...] = ((0, 1.0), (1, 1.0), (2, 1.0))  #: components of the sphere, and their units

    @classmethod
    def of_sphere(cls, times: int, number: tuple[int, int], surface: Spheres | None = None) -> "Cells":
        """Bands of equal height in cells of equal width, of the first sphere or ellipsoid of a surface."""
        low = np.tile([-1.0, -np.pi], (times, 1))
        cells = cls(low, -2 * low / number, number, ())
        if surface is None:
            return cells
        return cells._replace(axes=tuple((i, surface.lengths[i]) for i in surface.triples[0]))

    @classmethod
    def around(cls, values: Array, pair: tuple[int, ...], number: tuple[int, int]) -> "Cells":
        """Cells that hold the values (times, 2, paths) of two functions, and an eighth of their range on each side."""
        return cls(*cells_around(values, number[0], _MARGIN), number, pair)

    def places(self, states: Array, values: Array) -> Array:
        """(blocks, times, 1, LANES) the number of the cell, and a half; -1 outside of all cells, NaN where lost.

        Of states (d, blocks, times, LANES) or of the values (2, blocks, times, LANES) of two functions.
        """
        sides = values if self.pair else self._directions(states)
        return places_in_cells(sides, self.low, self.width, self.number, closed=not self.pair)

    def gibbs(self, model: Any, initial: Any, temperature: float) -> Array | None:
        """Density of exp(-H/T) in the cells of the sphere through `initial`; None where that is not the law."""
        of_law = initial.law.surface if isinstance(initial, RandomState) else initial
        if self.pair or not np.isfinite(temperature) or of_law is None or depends_on_time(model):
            return None
        fine = [(np.arange(_WITHIN * n) + 0.5) / (_WITHIN * n) for n in self.number]
        z, longitude = np.meshgrid(2 * fine[0] - 1, np.pi * (2 * fine[1] - 1), indexing="ij")
        across = np.sqrt(1 - z**2)
        y = np.linalg.norm(initial) * np.array([across * np.cos(longitude), across * np.sin(longitude), z])
        exponent = -path_function(model, (), "H").values(y) / temperature
        weight = np.exp(exponent - exponent.max())
        rows, columns = self.number
        return weight.reshape(rows, _WITHIN, columns, _WITHIN).mean(axis=(1, 3)) / (4 * np.pi * weight.mean())

    def _directions(self, y: Array) -> Array:
        """Height on the unit sphere and the longitude (2, ...) of states (d, ...)."""
        with np.errstate(all="ignore"):
            a, b, c = (y[i] / unit for i, unit in self.axes)
            return np.array([c / np.sqrt(a**2 + b**2 + c**2), np.arctan2(b, a)])

    def densities(self, counts: Array, t: Array, names: tuple[str, ...], origins: Array) -> dict[str, Any]:
        """Fields of a :class:`DensityMap` from counts (times, 1, 2 + cells).

        The functions of the sides have `names`, and were counted less their `origins` (2,).
        """
        n = counts[0, 0].sum()
        share = counts[:, 0, 1:-1].reshape(-1, *self.number) / n
        area = self.width.prod(axis=1)[:, np.newaxis, np.newaxis]
        return {
            "sides": names if self.pair else SPHERE_SIDES,
            "t": t,
            "low": self.low + origins,
            "width": self.width,
            "density": share / area,
            "stderr": share_stderr(share, n) / area,
            "outside": (counts[:, 0, 0] + counts[:, 0, -1]) / n,
        }
