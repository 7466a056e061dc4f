"""Conditions that several kinds of experiment have in common."""

import math
from collections.abc import Sequence
from typing import Any

from pydantic_core import PydanticCustomError

from ..ensemble.areas import fourier_terms, most_terms
from ..ensemble.fields import lie_poisson
from ..ensemble.protocol import area_pairs, flows_lacking, has_friction, inner, large
from ..ensemble.scheme_protocol import judges, needs_areas
from ..models import MODELS
from ..models.delegation import undamped
from ..schemes import SCHEMES, weak_exponents
from ..statistics.estimators import places
from ..systems import inexact
from ..systems.keys import MOST
from .keys import quantity, shown, suggestion, wrong

ROUNDING = 1e-12  #: relative: ratios of steps written as decimals are not exact
_MOST_STEPS = 2**34  # of the reference step: what the counter of the random numbers has room for


def check_count(end: float, step: float, key: str) -> None:
    if end / step > _MOST_STEPS:
        what = "gives more than 2^34 steps until final_time"
        raise wrong(what, f"must be at least {quantity(end / _MOST_STEPS)}", key)


def check_multiple(end: float, h: float, key: str, has: str) -> None:
    """The final time must be a multiple of h."""
    if h > end * (1 + ROUNDING) or abs(round(end / h) * h - end) > ROUNDING * end:
        lower = max(math.floor(end / h), 1) * h
        what = f"{has} {quantity(h)}, of which final_time {quantity(end)} is not a multiple"
        raise wrong(what, f"the nearest multiples are {quantity(lower)} and {quantity(lower + h)}", key)


def dyadic(case: Any, h: float) -> float:
    """h as exactly the reference step times a power of two that divides the final time."""
    end, reference = case.final_time, case.reference_step
    if h > end * (1 + ROUNDING):
        raise wrong(f"has {quantity(h)}", f"must not exceed final_time, which is {quantity(end)}", "steps")
    doublings = math.log2(h) - math.log2(reference)
    exact: float = reference * 2.0 ** round(doublings)
    if round(doublings) < 1 or abs(h - exact) > ROUNDING * h:
        lower = reference * 2.0 ** max(1, math.floor(doublings))
        what = f"has {quantity(h)}, which is not 2, 4, 8, ... times the reference_step {quantity(reference)}"
        raise wrong(what, f"the nearest are {quantity(lower)} and {quantity(2 * lower)}", "steps")
    check_multiple(end, h, "steps", "has")
    return exact


def check_distinct(listed: Sequence[Any], key: str) -> None:
    if len(set(listed)) < len(listed):
        raise wrong(f"has '{next(s for s in listed if listed.count(s) > 1)}' twice", "remove one", key)


def check_eps(case: Any) -> None:
    """There is an eps where a scheme needs one, and else none."""
    multiscale = [s for s in case.schemes if case.row(s).multiscale]
    if multiscale and case.eps is None:
        raise wrong("missing key 'eps'", f"'{multiscale[0]}' needs it: add eps: scale of the fast processes", "eps")
    if case.eps is not None:
        if not multiscale:
            known = [name for name, row in SCHEMES.items() if row.multiscale]
            raise wrong("is used by none of the schemes", f"leave it out or use one of {', '.join(known)}", "eps")
        check_distinct([f"{eps:g}" for eps in case.eps], "eps")  # as results are named
        for name in multiscale:
            if case.row(name).needs_eps and 0 in case.eps:
                raise wrong(f"has 0, which '{name}' cannot have", "must be positive for it", "eps")


def check_step(case: Any, key: str = "step") -> None:
    """What the step of a case of one step size must be, which stands under `key`."""
    check_count(case.final_time, case.step, key)
    check_multiple(case.final_time, case.step, key, "is")
    check_schemes(case, case.schemes, [case.step], key)


def check_every(case: Any) -> None:
    """The key `every` must divide the number of steps."""
    steps = round(case.final_time / case.step)
    if steps % case.every:
        what = f"is {case.every}, of which the number of steps, {steps}, is not a multiple"
        raise wrong(what, f"take {math.gcd(steps, case.every)}, which divides both", "every")


def times_on_grid(case: Any, between: float, of: str) -> tuple[float, ...]:
    """The key `times` in its order, as exact multiples of `between`; `of` stands before and behind it in a message."""
    before, behind = of.split("{}")

    for i, t in enumerate(case.times):
        if t > case.final_time * (1 + ROUNDING):
            right = f"must not exceed final_time, which is {quantity(case.final_time)}"
            raise wrong(f"is {quantity(t)}", right, "times", i)
        if abs(round(t / between) * between - t) > ROUNDING * max(t, between):
            lower = math.floor(t / between) * between
            right = f"the nearest are {quantity(lower)} and {quantity(lower + between)}"
            raise wrong(f"is {quantity(t)}, no multiple of {before}{quantity(between)}{behind}", right, "times", i)

    numbers = [round(t / between) for t in case.times]
    check_distinct([quantity(n * between) for n in numbers], "times")
    return tuple(n * between for n in sorted(numbers))


def wrong_scheme(case: Any, name: str, what: str, right: str) -> PydanticCustomError:
    """The error about a scheme, which stands under ``schemes`` or ``reference_scheme``."""
    has, key = ("has", "schemes") if name in case.schemes else ("is", "reference_scheme")
    return wrong(f"{has} '{name}', {what}", right, key)


def check_names(case: Any) -> None:
    """All schemes are in the table of schemes or among the compositions of the case."""
    known = (*SCHEMES, *case.compositions)
    for n, name in enumerate(case.schemes_used):
        if name not in known:
            place = ("schemes", n) if n < len(case.schemes) else ("reference_scheme",)
            raise wrong(f"is {shown(name)}", suggestion(name, known), *place)


