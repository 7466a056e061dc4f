"""The figure of weak errors: panels of errors, of sample sizes and of accuracy against processor time."""

import math
from collections.abc import Iterable, Sequence
from functools import partial
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP

from spi.drawing import page, style
from spi.drawing.axes import (
    ERRORS,
    HUGE,
    INTERVAL,
    LEAST,
    PANEL,
    error_axes,
    legend_line,
    legend_under,
    limits,
    note_diverged,
    panel_title,
    rules,
    slopes,
    with_order,
)
from spi.drawing.layout import Panel, check_panels, edge_marks, unresolved

from .estimators import ESTIMATORS, label_of
from .results import WeakErrors, comparable_sweeps, largest_over_eps, sweeps

# ---------------------------------------------------------------------------------------------------------------------
# Panels of weak errors against step sizes.
# ---------------------------------------------------------------------------------------------------------------------

#: Marker and colour for each number of paths, from few to many.
STAGES = (("o", "#56B4E9"), ("s", "#E69F00"), ("D", "#009E73"), ("^", "#D55E00"), ("v", "#0072B2"), ("P", "#CC79A7"))

VISIBLE = 0.01  # a band of relative half width less than that is as thin as the line
_DASHES = ("--", ":", "-.", (0, (6, 1.5, 1, 1.5, 1, 1.5)))  # of slopes, where there are more
_FEW = 2  # so many reference slopes have room above and below all points
_FAR = 1e3  # an error that is not resolved and so many times larger than those which are is that of a blow-up


class Series(NamedTuple):
    """The errors of one scheme by one estimator, for one test function, at N places along the horizontal axis."""

    h: np.ndarray  #: (N,) step sizes, or in a panel against eps the values of eps
    error: np.ndarray  #: (N,) without its sign
    half: np.ndarray  #: (N,) half the 95 % interval, or the bound of its numerical error
    resolved: np.ndarray  #: (N,) bool
    label: str
    look: dict
    exact: bool = False  #: whether nothing was sampled
    expected: float | None = None  #: order
    joined: bool = False  #: whether points are joined by a line


def series_of(reading: WeakErrors, f: int, look: dict[str, Any], label: str, joined: bool, beside: bool) -> Series:
    """The series of test function number `f` of a reading, drawn `beside` another of its scheme or not."""
    return Series(
        h=reading.h * (1.08 if beside else 1.0),
        error=np.abs(reading.error[f]),
        half=reading.half[f],
        resolved=reading.resolved[f],
        exact=reading.unsampled is not None,
        expected=reading.expected_order,
        label=with_order(label, *reading.orders[f][:3]),
        look=look | {"color": _pale(look["color"]), "markersize": 4} if beside else look,
        joined=joined,
    )


def frame(series: Sequence[Series]) -> tuple[float, float] | None:
    """The limits of the errors' axis, None if there is none: all that is resolved, and the sampling floor."""
    resolved = np.concatenate([one.error[_finite(one.error) & one.resolved] for one in series] or [[]])
    poor = [np.isfinite(one.error) & ~one.resolved for one in series]
    each = [np.fmax(one.error, 0.25 * one.half)[which] for one, which in zip(series, poor, strict=True)]
    floors = np.concatenate(each or [[]])
    floors = floors[_finite(floors)]
    if len(resolved):
        floors = np.minimum(floors, _FAR * resolved.max())
    values = np.concatenate([resolved, floors])
    return limits(values) if len(values) else None


def _finite(x: np.ndarray) -> np.ndarray:
    return (x > 0) & (x < HUGE)


def errors_panel(ax: Axes, series: Sequence[Series], title: str, notes: Iterable[str] = ()) -> None:
    """Errors against step sizes, with reference slopes; `notes` are further entries of the legend."""
    _begin(ax, series, title)
    ax.set_ylabel(ERRORS["weak"])
    orders = sorted({one.expected for one in series if one.expected}) or [1, 2]
    drawn = np.concatenate([_points(one, one.resolved) for one in series])
    if not len(drawn):
        drawn = np.concatenate([_points(one, ~one.resolved) for one in series])
    for one in series:
        draw_series(ax, one)
    if len(orders) > _FEW:
        for order, dashes in zip(orders, cycle(_DASHES), strict=False):  # above the points of which it is expected
            points = np.concatenate([_points(one, one.resolved) for one in series if one.expected == order])
            if len(points):
                slopes(ax, points, [(order, dashes, True)], (points[:, 0].min(), points[:, 0].max()))
    elif len(drawn):
        last = len(orders) - 1
        slopes(ax, drawn, [(p, ":" if i == last else "--", i < last) for i, p in enumerate(orders)])
    remarks(ax, series)
    for note in notes:
        ax.plot([], [], linestyle="none", label=note)
    legend_under(ax)


