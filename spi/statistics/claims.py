"""Claims: what a spec says must come out, and whether it did.  Nothing here computes, reads files or knows a kind.

A spec states claims under its key ``expect``; the module ``results`` of a kind of experiment says which quantities came
out; :func:`judge` compares the two.  A quantity is judged with its 95 % interval.  With [a, b] the numbers that the
claim allows, the claim is

    confirmed      if the interval lies in [a, b],
    consistent     if it meets [a, b], but does not lie in it,
    contradicted   if not even the interval of twice that width meets [a, b],
    inconclusive   otherwise, and if the interval is too wide to say anything or the number is not resolved.

No claim is confirmed, nor consistent, about what is not finite, be it in part, or of which paths diverged: it is
contradicted by what is finite, or inconclusive.  Only how many paths diverged is a number all the same.

An interval misses the truth once in 20 times, twice the interval once in 10,000: a true claim is hardly ever
contradicted.
"""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..storage.records import Order
from ..storage.stored import (
    AT_LEAST,
    AT_MOST,
    CLAIMED_ORDER,
    EQUAL,
    Claimed,
    Description,
    Entry,
    Estimate,
    Stored,
    last,
)
from .rounding import all_exact

CONFIRMED, CONSISTENT, INCONCLUSIVE, CONTRADICTED = "confirmed", "consistent", "inconclusive", "contradicted"
VERDICTS = (CONFIRMED, CONSISTENT, INCONCLUSIVE, CONTRADICTED)  #: from good to bad

_ROUNDING = 1e-12  # relative: step sizes written as decimals are not exact


def claimable(record: type[Stored]) -> dict[str, Claimed]:
    """Quantities that specs may expect of a record, by name, orders and what is claimed to be equal first."""
    found = [(entry, claim) for entry in record.entries for claim in entry.meaning.claims]
    found.sort(key=lambda pair: (math.isinf(pair[1].widest), pair[1].sense != EQUAL))
    return {claim.name or entry.name: claim._replace(per_step="h" in entry.axes) for entry, claim in found}


def in_print(name: str) -> str:
    """A quantity without a title as it is called in print: ``Casimir drift``."""
    return name.replace("_", " ").replace("casimir", "Casimir")


class Claim(NamedTuple):
    """One number that a spec expects."""

    case: str
    scheme: str
    quantity: str
    sense: str  #: EQUAL, AT_MOST or AT_LEAST
    number: float
    tolerance: float  #: to both sides of the number; 0 but for EQUAL
    stated: str  #: the number, its tolerance and the limits as they stand in the spec
    scopes: tuple[str, ...] = ()  #: the estimator, test function and extrapolation of which it is claimed; () for all
    limits: tuple[tuple[str, float], ...] = ()  #: up to which h, eps or swept value it is claimed; () for all

    @property
    def text(self) -> str:
        """``order 1/2`` or ``Casimir drift at most 1e-12``."""
        sense = "" if self.sense == EQUAL else f"{self.sense} "
        return f"{in_print(self.quantity)} {sense}{self.stated}"

    @property
    def allowed(self) -> tuple[float, float]:
        """[a, b], the numbers that it allows."""
        low = -math.inf if self.sense == AT_MOST else self.number - self.tolerance
        high = math.inf if self.sense == AT_LEAST else self.number + self.tolerance
        return low, high

    def covers(self, quantity: "Quantity") -> bool:
        """Whether the claim is about this quantity."""
        about = quantity.about
        same = (about.owner, about.scheme, quantity.name) == (self.case, self.scheme, self.quantity)
        small = (quantity.places.get(name, math.inf) <= limit + _ROUNDING * abs(limit) for name, limit in self.limits)
        scopes = {about.estimator, quantity.function, f"extrapolate {about.extrapolate}"}
        return same and all(small) and scopes.issuperset(self.scopes)


class Quantity(NamedTuple):
    """One number that came out, with its 95 % interval, [value, value] if it is exact; NaN where there is none."""

    name: str
    about: Description
    value: float
    low: float
    high: float
    function: str = ""  #: the test function it belongs to
    h: float | None = None  #: the step size it belongs to
    swept: tuple[str, float] | None = None  #: the swept parameter and the value it belongs to
    claim: Claimed = Claimed(EQUAL)  #: what may be claimed of it, and how it is written and drawn
    expected: float = math.nan  #: what theory, a reference or a solver without sampling says; NaN where none does
    lost: str = ""  #: what of it is not finite, which paths diverged, or why it is none: no claim about it is confirmed

    @property
    def at(self) -> tuple[str, float] | None:
        """The first swept parameter and the value it belongs to, within a result or because its case has it."""
        return next(iter(self.swept_places.items()), None)

    @property
    def swept_places(self) -> dict[str, float]:
        """Swept parameters with the values it belongs to."""
        if self.swept is not None:
            return dict([self.swept])
        return self.about.swept.places if self.about.swept else {}

    @property
    def places(self) -> dict[str, float]:
        """Step size, eps and the swept values that it belongs to, by name, where it has them."""
        by_name = {"h": self.h, "eps": self.about.eps, **self.swept_places}
        return {name: value for name, value in by_name.items() if value is not None}

    @property
    def subject(self) -> str:
        """Scheme, its eps, the estimator and the test function that it belongs to, as text."""
        return self.about.subject(self.function)


