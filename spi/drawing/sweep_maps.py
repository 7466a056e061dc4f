"""The figure of two swept parameters: each quantity as a map over both, for each scheme."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import FuncNorm, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..statistics.claims import AT_MOST, Sort
from ..statistics.curves import Curve
from . import layout, style
from .cells import cell_places, edges, ticks

SIZE = (4.3, 3.4)  # inches of a map
COLUMNS = 3  # maps side by side
_SIGNED, _ONE_SIGN = "RdBu_r", "viridis"  # colours
_LINEAR = 0.03  # share of the largest value of a sign below which colours are linear
_WIDE = 30.0  # ratio of values of one sign from which on their colours are logarithmic
_EVEN = 1.01  # ratio of gaps of values that are evenly spaced
_TICKS = 7
_UNKNOWN = "#dddddd"


def draw(title: str, cases: Sequence[tuple[str, Sequence[Curve], list[str]]], sorts: Mapping[str, Sort]) -> Figure:
    """The figure of cases in which two parameters are swept: of each the title, curves and facts."""
    shared = [fact for fact in cases[0][2] if all(fact in facts for _, _, facts in cases)]
    several = len({curve.about.variant for _, curves, _ in cases for curve in curves}) > 1
    lines: list[layout.Line] = []
    for name, curves, facts in cases:
        own = [fact for fact in facts if fact not in shared]
        panels = [partial(_panel, curve=curve, sorts=sorts, several=several) for curve in curves]
        found = layout.in_lines(panels, COLUMNS, SIZE)
        if len(cases) > 1:
            heading = style.wrapped([style.plain(name), *own], ",  ", "axes.titlesize", SIZE[0] * COLUMNS)
            found[0] = found[0]._replace(title="\n".join(heading))
        lines += found
    lines[-1] = lines[-1]._replace(legend=_legend([curve for _, curves, _ in cases for curve in curves]))
    return layout.arranged(title, lines, shared)


def _legend(curves: Sequence[Curve]) -> list[list[layout.Entry]]:
    if not any(_is_signed(curve) for curve in curves):
        return []
    zero = Line2D([], [], color="black", linewidth=1.2), "zero"
    return [[zero, layout.mark(".", "sign not decided (95 %)", markersize=4)]]


def _is_signed(curve: Curve) -> bool:
    values = curve.of("value")
    return bool((values < 0).any() and (values > 0).any())


def _panel(ax: Axes, curve: Curve, sorts: Mapping[str, Sort], several: bool) -> None:
    """A cell for each pair of values; where both signs occur also the line of zero, and cells of which none is sure."""
    grid = curve.grid()
    x, y = map(_axis, grid.axes)
    values, low, high = (grid.of(field) for field in ("value", "low", "high"))
    is_error, signed = curve.name in sorts and sorts[curve.name].sense == AT_MOST, _is_signed(curve)
    shown, sign = (-values, "minus ") if (values <= 0).all() else (values, "")
    corners = [np.append(each[:, 0], each[-1, 1]) for _, each, _ in (x, y)]
    ax.set_facecolor(_UNKNOWN)
    look: dict[str, Any] = {"cmap": _SIGNED if signed else _ONE_SIGN, "norm": _norm(shown, is_error)}
    mesh = ax.pcolormesh(*corners, shown.T, rasterized=True, **look)
    for scale, (_, _, on_log) in ((ax.set_xscale, x), (ax.set_yscale, y)):
        scale("log" if on_log else "linear")
    for axis, (places, _, _), known in zip((ax.xaxis, ax.yaxis), (x, y), grid.axes, strict=True):
        ticks(axis, places, known, steps=False, room=_TICKS)
    if signed:
        if min(values.shape) > 1:
            ax.contour(x[0], y[0], values.T, levels=[0.0], colors="black", linewidths=1.2)
        i, j = np.nonzero((low <= 0) & (high >= 0))
        ax.plot(x[0][i], y[0][j], ".", color="black", markersize=3)
    ax.set(xlabel=style.word(grid.words[0]), ylabel=style.word(grid.words[1]))
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02)
    if signed:
        at = _bar_ticks(values)
        bar.set_ticks(at, labels=[f"${style.number(one)}$" for one in at])
        bar.ax.minorticks_off()
    bar.outline.set_linewidth(0.4)
    told = [style.plain(f"{sign}{curve.label}{f' of {curve.function}' * bool(curve.function)}")]
    told += [style.label(curve.about)] * several
    if (agreement := curve.chi_squared) is not None:
        told.append(f"$\\chi^2={agreement[0]:.0f}$ of {agreement[1]} cells from what is known")
    ax.set_title("\n".join(told))


def _axis(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """Where the centres of cells stand, and their edges, and whether on logarithms."""
    gaps = np.diff(values)
    places, is_log = (values, False) if gaps.max() <= _EVEN * gaps.min() else cell_places(values)
    return places, edges(places, is_log), is_log


def _norm(values: np.ndarray, is_error: bool) -> Normalize | None:
    """How values become colours: of both signs each with the whole range of its own."""
    known = values[np.isfinite(values)]
    if known.size and known.min() < 0 < known.max():
        low, high, whole = float(-known.min()), float(known.max()), float(np.arcsinh(1 / _LINEAR))

        def forwards(v: Any) -> Any:
            return np.arcsinh(v / (_LINEAR * np.where(np.asarray(v) < 0, low, high))) / whole

        def backwards(u: Any) -> Any:
            return np.sinh(np.asarray(u) * whole) * _LINEAR * np.where(np.asarray(u) < 0, low, high)

        return FuncNorm((forwards, backwards), -low, high)
    positive = known[known > 0]
    if positive.size and (is_error or positive.max() > _WIDE * positive.min()):
        return LogNorm(positive.min(), positive.max())
    return None


def _bar_ticks(values: np.ndarray) -> list[float]:
    """0, and of each sign a round number near its largest value, and a tenth of that."""
    found = [0.0]
    for sign in (-1.0, 1.0):
        most = float(np.nanmax(sign * values))
        digit = 10.0 ** np.floor(np.log10(most))
        found += [sign * digit * np.floor(most / digit) / part for part in (1.0, 10.0)]
    return sorted(found)