def prefixes_panel(ax: Axes, reading: WeakErrors, f: int, exact: Series | None, title: str) -> None:
    """Errors of plain Monte Carlo against step sizes for several numbers of paths, over the exact ones."""
    stages = _stages(reading, f)
    shown = stages if exact is None else [*stages, exact]
    _begin(ax, shown, title)
    ax.set_ylabel(ERRORS["weak"])
    for one in stages:
        ax.plot(one.h, np.where(_finite(one.half), one.half, np.nan), "--", color=one.look["color"], linewidth=0.8)
        draw_series(ax, one, bars=False)
    if exact is not None:
        draw_series(ax, exact._replace(look={"color": "#000000"}))
    ax.plot([], [], "--", color="#777777", linewidth=0.8, label="half the 95 % interval")
    remarks(ax, stages)
    legend_under(ax)


def _stages(reading: WeakErrors, f: int) -> list[Series]:
    """A series for each number of first paths, and for all of them; none if there are no results of first paths."""
    first, all_paths = reading.prefixes, reading.sampled
    if first is None or all_paths is None:
        return []
    several = zip(first.samples.tolist(), first.error, first.error_stderr, first.resolved, strict=True)
    found = [(n, error[f], stderr[f], resolved[f]) for n, error, stderr, resolved in several]
    if all_paths.samples > found[-1][0]:
        found.append((all_paths.samples, reading.error[f], all_paths.error_stderr[f], reading.resolved[f]))
    stages = []
    for i, (n, error, stderr, resolved) in enumerate(found):
        marker, colour = STAGES[i % len(STAGES)]
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 5}
        told: dict[str, Any] = {"resolved": resolved, "label": f"{style.count(n)} paths", "look": look, "joined": True}
        stages.append(Series(h=reading.h, error=np.abs(error), half=INTERVAL * stderr, **told))
    return stages


def _begin(ax: Axes, series: Sequence[Series], title: str) -> None:
    error_axes(ax, np.concatenate([one.h for one in series]))
    ax.set_title(title)
    found = frame(series)
    if found:
        ax.set_ylim(found)


def _points(one: Series, which: np.ndarray) -> np.ndarray:
    chosen = _finite(one.error) & which
    return np.column_stack([one.h, one.error])[chosen]


def draw_series(ax: Axes, one: Series, bars: bool = True) -> None:
    """Draw one series: a curve with its band, or points with bars, hollow where they are not resolved."""
    if one.exact:
        _curve(ax, one)
        return
    bottom, top = ax.get_ylim()
    look = {**one.look, "markeredgewidth": 1.0, "linestyle": "none", "zorder": 3}
    hollow = look | unresolved(str(look["marker"]))
    inside = (one.error >= bottom) & (one.error <= top)
    good, poor = one.resolved & inside, ~one.resolved & inside
    if one.joined:
        joined = np.where(_finite(one.error) & (one.resolved | (not bars)), one.error, np.nan)
        ax.plot(one.h, joined, color=look["color"], linewidth=0.9, alpha=0.6, zorder=2)
    up = np.where(np.isfinite(one.half), one.half, 0.0) if bars else np.zeros_like(one.error)
    down = np.minimum(up, one.error - bottom)
    told = (one.label, None) if good.any() or not poor.any() else (None, one.label)
    for chosen, how, label in ((good, look, told[0]), (poor, hollow, told[1])):
        if chosen.any() or label:
            half = np.array([down[chosen], up[chosen]])
            ax.errorbar(one.h[chosen], one.error[chosen], half, label=label, elinewidth=0.8, capsize=0, **how)
    edge_marks(ax, one.h, one.error, look["color"])
    below = one.error < bottom
    if below.any():
        ends = np.maximum(one.error + up, bottom)[below]
        ax.vlines(one.h[below], bottom, ends, color=look["color"], linewidth=0.8, zorder=3)


