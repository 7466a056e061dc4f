"""Weak errors of schemes for the multiscale system: against eps, and the largest over eps."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from spi.drawing import style
from spi.drawing.axes import ERRORS, HUGE, INTERVAL, legend_under, limits, rules, with_order
from spi.drawing.layout import Panel

from ..comparisons import comparable_sweeps, largest_over_eps, sweeps
from ..estimators import label_of
from ..results import WeakErrors
from .series import Series, draw, frame, remarks

COLUMNS = 3  # panels side by side
APART = 0.01  # of the panel's width, between markers of two schemes at one eps
LIMIT = "#eeeeee"  # where the reference shows a limit
LARGEST, SMALLEST, OTHERS = 13.0, 5.5, 3.5  # discs of several eps, one on the other where the errors agree


def sizes(readings: Sequence[WeakErrors]) -> dict[str, float]:
    """Size of the marker of each variant of a scheme with several eps, smaller as eps is."""
    found: dict[str, float] = {}
    for members in sweeps(readings).values():
        if len(members) > 1:
            variants = [reading.about.variant for reading in members]
            found |= dict(zip(variants, np.linspace(LARGEST, SMALLEST, len(variants)).tolist(), strict=True))
    return found


def largest(readings: Sequence[WeakErrors], f: int, looks: style.Looks) -> list[Series]:
    """Of each scheme with several eps the series of its largest errors, with the order of these."""
    chosen = {key: members for key, members in comparable_sweeps(readings).items() if len(members[0].h) > 1}
    schemes, methods = ({key[i] for key in chosen} for i in (0, 1))
    series = []  # as broad lines behind the points
    for (scheme, estimator), members in chosen.items():
        top = largest_over_eps(members, f)
        told = [style.label(members[0].about, with_eps=False)] * (len(schemes) > 1)
        told += [label_of(estimator)] * (len(methods) > 1)
        series.append(
            Series(
                h=members[0].h,
                error=np.where(top.resolved, top.value, np.nan),
                half=INTERVAL * top.stderr,
                resolved=top.resolved,
                exact=True,
                expected=members[0].expected_order,
                label=with_order(", ".join([*told, r"largest over $\varepsilon$"]), *top.order[:3]),
                look={"color": looks[scheme][1] if len(schemes) > 1 else "#000000", "linewidth": 2.0},
                joined=True,
            )
        )
    return series


def reference_note(readings: Sequence[WeakErrors]) -> list[str]:
    """What a reference shows that does not resolve the fast processes; nothing if it resolves them all."""
    if not any(reading.reference_shows_limit for reading in readings):
        return []
    whose, scheme = "the scheme's own limit", readings[0].reference_scheme
    if scheme:
        of = (reading.about for reading in readings if reading.about.scheme == scheme)
        label = next((style.label(about, with_eps=False) for about in of), scheme.replace("_", " "))
        whose = f"the limit of {label}"
    return [rf"$\varepsilon<\sqrt{{h_{{\mathrm{{ref}}}}}}$: the reference shows {whose}"]


def panels(readings: Sequence[WeakErrors], f: int, looks: style.Looks, title: str) -> list[list[Panel]]:
    """Lines of panels of errors against eps, a panel for each step size."""
    if not any(reading.about.eps for reading in readings):
        raise ValueError("the panel 'eps' needs a scheme with eps > 0")
    steps = sorted({h for reading in readings for h in reading.h.tolist()}, reverse=True)
    found: list[Panel] = []
    for i, h in enumerate(steps):
        lines = [*[title] * (i == 0 and bool(title)), f"$h={style.number(h, steps=True)}$"]
        found.append(partial(eps_panel, readings=readings, f=f, looks=looks, h=h, title="\n".join(lines)))
    return [found[i : i + COLUMNS] for i in range(0, len(found), COLUMNS)]


def eps_panel(ax: Axes, readings: Sequence[WeakErrors], f: int, looks: style.Looks, h: float, title: str) -> None:
    """Errors at one step size against eps; of schemes that know no eps, or for eps = 0, a horizontal line."""
    ax.set(xscale="log", yscale="log", xlabel=r"$\varepsilon$", ylabel=ERRORS["weak"], title=title)
    rules(ax)
    readings = [reading for reading in readings if h in reading.h]
    ends = limits(np.array([eps for reading in readings if (eps := reading.about.eps)]))
    ax.set_xlim(ends)
    several = len({reading.about.estimator for reading in readings}) > 1
    curves = []
    for (scheme, _), members in sweeps(readings).items():
        fast = [reading for reading in members if reading.about.eps]
        if fast:
            curves.append(_series(fast, f, h, looks[scheme], style.label(fast[0].about, with_eps=False), several))
    without = [reading for reading in readings if not reading.about.eps]
    lines = [_series([one], f, h, looks[one.about.scheme], style.label(one.about), several) for one in without]
    found = frame([*curves, *lines])
    if found:
        ax.set_ylim(found)
    _draw_curves(ax, curves, (ends[1] / ends[0]) ** APART)
    for one in lines:
        _horizontal(ax, one)
    remarks(ax, curves, consequence="")
    _marks(ax, readings, h, ends)
    legend_under(ax)


def _draw_curves(ax: Axes, curves: list[Series], shift: float) -> None:
    """Draw the curves, each `shift` times farther right than the one before, so that markers can be told apart."""
    for i, one in enumerate(curves):
        beside = one._replace(h=one.h * shift ** (i - (len(curves) - 1) / 2))
        inside = (one.error > 0) & (one.error <= ax.get_ylim()[1])
        joined = np.where(inside, one.error, np.nan)
        ax.plot(beside.h, joined, color=one.look["color"], linewidth=0.9, alpha=0.6, zorder=2)
        draw(ax, beside)


def _series(
    members: Sequence[WeakErrors], f: int, h: float, look: style.Look, label: str, several_estimators: bool
) -> Series:
    """Errors of one scheme at one step size, over eps."""
    at = [int(np.flatnonzero(reading.h == h)[0]) for reading in members]
    each = list(zip(members, at, strict=True))
    estimator = members[0].about.estimator
    return Series(
        h=np.array([reading.about.eps or math.nan for reading in members]),
        error=np.array([abs(reading.error[f, i]) for reading, i in each]),
        half=np.array([reading.half[f, i] for reading, i in each]),
        resolved=np.array([reading.resolved[f, i] for reading, i in each]),
        label=", ".join([label, *[label_of(estimator)] * several_estimators]),
        look={"marker": look[0], "color": look[1], "markersize": 5.5},
    )


def _horizontal(ax: Axes, one: Series) -> None:
    (error,), (half,), colour = one.error, one.half, one.look["color"]
    if 0 < error < HUGE:
        ax.axhline(error, color=colour, linestyle="-" if one.resolved[0] else "--", linewidth=1.1, label=one.label)
        if math.isfinite(half):
            low = max(error - half, ax.get_ylim()[0])
            ax.axhspan(low, error + half, color=colour, alpha=0.12, linewidth=0, zorder=0.5)


def _marks(ax: Axes, readings: Sequence[WeakErrors], h: float, ends: tuple[float, float]) -> None:
    """Where the explicit scheme becomes unstable, and where the reference shows a limit."""
    stable = math.sqrt(h / 2)
    if ends[0] < stable < ends[1]:
        ax.axvline(stable, color="#777777", linestyle="--", linewidth=0.9, zorder=1, label=r"$h=2\,\varepsilon^2$")
    for note in reference_note(readings):
        edge = math.sqrt(readings[0].reference_step)
        ax.axvspan(ends[0], min(edge, ends[1]), color=LIMIT, linewidth=0, zorder=0.2, label=note)
