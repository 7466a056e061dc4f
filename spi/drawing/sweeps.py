"""Figures of swept parameters: each quantity over the values of one, or as a map over those of two."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib import colors

from ..expressions import as_numpy, parse_expression
from ..expressions.arithmetic import NumberError
from ..statistics.crossings import crossings
from ..statistics.curves import Curve
from ..storage.stored import AT_MOST
from . import layout, page, plots, style

DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), "-.")  #: of estimators

_OF_SPEC = "reference"  # where what is expected stands in a spec, perhaps as a formula
_FINE = 400  # points of a formula's curve
_SIGNED, _ONE_SIGN = "RdBu_r", "viridis"  # colours
_LINEAR = 0.03  # share of the largest value of a sign below which colours are linear
_WIDE = 30.0  # ratio of values of one sign from which on their colours are logarithmic
_EVEN = 1.01  # ratio of gaps of values that are evenly spaced
_UNEVEN = 3.0  # the largest gap over the smallest, in logarithms, from which on values stand in order
_UNKNOWN = "#dddddd"

Case = tuple[str, Sequence[Curve], list[str]]  #: title, curves and facts of one that is swept


def draw(
    title: str,
    cases: Sequence[Case],
    texts: Mapping[str, str] = {},
    references: Mapping[str, str] = {},
) -> layout.PanelFigure:
    """Figure of cases that are swept: each quantity over the values.

    `texts` has the formulas of test functions, `references` those of their means.
    """
    if page.current().overlays_cases() and len(cases) > 1:
        cases = [_overlaid(cases)]
    every: Any = [curve for _, curves, _ in cases for curve in curves]
    looks, estimators = style.looks([every]), list(dict.fromkeys(curve.about.estimator for curve in every))
    steps = {curve.h for curve in every}
    if (shared := steps.pop() if len(steps) == 1 else None) is not None:
        cases = [(name, curves, [*facts, style.value_of("h", shared)]) for name, curves, facts in cases]

    def panels(curves: Sequence[Curve]) -> list[list[plots.Plot]]:
        """A group for each quantity where it has several test functions, else one for all."""
        by_name: dict[str, dict[str, list[Curve]]] = {}
        for curve in curves:
            by_name.setdefault(curve.name, {}).setdefault(curve.function, []).append(curve)
        return [
            [_over(some, looks, estimators, texts, references, shared) for some in functions.values()]
            for functions in by_name.values()
        ]

    return _arranged(title, cases, panels)


def _overlaid(cases: Sequence[Case]) -> Case:
    """Curves of all cases as those of one."""
    words = {curve.word: name for name, curves, _ in cases for curve in curves}
    if len(words) > 1:
        raise ValueError(f"overlay: each case is swept over another word, {' and '.join(words)}")
    alone = all(len({curve.about.variant for curve in curves}) == 1 for _, curves, _ in cases)
    own = [curve._replace(about=style.in_overlay(curve.about, alone)) for _, curves, _ in cases for curve in curves]
    return "", own, [fact for fact in cases[0][2] if all(fact in facts for _, _, facts in cases)]


def each_value(curves: Sequence[Curve]) -> list[Curve]:
    """Curves over the first of two swept parameters, one for each value of the second."""
    alone = len({curve.about.variant for curve in curves}) == 1
    return [_at_second(curve, value, line, alone) for curve in curves for value, line in curve.lines()]


def _at_second(curve: Curve, value: float, line: Curve, alone: bool) -> Curve:
    about, text = line.about, style.value_of(curve.second_word, value)
    label = text if alone or not about.scheme_label else f"{about.scheme_label}, {text}"
    return line._replace(about=replace(about, variant=f"{about.variant}/{value:g}", scheme_label=label))


def draw_maps(title: str, cases: Sequence[Case]) -> layout.PanelFigure:
    """Figure of cases in which two parameters are swept: each quantity as a map over both, for each scheme."""
    several = len({curve.about.variant for _, curves, _ in cases for curve in curves}) > 1
    if page.current().overlays_cases() and len(cases) > 1:
        second = next(curve.second_word for _, curves, _ in cases for curve in curves)
        raise ValueError(f"overlay: is 'cases', whose maps cannot lie in one panel; must be {second}")

    def panels(curves: Sequence[Curve]) -> list[list[plots.Plot]]:
        return [[_map(curve, several)] for curve in curves]

    return _arranged(title, cases, panels)


def _arranged(
    title: str, cases: Sequence[Case], panels: Callable[[Sequence[Curve]], list[list[plots.Plot]]]
) -> layout.PanelFigure:
    shared = [fact for fact in cases[0][2] if all(fact in facts for _, _, facts in cases)]
    drawn = [
        ([style.plain(name), *(fact for fact in facts if fact not in shared)], panels(curves))
        for name, curves, facts in cases
    ]
    return layout.arranged(title, drawn, shared)


# ---------------------------------------------------------------------------------------------------------------------
# Curves over one parameter.
# ---------------------------------------------------------------------------------------------------------------------


def _over(
    curves: Sequence[Curve],
    looks: style.Looks,
    estimators: Sequence[str],
    texts: Mapping[str, str],
    references: Mapping[str, str],
    shared: float | None,
) -> plots.Plot:
    """One quantity over the parameter, with 95 % intervals; values by theory as marks, formulas as dashed curves."""
    first = curves[0]
    at = plots.places(np.concatenate([curve.values for curve in curves]))
    is_log = _is_error(first) and any((curve.of("value") > 0).any() for curve in curves)
    lines = []
    theory: dict[bytes, list[plots.Series]] = {}  # one line for all curves that share its values
    for curve in curves:
        marker, colour = looks[curve.about.variant]
        x, value, expected = at.of(curve.values), curve.of("value"), curve.of("expected")
        finite = np.isfinite(expected)
        dashes = "none" if finite.all() else DASHES[estimators.index(curve.about.estimator) % len(DASHES)]
        look = {"marker": marker, "color": colour, "markersize": 5.5, "linestyle": dashes}
        names = [style.label(curve.about), *[curve.about.estimator] * (len(estimators) > 1)]
        ends = {name: np.where(np.isfinite(value), curve.of(name), np.nan) for name in ("low", "high")}
        lines.append(plots.series(x, value, look, ", ".join(names), poor=curve.poor & np.isfinite(value), **ends))
        if finite.any():
            fine = _theory(curve, references.get(curve.function, ""), at)
            look = {"color": colour if len(curves) > 1 else plots.GREY} | (_MARKS if fine is None else _DASHED)
            name = r"theory, as $h\to0$" if curve.claim.is_order else "theory"
            there = (x[finite], expected[finite]) if fine is None else fine
            theory.setdefault(expected.tobytes(), []).append(plots.series(there[0], there[1], look, name))
    lines += [
        first._replace(look=first.look | {"color": plots.GREY} if others else first.look)
        for first, *others in theory.values()
    ]
    label = _label(curves, shared)
    title = "" if first.claim.is_named else _title(first, texts, label)
    crossing = page.current().chosen.get("crossing") in (first.function or first.name, first.name)
    marked = _crossing(curves, at) if crossing else []
    return plots.Plot(lines, title, _parameter(first), label, at.scale, is_log, own=_dressed(at, marked))


def _title(curve: Curve, texts: Mapping[str, str], label: str) -> str:
    """Definition of the function of a curve, or the function, where the label of the axis does not say it."""
    function, variables = curve.function, curve.about.variables
    if definition := style.definition(function, texts.get(function, function), variables):
        return definition
    return style.maths(function, variables) if function and "$" not in label.split(" at ")[0] else ""


def _dressed(at: plots.Places, marked: Sequence[tuple[float, float, str]]) -> plots.Draw:
    """A function that writes the ticks of the parameter and marks values with their intervals."""

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        entries = at.dress(ax)
        for place, half, text in marked:
            ax.axvspan(place - half, place + half, color=plots.GREY, alpha=0.2, linewidth=0, zorder=0.5)
            entries.append((ax.axvline(place, color=plots.GREY, linewidth=0.9, zorder=1), text))
        return entries

    return own


def _crossing(curves: Sequence[Curve], at: plots.Places) -> list[tuple[float, float, str]]:
    """Where each line crosses the next, with half the 95 % interval and both as text; ValueError where there is one."""
    if len(curves) < 2 or not np.array_equal(at.values, at.at):
        raise ValueError(f"crossing: needs two lines over a number, and there are {len(curves)}; give overlay: cases")
    word = style.symbol(curves[0].word) or curves[0].word
    marked = []
    for crossing in crossings((style.label(curve.about), curve) for curve in curves):
        names = f"crossing of {crossing.first[0]} and {crossing.second[0]}" if len(curves) > 2 else "crossing"
        for value, half, *_ in crossing.places:
            digits = max(0, 1 - math.floor(math.log10(half))) if half > 0 else 6  # two of the half width, rounded up
            rounded = math.ceil(half * 10**digits - 1e-9) / 10**digits
            marked.append((value, half, rf"{names} at ${word}={value:.{digits}f}\pm{rounded:.{digits}f}$"))
    return marked


def _parameter(curve: Curve) -> str:
    """Label of the horizontal axis: the parameter, and that it is 1/T where it is."""
    temperatures = [point.about.parameters.get("temperature") for point in curve.points]
    pairs = zip(curve.values.tolist(), temperatures, strict=False)
    is_inverse = bool(curve.points) and all(isinstance(T, float) and math.isclose(K * T, 1.0) for K, T in pairs)
    return f"${style.symbol(curve.word)}=1/T$" if is_inverse and style.symbol(curve.word) else style.word(curve.word)


_MARKS = {"linestyle": "none", "marker": "+", "markersize": 9, "markeredgewidth": 1.3, "zorder": 4}
_DASHED = {"linestyle": (0, (4, 2)), "linewidth": 1.1}


def _theory(curve: Curve, formula: str, at: plots.Places) -> tuple[plots.Array, plots.Array] | None:
    """Places and values of a curve of theory; None where only its values at those of the parameter are known.

    A number that is the same for all values, or the formula of a mean on a fine grid.  It names parameters, of which
    those that change are the swept one or 1 / that, and it must have the values that are known.
    """
    x, expected = curve.values, curve.of("expected")
    low, high = np.nanmin(at.of(x)), np.nanmax(at.of(x))
    if not np.isfinite(expected).all() or len(x) < 2:
        return None
    if np.allclose(expected, expected[0], rtol=1e-9, atol=0.0):
        return np.array([low, high]), expected[:2]
    if at.at is not at.values or curve.claim.expected != _OF_SPEC:  # values stand in order, or it is no mean
        return None
    fine = np.linspace(low, high, _FINE) if at.scale == "linear" else np.geomspace(low, high, _FINE)
    columns = _columns(curve, np.append(x, fine))
    try:
        values = as_numpy(parse_expression(formula, len(columns), tuple(columns)))(np.array([*columns.values()]))
    except NumberError:
        return None
    near = np.allclose(values[: len(x)], expected, rtol=1e-9, atol=1e-12)
    return (fine, values[len(x) :]) if near else None


def _columns(curve: Curve, x: plots.Array) -> dict[str, plots.Array]:
    """Numbers that formulas may name at values x of the parameter, those of the curve first."""
    each = [point.about.parameters | {"t": point.about.final_time} for point in curve.points]
    own, columns = x[: len(each)], {curve.word: x}
    for name in each[0]:
        values = np.array([one.get(name) for one in each])
        word = {"temperature": "T"}.get(name, name)
        if values.ndim != 1 or values.dtype.kind not in "if" or word == curve.word:
            continue
        if (values == values[0]).all():
            columns[word] = np.full(len(x), float(values[0]))
        elif np.allclose(values, own):
            columns[word] = x
        elif np.allclose(values * own, 1.0):
            columns[word] = 1.0 / x
    return columns


def _is_error(curve: Curve) -> bool:
    return curve.claim.sense == AT_MOST


def _name(curve: Curve) -> str:
    """Name of the quantity: a label that a person chose, or that in print."""
    return style.plain(page.current().label(curve.name) or curve.label)


def _label(curves: Sequence[Curve], shared: float | None) -> str:
    """Label of a panel: its quantity, and at which step size unless all panels `shared` that."""
    first, steps = curves[0], {curve.h for curve in curves}
    name, label = _name(first), page.current().label
    if first.function and not label(first.name):
        function = style.named(first.function, first.about.variables).strip("$")
        if first.claim.symbol:
            name = f"${first.claim.symbol}[{function}]$"
        elif label(first.function) or first.claim.is_named:
            name = f"${function}$"
    if steps in ({None}, {shared}):
        return name
    h = steps.pop() if len(steps) == 1 else None
    return f"{name} at the smallest $h$" if h is None else f"{name} at {style.value_of('h', h)}"


# ---------------------------------------------------------------------------------------------------------------------
# Maps over two parameters.
# ---------------------------------------------------------------------------------------------------------------------


def _map(curve: Curve, several: bool) -> plots.Plot:
    """A cell for each pair of values; where both signs occur also the line of zero, and marks where none is certain."""
    values = curve.grid().of("value")
    sign, name = "minus " if (values <= 0).all() else "", _label([curve], curve.h)
    if curve.function and name == _name(curve):
        name += f" of {style.named(curve.function, curve.about.variables)}"
    title = [sign + name]
    title += [style.label(curve.about)] * several
    if (agreement := curve.chi_squared) is not None:
        whose = r"the orders of theory as $h\to0$" if curve.claim.is_order else "theory"
        title.append(f"$\\chi^2={agreement[0]:.0f}$ for {agreement[1]} cells against {whose}")
    words = [style.word(word) for word in curve.grid().words]
    own = partial(_cells, curve, _is_error(curve))
    return plots.Plot(title="\n".join(title), x=words[0], y=words[1], own=own, aspect=page.current().layout.map_shape)


def _cells(curve: Curve, is_error: bool, ax: plots.Axes) -> list[plots.LegendEntry]:
    grid = curve.grid()
    x, y = map(even_places, grid.axes)
    values, low, high = (grid.of(field) for field in ("value", "low", "high"))
    shown, signed = -values if (values <= 0).all() else values, bool((values < 0).any() and (values > 0).any())
    ax.set_facecolor(_UNKNOWN)
    look: dict[str, Any] = {"cmap": _SIGNED if signed else _ONE_SIGN, "norm": _norm(shown, is_error)}
    mesh = ax.pcolormesh(cell_borders(x), cell_borders(y), shown.T, rasterized=True, **look)
    for scale, axis, at in ((ax.set_xscale, ax.xaxis, x), (ax.set_yscale, ax.yaxis, y)):
        scale("linear" if at.scale == "linear" else "log")
        plots.ticks(axis, at.at, at.values, room=page.current().layout.map_ticks_most)
    bar = ax.figure.colorbar(mesh, ax=ax, pad=page.current().layout.bar_pad)
    bar.outline.set_linewidth(0.4)
    if not signed:
        return []
    if min(values.shape) > 1:
        ax.contour(x.at, y.at, values.T, levels=[0.0], colors="black", linewidths=1.2)
    i, j = np.nonzero((low <= 0) & (high >= 0))
    ax.plot(x.at[i], y.at[j], ".", color="black", markersize=3)
    marks = _bar_ticks(values)
    bar.set_ticks(marks, labels=[f"${style.number(tick)}$" for tick in marks])
    bar.ax.minorticks_off()
    undecided = plots.mark(".", "sign not decided (95 %)", markersize=4)
    return [(plots.Line2D([], [], color="black", linewidth=1.2), "zero"), undecided]


def even_places(values: plots.Array) -> plots.Places:
    """Places of cells: evenly spaced values as they are, others by their logarithms or in order."""
    gaps = np.diff(values)
    if len(gaps) and gaps.max() <= _EVEN * gaps.min():
        return plots.Places(values, values, "linear")
    logs = np.diff(np.log(values)) if (values > 0).all() else np.ones(0)
    if (values > 0).all() and logs.max(initial=1.0) <= _UNEVEN * logs.min(initial=1.0):
        return plots.Places(values, values, "log")
    return plots.Places(values, np.arange(len(values), dtype=float), "linear")


def cell_borders(at: plots.Places) -> plots.Array:
    """Borders of the cells around ascending places, half way between neighbours."""
    x = at.at if at.scale == "linear" else np.log2(at.at)
    middle = (x[1:] + x[:-1]) / 2
    outer = middle[[0, -1]] - x[[0, -1]] if len(x) > 1 else np.array([0.5, -0.5])
    borders = np.concatenate([[x[0] - outer[0]], middle, [x[-1] - outer[1]]])
    return borders if at.scale == "linear" else 2.0**borders


def _norm(values: plots.Array, is_error: bool) -> colors.Normalize | None:
    """Map from values to colours; where both signs occur each has the whole range of its own."""
    finite = values[np.isfinite(values)]
    if finite.size and finite.min() < 0 < finite.max():
        low, high, whole = float(-finite.min()), float(finite.max()), float(np.arcsinh(1 / _LINEAR))

        def forwards(v: Any) -> Any:
            return np.arcsinh(v / (_LINEAR * np.where(np.asarray(v) < 0, low, high))) / whole

        def backwards(u: Any) -> Any:
            return np.sinh(np.asarray(u) * whole) * _LINEAR * np.where(np.asarray(u) < 0, low, high)

        return colors.FuncNorm((forwards, backwards), -low, high)
    positive = finite[finite > 0]
    if positive.size and (is_error or positive.max() > _WIDE * positive.min()):
        return colors.LogNorm(positive.min(), positive.max())
    return None


def _bar_ticks(values: plots.Array) -> list[float]:
    """0, and of each sign a round number near its largest value, and a tenth of that."""
    marks = [0.0]
    for sign in (-1.0, 1.0):
        most = float(np.nanmax(sign * values))
        digit = 10.0 ** np.floor(np.log10(most))
        marks += [sign * digit * np.floor(most / digit) / part for part in (1.0, 10.0)]
    return sorted(marks)
