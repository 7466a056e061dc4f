"""The figures of swept parameters: each quantity over the values of one, or as a map over those of two."""

from collections.abc import Callable, Mapping, Sequence
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
from .axes import cell_places, edges, limits, swept_axis, ticks

SIZE = (3.6, 2.9)  # inches of a panel
ALONE = (4.6, 3.5)  # the same where there is only one
COLUMNS = 3  # panels side by side
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), "-.")  #: of estimators
PALE = 0.4  # opacity of points that are not resolved
KNOWN: dict[str, Any] = {"linestyle": (0, (2, 2)), "linewidth": 1.0, "zorder": 3.5}  # over a curve that agrees


MAP = (4.3, 3.4)  # inches of a map
_SIGNED, _ONE_SIGN = "RdBu_r", "viridis"  # colours
_LINEAR = 0.03  # share of the largest value of a sign below which colours are linear
_WIDE = 30.0  # ratio of values of one sign from which on their colours are logarithmic
_EVEN = 1.01  # ratio of gaps of values that are evenly spaced
_TICKS = 7
_UNKNOWN = "#dddddd"

Case = tuple[str, Sequence[Curve], list[str]]  #: title, curves and facts of one that is swept


def draw(title: str, cases: Sequence[Case], sorts: Mapping[str, Sort]) -> Figure:
    """The figure of cases that are swept: each quantity over the values; `sorts` has the sort of each quantity."""
    every: Any = [curve for _, curves, _ in cases for curve in curves]
    looks = style.looks([every])
    estimators = list(dict.fromkeys(curve.about.estimator for curve in every))
    panel = partial(_panel, looks=looks, estimators=estimators, sorts=sorts)

    def lines_of(curves: Sequence[Curve]) -> list[layout.Line]:
        rows = _rows(curves)
        size = ALONE if len(cases) == len(rows) == len(rows[0]) == 1 else SIZE
        return [layout.Line([partial(panel, curves=some) for some in row], size) for row in rows]

    return _arranged(title, cases, lines_of, SIZE[0] * COLUMNS, _legend(every, looks, estimators))


def _arranged(
    title: str,
    cases: Sequence[Case],
    lines_of: Callable[[Sequence[Curve]], list[layout.Line]],
    width: float,
    legend: list[list[layout.Entry]],
) -> Figure:
    """The lines of each case, under its title if there are several, and the legend under all."""
    shared = [fact for fact in cases[0][2] if all(fact in facts for _, _, facts in cases)]
    lines: list[layout.Line] = []
    for name, curves, facts in cases:
        case_lines = lines_of(curves)
        if len(cases) > 1:
            heading = [style.plain(name), *(fact for fact in facts if fact not in shared)]
            case_lines[0] = case_lines[0]._replace(
                title="\n".join(style.wrapped(heading, ",  ", "axes.titlesize", width))
            )
        lines += case_lines
    lines[-1] = lines[-1]._replace(legend=legend)
    return layout.arranged(title, lines, shared)


def _rows(curves: Sequence[Curve]) -> list[list[list[Curve]]]:
    """The curves of each panel: a row for each quantity where it has several test functions, else one for all."""
    panels: dict[tuple[str, str], list[Curve]] = {}
    for curve in curves:
        panels.setdefault((curve.name, curve.function), []).append(curve)
    functions = {function for _, function in panels}
    names = list(dict.fromkeys(name for name, _ in panels)) if len(functions) > 1 else [""]
    rows = [[some for (quantity, _), some in panels.items() if name in (quantity, "")] for name in names]
    return [row[i : i + COLUMNS] for row in rows for i in range(0, len(row), COLUMNS)]