def _curve(ax: Axes, one: Series) -> None:
    order = np.argsort(one.h)
    h, error, half = one.h[order], one.error[order], one.half[order]
    known = _finite(error)
    look: dict[str, Any] = {"color": one.look["color"], "linewidth": one.look.get("linewidth", 1.2)}
    look |= {"marker": one.look.get("marker"), "markersize": 3}  # which tells curves apart without colours
    ax.plot(h[known], error[known], label=one.label, zorder=1.5, **look)
    known &= np.isfinite(half)
    if (half[known] > VISIBLE * error[known]).any():
        bottom = ax.get_ylim()[0]
        low, high = np.maximum(error - half, bottom)[known], (error + half)[known]
        ax.fill_between(h[known], low, high, color=one.look["color"], alpha=0.25, linewidth=0, zorder=1.2)


def remarks(ax: Axes, series: Sequence[Series], consequence: str = ", left out of the fit") -> None:
    """Entries of the legend for what is not an ordinary point."""
    top = ax.get_ylim()[1]
    sampled = [one for one in series if not one.exact]
    if any(((one.error <= top) & ~one.resolved).any() for one in sampled):
        look: dict[str, Any] = {"color": "#777777", "markerfacecolor": "none", "linestyle": "none"}
        crosses = ", or pale crosses" * any(one.look["marker"] not in Line2D.filled_markers for one in sampled)
        ax.plot([], [], "o", label=f"hollow{crosses}: not resolved{consequence}", **look)
    beyond = np.concatenate([one.error[~(one.error <= top)] for one in sampled] or [np.empty(0)])
    if len(beyond):
        note_diverged(ax, nearly=bool(np.isfinite(beyond).any()))


def _pale(colour: str) -> str:
    red, green, blue = (0.55 * np.array(to_rgb(colour)) + 0.45).tolist()
    return to_hex((red, green, blue))


# ---------------------------------------------------------------------------------------------------------------------
# Panels that compare the estimators of one weak error: accuracy, and the estimates, against processor time.
# ---------------------------------------------------------------------------------------------------------------------


class Run(NamedTuple):
    """An estimator's estimates of one error as its work grows."""

    estimator: str
    seconds: np.ndarray
    error: np.ndarray
    accuracy: np.ndarray  #: standard error; of what is not sampled the bound of the numerical error
    exact: bool  #: whether nothing is sampled

    @property
    def constant(self) -> float:
        """accuracy (seconds)^(1/2), of all its work."""
        return self.accuracy[-1] * math.sqrt(self.seconds[-1])


def panels_of_seconds(readings: Sequence[WeakErrors], f: int, title: str) -> list[list[Panel]]:
    """A line of two panels for each scheme of which plain results for the first so many paths are stored."""
    lines: list[list[Panel]] = []
    for variant in dict.fromkeys(reading.about.variant for reading in readings):
        of = {reading.about.estimator: reading for reading in readings if reading.about.variant == variant}
        if "plain" not in of or not of["plain"].prefixes:
            continue
        h = of["plain"].h
        middle = int(np.argmin(np.abs(np.log2(h) - 0.5 * (np.log2(h.min()) + np.log2(h.max())))))
        runs = [run for run in (_run(of[name], f, middle) for name in ESTIMATORS if name in of) if len(run.seconds)]
        label = style.label(of["plain"].about)
        what = "\n".join(filter(None, [title, f"{label}, $h={style.number(h[middle], steps=True)}$"]))
        lines.append([partial(panel, runs=runs, what=what) for panel in (accuracy_panel, estimates_panel)])
    return lines


def _run(reading: WeakErrors, f: int, i: int) -> Run:
    """The estimates at step size number i, of all stages with less work and of the whole."""
    last = reading.sampled.error_stderr if reading.sampled else reading.half
    points = [(reading.cpu_seconds, reading.error[f, i], last[f, i])]
    if reading.stages:
        each = zip(reading.stages.cpu_seconds, reading.stages.error, reading.stages.error_stderr, strict=True)
        less = [(seconds, error[f, i], stderr[f, i]) for seconds, error, stderr in each]
        points = [*(point for point in less if point[0] < reading.cpu_seconds), *points]
    found = np.array(points, float)
    drawable = (np.abs(found) < HUGE).all(axis=1) & (found[:, [0, 2]] > 1 / HUGE).all(axis=1)
    seconds, error, accuracy = found[drawable].T
    return Run(reading.about.estimator, seconds, error, accuracy, exact=reading.unsampled is not None)


