"""Tables of quantities over a swept parameter, a line for each value, and the main quantities in one line."""

import math
from collections.abc import Iterator, Sequence
from itertools import compress
from typing import Any

import numpy as np

from ..statistics.claims import Quantity
from ..statistics.crossings import Crossing
from ..statistics.curves import Curve
from .tables import StyledText, TextTable
from .text import fraction, interval_text, power_of_two, short, with_interval


def tables(title: str, curves: Sequence[Curve]) -> Iterator[TextTable | StyledText]:
    """Tables of a case that is swept: for each scheme, estimator and test function a line per value.

    Quantities of other test functions have a table of their own.
    """
    if curves and curves[0].second_word:
        for curve in curves:
            yield _map(title, curve)
            if (fit := curve.chi_squared) is not None:
                whose = "the orders of theory as h -> 0" if curve.claim.is_order else "expected values"
                yield StyledText(f"chi squared {fit[0]:.1f} of {fit[1]} differences from {whose}")
        return
    by_functions: dict[tuple[str, ...], list[Curve]] = {}
    for name in dict.fromkeys(curve.name for curve in curves):
        members = [curve for curve in curves if curve.name == name]
        by_functions.setdefault(tuple(dict.fromkeys(curve.function for curve in members)), []).extend(members)
    for members in by_functions.values():
        yield _table(title, members)


def _table(title: str, curves: Sequence[Curve]) -> TextTable:
    names = {curve.name: curve.label for curve in curves}
    several = [any(curve.about.estimator for curve in curves), any(curve.function for curve in curves)]
    labels = ["scheme", *compress(("estimator", "function"), several)]
    headings = [f"{label}{_at(curves, name)}\n(95 %)" for name, label in names.items()]
    sections = []
    for owner in dict.fromkeys(map(_owner, curves)):
        members = [curve for curve in curves if _owner(curve) == owner]
        about, function = members[0].about, members[0].function
        cells = {
            (point.at, curve.name): StyledText(quantity_text(point)) for curve in members for point in curve.points
        }
        texts = [about.label, *compress((about.estimator, function), several)]
        rows: list[list[StyledText]] = []
        for at in dict.fromkeys(at for at, _ in cells if at):
            numbers = [cells.get((at, name), StyledText("")) for name in names]
            rows.append([*(StyledText(text * (not rows)) for text in texts), StyledText(f"{at[1]:g}"), *numbers])
        sections.append(rows)
    return TextTable(title, [*labels, curves[0].word, *headings], sections, len(labels), 1 + len(labels))


def _map(title: str, curve: Curve) -> TextTable:
    """Over two parameters a line for each value of the first: the least and the largest number, and the zeros."""
    grid = curve.grid()
    first, second = grid.words
    values, zeros = grid.of("value"), grid.zeros()
    headings = [first, "least", f"at {second}", "largest", f"at {second}", *[f"zero at {second} (95 %)"] * bool(zeros)]
    rows = []
    for i, value in enumerate(grid.axes[0].tolist()):
        finite = np.flatnonzero(np.isfinite(values[i]))
        ends = [finite[pick(values[i, finite])] for pick in (np.argmin, np.argmax)] if finite.size else []
        texts = [text for j in ends for text in (short(float(values[i, j])), f"{grid.axes[1][j]:g}")] or [""] * 4
        texts += [", ".join(with_interval(zero, half) for at, zero, half in zeros if at == value)] * bool(zeros)
        rows.append([StyledText(f"{value:g}"), *map(StyledText, texts)])
    subject = curve.about.subject(curve.function, with_estimator=False)
    name = subject if curve.claim.is_named else f"{curve.label}, {subject}"
    return TextTable(": ".join(filter(None, (title, name))), headings, [rows], 0)


def _owner(curve: Curve) -> tuple[str, str, str]:
    return curve.about.variant, curve.about.estimator, curve.function


