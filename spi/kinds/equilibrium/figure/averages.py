"""Panels of means of functions over time: biases, histograms, autocorrelations, fluctuations, acceptance."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import (
    INTERVAL,
    KNOWN,
    dress_function,
    error_axes,
    histogram,
    legend_under,
    limits,
    with_order,
)

from ..results import Equilibrium, with_averages

SIZE = (3.3, 2.7)  # inches of a panel
_LEAST = 1.9  # of its width in a paper
_MOST_COLUMNS = 4
_MARKERS = 12
_ENDS = 0.02  # an autocorrelation is shown until it is less than that


def lines(readings: Sequence[Equilibrium], looks: style.Looks) -> list[layout.Line]:
    """The lines of panels of one case that are about functions, a panel for each, and of acceptance."""
    words, found = readings[0].panels, []
    known = [averages for _, averages in with_averages(readings)][:1]
    shown = {"means": _means, "histogram": _histogram, "autocorrelation": _autocorrelation, "heat": _response}
    for word, panel in shown.items() if known else ():
        functions = range(len(known[0].functions)) if word in words else ()
        chosen = [f for f in functions if word != "heat" or np.isfinite(known[0].response(f)[1])]
        panels = [partial(panel, readings=readings, f=f, looks=looks) for f in chosen]
        legend = [_entries(readings, looks, word)]
        found += layout.in_lines(panels, _MOST_COLUMNS, SIZE, legend=legend, least=_LEAST)
    if "acceptance" in words and any(reading.acceptance for reading in readings):
        found.append(layout.Line([partial(_acceptance, readings=readings, looks=looks)], SIZE, least=_LEAST))
    return found


def _entries(readings: Sequence[Equilibrium], looks: style.Looks, word: str) -> list[layout.Entry]:
    """The entries of the legend of a line of panels: the schemes, and what is known."""
    found: list[layout.Entry] = []
    for reading, _ in with_averages(readings):
        more = ""
        if word in ("histogram", "autocorrelation"):
            i = _shown(reading, word)
            more = ", diverged" if i is None else f", $h={style.number(float(reading.h[i]), steps=True)}$"
        found.append(layout.scheme_entry(reading.about, looks, more, markerfacecolor="none"))
    averages = next(one for _, one in with_averages(readings))
    known = {"means": averages.reference, "histogram": averages.density_exact, "heat": averages.reference_variance}
    if word in known and np.isfinite(known[word]).any() and not (word == "means" and _of_biases(readings)):
        found.append((Line2D([], [], **KNOWN), "exact" if word != "means" else "reference"))
    if word == "means" and _of_biases(readings):
        found.append(layout.zero_mark())
    return found


def _shown(reading: Equilibrium, word: str) -> int | None:
    """Of which step size a histogram or an autocorrelation is shown: the largest, or smallest, that keeps all paths."""
    finite = np.flatnonzero(reading.nonfinite == 0)
    return int(finite[0 if word == "histogram" else -1]) if len(finite) else None


def _of_biases(readings: Sequence[Equilibrium]) -> bool:
    return any(np.isfinite(one.bias).any() and len(reading.h) > 1 for reading, one in with_averages(readings))


def _dress(ax: Axes, readings: Sequence[Equilibrium], f: int, x: str | None, y: str) -> None:
    dress_function(ax, next(found for _, found in with_averages(readings)), f, x, y)


def _means(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """The modulus of biases against the step size with the fitted orders, or means where nothing is known."""
    known = [one for one in with_averages(readings) if np.isfinite(one[1].reference[f])]
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    if not (known and _of_biases(readings)):
        ax.set_yscale("linear")
        for reading, found in with_averages(readings):
            look = _look(reading, looks)
            ax.errorbar(reading.h, found.average[:, f], found.average_half[:, f], elinewidth=0.8, **look)
            if np.isfinite(found.reference[f]):
                ax.axhline(found.reference[f], **KNOWN)
        _dress(ax, readings, f, "step size $h$", "mean")
        return
    _dress(ax, readings, f, "step size $h$", "|mean $-$ reference|")
    bias = {reading.about.variant: (np.abs(one.bias[:, f]), one.bias_stderr[:, f]) for reading, one in known}
    each = [np.maximum(value, stderr) for value, stderr in bias.values()]
    values = np.concatenate(each)
    ax.set_ylim(limits(values[np.isfinite(values) & (values > 0)]))
    for reading, found in known:
        value, stderr = bias[reading.about.variant]
        look, order = _look(reading, looks), found.order[f]
        label = with_order("", order.order, order.low, order.high).lstrip(": ") if np.isfinite(order.order) else None
        zero = ~(value > 2 * stderr)
        used = value > 0
        ax.plot(reading.h[used], value[used], color=look["color"], linewidth=0.9, alpha=0.6)
        filled = look | {"linestyle": "none", "markerfacecolor": look["color"]}
        for some, how in ((used & ~zero, {"label": label}), (used & zero, layout.unresolved(look["marker"]))):
            half = np.array([np.minimum(INTERVAL * stderr, 0.999 * value), INTERVAL * stderr])[:, some]
            ax.errorbar(reading.h[some], value[some], half, elinewidth=0.8, **filled | how)
        if np.isfinite(order.order):
            ax.plot(reading.h, abs(found.constant[f]) * reading.h**order.order, color=look["color"], linewidth=0.6)
    if ax.get_legend_handles_labels()[0]:
        legend_under(ax)


def _look(reading: Equilibrium, looks: style.Looks) -> dict[str, Any]:
    marker, colour = looks[reading.about.variant]
    return {"color": colour, "marker": marker, "markersize": 5, "markerfacecolor": "none", "linewidth": 1.0}


def _histogram(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """Densities at the largest step size that keeps all paths, without empty cells at both ends, and the exact one."""
    known = False
    for reading, found in with_averages(readings):
        i, colour = _shown(reading, "histogram"), looks[reading.about.variant][1]
        if i is None:
            continue
        cells, exact = (found.cell_low[i, f], found.cell_width[i, f]), found.density_exact[i, f]
        shown = histogram(ax, cells, found.density[i, f], found.density_stderr[i, f], colour, exact)
        if not known and np.isfinite(exact).any():
            known = True
            ax.stairs(*shown, **KNOWN)
    ax.set_ylim(bottom=0)
    _dress(ax, readings, f, None, "density")


def _autocorrelation(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """Autocorrelations at the smallest step size that keeps all paths, with 95 % intervals."""
    ax.axhline(0, color="black", linewidth=0.6)
    last = 1.0
    for reading, found in with_averages(readings):
        i, look = _shown(reading, "autocorrelation"), _look(reading, looks)
        if i is None:
            continue
        value, half = found.correlation[i, f], INTERVAL * np.nan_to_num(found.correlation_stderr[i, f])
        above = np.flatnonzero(np.abs(value) > np.maximum(_ENDS, half))
        end = min(len(value), 2 + 3 * (above[-1] + 1) // 2 if len(above) else 2)
        last = max(last * (reading is not readings[0]), float(found.lag[end - 1]))
        every = max(1, end // _MARKERS)
        ax.plot(found.lag[:end], value[:end], markevery=every, **look | {"markersize": 4})
        ax.fill_between(
            found.lag[:end], (value - half)[:end], (value + half)[:end], color=look["color"], alpha=0.3, lw=0
        )
    ax.set_xlim(0, last)
    _dress(ax, readings, f, "lag $s$", "autocorrelation")


def _response(ax: Axes, readings: Sequence[Equilibrium], f: int, looks: style.Looks) -> None:
    """Heat capacity or susceptibility against the step size."""
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    ax.set_yscale("linear")
    name = ""
    for reading, found in with_averages(readings):
        name, factor = found.response(f)
        half = INTERVAL * abs(factor) * found.variance_stderr[:, f]
        ax.errorbar(reading.h, factor * found.variance[:, f], half, elinewidth=0.8, **_look(reading, looks))
        if np.isfinite(found.reference_variance[f]):
            ax.axhline(factor * found.reference_variance[f], **KNOWN)
    _dress(ax, readings, f, "step size $h$", f"{name}, {'Var$/T^2$' if name == 'heat capacity' else 'Var$/T$'}")


def _acceptance(ax: Axes, readings: Sequence[Equilibrium], looks: style.Looks) -> None:
    """How often noise flows (line) and steps of the drift (dashed) were accepted, against the step size."""
    error_axes(ax, np.concatenate([reading.h for reading in readings]))
    ax.set(yscale="linear", ylabel="share accepted")
    for reading in readings:
        if rates := reading.acceptance:
            look = _look(reading, looks)
            ax.plot(reading.h, rates.noise_accepted, label="noise flows", **look)
            ax.plot(reading.h, rates.drift_accepted, label="steps of the drift", **look | {"linestyle": "--"})
    ax.set_ylim(top=1.01)
    legend_under(ax)