def accuracy_panel(ax: Axes, runs: Sequence[Run], what: str) -> None:
    """Standard errors against processor time, with lines of slope -1/2."""
    ax.set(xscale="log", yscale="log", xlabel="processor time (s)", title=f"{what}: accuracy")
    ax.set_ylabel("standard error of the weak error")
    rules(ax)
    plain = next((run for run in runs if run.estimator == "plain"), None)
    seconds = np.concatenate([run.seconds for run in runs] or [np.ones(1)])
    ends = np.array([seconds.min() / 2, seconds.max() * 2])
    sampled = np.concatenate([run.accuracy for run in runs if not run.exact] or [np.ones(1)])
    low, high = limits(sampled)
    for run in runs:
        marker, colour = ESTIMATORS[run.estimator].keys.LOOK
        told = [label_of(run.estimator)]
        if run.exact:
            told.append(f"bound ${style.number(float(f'{run.accuracy[-1]:.1e}'))}$")
        if plain and run is not plain:
            told.append(f"{_times((plain.constant / run.constant) ** 2)} as fast as plain")
        look: dict[str, Any] = {"marker": marker, "color": colour, "linestyle": "none", "label": ", ".join(told)}
        if run.exact:
            low = max(low / 300, min(low, run.accuracy[-1] / 2))
            at = np.maximum(run.accuracy, low)
            ax.plot(run.seconds, at, markersize=10, clip_on=False, zorder=4, **look)
            if run.accuracy[-1] < low:
                below: dict[str, Any] = {"textcoords": "offset points", "xytext": (4, 12), "ha": "right", "fontsize": 8}
                ax.annotate(f"far below:\n{told[1]}", (run.seconds[-1], low), **below)
            continue
        ax.plot(run.seconds, run.accuracy, **look)
        ax.plot(ends, run.constant / np.sqrt(ends), color=colour, linewidth=0.9)
    ax.set(xlim=ends, ylim=(low, high))
    ax.plot([], [], color="#777777", linewidth=0.9, label="slope $-$1/2")
    legend_under(ax)


def estimates_panel(ax: Axes, runs: Sequence[Run], what: str) -> None:
    """Estimates of the error with 95 % intervals against processor time, over the exact value."""
    ax.set(xscale="log", xlabel="processor time (s)", title=f"{what}: estimates")
    ax.set_ylabel(r"weak error  $\mathrm{E}\,\varphi(y_h(T))-\mathrm{E}\,\varphi(y(T))$")
    rules(ax)
    found = [run for run in runs if not run.exact]
    if found:
        ax.set_ylim(_window(found))
    for run in runs:
        marker, colour = ESTIMATORS[run.estimator].keys.LOOK
        if run.exact:
            ax.axhline(run.error[-1], color=colour, linewidth=1.0, label=label_of(run.estimator), zorder=1)
            continue
        look: dict[str, Any] = {"marker": marker, "color": colour, "linestyle": "none", "elinewidth": 0.9, "capsize": 2}
        ax.errorbar(run.seconds, run.error, INTERVAL * run.accuracy, label=label_of(run.estimator), **look)
        edge: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 4}
        low, high = ax.get_ylim()
        for outside, mark, place in ((run.error < low, CARETDOWN, 0), (run.error > high, CARETUP, 1)):
            if outside.any():
                at = np.full(outside.sum(), place)
                ax.plot(run.seconds[outside], at, marker=mark, color=colour, linestyle="none", **edge)
    legend_under(ax)


def _window(runs: Sequence[Run]) -> tuple[float, float]:
    """Limits about the best estimate in which the narrowest intervals can be seen and the widest need not fit."""
    best = min(runs, key=lambda run: run.accuracy[-1])
    half = INTERVAL * np.concatenate([run.accuracy for run in runs])
    reach = max((np.abs(run.error - best.error[-1]) + INTERVAL * run.accuracy).max() for run in runs)
    room = 1.05 * min(reach, 4 * math.sqrt(half.min() * half.max()))
    return best.error[-1] - room, best.error[-1] + room


