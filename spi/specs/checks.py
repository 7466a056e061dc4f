"""Conditions that several kinds of experiment have in common."""

import math
from collections.abc import Sequence
from typing import Any

from pydantic_core import PydanticCustomError

from ..compiler.dispatch import MOST
from ..ensemble.areas import fourier_terms, most_terms
from ..ensemble.fields import lie_poisson
from ..ensemble.protocol import area_pairs, flows_lacking, inner, large, why_inexact
from ..ensemble.scheme_protocol import judges, needs_areas, substeps
from ..models.delegation import depends_on_time, undamped
from ..schemes import SCHEMES, weak_exponents
from ..statistics.estimators import places
from .keys import quantity, wrong

ROUNDING = 1e-12  #: relative: ratios of steps written as decimals are not exact
_MOST_STEPS = 2**34  # of the reference step: the range of the counter of random numbers


def check_count(end: float, step: float, key: str) -> None:
    if end / step > _MOST_STEPS:
        fault = "gives more than 2^34 steps until final_time"
        raise wrong(fault, f"must be at least {quantity(end / _MOST_STEPS)}", key)


def check_multiple(end: float, h: float, key: str, has: str) -> None:
    """The final time must be a multiple of h."""
    if h > end * (1 + ROUNDING) or abs(round(end / h) * h - end) > ROUNDING * end:
        lower = max(math.floor(end / h), 1) * h
        fault = f"{has} {quantity(h)}, of which final_time {quantity(end)} is not a multiple"
        raise wrong(fault, f"the nearest multiples are {quantity(lower)} and {quantity(lower + h)}", key)


def dyadic(case: Any, h: float) -> float:
    """h as exactly the reference step times a power of two that divides the final time."""
    end, reference = case.final_time, case.reference_step
    if h > end * (1 + ROUNDING):
        raise wrong(f"has {quantity(h)}", f"must not exceed final_time, which is {quantity(end)}", "steps")
    doublings = math.log2(h) - math.log2(reference)
    exact: float = reference * 2.0 ** round(doublings)
    if round(doublings) < 1 or abs(h - exact) > ROUNDING * h:
        lower = reference * 2.0 ** max(1, math.floor(doublings))
        fault = f"has {quantity(h)}, which is not 2, 4, 8, ... times the reference_step {quantity(reference)}"
        raise wrong(fault, f"the nearest are {quantity(lower)} and {quantity(2 * lower)}", "steps")
    check_multiple(end, h, "steps", "has")
    return exact


def check_distinct(listed: Sequence[Any], *keys: str) -> None:
    if len(set(listed)) < len(listed):
        raise wrong(f"has '{next(s for s in listed if listed.count(s) > 1)}' twice", "remove one", *keys)


def check_step(case: Any, key: str = "step") -> None:
    """Conditions on the step of a case of one step size, which stands under `key`."""
    check_count(case.final_time, case.step, key)
    check_multiple(case.final_time, case.step, key, "is")
    check_schemes(case, case.schemes, [case.step], key)


def check_every(case: Any) -> None:
    """The key `every` must divide the number of steps."""
    steps = round(case.final_time / case.step)
    if steps % case.every:
        fault = f"is {case.every}, of which the number of steps, {steps}, is not a multiple"
        raise wrong(fault, f"take {math.gcd(steps, case.every)}, which divides both", "every")


def times_on_grid(case: Any, between: float, of: str, times: Sequence[float], *keys: str) -> tuple[float, ...]:
    """`times` of a key in their order, as exact multiples of `between`; `of` stands around it in a message."""
    before, behind = of.split("{}")

    for i, t in enumerate(times):
        if t > case.final_time * (1 + ROUNDING):
            right = f"must not exceed final_time, which is {quantity(case.final_time)}"
            raise wrong(f"is {quantity(t)}", right, *keys, i)
        if abs(round(t / between) * between - t) > ROUNDING * max(t, between):
            lower = math.floor(t / between) * between
            right = f"the nearest are {quantity(lower)} and {quantity(lower + between)}"
            raise wrong(f"is {quantity(t)}, no multiple of {before}{quantity(between)}{behind}", right, *keys, i)

    numbers = [round(t / between) for t in times]
    check_distinct([quantity(n * between) for n in numbers], *keys)
    return tuple(n * between for n in sorted(numbers))


