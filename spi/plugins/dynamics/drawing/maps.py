"""Maps of densities in cells, of two quantities or of a sphere, and densities of one: panels and what they draw."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from spi.drawing import plots, style
from spi.drawing.panels import Records, names_along, scheme_look
from spi.numerics.types import Array
from spi.storage.stored import Description

# ---------------------------------------------------------------------------------------------------------------------
# Mollweide's projection of the sphere, which keeps areas.
# ---------------------------------------------------------------------------------------------------------------------

#: Half the axes of the ellipse that the sphere becomes, of area 4 pi.
_HALF_WIDTH, _HALF_HEIGHT = 2 * np.sqrt(2.0), np.sqrt(2.0)

_TABLE = np.linspace(-np.pi / 2, np.pi / 2, 2001)  # auxiliary angles a with 2 a + sin 2 a = pi sin(latitude)
_HEIGHT = (2 * _TABLE + np.sin(2 * _TABLE)) / np.pi


def heights(low: float, high: float, count: int) -> Array:
    """`count` heights from `low` to `high`, dense near the poles, where meridians bend, so that curves look smooth."""
    angle = np.linspace(np.interp(low, _HEIGHT, _TABLE), np.interp(high, _HEIGHT, _TABLE), count)
    return (2 * angle + np.sin(2 * angle)) / np.pi


def mollweide(z: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(x, y) in the plane of the point of the unit sphere at height `z` and longitude in [-pi, pi]."""
    angle = np.interp(z, _HEIGHT, _TABLE)
    return _HALF_WIDTH / np.pi * longitude * np.cos(angle), _HALF_HEIGHT * np.sin(angle)


# ---------------------------------------------------------------------------------------------------------------------
# Cells.
# ---------------------------------------------------------------------------------------------------------------------

_BANDS = 96  # into which a sphere is divided at least, as the edges of its cells are curved


def cell_edges(maps: Any, i: int, finer: int = 1) -> list[Array]:
    """Edges of the cells of map `i` along both of its sides, each cell divided into `finer` parts."""
    ends = zip(maps.low[i], maps.width[i], maps.density.shape[1:], strict=True)
    return [low + width * np.linspace(0, number, finer * number + 1) for low, width, number in ends]


