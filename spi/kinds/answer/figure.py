"""The figure of answers: means and standard deviations of the differences of levels, beside the accuracy."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from spi.drawing import style
from spi.drawing.axes import INTERVAL, case_panels, error_axes, legend_under, limits, rules

from .results import Answer

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def draw(title: str, cases: Sequence[Sequence[Answer]]) -> Figure:
    """The figure of answers: a panel per case."""
    facts = [style.facts(readings[0], "accuracy") for readings in cases]
    fig, axes = case_panels(title, cases, facts, max(2 * len(case[0].functions) + 1 for case in cases))
    for (ax,), readings in zip(axes, cases, strict=True):
        (_levels if readings[0].chosen else _values)(ax, readings[0])
        legend_under(ax)
    return fig


def _levels(ax: Axes, one: Answer) -> None:
    """The moduli of the means with their intervals, and standard deviations, against the smaller step."""
    levels = one.chosen.levels if one.chosen else None
    if levels is None:
        return
    error_axes(ax, levels.h)
    mean, deviation = np.abs(levels.mean), np.sqrt(levels.variance)
    for f, name in enumerate(one.functions):
        look: dict[str, Any] = {"color": _COLOURS[f % len(_COLOURS)], "markerfacecolor": "none"}
        told, bars = style.plain(name), INTERVAL * levels.stderr[f]
        ax.errorbar(levels.h, mean[f], bars, marker="o", elinewidth=0.7, label=f"{told}: mean difference", **look)
        ax.plot(levels.h, deviation[f], ":", marker="s", label=f"{told}: standard deviation", **look)
    ax.axhline(one.aim, color="#777777", linewidth=1, linestyle="--", label="accuracy")
    drawn = np.concatenate([mean.ravel(), deviation.ravel(), [one.aim]])
    if (drawn > 0).any():
        ax.set_ylim(limits(drawn[np.isfinite(drawn) & (drawn > 0)]))
    ax.set_ylabel("difference of neighbouring steps")


def _values(ax: Axes, one: Answer) -> None:
    """The values with their intervals, where nothing was sampled."""
    place = np.arange(len(one.functions))
    ax.errorbar(place, one.value, one.half, marker="o", linestyle="none", capsize=3, color=_COLOURS[0], label="value")
    ax.set_xticks(place, [style.plain(name) for name in one.functions])
    ax.set_xlim(-0.5, len(place) - 0.5)
    ax.set_ylabel(r"$\mathrm{E}\,\phi(y(T))$")
    rules(ax)