def wrong_scheme(case: Any, name: str, fault: str, right: str) -> PydanticCustomError:
    """Error about a scheme, which stands under ``schemes`` or ``reference_scheme``."""
    has, key = ("has", "schemes") if name in case.schemes else ("is", "reference_scheme")
    return wrong(f"{has} '{name}', {fault}", right, key)


def check_flows(case: Any) -> None:
    """Compositions of flows have a flow of every piece and noise, or an inner method for it."""
    if not (lacking := flows_lacking(case.model)):
        return
    if method := inner(case.model):
        if method == "munthe_kaas" and not lie_poisson(undamped(case.model)):
            raise wrong("is 'munthe_kaas', which needs a bracket that is linear", "use midpoint", "model", "inner")
        return
    for name in case.schemes_used:
        if case.row(name).composition is not None:
            raise _without_flow(case, name, *lacking[0])


def _without_flow(case: Any, name: str, part: str, k: int) -> PydanticCustomError:
    """Error about a composition of flows of which one is not known, with the schemes that need none."""
    able = [name for name, row in SCHEMES.items() if not (row.composition or row.multiscale or judges(row.record))]
    able = [name for name in able if not (needs := SCHEMES[name].needs) or needs(case.model)]
    formula, why = why_inexact(undamped(case.model), part, k)
    why = why.replace(f"'{formula}'", "it")
    fault = f"made of exact flows, and none is known of '{formula}': {why}"
    either = "midpoint (or munthe_kaas)" if lie_poisson(undamped(case.model)) else "midpoint"
    return wrong_scheme(case, name, fault, f"add inner: {either} to the model, or use {', '.join(able)}")


def _check_judged(case: Any, name: str) -> None:
    """The law by which flows are accepted is that of the case."""
    if case.truncate_noise:
        fault = "whose tests of acceptance are those of normal increments, not of clipped ones"
        raise wrong_scheme(case, name, fault, "leave out truncate_noise, or give the scheme a case of its own")
    if large(case.model) and depends_on_time(case.model):
        fault = "whose flows are accepted by the law exp(-H/T), which is none of an H that depends on time"
        raise wrong_scheme(case, name, fault, "use splitting_symmetric, or leave t out of the model")


def check_schemes(case: Any, used: tuple[str, ...], steps: Sequence[float], key: str) -> None:
    """No scheme twice, flows where there must be some, no Lévy areas of more pairs of noises than compiled code takes;
    and what the truncation of increments asks for, where some of the schemes are `used`."""
    listed, truncated, pairs = case.schemes, case.truncate_noise, len(area_pairs(case.model))
    check_distinct(listed, "schemes")
    if truncated and max(steps) >= 1:
        has = "has" if key == "steps" else "is"
        right = "must be below 1 with truncate_noise, whose bound is 0 there"
        raise wrong(f"{has} {quantity(max(steps))}", right, key)
    for name in case.schemes_used:
        row = case.row(name)
        if judges(row.record):
            _check_judged(case, name)
        if row.needs_truncation and name in used and not truncated and case.noise is None:
            right = _apart(name) if max(getattr(case, "extrapolate", (0,))) else "set truncate_noise: true"
            raise wrong_scheme(case, name, "which needs bounded increments", right)
        if pairs > MOST and needs_areas(row.record):
            fault = f"which needs the Lévy areas of {pairs} pairs of noises that do not commute"
            raise wrong_scheme(case, name, fault, f"there may be {MOST}; leave out the scheme or some of the noises")
    check_areas(case, min(steps), key)
    check_flows(case)