def _on_sphere(maps: Any, i: int, density: Array) -> tuple[Array, Array, Array]:
    """Places and densities in Mollweide's plane of the cells of map `i`, by height and longitude on a sphere."""
    finer = -(-_BANDS // len(density))
    density = np.repeat(np.repeat(density, finer, axis=0), finer, axis=1)
    sides, longitude = cell_edges(maps, i)[0], cell_edges(maps, i, finer)[1]
    z = np.append([heights(*side, finer + 1)[:-1] for side in pairwise(sides.tolist())], sides[-1])
    return *mollweide(*np.meshgrid(z, longitude, indexing="ij")), density


def log_colours(least: float, most: float) -> dict[str, Any]:
    """Logarithmic colours from pale for the least density to dark for the largest."""
    return {"cmap": "inferno_r", "norm": LogNorm(least, max(most, 2 * least))}


def draw_cells(ax: Axes, about: Description, maps: Any, i: int, density: Array, look: dict[str, Any]) -> None:
    """Draw a density in the cells of map `i`, where it is above 0, with the names of their sides and a colour bar."""
    density = np.where(density > 0, density, np.nan)
    cells = _on_sphere(maps, i, density) if maps.is_sphere else (*cell_edges(maps, i), density.T)
    mesh = ax.pcolormesh(*cells, rasterized=True, **look)
    if maps.is_sphere:
        net(ax, style.component_names(about, 3))
        below = ax.inset_axes((0.15, -0.2, 0.7, 0.05))
        bar = ax.figure.colorbar(mesh, cax=below, label="density per steradian", orientation="horizontal")
    else:
        ax.set(xlabel=style.maths(maps.sides[0], about.variables), ylabel=style.maths(maps.sides[1], about.variables))
        bar = ax.figure.colorbar(mesh, ax=ax, label="density", pad=0.02)
    bar.minorticks_off()
    bar.outline.set_linewidth(0.4)


def net(ax: Axes, names: Sequence[str]) -> None:
    """Draw meridians, parallels, the outline and the points where the axes with these `names` leave the sphere."""
    thin: dict[str, Any] = {"color": plots.GREY, "linewidth": 0.4, "alpha": 0.6}
    whole, up = np.linspace(-1, 1, 201), heights(-1, 1, 201)
    for longitude in np.pi * np.array([-1.0, -0.5, 0, 0.5, 1.0]):
        outline = {"color": "black", "linewidth": 0.7} if abs(longitude) > 3 else thin
        ax.plot(*mollweide(up, np.full_like(up, longitude)), **outline)
    for height in (-0.5, 0, 0.5):
        ax.plot(*mollweide(np.full_like(whole, height), np.pi * whole), **thin)
    ends = {
        (0, 0): names[0],
        (0, 0.5): names[1],
        (0, -0.5): f"$-${names[1]}",
        (1, 0): names[2],
        (-1, 0): f"$-${names[2]}",
    }
    for (height, turn), name in ends.items():
        x, y = mollweide(np.array(height, float), np.pi * np.array(turn))
        ax.plot(x, y, marker="+", color="black", markersize=4, markeredgewidth=0.7)
        above = height >= 0
        place: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom" if above else "top"}
        ax.annotate(name, (x, y), (0, 3 if above else -3), **place)
    ax.set_aspect("equal")
    ax.set_axis_off()


# ---------------------------------------------------------------------------------------------------------------------
# Panels.
# ---------------------------------------------------------------------------------------------------------------------


class HistogramPanel(NamedTuple):
    """Densities in cells of equal width, a panel for each function, with the density of theory as a smooth line."""

    field: str
    low: str  #: the field beside it with the lower ends of the first cells
    width: str
    at: Callable[[Any], int | None]  #: the place along the axis that is neither the functions' nor the cells'
    label: str = "density of ${f}$"
    exact: str = ""  #: the field with the density of theory
    only: Callable[[Any, int], bool] = lambda record, place: True

    def expand(self, records: Records, looks: style.Looks) -> Iterator[plots.Plot]:
        """Panels of one case."""
        shown = [record for record in records if record.get(self.field) is not None and self.at(record) is not None]
        if not shown:
            return
        along = shown[0].by_name[self.field].axes.index("function")
        for f, name in enumerate(names_along(shown[0], "function", shown[0].get(self.field).shape[along])):
            if not any(self.only(record, f) for record in shown):
                continue
            lines: list[plots.Series] = []
            for record in shown:
                index = (f, self.at(record)) if along == 0 else (self.at(record), f)
                lines = [*self._lines(record, index, looks), *lines]
            lines.sort(key=lambda line: line.label == "exact")
            peak = max(float(np.nanmax(line.y, initial=0.0)) for line in lines)
            title, label = style.long_title(shown[0], "function", f), self.label.format(f=name.strip("$"))
            yield plots.Plot(lines, title, name, label, ylim=(0.0, 1.12 * peak or 1.0))

    def _lines(self, record: Any, index: Any, looks: style.Looks) -> Iterator[plots.Series]:
        """Density of one scheme without the empty cells at both ends, and that of theory."""
        density, bottom, top = (array[index] for array in record.estimate(self.field)[1:])
        exact, low, width = (record.get(name)[index] for name in (self.exact or self.field, self.low, self.width))
        used = np.flatnonzero((density > 0) | (exact > 0))
        cells = slice(used[0], used[-1] + 1) if len(used) else slice(None)
        x = (low + width * (np.arange(len(density)) + 0.5))[cells]
        has_exact = bool(self.exact) and np.isfinite(exact).any()
        own = {"linestyle": "none", "markersize": 4.0} if has_exact else {"drawstyle": "steps-mid", "marker": ""}
        look, ends = scheme_look(record, looks) | own, {"low": bottom[cells], "high": top[cells]}
        yield plots.series(x, density[cells], look, style.label(record.about), **ends)
        if has_exact:
            yield plots.series(x, exact[cells], plots.THEORY, "exact")


class MapPanel(NamedTuple):
    """Maps of a nested record with cells, of two quantities or of the sphere, each scheme at each time."""

    field: str  #: the nested record
    #: Of an axes, a record, the number of the map, and all records.
    draw: Callable[[Axes, Any, int | None, Records], list[plots.LegendEntry]]
    law: str = ""  #: the field of the nested record with a law, which is drawn as map None, and its title
    law_title: str = ""

    def expand(self, records: Records, looks: style.Looks) -> Iterator[plots.Plot]:
        """A panel for each scheme and time, and one for the law."""
        shown = [record for record in records if getattr(record, self.field) is not None]
        for record in shown:
            for i, t in enumerate(getattr(record, self.field).t.tolist()):
                title = f"{style.label(record.about)}, $t={style.number(t)}$"
                yield plots.Plot(title=title, own=partial(self._own, record, i, shown), aspect=0.8)
        if shown and self.law and getattr(getattr(shown[0], self.field), self.law) is not None:
            yield plots.Plot(title=self.law_title, own=partial(self._own, shown[0], None, shown), aspect=0.8)

    def _own(self, record: Any, i: int | None, records: Records, ax: Axes) -> list[plots.LegendEntry]:
        return self.draw(ax, record, i, records)
