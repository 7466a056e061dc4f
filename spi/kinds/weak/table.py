"""Tables of weak errors."""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.text import (
    INTERVAL,
    error_and_remark,
    error_table,
    fraction,
    joined,
    lines_of,
    lost_paths,
    new_table,
    order_found,
    power_of_two,
    print_lines,
    print_whole,
    readable,
    short,
    with_interval,
)
from spi.storage.records import HEAVY_TAILS, Order

from .results import (
    Differences,
    Levels,
    Prefixes,
    Quasi,
    Sampled,
    WeakErrors,
    agreement,
    cannot_do,
    comparable_sweeps,
    largest_over_eps,
    not_reached,
    own_error,
)

# ---------------------------------------------------------------------------------------------------------------------
# Tables of the levels of multilevel estimates (Giles, Operations Research 56, 2008), and of their differences.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

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


# ---------------------------------------------------------------------------------------------------------------------
# What is said under a table of weak errors: orders, standard errors, references, agreement.
# ---------------------------------------------------------------------------------------------------------------------

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


_AXES = ("function", "h")
#: What the rows of fewer paths have in common with those of all.
_OF_ALL = ("case", "scheme", "eps", "extrapolate", "estimator", *_AXES, "expected_order")


def rows(readings: Sequence[WeakErrors]) -> Iterator[dict[str, Any]]:
    """A record per test function and step size; after them those of the first so many paths, where they are kept.

    ``agreement`` is the error less the deterministic one, in standard errors.
    """
    for reading in readings:
        yield from _point_rows(reading, readings)
        if reading.prefixes and reading.sampled:
            yield from _prefix_rows(reading, reading.prefixes, reading.sampled.samples)


def _point_rows(reading: WeakErrors, readings: Sequence[WeakErrors] = ()) -> Iterator[dict[str, Any]]:
    """The records of all step sizes; their ``agreement`` with one of `readings`, if it is not sampled."""
    found = agreement(reading, readings)
    errors = replace(reading, levels=None, differences=None)  # which have a table of their own
    yield from rows_of(errors, _AXES, derived={"agreement": (_AXES, found.deviation)} if found else {})


def _prefix_rows(reading: WeakErrors, prefixes: Prefixes, all_samples: int) -> Iterator[dict[str, Any]]:
    """Of fewer paths than all; expectations and orders are known of all only."""
    resolved = prefixes.resolved
    for n, samples in enumerate(prefixes.samples.tolist()):
        if samples == all_samples:
            continue
        fewer = {"samples": samples, "cpu_seconds": prefixes.cpu_seconds[n].item()}
        values = {"error": prefixes.error[n], "error_stderr": prefixes.error_stderr[n], "resolved": resolved[n]}
        for place, row in zip(np.ndindex(reading.error.shape), _point_rows(reading), strict=True):
            same = {name: row[name] for name in _OF_ALL if name in row}
            yield same | {name: of_all[place].item() for name, of_all in values.items()} | fewer


def show(console: "Console", heading: str, readings: Sequence[WeakErrors]) -> None:
    """Print the tables of a case: errors, what is to be said about them, and the levels of multilevel estimates."""
    print_whole(console, _errors(heading, readings))
    console.print()
    print_lines(console, summaries(readings))
    each = [(reading, f) for reading in readings for f in range(len(reading.functions))]
    for reading, f in each:
        for line, bad in agreement_line(reading, readings, f):
            print_lines(console, [f"{name_of(reading, f)}: {line}"], style="bold red" if bad else None)
    console.print()
    known = set()  # as those of one scheme serve all levels of extrapolation
    for reading, f in each:
        name = name_of(reading, f)
        if reading.differences:
            print_whole(console, difference_table(reading.differences, reading.h, f, name))
            console.print()
        if not (levels := reading.levels):
            continue
        of_all = reading.about.scheme, reading.about.eps, f, levels.samples.tobytes(), levels.mean[f].tobytes()
        if of_all not in known:
            known.add(of_all)
            of = f" of {reading.differences.scheme}" if reading.differences else ""
            print_whole(console, level_table(levels, f, f"{name}{of}"))
            console.print()


def _errors(heading: str, readings: Sequence[WeakErrors]) -> "Table":
    """The table of errors and expectations, a line per test function and step size."""
    trust = " or ".join(
        ["95 %"] * any(reading.sampled for reading in readings)
        + ["bound"] * any(reading.unsampled for reading in readings)
    )
    several = any(len(reading.functions) > 1 for reading in readings)
    lost = any(reading.nonfinite is not None and reading.nonfinite.any() for reading in readings)
    names = ["scheme,\nestimator", *["function"] * several, "h"]
    headings = [*names, f"weak error ({trust})", f"expectation ({trust})", *["di-\nverged"] * lost, ""]
    return error_table(heading, headings, len(names), (_labelled(reading, several, lost) for reading in readings))


def _labelled(reading: WeakErrors, several: bool, lost: bool) -> tuple[list[str], list[tuple["str | Text", ...]]]:
    """The labels of one scheme and estimator, and the cells of each line."""
    lines, labels = list(_lines(reading, several, lost)), [lines_of(reading.about), reading.about.estimator]
    return ["\n".join(labels)] if len(lines) == 1 else labels, lines


def _lines(reading: WeakErrors, several: bool, lost: bool) -> Iterator[tuple["str | Text", ...]]:
    """The cells of each line of one scheme and estimator, which name the test function and count lost paths or not."""
    from rich.text import Text

    halves = zip(reading.half.flat, reading.expectation_half.flat, strict=True)
    before = None
    for record, (half, expectation_half) in zip(_point_rows(reading), halves, strict=True):
        error, remark = error_and_remark(record, half)
        yield (
            *[Text(record["function"] if record["function"] != before else "")] * several,
            power_of_two(record["h"]),
            error,
            with_interval(record["expectation"], expectation_half),
            *[lost_paths(record.get("nonfinite"))] * lost,
            remark,
        )
        before = record["function"]
