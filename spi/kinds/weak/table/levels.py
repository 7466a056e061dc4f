"""Tables of the levels of multilevel estimates (Giles, Operations Research 56, 2008)."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from spi.printing.text import INTERVAL, lost_paths, new_table, power_of_two, short, with_interval

from ..reading import Levels

if TYPE_CHECKING:
    from rich.table import Table

KURTOSIS = 100.0  #: beyond that few samples carry the variance, whose estimate is then poor
CONSISTENCY = 1.0  #: beyond that means of neighbouring levels disagree, but for 0.3 % of the time


def level_table(levels: Levels, f: int, title: str) -> "Table":
    """The levels of one test function, from large to small steps."""
    from rich.text import Text

    lost = bool(levels.nonfinite.any())
    headings = ["steps", "mean of the\ndifference (95 %)", "variance", "kurtosis", "consis-\ntency"]
    headings += ["samples", "µs per\nsample", *["non-\nfinite"] * lost]
    table = new_table(f"{title}: levels", headings, left=1)
    for i in levels.h.argsort()[::-1]:
        variance, kurtosis, consistency = (
            float(values[f, i]) for values in (levels.variance, levels.kurtosis, levels.consistency)
        )
        samples = int(levels.samples[i])
        half = INTERVAL * math.sqrt(variance / samples) if variance > 0 and samples else 0.0
        table.add_row(
            f"{power_of_two(levels.h[i])}, {power_of_two(levels.h[i] / 2)}",
            with_interval(float(levels.mean[f, i]), half),
            short(variance, ".2e"),
            Text(f"{kurtosis:.3g}", style="bold red" if kurtosis > KURTOSIS else ""),
            Text(f"{consistency:.2f}", style="bold red" if consistency > CONSISTENCY else ""),
            short(float(samples), ".2e") if samples >= 1e6 else str(samples),
            f"{1e6 * levels.seconds[i]:.3g}",
            *[lost_paths(levels.nonfinite[i])] * lost,
        )
    return table


def level_warnings(levels: Levels, f: int) -> Iterator[str]:
    """The rates by which mean, variance and cost of the levels change, and what speaks against them."""
    rates = {"mean": levels.mean_rate, "variance": levels.variance_rate}
    told = [f"{what} {_rate(*values[f].tolist())}" for what, values in rates.items() if values is not None]
    if math.isfinite(levels.cost_rate):
        told.append(f"cost h^-{levels.cost_rate:.2f}")
    if told:
        yield f"levels: {', '.join(told)}{'; with reversed twins' if levels.twins else ''}"
    for h, kurtosis, consistency in zip(levels.h, levels.kurtosis[f], levels.consistency[f], strict=True):
        if kurtosis > KURTOSIS:
            yield f"kurtosis {kurtosis:.3g} at {power_of_two(h)}: the variance estimate is poor"
        if consistency > CONSISTENCY:
            yield f"consistency {consistency:.2f} at {power_of_two(h)}: the means of neighbouring levels disagree"


def _rate(rate: float, low: float, high: float) -> str:
    return f"h^{rate:.2f} [{low:.2f}, {high:.2f}]" if math.isfinite(rate) else "not resolved"