def check_flows(case: Any) -> None:
    """Compositions of flows have a flow of every piece and noise, or an inner method for it."""
    if not (lacking := flows_lacking(case.model)):
        return
    if method := inner(case.model):
        if method == "munthe_kaas" and not lie_poisson(undamped(case.model)):
            raise wrong("is 'munthe_kaas', which needs a bracket that is linear", "use midpoint", "model", "inner")
        return
    able = [name for name, row in SCHEMES.items() if not (row.composition or row.multiscale or judges(row.record))]
    able = [name for name in able if not (needs := SCHEMES[name].needs) or needs(case.model)]
    part, k = lacking[0]
    formula, why = inexact(undamped(case.model)).get(part, {}).get(k, (f"{part}[{k}]", "as the model says"))
    why = why.replace(f"'{formula}'", "it")
    for name in case.schemes_used:
        if case.row(name).composition is not None:
            what = f"made of exact flows, and none is known of '{formula}': {why}"
            either = "midpoint (or munthe_kaas)" if lie_poisson(undamped(case.model)) else "midpoint"
            raise wrong_scheme(case, name, what, f"add inner: {either} to the model, or use {', '.join(able)}")


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
        if row.needs_truncation and name in used and not truncated and case.noise is None:
            right = _apart(name) if max(getattr(case, "extrapolate", (0,))) else "set truncate_noise: true"
            raise wrong_scheme(case, name, "which needs bounded increments", right)
        if pairs > MOST and needs_areas(row.record):
            what = f"which needs the Lévy areas of {pairs} pairs of noises that do not commute"
            raise wrong_scheme(case, name, what, f"there may be {MOST}; leave out the scheme or some of the noises")
    check_areas(case, min(steps), key)
    check_flows(case)


def check_areas(case: Any, h: float, key: str) -> None:
    """There are random numbers enough for the Lévy areas over h, the smallest step that has them drawn."""
    most = most_terms(case.model)

    def terms(name: str, step: float) -> int:
        return fourier_terms(case.model, [case.row(name).record], step, areas=case.areas)

    for name in case.schemes_used:
        if (found := terms(name, h)) > most:
            has, least = "has" if key == "steps" else "is", h
            while terms(name, least) > most:
                least *= 2
            what = f"{has} {quantity(h)}, where the Lévy areas of '{name}' take {found} terms of a Fourier series"
            right = f"there are random numbers for {most}; use {quantity(least)} or more, or leave out the scheme"
            raise wrong(what, right, key)


def check_word_of_areas(case: Any) -> None:
    """Gaussian areas have their law alone, and some scheme must need them."""
    if case.areas == "exact":
        return
    if case.along_paths:
        what = f"is '{case.areas}', but strong errors are those of given paths, which have areas of their own"
        raise wrong(what, "leave it out", "areas")
    if not any(needs_areas(case.row(name).record) for name in case.schemes_used):
        known = ", ".join(name for name, row in SCHEMES.items() if needs_areas(row.record))
        raise wrong(f"is '{case.areas}', but no scheme needs Lévy areas", f"leave it out, or use {known}", "areas")


def check_large(case: Any) -> None:
    """What cannot be done with a model whose states are arrays."""
    for name in case.schemes_used:
        if not case.row(name).for_large_models:
            right = "use euler_maruyama or a splitting without joint flows and Lévy areas"
            raise wrong_scheme(case, name, f"which is not for {case.model_name}", right)


def check_needs(case: Any) -> None:
    """The facts that schemes need hold for the model."""
    if large(case.model):
        check_large(case)
    for name in case.schemes_used:
        needs = case.row(name).needs
        if has_friction(case.model) and case.row(name).multiscale:
            what = f"has '{name}', whose noise is a fast process, for which no friction is known"
            raise wrong(what, "leave out the scheme or temperature", "schemes")
        if judges(case.row(name).record) and flows_lacking(case.model):
            what = f"has '{name}', which is made of exact flows, and not all are known of {case.model_name}"
            raise wrong(what, "use another", "schemes")
        if needs is has_friction and not needs(case.model):
            raise wrong(f"has '{name}', which needs a temperature", "add temperature: T, or use another", "schemes")
        if needs is lie_poisson and not needs(undamped(case.model)):
            raise wrong_scheme(case, name, "which needs a bracket that is linear", "use another")
        if needs and not needs(case.model):
            able = " and ".join(n for n, cls in MODELS.items() if needs(cls))
            able += " without damping" if case.damping else ""
            raise wrong_scheme(case, name, f"which is for {able}", "use another")


def _apart(name: str) -> str:
    """Where a scheme that needs bounded increments may stand, with which extrapolated ones have no powers of h."""
    keys = f"{{name: {name}, schemes: [{name}], truncate_noise: true, extrapolate: 0}}"
    return f"give '{name}' a panel of its own beside the extrapolated schemes, a case {keys}"


def check_extrapolate(case: Any) -> None:
    """What the key `extrapolate` needs: schemes whose weak error is a series in known powers of h, and steps."""
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
            what = f"has {most}, but theory knows no powers of h in the weak error of '{name}'"
            raise wrong(what, "leave out the scheme or extrapolate", "extrapolate")
    if not len(places(case.steps, most)):
        needed = ", ".join(["h", *(f"{2**i}h" for i in range(1, most + 1))])
        raise wrong(f"has {most}, which combines the steps {needed}", "add them to steps", "extrapolate")


def need(case: Any, estimator: str, *keys: str) -> None:
    """One of these keys must be given."""
    if all(getattr(case, key) is None for key in keys):
        add = " or ".join(f"{key}: {type(case).model_fields[key].description}" for key in keys)
        raise wrong(f"missing key '{keys[0]}', needed by the estimator '{estimator}'", f"add {add}", keys[0])
