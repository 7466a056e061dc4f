"""The figure of long times: how errors of the Casimirs grow, and how far the law of long paths is from its limit."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import (
    INTERVAL,
    KNOWN,
    SLOPE,
    dress_function,
    error_axes,
    histogram,
    legend_line,
    legend_under,
    limits,
    rules,
    with_order,
)

from .results import PANELS, Equilibrium, with_averages, with_laws

# ---------------------------------------------------------------------------------------------------------------------
# Panels of means of functions over time: biases, histograms, autocorrelations, fluctuations, acceptance.
# ---------------------------------------------------------------------------------------------------------------------

SIZE = (3.3, 2.7)  # inches of a panel
_LEAST = 1.9  # of its width in a paper
_MOST_COLUMNS = 4
_MARKERS = 12
_ENDS = 0.02  # an autocorrelation is shown until it is less than that


def average_lines(readings: Sequence[Equilibrium], looks: style.Looks) -> list[layout.Line]:
    """The lines of panels of one case that are about functions, a panel for each, and of acceptance."""
    words, lines = readings[0].panels, []
    first = [averages for _, averages in with_averages(readings)][:1]
    shown = {"means": _means, "histogram": _histogram, "autocorrelation": _autocorrelation, "heat": _response}
    for word, panel in shown.items() if first else ():
        functions = range(len(first[0].functions)) if word in words else ()
        chosen = [f for f in functions if word != "heat" or np.isfinite(first[0].response(f)[1])]
        panels = [partial(panel, readings=readings, f=f, looks=looks) for f in chosen]
        legend = [_entries(readings, looks, word)]
        lines += layout.in_lines(panels, _MOST_COLUMNS, SIZE, legend=legend, least=_LEAST)
    if "acceptance" in words and any(reading.acceptance for reading in readings):
        lines.append(layout.Line([partial(_acceptance, readings=readings, looks=looks)], SIZE, least=_LEAST))
    return lines


def _entries(readings: Sequence[Equilibrium], looks: style.Looks, word: str) -> list[layout.Entry]:
    """The entries of the legend of a line of panels: the schemes, and the references."""
    entries: list[layout.Entry] = []
    for reading, _ in with_averages(readings):
        more = ""
        if word in ("histogram", "autocorrelation"):
            i = _shown(reading, word)
            more = ", diverged" if i is None else f", $h={style.number(float(reading.h[i]), steps=True)}$"
        entries.append(layout.scheme_entry(reading.about, looks, more, markerfacecolor="none"))
    averages = next(averages for _, averages in with_averages(readings))
    references = {"means": averages.reference, "histogram": averages.density_exact, "heat": averages.reference_variance}
    if word in references and np.isfinite(references[word]).any() and not (word == "means" and _of_biases(readings)):
        entries.append((Line2D([], [], **KNOWN), "exact" if word != "means" else "reference"))
    if word == "means" and _of_biases(readings):
        entries.append(layout.zero_mark())
    return entries


def _shown(reading: Equilibrium, word: str) -> int | None:
    """The step size of a histogram or an autocorrelation: the largest, or smallest, at which no path diverged."""
    finite = np.flatnonzero(reading.nonfinite == 0)
    return int(finite[0 if word == "histogram" else -1]) if len(finite) else None


def _of_biases(readings: Sequence[Equilibrium]) -> bool:
    return any(np.isfinite(averages.bias).any() and len(reading.h) > 1 for reading, averages in with_averages(readings))


def _dress(ax: Axes, readings: Sequence[Equilibrium], f: int, x: str | None, y: str) -> None:
    dress_function(ax, next(averages for _, averages in with_averages(readings)), f, x, y)


def _means(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """The modulus of biases against the step size with the fitted orders, or means where there is no reference."""
    referenced = [pair for pair in with_averages(readings) if np.isfinite(pair[1].reference[f])]
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    if not (referenced and _of_biases(readings)):
        ax.set_yscale("linear")
        for reading, averages in with_averages(readings):
            look = _look(reading, looks)
            ax.errorbar(reading.h, averages.average[:, f], averages.average_half[:, f], elinewidth=0.8, **look)
            if np.isfinite(averages.reference[f]):
                ax.axhline(averages.reference[f], **KNOWN)
        _dress(ax, readings, f, "step size $h$", "mean")
        return
    _dress(ax, readings, f, "step size $h$", "|mean $-$ reference|")
    bias = {
        reading.about.variant: (np.abs(record.bias[:, f]), record.bias_stderr[:, f]) for reading, record in referenced
    }
    each = [np.maximum(value, stderr) for value, stderr in bias.values()]
    values = np.concatenate(each)
    ax.set_ylim(limits(values[np.isfinite(values) & (values > 0)]))
    for reading, averages in referenced:
        value, stderr = bias[reading.about.variant]
        look, order = _look(reading, looks), averages.order[f]
        label = with_order("", order.order, order.low, order.high).lstrip(": ") if np.isfinite(order.order) else None
        zero = ~(value > 2 * stderr)
        used = value > 0
        ax.plot(reading.h[used], value[used], color=look["color"], linewidth=0.9, alpha=0.6)
        filled = look | {"linestyle": "none", "markerfacecolor": look["color"]}
        for some, how in ((used & ~zero, {"label": label}), (used & zero, layout.unresolved(look["marker"]))):
            half = np.array([np.minimum(INTERVAL * stderr, 0.999 * value), INTERVAL * stderr])[:, some]
            ax.errorbar(reading.h[some], value[some], half, elinewidth=0.8, **filled | how)
        if np.isfinite(order.order):
            ax.plot(reading.h, abs(averages.constant[f]) * reading.h**order.order, color=look["color"], linewidth=0.6)
    if ax.get_legend_handles_labels()[0]:
        legend_under(ax)


def _look(reading: Equilibrium, looks: style.Looks) -> dict[str, Any]:
    marker, colour = looks[reading.about.variant]
    return {"color": colour, "marker": marker, "markersize": 5, "markerfacecolor": "none", "linewidth": 1.0}


def _histogram(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """Densities at the largest step size without diverged paths, no empty cells at both ends, and the exact density."""
    has_exact = False
    for reading, averages in with_averages(readings):
        i, colour = _shown(reading, "histogram"), looks[reading.about.variant][1]
        if i is None:
            continue
        cells, exact = (averages.cell_low[i, f], averages.cell_width[i, f]), averages.density_exact[i, f]
        shown = histogram(ax, cells, averages.density[i, f], averages.density_stderr[i, f], colour, exact)
        if not has_exact and np.isfinite(exact).any():
            has_exact = True
            ax.stairs(*shown, **KNOWN)
    ax.set_ylim(bottom=0)
    _dress(ax, readings, f, None, "density")


def _autocorrelation(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """Autocorrelations at the smallest step size without diverged paths, with 95 % intervals."""
    ax.axhline(0, color="black", linewidth=0.6)
    last = 1.0
    for reading, averages in with_averages(readings):
        i, look = _shown(reading, "autocorrelation"), _look(reading, looks)
        if i is None:
            continue
        value, half = averages.correlation[i, f], INTERVAL * np.nan_to_num(averages.correlation_stderr[i, f])
        above = np.flatnonzero(np.abs(value) > np.maximum(_ENDS, half))
        end = min(len(value), 2 + 3 * (above[-1] + 1) // 2 if len(above) else 2)
        last = max(last * (reading is not readings[0]), float(averages.lag[end - 1]))
        every = max(1, end // _MARKERS)
        ax.plot(averages.lag[:end], value[:end], markevery=every, **look | {"markersize": 4})
        ax.fill_between(
            averages.lag[:end], (value - half)[:end], (value + half)[:end], color=look["color"], alpha=0.3, lw=0
        )
    ax.set_xlim(0, last)
    _dress(ax, readings, f, "lag $s$", "autocorrelation")


def _response(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """Heat capacity or susceptibility against the step size."""
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    ax.set_yscale("linear")
    name = ""
    for reading, averages in with_averages(readings):
        name, factor = averages.response(f)
        half = INTERVAL * abs(factor) * averages.variance_stderr[:, f]
        ax.errorbar(reading.h, factor * averages.variance[:, f], half, elinewidth=0.8, **_look(reading, looks))
        if np.isfinite(averages.reference_variance[f]):
            ax.axhline(factor * averages.reference_variance[f], **KNOWN)
    _dress(ax, readings, f, "step size $h$", f"{name}, {'Var$/T^2$' if name == 'heat capacity' else 'Var$/T$'}")


def _acceptance(ax: Axes, readings: Sequence[Equilibrium], looks: style.Looks) -> None:
    """Shares of accepted noise flows (line) and steps of the drift (dashed), against the step size."""
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    ax.set(yscale="linear", ylabel="share accepted")
    for reading in readings:
        if rates := reading.acceptance:
            look = _look(reading, looks)
            ax.plot(reading.h, rates.noise_accepted, label="noise flows", **look)
            ax.plot(reading.h, rates.drift_accepted, label="steps of the drift", **look | {"linestyle": "--"})
    ax.set_ylim(top=1.01)
    legend_under(ax)


# ---------------------------------------------------------------------------------------------------------------------
# Panels that compare the law of long paths with the exact stationary law.
# ---------------------------------------------------------------------------------------------------------------------

MOST = 4  # variables shown
ZERO = 2.0  # standard errors: up to these a distance is statistically zero
NARROWEST, WIDEST = 0.03, 0.6  # deviations of a density from 1 that the axis reaches at least, and at most
APART = 0.006  # between the markers of two schemes in one bin
FAR = 6.0  # standard errors: a mean further from the exact value is only marked


def chosen(names: tuple[str, ...]) -> tuple[str, ...]:
    """The variables shown: all, or of many the first, the second and the last two."""
    return names if len(names) <= MOST else (*names[:2], *names[-2:])


def scheme_entries(readings: Sequence[Equilibrium], looks: style.Looks, word: str) -> list[layout.Entry]:
    """The entries of the legend of a line of panels: the schemes, in "law" with their step sizes, and one more."""
    row = []
    for reading in readings:
        more = ""
        if word == "law":
            more = ": paths diverge at every $h$" if reading.largest_finite is None else f", {_step(reading)}"
        row.append(layout.scheme_entry(reading.about, looks, more, markersize=5, linewidth=0.9))
    if word == "law":
        return [*row, (Line2D([], [], color="black", linewidth=0.9), "exact")]
    return [*row, layout.zero_mark()]


def _step(reading: Equilibrium) -> str:
    return f"$h={style.number(float(reading.h[reading.largest_finite]), steps=True)}$"


def _densities(readings: Sequence[Equilibrium], name: str) -> Iterator[tuple[Equilibrium, np.ndarray, np.ndarray]]:
    """(reading, frequency over exact probability, half the 95 % interval) of each scheme.

    They are those of its largest step size without diverged paths; a scheme without such a step size is left out.
    """
    for reading, law in with_laws(readings):
        i = reading.largest_finite
        if i is not None:
            at = i, law.variables.index(name)
            values, stderr = law.fraction[at], law.fraction_stderr[at]
            yield reading, len(values) * values, INTERVAL * len(values) * stderr


def law_limits(readings: Sequence[Equilibrium], names: tuple[str, ...]) -> tuple[float, float]:
    """Limits of the axis of densities, about 1: all values of the best scheme, and those of others that are near."""
    reach: dict[str, float] = {}
    for name in names:
        for reading, values, half in _densities(readings, name):
            farthest, variant = float(np.nanmax(np.abs(values - 1) + half)), reading.about.variant
            reach[variant] = max(reach.get(variant, 0.0), farthest)
    if not reach:
        return 0.0, 2.0
    best = min(reach.values())
    room = 1.08 * max(NARROWEST, best, min(max(reach.values()), max(WIDEST, 3 * best)))
    return 1 - room, 1 + room


def law_panel(
    ax: Axes, readings: Sequence[Equilibrium], name: str, limits: tuple[float, float], looks: style.Looks
) -> None:
    """Frequency over exact probability in bins of equal probability, at the largest step size without lost paths."""
    _begin(ax, name, "frequency / exact")
    ax.set(xlabel="exact distribution function", xlim=(0, 1), ylim=limits)
    ax.set_xticks([0, 0.5, 1], ["0", "1/2", "1"])
    rules(ax)
    ax.axhline(1, color="black", linewidth=0.9, zorder=1)
    curves = list(_densities(readings, name))
    for k, (reading, values, half) in enumerate(curves):
        marker, colour = looks[reading.about.variant]
        x = (np.arange(len(values)) + 0.5) / len(values) + APART * (k - (len(curves) - 1) / 2)
        look: dict[str, Any] = {
            "marker": marker,
            "color": colour,
            "markersize": 3.5,
            "linewidth": 0.7,
            "elinewidth": 0.7,
        }
        inside = (values >= limits[0]) & (values <= limits[1])
        ax.errorbar(x, np.where(inside, values, np.nan), half, zorder=3, **look)
        layout.edge_marks(ax, x[~inside], values[~inside], colour)


def _begin(ax: Axes, name: str, label: str) -> None:
    ax.set_title(f"${style.formula(name)}$")
    ax.set_ylabel(label)


def _distances(readings: Sequence[Equilibrium], name: str) -> Iterator[tuple[Equilibrium, np.ndarray, np.ndarray]]:
    """(reading, distance, standard error), arrays (h,), of each scheme."""
    for reading, law in with_laws(readings):
        at = law.variables.index(name)
        yield reading, law.distance[:, at], law.distance_stderr[:, at]


def distance_limits(readings: Sequence[Equilibrium], names: tuple[str, ...]) -> tuple[float, float]:
    """Limits of the axis of distances: all of them, and the sampling errors."""
    each = []
    for name in names:
        for _, value, stderr in _distances(readings, name):
            each += [value, np.maximum(value - INTERVAL * stderr, stderr)]
    positive = np.concatenate(each)
    positive = positive[np.isfinite(positive) & (positive > 0)]
    return limits(positive if positive.size else np.array([1.0]))


def distance_panel(
    ax: Axes, readings: Sequence[Equilibrium], name: str, limits: tuple[float, float], looks: style.Looks
) -> None:
    """Largest difference of the distribution functions against the step size, hollow where it is statistically zero."""
    curves = list(_distances(readings, name))
    error_axes(ax, np.concatenate([reading.h for reading, _, _ in curves]))
    _begin(ax, name, r"$\max\,|F_h-F|$")
    ax.set_ylim(limits)
    bottom, top = limits
    for reading, value, stderr in curves:
        marker, colour = looks[reading.about.variant]
        shown = np.where((value >= bottom) & (value <= top), value, np.nan)
        ax.plot(reading.h, shown, color=colour, linewidth=0.9, alpha=0.6, zorder=2)
        look = {"marker": marker, "color": colour, "markersize": 5}
        layout.points(ax, reading.h, value, INTERVAL * stderr, ~(value > ZERO * stderr), look)
        layout.edge_marks(ax, reading.h, value, colour)


def moments_panel(ax: Axes, readings: Sequence[Equilibrium], names: tuple[str, ...], looks: style.Looks) -> None:
    """Means less exact values in standard errors, of each scheme at the largest step size without lost paths."""
    ax.set(xlim=(-0.6, len(names) - 0.4), ylim=(-FAR, FAR), ylabel="(mean $-$ exact) / standard error")
    ax.set_xticks(range(len(names)), [f"${style.formula(name)}$" for name in names])
    rules(ax)
    ax.axhspan(-INTERVAL, INTERVAL, color="#eeeeee", linewidth=0, zorder=0.2, label="95 % if the law is exact")
    ax.axhline(0, color="black", linewidth=0.9, zorder=1)
    far = False
    for k, (reading, law) in enumerate(with_laws(readings)):
        if reading.largest_finite is None:
            continue
        marker, colour = looks[reading.about.variant]
        z = law.z[reading.largest_finite]
        x = np.arange(len(names)) + 0.12 * (k - (len(readings) - 1) / 2)
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 5, "linestyle": "none"}
        inside = np.abs(z) <= FAR
        ax.plot(
            x, np.where(inside, z, np.nan), label=f"{style.label(reading.about)}, {_step(reading)}", zorder=3, **look
        )
        layout.edge_marks(ax, x[~inside], z[~inside], colour)
        far |= not inside.all()
    if far:
        ax.plot([], [], "^", color="black", label=f"further away than {FAR:g}, or not finite")
    legend_under(ax)


LARGE = (4.6, 3.2)  # inches of a panel of growth or moments, without its legend
SMALL = (2.6, 2.5)  # the same of a panel of one variable
LEAST_LARGE, LEAST_SMALL = 3.2, 1.6  # inches of their widths in a paper

FLOOR = 1e-11  #: errors of schemes that preserve a Casimir but for rounding are expected to stay below this
TOP = 1e2  # larger errors are only marked
MARKERS = 9  # along a curve
KEPT = 1e-6  # only a scheme whose errors end below that has reference slopes
STEPS = 3  # step sizes shown at most
SLOPE_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": SLOPE, "linestyle": "--", "linewidth": 1.0},
    {"color": SLOPE, "linestyle": ":", "linewidth": 0.8},
)
FLOOR_LOOK: dict[str, Any] = {"color": "#000000", "linestyle": "-.", "linewidth": 0.8}


def draw(title: str, cases: Sequence[Sequence[Equilibrium]]) -> Figure:
    """The figure of a study of kind equilibrium.

    For each case a line with ``growth``, a panel per Casimir, and ``moments``, and under it lines of ``law`` and of
    ``distance``, a panel per variable, and of means of functions, a panel for each.
    """
    return layout.of_cases(title, cases, _facts, _lines)


def _facts(reading: Equilibrium) -> dict[str, str]:
    steps = style.number(reading.steps_each, steps=True)
    each = "" if reading.averages else f" of ${steps}$ steps"
    return {**style.facts(reading), "paths": f"{style.count(reading.samples)} paths{each}"}


def _lines(readings: Sequence[Equilibrium], looks: style.Looks) -> list[layout.Line]:
    """The lines of panels of one case; those of the stationary law are left out where it is not known."""
    words, law = readings[0].panels, readings[0].law
    layout.check_panels(words, PANELS)
    lines: list[layout.Line] = []
    large: list[layout.Panel] = []
    if "growth" in words:
        count = max(readings[0].casimir_count, 1)
        large += [partial(_growth_panel, readings=readings, c=c, looks=looks) for c in range(count)]
    if law and "moments" in words:
        large.append(partial(moments_panel, readings=readings, names=law.moments, looks=looks))
    if large:
        curves = sum(len(_steps_shown(reading)) for reading in readings) if "growth" in words else 0
        size = LARGE[0], LARGE[1] + legend_line() * max(len(readings) + 2, curves)
        lines.append(
            layout.Line(large, size, legend=[_marks(readings)] if "growth" in words else (), least=LEAST_LARGE)
        )
    for word, panel, limits_of in (("law", law_panel, law_limits), ("distance", distance_panel, distance_limits)):
        if law and word in words:
            names = chosen(law.variables)
            arguments: dict[str, Any] = {"readings": readings, "limits": limits_of(readings, names), "looks": looks}
            panels = [partial(panel, name=name, **arguments) for name in names]
            entries = [scheme_entries(readings, looks, word)]
            lines.append(layout.Line(panels, SMALL, legend=entries, least=LEAST_SMALL, shared=True))
    return lines + average_lines(readings, looks)


def _growth_panel(ax: Axes, readings: Sequence[Equilibrium], c: int, looks: style.Looks) -> None:
    """Root mean square of the relative error of Casimir `c` against the number of steps, and of path 0, thin.

    A line per scheme and step size, with the fitted exponent in the legend.  Slope 1/2 lies just above the errors of
    the scheme that preserves the Casimir best; slope 1 starts with it, and shows the growth of a bias of that size.
    """
    count = readings[0].casimir_count
    if not count:
        layout.empty(ax, "no Casimir")
        return
    symbol = f"C_{c + 1}" if count > 1 else "C"
    ax.set(xscale="log", yscale="log", xlabel="number of steps $n$")
    ax.set_ylabel(f"rms of ${symbol}(y_n)\\,/\\,{symbol}(y_0)-1$")
    rules(ax)
    n = np.concatenate([reading.n for reading in readings])
    ax.set_xlim(n.min() / 1.5, n.max() * 1.5)
    shown_rms = np.concatenate([reading.casimir_rms[..., c].ravel() for reading in readings])
    shown_rms = shown_rms[(shown_rms > 0) & (shown_rms <= TOP)]
    ax.set_ylim(limits(np.append(shown_rms, FLOOR)))
    for reading in readings:
        marker, colour = looks[reading.about.variant]
        shown = _steps_shown(reading)
        for k, i in enumerate(shown):
            _curves(ax, reading, i, c, marker, layout.shade(colour, k, len(shown)), 3 - 0.1 * k)
    _slopes(ax, readings, c)
    ax.axhline(FLOOR, zorder=1, **FLOOR_LOOK)
    legend_under(ax)


def _steps_shown(reading: Equilibrium) -> list[int]:
    """The numbers of the step sizes that have lines."""
    return layout.spread(len(reading.h), STEPS)


def _marks(readings: Sequence[Equilibrium]) -> list[layout.Entry]:
    """Entries of a legend for lines and marks that are not curves of schemes."""
    looks = zip(("1/2", "1"), SLOPE_LOOKS, strict=True)
    entries: list[layout.Entry] = [(Line2D([], [], **look), f"slope {text}") for text, look in looks]
    entries.append((Line2D([], [], **FLOOR_LOOK), f"${style.power(FLOOR)}$"))
    entries.append((Line2D([], [], color="#777777", linewidth=0.6), "thin: path 0"))
    if any((~(reading.casimir_rms <= TOP)).any() for reading in readings):
        entries.append(layout.mark("^", f"not finite, or above ${style.power(TOP)}$"))
    return entries


def _slopes(ax: Axes, readings: Sequence[Equilibrium], c: int) -> None:
    """Reference slopes at the errors of the scheme with the smallest ones in the end."""
    ends = [(values[-1], reading.n, values) for reading in readings for values in reading.casimir_rms[..., c]]
    small = [end for end in ends if 0 < end[0] < KEPT]
    if not small:
        return
    _, n, values = min(small, key=lambda end: end[0])
    x = np.array(ax.get_xlim())
    first = 1.7 * (values / np.sqrt(n)).max() * np.sqrt(x[0])
    ax.plot(x, first * np.sqrt(x / x[0]), zorder=1, **SLOPE_LOOKS[0])
    ax.plot(x, first * x / x[0], zorder=1, **SLOPE_LOOKS[1])


def _curves(ax: Axes, reading: Equilibrium, i: int, c: int, marker: str, colour: str, zorder: float) -> None:
    """The lines of one scheme at one step size, with a mark where the first leaves the panel."""
    n, top = reading.n, ax.get_ylim()[1]
    rms, of_path_0 = reading.casimir_rms[i, :, c], np.abs(reading.casimir_one[i, :, c])
    shown, single = (np.where((values > 0) & (values <= top), values, np.nan) for values in (rms, of_path_0))
    every = max(1, len(n) // MARKERS)
    look: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 4.5, "markevery": (i % every, every)}
    ax.plot(n, shown, label=_label(reading, i, c), zorder=zorder, **look)
    ax.plot(n, single, color=colour, linewidth=0.5, zorder=2)
    above = ~(rms <= top)
    layout.edge_marks(ax, n[above][:1], rms[above][:1], colour)


def _label(reading: Equilibrium, i: int, c: int) -> str:
    p, low, high = (float(values[i, c]) for values in (reading.growth, reading.growth_low, reading.growth_high))
    text = f"{style.label(reading.about)}, $h={style.number(float(reading.h[i]), steps=True)}$"
    return f"{text}: $n^{{{p:.2f}}}$ [{low:.2f}, {high:.2f}]" if math.isfinite(p) else text