class Verdict(NamedTuple):
    """Verdict on a claim for one scheme, at one eps, with one estimator and test function."""

    claim: Claim
    found: Quantity | None  #: the worst of all step sizes; None if nothing came out that the claim speaks of
    verdict: str  #: one of VERDICTS

    @property
    def subject(self) -> str:
        """Scheme, estimator and test function whose quantity is judged, as text."""
        return self.found.subject if self.found else ", ".join((self.claim.scheme, *self.claim.scopes))

    @property
    def text(self) -> str:
        """The claim, with the quantity as it is called in print."""
        title = self.found.claim.title if self.found else ""
        return self.claim._replace(quantity=title or self.claim.quantity).text


# ---------------------------------------------------------------------------------------------------------------------
# Quantities that came out
# ---------------------------------------------------------------------------------------------------------------------


def quantity(
    name: str,
    about: Description,
    value: float,
    half: float = 0.0,
    function: str = "",
    h: float | None = None,
    expected: float = math.nan,
    lost: str = "",
    claim: Claimed = Claimed(EQUAL),  # noqa: B008
) -> Quantity:
    """A quantity with half the width of its interval, which is 0 for an infinite value: that is certain."""
    value, half = float(value), 0.0 if math.isinf(value) else float(half)
    ends = value - half, value + half
    return Quantity(name, about, value, *ends, function, h, claim=claim, expected=float(expected), lost=lost)


def lost_among(values: np.ndarray, plural: str) -> str:
    """``not finite: 3 of 5 times`` of values of which 3 are not, where `plural` is "times"; "" if all are finite."""
    lost = np.count_nonzero(~np.isfinite(values))
    return f"not finite: {lost} of {np.size(values)} {plural}" if lost else ""


def order(
    about: Description,
    fitted: Order,
    claim: Claimed = CLAIMED_ORDER,
    function: str = "",
    expected: float | None = None,
) -> Quantity:
    """A fitted order of convergence, which may be claimed, with the order `expected` by theory."""
    name, theory = claim.name or "order", math.nan if expected is None else expected
    return Quantity(name, about, fitted.order, fitted.low, fitted.high, function, claim=claim, expected=theory)


def lost_is_infinite(values: np.ndarray) -> np.ndarray:
    """Values with infinity for NaN, where NaN means that a path diverged."""
    return np.where(np.isnan(values), np.inf, values)


def quantities(readings: Sequence[Stored]) -> Iterator[Quantity]:
    """Quantities of the records of a case that specs may expect, and those that several records have together."""
    for record in readings:
        for entry in record.entries:
            for claim in entry.meaning.claims:
                yield from _claimed(record, entry, claim)
    if readings:
        yield from readings[0].quantities_of_case(readings)


def orders_of(readings: Sequence[Stored]) -> list[Quantity]:
    """Fitted orders of the records of a case, those of the largest errors over eps as well."""
    return [one for one in quantities(readings) if one.claim.is_order]


#: The axes along which a field has quantities of their own, beside those whose values have labels.
_APART = ("h", "value")


def _claimed(record: Stored, entry: Entry, claim: Claimed) -> Iterator[Quantity]:
    """Quantities of a field, one for each of the :func:`_numbers` that is one by ``where``."""
    if (numbers := _numbers(record, entry, claim)) is None:
        return
    labels = _labels(record, numbers.axes)
    sides = ((claim.where, True), (claim.expected, math.nan), (claim.lost, ""))
    where, expected, lost = (record.along(side, numbers, default) for side, default in sides)
    for place in filter(where.__getitem__, np.ndindex(numbers.value.shape)):
        at = {axis: record.get(axis)[i] for axis, i in zip(numbers.axes, place, strict=True) if axis in labels}
        function = ", ".join(labels[axis].format(value) for axis, value in at.items() if labels[axis])
        exact = all_exact(record.get("note") or "", function) if entry.field and entry.field.is_order else ""
        yield Quantity(
            name=claim.name or entry.name,
            about=record.about,
            value=float(numbers.value[place]),
            low=float(numbers.low[place]),
            high=float(numbers.high[place]),
            function=function,
            h=float(at["h"]) if "h" in at else None,
            swept=(record.get("sweep"), float(at["value"])) if "value" in at else None,
            claim=claim,
            expected=float(expected[place]),
            lost=str(lost[place]) or exact,
        )