def _at(curves: Sequence[Curve], name: str) -> str:
    """At which step size a quantity is."""
    steps = {point.h for curve in curves if curve.name == name for point in curve.points}
    if steps == {None}:
        return ""
    return f" at\nh = {power_of_two(h)}" if len(steps) == 1 and (h := steps.pop()) else " at the\nsmallest h"


def quantity_text(point: Quantity) -> str:
    """A quantity with its interval."""
    if math.isnan(point.value):
        return point.lost or "not resolved"
    ends = None if point.low == point.high else (point.low, point.high)
    form = ".3g" if ends is None else point.claim.ends or ".3f"
    return interval_text(point.value, ends, form, bool(point.claim.ends))


def headline(curves: Sequence[Curve]) -> str:
    """``Order: 0.504 [0.489, 0.520] with splitting; ... Error at h = 2^-9: ...``, of the first test function."""
    parts = []
    resolved = [curve for curve in curves if curve.is_known or not curve.claim.is_fit]
    for name in dict.fromkeys(curve.name for curve in resolved):
        first, *_ = of_name = [curve for curve in resolved if curve.name == name]
        text = f"{first.label[0].upper()}{first.label[1:]}" + (f" of {first.function}" if first.function else "")
        text = first.function if first.claim.is_named else text
        members = "; ".join(_ends(curve) for curve in of_name if curve.function == first.function)
        parts.append(f"{text}{_at(curves, name)}: {members}.".replace("\n", " "))
    return " ".join(parts)


def _ends(curve: Curve) -> str:
    """The first and the last value of a curve, with those of the parameter, or the only one."""
    ends = [curve.points[0], *curve.points[1:][-1:]]
    places = [", ".join(f"{word} = {x:g}" for word, x in one.swept_places.items()) for one in ends]
    values = [
        f"{quantity_text(one)} at {place}" if place else quantity_text(one)
        for one, place in zip(ends, places, strict=True)
    ]
    zeros = "".join(
        f", zero at {curve.word} = {with_interval(*zero)} on a line between values" for zero in curve.zeros()
    )
    stated = curve.claim.is_order and math.isfinite(ends[0].expected)
    theory = f" (theory {fraction(ends[0].expected)})" if stated else ""
    whose = ", ".join(filter(None, (curve.about.label, curve.about.estimator)))
    return f"{' to '.join(values)}{theory}{zeros} with {whose}"


def crossing_rows(crossings: Sequence[Crossing]) -> list[dict[str, Any]]:
    """A row for each crossing: the parameter and the quantity there, with their 95 % intervals."""
    rows = []
    for one in crossings:
        (first, curve), (second, _) = one.first, one.second
        about = {"scheme": curve.about.scheme, "estimator": curve.about.estimator or None}
        head = {"quantity": curve.function or curve.name, "first": first, "second": second, **about}
        for place in one.places:
            numbers = {curve.word: (place.at, place.at_half), "value": (place.value, place.value_half)}
            row: dict[str, Any] = {name: it for name, it in head.items() if it is not None}
            for name, (value, half) in numbers.items():
                row |= {name: value, f"{name}_low": value - half, f"{name}_high": value + half}
            rows.append(row)
    return rows


def crossing_lines(crossings: Sequence[Crossing]) -> list[str]:
    """Sentences on where curves cross, ``binder of a and b cross at T = 1.44 ± 0.01, where it is 0.62 ± 0.01``."""
    lines = []
    for one in crossings:
        (first, curve), (second, _) = one.first, one.second
        whose = ", ".join(filter(None, (curve.about.label, curve.about.estimator)))
        subject = f"{curve.function or curve.label} of {first} and {second}"
        for place in one.places:
            at = f"{curve.word} = {with_interval(place.at, place.at_half)}"
            value = with_interval(place.value, place.value_half)
            lines.append(f"{subject}: crossing at {at}, where it is {value}, with {whose}")
        if not one.places:
            lines.append(f"{subject}: no crossing is certain to 95 %, with {whose}")
    return lines
