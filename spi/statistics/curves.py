"""Curves of quantities, perhaps over a swept parameter: one for each quantity, scheme, estimator and function."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..storage.records import INTERVAL
from ..storage.stored import AT_MOST, Claimed, Description
from .claims import Quantity, in_print


class Surface(NamedTuple):
    """A quantity over the values of two parameters."""

    words: tuple[str, str]
    axes: tuple[np.ndarray, np.ndarray]  #: the values, in ascending order
    points: dict[tuple[float, float], Quantity]

    def of(self, field: str) -> np.ndarray:
        """(V, W) a field of the quantities; NaN where there is none."""
        values = np.full((len(self.axes[0]), len(self.axes[1])), np.nan)
        for i, value in enumerate(self.axes[0].tolist()):
            for j, second in enumerate(self.axes[1].tolist()):
                if (value, second) in self.points:
                    values[i, j] = getattr(self.points[value, second], field)
        return values

    def zeros(self) -> list[tuple[float, float, float]]:
        """(value, zero of the quantity along the second parameter, half the width of its 95 % interval), for each zero.

        A zero lies between two points whose signs differ and are certain to 95 %, with none such between them; it is
        that of the line of least squares through these and all points between them.
        """
        fields = [self.of(field) for field in ("value", "low", "high")]
        return [
            (value, *zero)
            for i, value in enumerate(self.axes[0].tolist())
            for zero in _zeros(self.axes[1], *(field[i] for field in fields))
        ]


def _zeros(x: np.ndarray, middle: np.ndarray, low: np.ndarray, high: np.ndarray) -> Iterator[tuple[float, float]]:
    """Zeros of numbers with intervals along ascending x, see :meth:`Surface.zeros`."""
    for a, b in sign_changes(middle, low, high):
        at = slice(a, b + 1)
        yield _zero(x[at], middle[at], (high[at] - low[at]) / 2)


def sign_changes(middle: np.ndarray, low: np.ndarray, high: np.ndarray) -> Iterator[tuple[int, int]]:
    """Places before and after each change of sign: the signs there are certain to 95 %, and none between them is."""
    sure = np.flatnonzero((low > 0) | (high < 0))
    yield from ((a, b) for a, b in pairwise(sure.tolist()) if middle[a] * middle[b] < 0)


def _zero(x: np.ndarray, y: np.ndarray, half: np.ndarray) -> tuple[float, float]:
    """Where the line of least squares through points with errors is zero, and half the width of that interval."""
    weight = 1.0 / np.maximum(half, 1e-12 * np.abs(y).max()) ** 2
    centre = (weight @ x) / weight.sum()
    slope = (weight * (x - centre)) @ y / ((weight * (x - centre)) @ (x - centre))
    level = (weight @ y) / weight.sum()
    where = centre - level / slope
    spread = 1.0 / weight.sum() + (where - centre) ** 2 / (weight @ (x - centre) ** 2)
    return float(where), float(np.sqrt(spread) / abs(slope))


class Curve(NamedTuple):
    """A quantity over the values of a parameter, or of two, with its 95 % intervals; one point if none is swept."""

    name: str  #: of the quantity
    function: str  #: the test function that it belongs to, or ""
    about: Description  #: that of the first value; without eps, unless the scheme has several
    points: tuple[Quantity, ...]  #: one for each value, in their order

    @property
    def word(self) -> str:
        """Parameter."""
        return self.points[0].at[0] if self.points[0].at else ""

    @property
    def label(self) -> str:
        """Name of the quantity in print."""
        return self.claim.title or in_print(self.name)

    @property
    def claim(self) -> Claimed:
        """What may be claimed of the quantity, and how it is written and drawn."""
        return self.points[0].claim

    @property
    def values(self) -> np.ndarray:
        """(V,) the values of the parameter."""
        return np.array([point.at[1] for point in self.points if point.at])

    @property
    def second_word(self) -> str:
        """The other parameter; empty if there is none."""
        return self.about.swept.second_word if self.about.swept and not self.points[0].swept else ""

    def grid(self) -> Surface:
        """Quantity over both parameters, where there are two."""
        points = {
            (point.about.swept.value, point.about.swept.second_value): point
            for point in self.points
            if point.about.swept
        }
        first, second = (np.unique(each) for each in zip(*points, strict=True))
        return Surface((self.word, self.second_word), (first, second), points)

    def lines(self) -> list[tuple[float, "Curve"]]:
        """Each value of the second of two parameters, in ascending order, with the curve over the first one there."""
        by_value: dict[float, list[Quantity]] = {}
        for point in self.points:
            if point.about.swept:
                by_value.setdefault(point.about.swept.second_value, []).append(point)
        lines = []
        for value, points in sorted(by_value.items()):
            swept = points[0].about.swept and replace(points[0].about.swept, second_word="", second_value=math.nan)
            lines.append((value, self._replace(points=tuple(points), about=replace(points[0].about, swept=swept))))
        return lines

    def zeros(self) -> list[tuple[float, float]]:
        """Zeros over the only parameter, each with half the width of its 95 % interval; see :meth:`Surface.zeros`."""
        if self.second_word or len(self.values) < 2:
            return []
        order = np.argsort(self.values)
        return list(_zeros(self.values[order], *(self.of(field)[order] for field in ("value", "low", "high"))))

    @property
    def chi_squared(self) -> tuple[float, int] | None:
        """Sum of the squared differences from expected values, in standard errors, and their number; None if 0."""
        with np.errstate(invalid="ignore", divide="ignore"):
            away = INTERVAL * (self.of("value") - self.of("expected")) / ((self.of("high") - self.of("low")) / 2)
        away = away[np.isfinite(away)]
        return (float((away**2).sum()), len(away)) if away.size else None

    @property
    def is_known(self) -> bool:
        """Whether any of its values is a number."""
        return not np.isnan(self.of("value")).all()

    @property
    def h(self) -> float | None:
        """Step size of all points; None if they have none, or different ones."""
        steps = {point.h for point in self.points}
        return steps.pop() if len(steps) == 1 else None

    @property
    def poor(self) -> np.ndarray:
        """(V,) whether the interval is too wide to say anything, or, of errors, has no positive lower end."""
        with np.errstate(invalid="ignore"):  # of paths that diverged
            half = (self.of("high") - self.of("low")) / 2
        below = (self.of("low") <= 0) & (self.of("low") < self.of("value")) & (self.claim.sense == AT_MOST)
        return ~(half <= self.claim.widest) | below

    def of(self, field: str) -> np.ndarray:
        """(V,) a field of the quantities: ``value``, ``low``, ``high`` or ``expected``."""
        return np.array([getattr(point, field) for point in self.points])


def curves(quantities: Iterable[Quantity], names: Sequence[str]) -> list[Curve]:
    """Curves of the quantities of these names, in this order.

    Of a quantity at several step sizes that at the smallest counts, and of several Casimir functions the largest.
    """
    wanted = [quantity for quantity in quantities if quantity.name in names]
    several = _several_eps(wanted)
    by_curve: dict[tuple, dict[tuple, Quantity]] = {}
    for quantity in wanted:
        about = quantity.about
        place = several.get((about.case, about.scheme), {}).get(about.eps)
        key = (quantity.name, quantity.function, about.scheme, place, about.extrapolate, about.estimator)
        points, at = by_curve.setdefault(key, {}), (about.case, quantity.swept)
        if at not in points or _before(quantity, points[at]):
            points[at] = quantity
    listed = []
    for (name, function, _, place, *_), points in by_curve.items():
        first = next(iter(points.values())).about
        if place is None and first.eps is not None:
            first = replace(first, eps=None, variant=first.variant.replace(f"_eps_{first.eps:g}", ""))
        listed.append(Curve(name, function, first, tuple(points.values())))
    return sorted(listed, key=lambda curve: names.index(curve.name))


def _several_eps(quantities: Iterable[Quantity]) -> dict[tuple[str, str], dict[float | None, int]]:
    """(case, scheme) -> the eps that the scheme has there, each with its number, where there are several."""
    numbers: dict[tuple[str, str], dict[float | None, int]] = {}
    for quantity in quantities:
        of_scheme = numbers.setdefault((quantity.about.case, quantity.about.scheme), {})
        of_scheme.setdefault(quantity.about.eps, len(of_scheme))
    return {key: of_scheme for key, of_scheme in numbers.items() if len(of_scheme) > 1}


def _before(one: Quantity, other: Quantity) -> bool:
    """Whether a quantity stands for the place of the two: at a smaller step size, or larger at the same."""
    if one.h != other.h:
        return (one.h or 0.0) < (other.h or 0.0)
    return abs(one.value) > abs(other.value)
