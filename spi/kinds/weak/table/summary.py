"""What is said under a table of weak errors: orders, standard errors, references, agreement."""

import json
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.printing.text import INTERVAL, fraction, order_found, power_of_two, readable, short, with_interval

from ..comparisons import agreement, cannot_do, comparable_sweeps, largest_over_eps, not_reached, own_error
from ..results import Quasi, Sampled, WeakErrors
from .levels import difference_warnings, level_warnings

PAPER = 1e9  #: samples of the paper's weak errors
TOO_FAR = 4.0  #: standard errors
_ORDER_AMISS = 0.5  # by so much an extrapolated order must lie below the one expected


def summaries(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """The lines under the table of a case."""
    for name, formula in zip(readings[0].functions, readings[0].formulas, strict=True):
        yield f"{name} = {readable(formula, readings[0].about.variables)}"
    for reading in readings:
        yield from _summary(reading)
    yield from _over_eps(readings)
    yield from _references(readings)
    yield from _limits_shown(readings)
    for estimator, schemes in dict.fromkeys((reading.about.estimator, reading.left_out) for reading in readings):
        if schemes:
            yield cannot_do(estimator, schemes)


def name_of(reading: WeakErrors, f: int) -> str:
    """What a line is about: scheme, estimator and, if there are several, the test function."""
    names = reading.functions
    return ", ".join([reading.about.label, reading.about.estimator, *[names[f]] * (len(names) > 1)])


def _summary(reading: WeakErrors) -> Iterator[str]:
    """What is to be said about all step sizes of one scheme with one estimator."""
    points, own = len(reading.h), own_error(reading)
    for f, function in enumerate(reading.functions):
        order, low, high, used = reading.orders[f]
        through = f", through {used} of {points} step sizes" if math.isfinite(order) and used < points else ""
        yield f"{name_of(reading, f)}: {order_found(order, low, high, reading.expected_order)}{through}"
        if reading.about.extrapolate and high < (reading.expected_order or -math.inf) - _ORDER_AMISS:
            yield f"    {_not_as_assumed(reading)}"
        if reading.sampled and (told := _accuracy(reading, reading.sampled, f)):
            yield f"    {told}"
        if reading.quasi:
            yield f"    {_points(reading.quasi, f)}"
        if own and own.differ[f]:
            yield f"    {_assumed(reading, float(own.value[f]), float(own.by_next[f]))}"
        if reading.unsampled:
            limit, bound = (values[f].item() for values in (reading.unsampled.limit, reading.unsampled.limit_bound))
            yield f"    E {function}(y(T)) = {with_interval(limit, bound)} (bound)"
        if reading.differences:
            yield from (f"    {line}" for line in difference_warnings(reading.differences, reading.h, f))
        if reading.levels:
            yield from (f"    {line}" for line in level_warnings(reading.levels, f))
    if reading.unsampled and (resolution := _resolution(reading.unsampled.noted)):
        yield f"    {resolution}"
    if poor := not_reached(reading):
        yield f"    {poor}"
    if reading.reference_nonfinite:
        yield f"    {reading.reference_nonfinite} reference paths diverged (NaN or infinity)"


def _accuracy(reading: WeakErrors, sampled: Sampled, f: int) -> str:
    """The standard error at the largest step beside that of so many independent samples as the paper has."""
    largest, seconds = int(reading.h.argmax()), reading.cpu_seconds
    stderr = float(sampled.error_stderr[f, largest])
    if math.isnan(stderr):
        return "one path has no standard error: not resolved" if sampled.samples == 1 else ""
    told = f"standard error {short(stderr)} at {power_of_two(reading.h[largest])}"
    told += f" in {seconds:.3g} s of processor time"
    paper = math.nan if sampled.sd is None else float(sampled.sd[f]) / math.sqrt(PAPER)
    if 0 < paper < math.inf and not reading.quasi:  # whose standard errors fall faster than by the root
        told += f"; 10^9 independent samples would give {short(paper)}"
        if stderr > paper > 0 and math.isfinite(stderr):
            needed = float(f"{seconds * (stderr / paper) ** 2:.2g}")
            told += f", which would take about {short(needed, 'g')} s here"
    return told


def _not_as_assumed(reading: WeakErrors) -> str:
    """That extrapolated errors do not fall as they would if the powers of h removed were those that there are."""
    power = _power(reading.expected_order or math.nan, "h")
    told = f"the order found is not the one assumed: extrapolated errors should fall like {power}"
    return f"{told}; the function may have a jump or a kink, or the steps may be too large; compare extrapolate: 0"


def _points(quasi: Quasi, f: int) -> str:
    """What points there were, and what they were worth."""
    low, high = (short(float(one), ".3g") for one in (quasi.gain[f].min(), quasi.gain[f].max()))
    points = f"{quasi.scrambles} scrambles of {quasi.points} points in {quasi.dimensions} dimensions"
    if not (np.isfinite(quasi.gain[f]) & (quasi.gain[f] > 0)).all():
        return points  # all paths of some step size are alike
    return f"{points}; as many independent paths have {low} to {high} times the variance of the expectation"


def _assumed(reading: WeakErrors, added: float, by_next: float) -> str:
    """That the reference's own error, as it was added, is not what the next step makes it."""
    power = _power(reading.expected_order or math.nan, "h")
    off = f"{short(abs(by_next - added))} {'more' if by_next > added else 'less'}"
    told = f"the reference's own error, {short(added)} by the smallest step, would be {off} by the next"
    return f"{told}: errors are not yet C {power}, and may be off by about that; try a smaller reference_step"


def _power(order: float, base: str) -> str:
    """``h``, ``h^2`` or ``(h_ref/h)^(3/2)``."""
    return base if order == 1 else f"{base}^{fraction(order)}"


def _resolution(notes: dict[str, Any]) -> str:
    """The short ones of the notes of a solver without sampling."""
    short_ones = {key: json.dumps(value) for key, value in notes.items() if not key.startswith("seconds")}
    return ", ".join(f"{key.replace('_', ' ')} {text}" for key, text in short_ones.items() if len(text) <= 12)


def _references(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """How much of the errors the references of a case lack."""
    sampled = [reading for reading in readings if reading.sampled]
    own = ((r.expected_order, "") if not r.differences else (2.0, r.differences.scheme) for r in sampled)
    each = ((r.reference_step, r.h.min(), *of, r.reference_scheme) for r, of in zip(sampled, own, strict=True))
    for reference, finest, order, compared, scheme in dict.fromkeys(each):
        where = f"the reference at h_ref = {power_of_two(reference)}"
        if scheme:
            yield f"{where} is {scheme}: errors are not corrected for what it lacks"
        elif order:
            share = 100 * (reference / finest) ** order
            ratio = "h_ref/h" if order == 1 else _power(order, "(h_ref/h)")
            whose = f"the error of {compared} at the finest step" if compared else "the finest error"
            lacks = f"lacks {ratio} = {share:.2g} % of {whose} (order {fraction(order)})"
            yield f"{where} {lacks}, which is added to all errors"
        else:
            yield f"{where}: errors are not corrected for what it lacks, as theory states no order"


def _over_eps(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """The largest errors over eps of each scheme and estimator with several eps: their order, and what they are."""
    for members in comparable_sweeps(readings).values():
        first, names = members[0], members[0].functions
        for f, name in enumerate(names):
            top = largest_over_eps(members, f)
            told = ", ".join([first.about.scheme_label, first.about.estimator, *[name] * (len(names) > 1)])
            order, low, high, _ = top.order
            yield f"{told}, largest over eps: {order_found(order, low, high, first.expected_order)}"
            points = (
                f"{power_of_two(h)}: {with_interval(value, INTERVAL * stderr)} (eps = {members[i].about.eps:g})"
                for h, value, stderr, i in zip(first.h, top.value, top.stderr, top.which, strict=True)
            )
            yield f"    {', '.join(points)}"


def _limits_shown(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """For which eps a reference does not resolve the fast processes, and what it shows then."""
    told: dict[tuple, set] = {}
    for reading in readings:
        if reading.reference_shows_limit:
            told.setdefault((reading.reference_step, reading.reference_scheme), set()).add(reading.about.eps)
    for (reference, scheme), small in told.items():
        few = ", ".join(f"{eps:g}" for eps in sorted(small, reverse=True))
        whose = f"the limit of {scheme}" if scheme else "the scheme's own limit"
        edge = f"eps < sqrt(h_ref) = {short(math.sqrt(reference), '.2g')}"
        yield f"{edge} (eps = {few}): the reference shows {whose}"


def agreement_line(reading: WeakErrors, readings: Sequence[WeakErrors], f: int) -> Iterator[tuple[str, bool]]:
    """What is to be said about one test function, and whether the errors disagree; nothing if they are not compared."""
    found = agreement(reading, readings)
    if found is None or not any(map(math.isfinite, found.deviation[f])):
        return
    far = [power_of_two(h) for h, value in zip(reading.h, found.deviation[f], strict=True) if abs(value) > TOO_FAR]
    told = f"sampled minus deterministic, in standard errors: {_each(reading.h, found.deviation[f], 'z.1f')}"
    told += f"; standard error / weak error: {_each(reading.h, found.share[f], '.2g')}"
    yield told + f"; DISAGREE at {', '.join(far)}" * bool(far), bool(far)


def _each(h: np.ndarray, values: np.ndarray, form: str) -> str:
    pairs = zip(h, values, strict=True)
    return ", ".join(
        f"{power_of_two(step)}: {short(float(value), form)}" for step, value in pairs if math.isfinite(value)
    )