def _panel(
    ax: Axes, curves: Sequence[Curve], looks: style.Looks, estimators: Sequence[str], sorts: Mapping[str, Sort]
) -> None:
    """One quantity over the parameter, with 95 % intervals; its expected values dashed."""
    first, every = curves[0], np.unique(np.concatenate([curve.values for curve in curves]))
    places = dict(zip(every.tolist(), swept_axis(ax, first.word, every).tolist(), strict=True))
    is_log = first.name in sorts and sorts[first.name].sense == AT_MOST
    _limits(ax, curves, is_log)
    if ax.get_yscale() == "linear" and np.prod(ax.get_ylim()) < 0:
        ax.axhline(0, color="#aaaaaa", linewidth=0.8, zorder=1)
    # expected values that several curves share are drawn once
    theory: dict[tuple[bytes, bytes], list[tuple[np.ndarray, np.ndarray, str]]] = {}
    for curve in curves:
        marker, colour = looks[curve.about.variant]
        x, value = np.array([places[number] for number in curve.values.tolist()]), curve.of("value")
        order, dashes = np.argsort(x), DASHES[estimators.index(curve.about.estimator) % len(DASHES)]
        ax.plot(x[order], value[order], color=colour, linestyle=dashes, zorder=3)
        with np.errstate(invalid="ignore"):  # of paths that diverged
            bars = np.nan_to_num(np.array([value - curve.of("low"), curve.of("high") - value]), posinf=0.0)
        look: dict[str, Any] = {"marker": marker, "color": colour, "markerfacecolor": "none", "linestyle": "none"}
        poor = curve.poor
        for chosen, pale in ((~poor, 1.0), (poor, PALE)):
            if chosen.any():
                ax.errorbar(x[chosen], value[chosen], bars[:, chosen], elinewidth=0.8, zorder=3, alpha=pale, **look)
        numbers = ~np.isnan(value)
        layout.edge_marks(ax, x[numbers], value[numbers], colour)
        if np.isfinite(expected := curve.of("expected")[order]).any():
            theory.setdefault((x[order].tobytes(), expected.tobytes()), []).append((x[order], expected, colour))
    for (x, expected, colour), *others in theory.values():
        ax.plot(x, expected, color=colour if len(curves) > 1 and not others else "#777777", **KNOWN)
    ax.set_ylabel(_label(curves))
    ax.set_title(style.plain(first.function))


def _limits(ax: Axes, curves: Sequence[Curve], is_log: bool) -> None:
    """Scale and limits of the vertical axis: those of the points that are resolved, or of all if none is."""
    values = np.array([np.concatenate([curve.of(field) for curve in curves]) for field in ("value", "low", "high")])
    good = ~np.concatenate([curve.poor for curve in curves])
    values = values[:, good] if good.any() else values[:1]
    positive = values[0][np.isfinite(values[0]) & (values[0] > 0)]
    if is_log and positive.size:
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(limits(positive))
        return
    shown = np.concatenate([values.ravel(), *(curve.of("expected") for curve in curves)])
    if (shown := shown[np.isfinite(shown)]).size:
        room = 0.06 * (shown.max() - shown.min()) or 0.05 * abs(shown[0]) or 1.0
        ax.set_ylim(shown.min() - room, shown.max() + room)


def _label(curves: Sequence[Curve]) -> str:
    """The label of a panel: its quantity, and at which step size."""
    name = style.plain(curves[0].label)
    steps = {curve.h for curve in curves}
    if steps == {None}:
        return name
    h = steps.pop() if len(steps) == 1 else None
    return f"{name} at the smallest $h$" if h is None else f"{name} at $h={style.number(h, steps=True)}$"


def _legend(curves: Sequence[Curve], looks: style.Looks, estimators: Sequence[str]) -> list[list[layout.Entry]]:
    """The rows of the legend: markers, dashes and marks."""
    abouts = {curve.about.variant: curve.about for curve in curves}
    rows = [[layout.scheme_entry(about, looks, markerfacecolor="none") for about in abouts.values()]]
    if len(estimators) > 1:
        handles = [Line2D([], [], color="#777777", linestyle=DASHES[i % len(DASHES)]) for i in range(len(estimators))]
        rows.append(list(zip(handles, map(style.plain, estimators), strict=True)))
    if any(np.isfinite(curve.of("expected")).any() for curve in curves):
        rows.append([(Line2D([], [], color="#777777", **KNOWN), "stated by theory, or known")])
    marks: list[layout.Entry] = []
    if any((curve.poor & np.isfinite(curve.of("value"))).any() for curve in curves):
        marks.append(layout.mark("o", "pale: not resolved", markerfacecolor="none", alpha=PALE))
    if any(np.isinf(curve.of("value")).any() for curve in curves):
        marks.append(layout.mark("^", "paths diverged (NaN or infinity)"))
    return [*rows, marks] if marks else rows


