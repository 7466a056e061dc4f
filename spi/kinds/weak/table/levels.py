"""Tables of the levels of multilevel estimates (Giles, Operations Research 56, 2008), and of their differences."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from spi.printing.sentences import joined
from spi.printing.text import INTERVAL, lost_paths, new_table, power_of_two, short, with_interval
from spi.storage.records import HEAVY_TAILS, Order

from ..results import Differences, Levels

if TYPE_CHECKING:
    from rich.table import Table

CONSISTENCY = 1.0  #: beyond that means of neighbouring levels disagree, but for 0.3 % of the time


def level_table(levels: Levels, f: int, title: str) -> "Table":
    """The levels of one test function, from large to small steps."""
    order = levels.h.argsort()[::-1]
    names = [f"{power_of_two(levels.h[i])}, {power_of_two(levels.h[i] / 2)}" for i in order]
    return _table(f"{title}: levels", "steps", names, levels, f, order)


def difference_table(differences: Differences, h: np.ndarray, f: int, title: str) -> "Table":
    """The differences of one test function to the scheme of weak order 2, at the step sizes h from large to small."""
    halves = np.zeros(len(h), bool) if differences.symmetrised is None else differences.symmetrised
    names = [power_of_two(step) + ", in halves" * bool(half) for step, half in zip(h, halves, strict=True)]
    return _table(f"{title}: differences to {differences.scheme}", "h", names, differences, f, np.arange(len(h)))


def _table(
    title: str, heading: str, names: Sequence[str], rows: Levels | Differences, f: int, order: np.ndarray
) -> "Table":
    """A line for each of the rows in this order, with its name under `heading`."""
    from rich.text import Text

    lost = bool(rows.nonfinite.any())
    headings = [heading, "mean of the\ndifference (95 %)", "variance", "kurtosis", "consis-\ntency"]
    headings += ["samples", "µs per\nsample", *["di-\nverged"] * lost]
    table = new_table(title, headings, left=1)
    for name, i in zip(names, order, strict=True):
        variance, kurtosis, consistency = (
            float(values[f, i]) for values in (rows.variance, rows.kurtosis, rows.consistency)
        )
        samples = int(rows.samples[i])
        half = INTERVAL * math.sqrt(variance / samples) if variance > 0 and samples else 0.0
        table.add_row(
            name,
            with_interval(float(rows.mean[f, i]), half),
            short(variance, ".2e"),
            Text(f"{kurtosis:.3g}", style="bold red" if kurtosis > HEAVY_TAILS else ""),
            Text(f"{consistency:.2f}", style="bold red" if consistency > CONSISTENCY else ""),
            short(float(samples), ".2e") if samples >= 1e6 else str(samples),
            f"{1e6 * rows.seconds[i]:.3g}",
            *[lost_paths(rows.nonfinite[i])] * lost,
        )
    return table


def level_warnings(levels: Levels, f: int) -> Iterator[str]:
    """The rates by which mean, variance and cost of the levels change, and what speaks against them."""
    rates = {"mean": levels.mean_rate, "variance": levels.variance_rate}
    told = [f"{what} {_rate(values[f])}" for what, values in rates.items() if values is not None]
    if math.isfinite(levels.cost_rate):
        told.append(f"cost h^{-levels.cost_rate:z.2f}")
    if told:
        yield f"levels: {', '.join(told)}{'; with antithetic paths' if levels.antithetic else ''}"
    if levels.base_gain is not None:
        worth = short(float(levels.base_gain[f]), ".3g")
        yield f"the largest step alone follows points; as many independent samples have {worth} times the variance"
    yield from _doubts(levels.h, levels, f, "the means of neighbouring levels disagree")


def difference_warnings(differences: Differences, h: np.ndarray, f: int) -> Iterator[str]:
    """The rate by which the variance of the differences at the step sizes h changes, and what speaks against them."""
    yield f"differences to {differences.scheme}: variance {_rate(differences.variance_rate[f])}"
    yield from _doubts(h, differences, f, "the expectation is not that of its levels")


def _doubts(h: np.ndarray, rows: Levels | Differences, f: int, inconsistency: str) -> Iterator[str]:
    heavy = [(k, power_of_two(step)) for step, k in zip(h, rows.kurtosis[f], strict=True) if k > HEAVY_TAILS]
    if heavy:
        each = joined([f"kurtosis {kurtosis:.3g} at {step}" for kurtosis, step in heavy])
        yield f"heavy tails: {each}; few samples carry the variance, so that intervals may be too narrow"
    for step, consistency in zip(h, rows.consistency[f], strict=True):
        if consistency > CONSISTENCY:
            yield f"consistency {consistency:.2f} at {power_of_two(step)}: {inconsistency}"


def _rate(rate: Order) -> str:
    """A fitted power of h with its interval, which is not known where a group of the jackknife has no variance left."""
    known = all(map(math.isfinite, (rate.order, rate.low, rate.high)))
    return f"h^{rate.order:.2f} [{rate.low:.2f}, {rate.high:.2f}]" if known else "not resolved"