def _times(ratio: float) -> str:
    """A ratio with two digits, as a power of ten if it is large."""
    if not math.isfinite(ratio):
        return "?"
    if 1e-2 < ratio < 1e4:
        return f"{float(f'{ratio:.2g}'):g} times"
    return f"${style.number(float(f'{ratio:.1e}'))}$ times"


# ---------------------------------------------------------------------------------------------------------------------
# Weak errors of schemes for the multiscale system: against eps, and the largest over eps.
# ---------------------------------------------------------------------------------------------------------------------

EPS_COLUMNS = 3  # panels side by side
APART = 0.01  # of the panel's width, between markers of two schemes at one eps
LIMIT = "#eeeeee"  # where the reference shows a limit
LARGEST, SMALLEST, OTHERS = 13.0, 5.5, 3.5  # discs of several eps, one on the other where the errors agree


def marker_sizes(readings: Sequence[WeakErrors]) -> dict[str, float]:
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


def panels_over_eps(readings: Sequence[WeakErrors], f: int, looks: style.Looks, title: str) -> list[list[Panel]]:
    """Lines of panels of errors against eps, a panel for each step size."""
    if not any(reading.about.eps for reading in readings):
        raise ValueError("the panel 'eps' needs a scheme with eps > 0")
    steps = sorted({h for reading in readings for h in reading.h.tolist()}, reverse=True)
    found: list[Panel] = []
    for i, h in enumerate(steps):
        lines = [*[title] * (i == 0 and bool(title)), f"$h={style.number(h, steps=True)}$"]
        found.append(partial(eps_panel, readings=readings, f=f, looks=looks, h=h, title="\n".join(lines)))
    return [found[i : i + EPS_COLUMNS] for i in range(0, len(found), EPS_COLUMNS)]


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
            curves.append(
                _series_over_eps(fast, f, h, looks[scheme], style.label(fast[0].about, with_eps=False), several)
            )
    without = [reading for reading in readings if not reading.about.eps]
    lines = [_series_over_eps([one], f, h, looks[one.about.scheme], style.label(one.about), several) for one in without]
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
        draw_series(ax, beside)


