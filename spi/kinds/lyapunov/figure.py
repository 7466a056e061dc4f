"""The figure of Lyapunov exponents: averages until t, with their 95 % intervals."""

from collections.abc import Sequence
from functools import partial

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import INTERVAL, rules

from .results import Exponents

SIZE = (3.4, 2.7)  # inches of a panel


def draw(title: str, cases: Sequence[Sequence[Exponents]]) -> Figure:
    """A panel for each exponent and one for their sum, in a line for each case."""
    looks = style.looks(cases)
    shared, own = style.split_facts([style.facts(readings[0], "samples", "step") for readings in cases])
    lines = []
    for readings, facts in zip(cases, own, strict=True):
        count = len(readings[0].number)
        panels = [partial(_panel, readings=readings, looks=looks, k=k) for k in range(count + (count > 1))]
        case = layout.case_title(readings[0].about, facts, len(panels) * SIZE[0]) if len(cases) > 1 else ""
        lines.append(layout.Line(panels, SIZE, title=case, legend=[_entries(readings, looks)], least=2.4))
    return layout.arranged(title, lines, shared)


def _entries(readings: Sequence[Exponents], looks: style.Looks) -> list[layout.Entry]:
    found: list[layout.Entry] = []
    for one in readings:
        marker, colour = looks[one.about.variant]
        found.append((Line2D([], [], color=colour, marker=marker, markersize=4), style.label(one.about)))
    return found


def _panel(ax: Axes, readings: Sequence[Exponents], looks: style.Looks, k: int) -> None:
    """Exponent k from 0 on, or behind the last their sum."""
    is_sum = k == len(readings[0].number)
    ax.set_title("sum of the exponents" if is_sum else f"exponent {k + 1}")
    ax.set_xlabel("averaged until time $t$")
    ax.set_ylabel("$\\sum_k \\lambda_k$" if is_sum else f"$\\lambda_{{{k + 1}}}$")
    rules(ax)
    for one in readings:
        marker, colour = looks[one.about.variant]
        value = one.total if is_sum else one.exponent[k]
        half = INTERVAL * (one.total_stderr if is_sum else one.exponent_stderr[k])
        ax.fill_between(one.t, value - half, value + half, color=colour, alpha=0.2, linewidth=0)
        ax.plot(one.t, value, color=colour, marker=marker, markersize=4)
