"""The figure of a swept parameter: each quantity over its values, a curve for each scheme."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from ..statistics.claims import AT_MOST, Sort
from ..statistics.curves import Curve
from . import layout, style
from .axes import limits, power_ticks, rules

SIZE = (3.6, 2.9)  # inches of a panel
ALONE = (4.6, 3.5)  # the same where there is only one
COLUMNS = 3  # panels side by side
WIDE = 20.0  # ratio of swept values above which their axis is logarithmic
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (1.5, 1)), "-.")  #: of estimators
PALE = 0.4  # of what says nothing
KNOWN: dict[str, Any] = {"linestyle": (0, (2, 2)), "linewidth": 1.0, "zorder": 2}


def draw(title: str, cases: Sequence[tuple[str, Sequence[Curve], list[str]]], sorts: Mapping[str, Sort]) -> Figure:
    """The figure of cases that are swept: of each the title, curves and facts; `sorts` are those of the quantities."""
    every: Any = [curve for _, curves, _ in cases for curve in curves]
    looks = style.looks([every])
    estimators = list(dict.fromkeys(curve.about.estimator for curve in every))
    shared = [fact for fact in cases[0][2] if all(fact in facts for _, _, facts in cases)]
    lines: list[layout.Line] = []
    for name, curves, facts in cases:
        own = [fact for fact in facts if fact not in shared]
        heading = "\n".join(style.wrapped([style.plain(name), *own], ",  ", "axes.titlesize", SIZE[0] * COLUMNS))
        panel = partial(_panel, looks=looks, estimators=estimators, sorts=sorts)
        found = [[partial(panel, curves=some) for some in row] for row in _rows(curves)]
        alone = len(cases) == len(found) == len(found[0]) == 1
        lines += [layout.Line(row, ALONE if alone else SIZE) for row in found]
        lines[-len(found)] = lines[-len(found)]._replace(title=heading if len(cases) > 1 else "")
    lines[-1] = lines[-1]._replace(legend=_legend(every, looks, estimators))
    return layout.arranged(title, lines, shared)


def _rows(curves: Sequence[Curve]) -> list[list[list[Curve]]]:
    """The curves of each panel: a row for each quantity where it has several test functions, else one for all."""
    panels: dict[tuple[str, str], list[Curve]] = {}
    for curve in curves:
        panels.setdefault((curve.name, curve.function), []).append(curve)
    functions = {function for _, function in panels}
    names = list(dict.fromkeys(name for name, _ in panels)) if len(functions) > 1 else [""]
    rows = [[some for (one, _), some in panels.items() if name in (one, "")] for name in names]
    return [row[i : i + COLUMNS] for row in rows for i in range(0, len(row), COLUMNS)]


def swept_axis(ax: Axes, word: str, values: np.ndarray) -> np.ndarray:
    """Scale, ticks and label of a horizontal axis for the values of a parameter; returns where its points are."""
    rules(ax)
    ax.set_xlabel(style.word(word))
    positive = values[values > 0]
    if len(values) > 2 and len(positive) == len(values) and (np.frexp(values)[0] == 0.5).all():
        ax.set_xscale("log", base=2)
        ax.set_xlim(values.min() / 1.25, values.max() * 1.25)
        power_ticks(ax, values)
        return values
    sizes = np.abs(values[values != 0])
    if sizes.size and sizes.max() <= WIDE * sizes.min():
        return values
    places, is_log = value_places(values)
    if is_log:
        ax.set_xscale("log")
    else:
        ax.set_xticks(places, [f"${style.number(float(value))}$" for value in values])
    return places


def value_places(values: np.ndarray) -> tuple[np.ndarray, bool]:
    """Where values stand on an axis, and whether it is logarithmic; values that are not all positive by their rank."""
    if (values > 0).all():
        return values, True
    return np.argsort(np.argsort(values)).astype(float), False


def _panel(
    ax: Axes, curves: Sequence[Curve], looks: style.Looks, estimators: Sequence[str], sorts: Mapping[str, Sort]
) -> None:
    """One quantity over the parameter, with 95 % intervals; dashed what is known of it."""
    first, every = curves[0], np.unique(np.concatenate([curve.values for curve in curves]))
    places = dict(zip(every.tolist(), swept_axis(ax, first.word, every).tolist(), strict=True))
    is_log = first.name in sorts and sorts[first.name].sense == AT_MOST
    _limits(ax, curves, is_log)
    known: dict[tuple[bytes, bytes], list[tuple[np.ndarray, np.ndarray, str]]] = {}  # what several have alike, once
    for curve in curves:
        marker, colour = looks[curve.about.variant]
        x, value = np.array([places[one] for one in curve.values.tolist()]), curve.of("value")
        order, dashes = np.argsort(x), DASHES[estimators.index(curve.about.estimator) % len(DASHES)]
        ax.plot(x[order], value[order], color=colour, linestyle=dashes, zorder=3)
        with np.errstate(invalid="ignore"):  # of paths that diverged
            bars = np.nan_to_num(np.array([value - curve.of("low"), curve.of("high") - value]), posinf=0.0)
        look: dict[str, Any] = {"marker": marker, "color": colour, "markerfacecolor": "none", "linestyle": "none"}
        poor = curve.poor
        for chosen, pale in ((~poor, 1.0), (poor, PALE)):
            if chosen.any():
                ax.errorbar(x[chosen], value[chosen], bars[:, chosen], elinewidth=0.8, zorder=3, alpha=pale, **look)
        told = ~np.isnan(value)
        layout.edge_marks(ax, x[told], value[told], colour)
        if np.isfinite(expected := curve.of("expected")[order]).any():
            known.setdefault((x[order].tobytes(), expected.tobytes()), []).append((x[order], expected, colour))
    for (x, expected, colour), *others in known.values():
        ax.plot(x, expected, color="#777777" if others else colour, **KNOWN)
    ax.set_ylabel(_label(curves))
    ax.set_title(style.plain(first.function))


def _limits(ax: Axes, curves: Sequence[Curve], is_log: bool) -> None:
    """Scale and limits of the vertical axis: those of what says something, or of all if nothing does."""
    values = np.array([np.concatenate([curve.of(field) for curve in curves]) for field in ("value", "low", "high")])
    good = ~np.concatenate([curve.poor for curve in curves])
    values = values[:, good] if good.any() else values[:1]
    positive = values[0][np.isfinite(values[0]) & (values[0] > 0)]
    if is_log and positive.size:
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(limits(positive))
        return
    known = np.concatenate([values.ravel(), *(curve.of("expected") for curve in curves)])
    if (known := known[np.isfinite(known)]).size:
        room = 0.06 * (known.max() - known.min()) or 0.05 * abs(known[0]) or 1.0
        ax.set_ylim(known.min() - room, known.max() + room)


def _label(curves: Sequence[Curve]) -> str:
    """What a panel shows, and at which step size."""
    name = style.plain(curves[0].label)
    steps = {curve.h for curve in curves}
    if steps == {None}:
        return name
    h = steps.pop() if len(steps) == 1 else None
    return f"{name} at the smallest $h$" if h is None else f"{name} at $h={style.number(h, steps=True)}$"


def _legend(curves: Sequence[Curve], looks: style.Looks, estimators: Sequence[str]) -> list[list[layout.Entry]]:
    """What markers and dashes mean."""
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