def draw_maps(title: str, cases: Sequence[Case], sorts: Mapping[str, Sort]) -> Figure:
    """The figure of cases in which two parameters are swept: each quantity as a map over both, for each scheme."""
    every = [curve for _, curves, _ in cases for curve in curves]
    several = len({curve.about.variant for curve in every}) > 1

    def lines_of(curves: Sequence[Curve]) -> list[layout.Line]:
        panels = [partial(_map, curve=curve, sorts=sorts, several=several) for curve in curves]
        return layout.in_lines(panels, COLUMNS, MAP)

    return _arranged(title, cases, lines_of, MAP[0] * COLUMNS, _map_legend(every))


def _map_legend(curves: Sequence[Curve]) -> list[list[layout.Entry]]:
    if not any(_is_signed(curve) for curve in curves):
        return []
    zero = Line2D([], [], color="black", linewidth=1.2), "zero"
    return [[zero, layout.mark(".", "sign not decided (95 %)", markersize=4)]]


def _is_signed(curve: Curve) -> bool:
    values = curve.of("value")
    return bool((values < 0).any() and (values > 0).any())


def _map(ax: Axes, curve: Curve, sorts: Mapping[str, Sort], several: bool) -> None:
    """A cell for each pair of values; where both signs occur also the line of zero, and marks where none is certain."""
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
    for axis, (places, _, _), along in zip((ax.xaxis, ax.yaxis), (x, y), grid.axes, strict=True):
        ticks(axis, places, along, steps=False, room=_TICKS)
    if signed:
        if min(values.shape) > 1:
            ax.contour(x[0], y[0], values.T, levels=[0.0], colors="black", linewidths=1.2)
        i, j = np.nonzero((low <= 0) & (high >= 0))
        ax.plot(x[0][i], y[0][j], ".", color="black", markersize=3)
    ax.set(xlabel=style.word(grid.words[0]), ylabel=style.word(grid.words[1]))
    bar = ax.figure.colorbar(mesh, ax=ax, pad=0.02)
    if signed:
        at = _bar_ticks(values)
        bar.set_ticks(at, labels=[f"${style.number(tick)}$" for tick in at])
        bar.ax.minorticks_off()
    bar.outline.set_linewidth(0.4)
    title = [style.plain(f"{sign}{curve.label}{f' of {curve.function}' * bool(curve.function)}")]
    title += [style.label(curve.about)] * several
    if (agreement := curve.chi_squared) is not None:
        title.append(f"$\\chi^2={agreement[0]:.0f}$ for {agreement[1]} cells against known values")
    ax.set_title("\n".join(title))


def _axis(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
    """The centres of cells on an axis, their edges, and whether the axis is logarithmic."""
    gaps = np.diff(values)
    places, is_log = (values, False) if gaps.max() <= _EVEN * gaps.min() else cell_places(values)
    return places, edges(places, is_log), is_log


def _norm(values: np.ndarray, is_error: bool) -> Normalize | None:
    """The map from values to colours; where both signs occur each has the whole range of its own."""
    finite = values[np.isfinite(values)]
    if finite.size and finite.min() < 0 < finite.max():
        low, high, whole = float(-finite.min()), float(finite.max()), float(np.arcsinh(1 / _LINEAR))

        def forwards(v: Any) -> Any:
            return np.arcsinh(v / (_LINEAR * np.where(np.asarray(v) < 0, low, high))) / whole

        def backwards(u: Any) -> Any:
            return np.sinh(np.asarray(u) * whole) * _LINEAR * np.where(np.asarray(u) < 0, low, high)

        return FuncNorm((forwards, backwards), -low, high)
    positive = finite[finite > 0]
    if positive.size and (is_error or positive.max() > _WIDE * positive.min()):
        return LogNorm(positive.min(), positive.max())
    return None


def _bar_ticks(values: np.ndarray) -> list[float]:
    """0, and of each sign a round number near its largest value, and a tenth of that."""
    marks = [0.0]
    for sign in (-1.0, 1.0):
        most = float(np.nanmax(sign * values))
        digit = 10.0 ** np.floor(np.log10(most))
        marks += [sign * digit * np.floor(most / digit) / part for part in (1.0, 10.0)]
    return sorted(marks)