def _numbers(record: Stored, entry: Entry, claim: Claimed) -> Estimate | None:
    """Numbers of a field that may be claimed: of several times the last, and of exact ones the worst; or None.

    The worst is that along axes that neither stand apart nor have labels.
    """
    numbers = record.estimate(entry.name)
    if numbers is None or not numbers.value.size:
        return None
    if claim.infinite:
        numbers = numbers.map(lost_is_infinite)
    if claim.absolute:
        numbers = numbers.absolute
    for axis in {"t", "lag"} & {*numbers.axes}:
        numbers = numbers.without(axis, last)
    if not numbers.exact or claim.sense == EQUAL:
        return numbers
    labels = _labels(record, numbers.axes)
    for axis in numbers.axes:
        if axis not in _APART and not labels.get(axis):
            numbers = numbers.without(axis, np.max if claim.sense == AT_MOST else np.min)
    return numbers


def _labels(record: Stored, axes: Iterable[str]) -> dict[str, str]:
    """Template that names a quantity at a place, by axis; empty where it has none."""
    return {axis: record.by_name[axis].meaning.label for axis in axes if axis in record.by_name}


# ---------------------------------------------------------------------------------------------------------------------
# The verdicts
# ---------------------------------------------------------------------------------------------------------------------


def judge(claims: Iterable[Claim], quantities: Iterable[Quantity]) -> list[Verdict]:
    """Verdicts on the claims, in their order, one for each scheme, eps, estimator and function that it is about.

    Of the step sizes that a claim covers the worst one counts.  A claim without a result is inconclusive.
    """
    quantities, verdicts = _with_diverged(list(quantities)), []
    for claim in claims:
        covered: dict[str, list[Quantity]] = {}
        for quantity in filter(claim.covers, quantities):
            covered.setdefault(quantity.subject, []).append(quantity)
        verdicts += [_worst(claim, members) for members in covered.values()] or [Verdict(claim, None, INCONCLUSIVE)]
    return verdicts


def _with_diverged(quantities: Sequence[Quantity]) -> list[Quantity]:
    """Quantities, with ``lost`` set where the paths that they are estimated from diverged.

    A quantity that belongs to no step size is estimated from the paths at all of them.
    """
    diverged: dict[tuple[Any, ...], str] = {}
    for q in quantities:
        if q.claim.counts_paths and q.value != q.claim.none_diverged:
            share = q.claim.none_diverged - q.value
            count = f"{share:.3g} of the paths" if share > 0 else f"{q.value:g}"
            reason = f"{count} diverged"
            diverged[_paths(q)] = reason
            diverged.setdefault(_paths(q._replace(h=None)), reason if q.h is None else f"{reason} at h = {q.h:g}")
    return [q if q.claim.counts_paths else q._replace(lost=q.lost or diverged.get(_paths(q), "")) for q in quantities]


def _paths(quantity: Quantity) -> tuple[Any, ...]:
    """Paths that a quantity is estimated from: case, variant, estimator, swept value, step size."""
    return quantity.about.case, quantity.about.variant, quantity.about.estimator, quantity.swept, quantity.h


def _worst(claim: Claim, members: Sequence[Quantity]) -> Verdict:
    """Verdict on the quantity that does worst."""

    def badness(q: Quantity) -> tuple[int, float]:
        a, b = claim.allowed
        beyond = abs(q.value - claim.number) if claim.sense == EQUAL else max(a - q.low, q.high - b)
        return VERDICTS.index(_verdict(claim, q)), math.inf if math.isnan(beyond) else beyond

    worst = max(members, key=badness)
    return Verdict(claim, worst, _verdict(claim, worst))


def _verdict(claim: Claim, q: Quantity) -> str:
    a, b = claim.allowed
    down, up = (0.0 if end == q.value else abs(q.value - end) for end in (q.low, q.high))
    if any(map(math.isnan, (q.value, down, up))) or (down + up) / 2 > q.claim.widest:
        return INCONCLUSIVE
    if q.low <= b and q.high >= a:
        if q.lost or not all(map(math.isfinite, (q.value, q.low, q.high))):
            return INCONCLUSIVE
        return CONFIRMED if a <= q.low and q.high <= b else CONSISTENT
    return INCONCLUSIVE if q.value - 2 * down <= b and q.value + 2 * up >= a else CONTRADICTED


# ---------------------------------------------------------------------------------------------------------------------
# As text
# ---------------------------------------------------------------------------------------------------------------------


def as_text(claims: Iterable[Claim]) -> str | None:
    """Claims as JSON, to be stored; None if there are none."""
    plain = [claim._asdict() for claim in claims]
    return json.dumps(plain, ensure_ascii=False, allow_nan=False) if plain else None


def of_text(text: str | None) -> list[Claim]:
    """Claims in a text of :func:`as_text`; ValueError if it is none."""
    try:
        plain = json.loads(text) if text is not None else []
        lists = [{"scopes": tuple(entry["scopes"]), "limits": tuple(map(tuple, entry["limits"]))} for entry in plain]
        return [Claim(**(entry | tuples)) for entry, tuples in zip(plain, lists, strict=True)]
    except (TypeError, KeyError, ValueError) as error:
        raise ValueError(f"no list of claims ({error})") from None
