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
KNOWN: dict[str, Any] = {"linestyle": (0, (2, 2)), "linewidth": 1.0, "zorder": 2}


def draw(title: str, cases: Sequence[tuple[str, Sequence[Curve], list[str]]], sorts: Mapping[str, Sort]) -> Figure:
    """The figure of cases that are swept: of each the title, curves and facts; `sorts` are those of the quantities."""
    every: Any = [curve for _, curves, _ in cases for curve in curves]
    looks = style.looks([every])
    estimators = list(dict.fromkeys(curve.about.estimator for curve in every))
    shared = [fact for fact in cases[0][2] if all(fact in facts for _, _, facts in cases)]
    lines: list[layout.Line] = []
    for name, curves, facts in cases:
        panels = list(dict.fromkeys((curve.name, curve.function) for curve in curves))
        size = SIZE if len(panels) > 1 or len(cases) > 1 else ALONE
        chosen = [[curve for curve in curves if (curve.name, curve.function) == one] for one in panels]
        drawn = [partial(_panel, curves=some, looks=looks, estimators=estimators, sorts=sorts) for some in chosen]
        own = [fact for fact in facts if fact not in shared]
        heading = "\n".join(style.wrapped([style.plain(name), *own], ",  ", "axes.titlesize", size[0] * COLUMNS))
        found = [layout.Line(drawn[i : i + COLUMNS], size) for i in range(0, len(drawn), COLUMNS)]
        found[0] = found[0]._replace(title=heading if len(cases) > 1 else "")
        lines += found
    lines[-1] = lines[-1]._replace(legend=_legend(every, looks, estimators))
    return layout.arranged(title, lines, shared)


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
    if positive.size and positive.max() <= WIDE * positive.min() and (values >= 0).all():
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
    first = curves[0]
    every = np.unique(np.concatenate([curve.values for curve in curves]))
    places = dict(zip(every.tolist(), swept_axis(ax, first.word, every).tolist(), strict=True))
    found = np.concatenate([curve.of("value") for curve in curves])
    known = found[np.isfinite(found)]
    if first.name in sorts and sorts[first.name].sense == AT_MOST and (known > 0).all():
        ax.set_yscale("log", nonpositive="clip")
        ax.set_ylim(limits(known))
    known_of: dict[tuple[bytes, bytes], list[tuple[np.ndarray, np.ndarray, str]]] = {}  # what several have alike, once
    for curve in curves:
        marker, colour = looks[curve.about.variant]
        x, value = np.array([places[one] for one in curve.values.tolist()]), curve.of("value")
        order, dashes = np.argsort(x), DASHES[estimators.index(curve.about.estimator) % len(DASHES)]
        bars = np.nan_to_num(np.array([value - curve.of("low"), curve.of("high") - value]), posinf=0.0)[:, order]
        look: dict[str, Any] = {"marker": marker, "color": colour, "markerfacecolor": "none", "linestyle": dashes}
        ax.errorbar(x[order], value[order], bars, elinewidth=0.8, capsize=0, zorder=3, **look)
        if np.isfinite(expected := curve.of("expected")[order]).any():
            known_of.setdefault((x[order].tobytes(), expected.tobytes()), []).append((x[order], expected, colour))
    for (x, expected, colour), *others in known_of.values():
        ax.plot(x, expected, color="#777777" if others else colour, **KNOWN)
    ax.set_ylabel(_label(curves))
    ax.set_title(style.plain(first.function))


def _label(curves: Sequence[Curve]) -> str:
    """What a panel shows, and at which step size."""
    name = style.plain(curves[0].name.replace("_", " "))
    steps = {curve.h for curve in curves}
    if steps == {None}:
        return name
    h = steps.pop() if len(steps) == 1 else None
    return f"{name} at the smallest $h$" if h is None else f"{name} at $h={style.number(h, steps=True)}$"


def _legend(curves: Sequence[Curve], looks: style.Looks, estimators: Sequence[str]) -> list[list[layout.Entry]]:
    """What markers and dashes mean."""
    abouts = {curve.about.variant: curve.about for curve in curves}
    rows: list[list[layout.Entry]] = [
        [
            (Line2D([], [], marker=looks[one][0], color=looks[one][1], markerfacecolor="none"), style.label(about))
            for one, about in abouts.items()
        ]
    ]
    if len(estimators) > 1:
        handles = [Line2D([], [], color="#777777", linestyle=DASHES[i % len(DASHES)]) for i in range(len(estimators))]
        rows.append(list(zip(handles, map(style.plain, estimators), strict=True)))
    if any(np.isfinite(curve.of("expected")).any() for curve in curves):
        rows.append([(Line2D([], [], color="#777777", **KNOWN), "stated by theory, or known")])
    return rows