def check_areas(case: Any, h: float, key: str) -> None:
    """There are random numbers enough for the Lévy areas over h, the smallest step that has them drawn."""
    if not area_pairs(case.model):
        return
    most = most_terms(case.model)
    _check_substeps(case, h)

    def terms(name: str, step: float) -> int:
        return fourier_terms(case.model, [case.row(name).record], step, areas=case.areas)

    for name in case.schemes_used:
        if (count := terms(name, h)) > most:
            has, least = "has" if key == "steps" else "is", h
            while terms(name, least) > most:
                least *= 2
            fault = f"{has} {quantity(h)}, where the Lévy areas of '{name}' take {count} terms of a Fourier series"
            right = f"there are random numbers for {most}; use {quantity(least)} or more, or leave out the scheme"
            raise wrong(fault, right, key)


def _check_substeps(case: Any, h: float) -> None:
    """No path has Lévy areas and sub-steps of one and the same time: each are drawn given the increment alone."""
    records = {name: case.row(name).record for name in case.schemes_used}
    divided = {name: n for name, record in records.items() if (n := substeps(record)) > 1}
    supplied, apart = [name for name in records if needs_areas(records[name])], "which are drawn apart"
    reference = getattr(case, "reference_scheme", None)
    if both := [name for name in supplied if name in divided]:
        raise wrong_scheme(
            case, both[0], f"which needs Lévy areas and sub-steps, {apart}", "use one without the others"
        )
    if reference in divided and supplied:
        fault = f"is '{reference}', which has sub-steps of the path whose Lévy areas '{supplied[0]}' needs, {apart}"
        raise wrong(fault, f"use {supplied[0]}, or a scheme without sub-steps", "reference_scheme")
    if reference in supplied:
        for name, n in divided.items():
            if h < n * case.reference_step:
                fault = (
                    f"has {quantity(h)}, where the {n} sub-steps of '{name}' and the Lévy areas of '{reference}' are"
                )
                right = f"leave out steps below {quantity(n * case.reference_step)}, or take a smaller reference_step"
                raise wrong(f"{fault} of one time, {apart}", right, "steps")


def _apart(name: str) -> str:
    """Where a scheme that needs bounded increments may stand, with which extrapolated ones have no powers of h."""
    keys = f"{{name: {name}, schemes: [{name}], truncate_noise: true, extrapolate: 0}}"
    return f"give '{name}' a panel of its own beside the extrapolated schemes, a case {keys}"


def check_extrapolate(case: Any) -> None:
    """The key `extrapolate` has schemes whose weak error is a series in given powers of h, and steps to combine."""
    check_distinct(case.extrapolate, "extrapolate")
    if not (most := max(case.extrapolate)):
        return
    for key, why in (("reference_scheme", "measures each scheme with itself"), ("truncate_noise", "needs powers of h")):
        if getattr(case, key):
            bounded = [name for name in case.schemes if key == "truncate_noise" and case.row(name).needs_truncation]
            right = f"leave out {key}" + (f", and {_apart(bounded[0])}" if bounded else "")
            raise wrong(f"has {most}, which {why}", right, "extrapolate")
    for name in case.schemes:
        if weak_exponents(case.row(name), case.model, most) is None:
            fault = f"has {most}, but theory knows no powers of h in the weak error of '{name}'"
            raise wrong(fault, "leave out the scheme or extrapolate", "extrapolate")
    if not len(places(case.steps, most)):
        needed = ", ".join(["h", *(f"{2**i}h" for i in range(1, most + 1))])
        raise wrong(f"has {most}, which combines the steps {needed}", "add them to steps", "extrapolate")


def need(case: Any, estimator: str, *keys: str) -> None:
    """One of these keys must be given."""
    if all(getattr(case, key) is None for key in keys):
        add = " or ".join(f"{key}: {type(case).model_fields[key].description}" for key in keys)
        raise wrong(f"missing key '{keys[0]}', needed by the estimator '{estimator}'", f"add {add}", keys[0])