def _series_over_eps(
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


#: The words of the key ``panels``.
WORDS = ("errors", "samples", "seconds", "eps")

_SIZE = 6.0  # of a marker


def draw(title: str, cases: Sequence[Sequence[WeakErrors]]) -> Figure:
    """The figure of a study of kind weak, the panels of each case and test function as its ``panels`` ask.

    ``errors`` against step sizes, beside it ``samples``, the same by number of paths, and under them ``eps``, errors
    against eps, and ``seconds``, accuracy and estimates against processor time.
    """
    looks = style.looks(cases)
    shared, own = style.split_facts([_facts(readings) for readings in cases])
    lines = []
    for f in range(max(len(readings[0].functions) for readings in cases)):
        for readings, facts in zip(cases, own, strict=True):
            if f < len(readings[0].functions):
                lines += _lines(readings, f, looks, _title(readings[0], f, len(cases) > 1, facts))
    if not lines:
        raise ValueError("the results name no panel that could be drawn")
    if all(len(line) == 1 for line in lines):
        lines = _arranged([panel for (panel,) in lines], len(cases))

    columns, size = page.current().panels(max(map(len, lines)), PANEL, LEAST)
    lines = [line[i : i + columns] for line in lines for i in range(0, len(line), columns)]
    fig = Figure()
    height = len(lines) * (size[1] + legend_line() * (5 + max(map(_entries, cases))))
    style.dress(fig, columns * size[0], height, title, shared)
    grid = fig.add_gridspec(len(lines), columns)
    for i, line in enumerate(lines):
        for j, panel in enumerate(line):
            ax = fig.add_subplot(grid[i, j])
            panel(ax)
            if j and ax.get_ylabel() == ERRORS["weak"]:
                ax.set_ylabel("")
    return fig


def _entries(readings: Sequence[WeakErrors]) -> int:
    """How many lines the schemes of a case take in a legend, with what is said about several eps."""
    found = sweeps(readings)
    others = sum(reading.about.eps is None for reading in readings)
    many = len(readings) + 2 * bool(found) if {"errors", "samples"} & set(readings[0].panels) else 0
    return max(many, len(found) + others + 1)


def _arranged(panels: list[Panel], cases: int) -> list[list[Panel]]:
    """Panels in lines: the cases side by side, a line per function; of one function or many cases as it fits."""
    columns = cases if 1 < cases <= 3 else 2 if len(panels) in (2, 4) else min(len(panels), 3)
    return [panels[i : i + columns] for i in range(0, len(panels), columns)]


def _facts(readings: Sequence[WeakErrors]) -> dict[str, str]:
    """What is told of all of a case: of the estimators and their samples only what they have in common."""
    first, estimators = readings[0], {reading.about.estimator for reading in readings}
    return style.facts(
        first,
        "reference_scheme",
        reference_step=first.reference_step if any(reading.sampled for reading in readings) else None,
        samples=first.paths if len(estimators) == 1 else None,
        estimator=label_of(first.about.estimator) if len(estimators) == 1 else None,
        functions=first.formulas,
    )


def _title(reading: WeakErrors, f: int, several_cases: bool, facts: list[str]) -> str:
    lines = [panel_title(reading.about, facts)] if several_cases else []
    if len(reading.functions) > 1:
        formula = style.formula(reading.formulas[f], reading.about.variables)
        lines.append(rf"{style.plain(reading.functions[f])}: $\varphi(y)={formula}$")
    return "\n".join(lines)


def _lines(readings: Sequence[WeakErrors], f: int, looks: style.Looks, title: str) -> list[list[Panel]]:
    """The lines of panels of one case and test function."""
    panels = readings[0].panels
    check_panels(panels, WORDS)
    staged = [reading for reading in readings if reading.prefixes]
    apart = "samples" in panels and staged  # plain results then have panels of their own
    shown = [reading for reading in readings if not (apart and _is_outdone(reading, readings))]
    sizes = marker_sizes(shown)
    shown.sort(key=lambda one: -sizes.get(one.about.variant, 0.0))  # where errors agree, small discs lie on large ones
    series = _series(shown, readings, f, looks, sizes)
    first: list[Panel] = []
    if "errors" in panels:
        drawn: dict[str, Any] = {
            "series": [*largest(shown, f, looks), *series],
            "notes": reference_note(readings),
        }
        first.append(partial(errors_panel, title=title, **drawn))
    if apart:
        exact = {one.about.variant: line for one, line in zip(shown, series, strict=True) if line.exact}
        for reading in staged:
            schemes = {one.about.variant for one in readings}
            of_paths = [style.label(reading.about)] * (len(schemes) > 1) + ["plain Monte Carlo by number of paths"]
            titles = [title] * (not first) + [": ".join(of_paths)]
            told: dict[str, Any] = {"exact": exact.get(reading.about.variant), "title": "\n".join(filter(None, titles))}
            first.append(partial(prefixes_panel, reading=reading, f=f, **told))
    under = panels_over_eps(shown, f, looks, "" if first else title) if "eps" in panels else []
    if "seconds" in panels:
        under += panels_of_seconds(readings, f, "" if first or under else title)
    return [line for line in (first, *under) if line]


def _series(
    shown: Sequence[WeakErrors], readings: Sequence[WeakErrors], f: int, looks: style.Looks, sizes: dict[str, float]
) -> list[Series]:
    """The series of each reading that is shown; `sizes` are those of markers of schemes with several eps."""
    several_schemes = len({reading.about.variant for reading in readings}) > 1
    several_estimators = len({reading.about.estimator for reading in readings}) > 1
    joined = all(reading.sampled for reading in readings)
    found = []
    for reading in shown:
        variant = reading.about.variant
        marker, colour = looks[variant]
        size = sizes.get(variant, OTHERS if sizes else _SIZE)
        look = {"marker": "o" if variant in sizes else marker, "color": colour, "markersize": size}
        estimator = label_of(reading.about.estimator)
        if reading.paths is not None:
            estimator += f" ({style.count(reading.paths)})"
        names = [style.label(reading.about)] * (several_schemes or not several_estimators)
        label = ", ".join([*names, *[estimator] * several_estimators])
        found.append(series_of(reading, f, look, label, joined, _is_outdone(reading, shown)))
    return found


def _is_outdone(reading: WeakErrors, readings: Sequence[WeakErrors]) -> bool:
    """Whether a plain estimate stands beside a better one of the same scheme, by levels or points."""
    return reading.about.estimator == "plain" and any(
        other.about.estimator in ("multilevel", "quasi") and other.about.variant == reading.about.variant
        for other in readings
    )
