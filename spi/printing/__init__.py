"""Numbers as JSON and CSV, what an experiment would cost, and lists of results."""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from .text import human_time, new_console, print_lines, printable, short


def as_json(records: Iterable[dict[str, Any]], unicode: bool = True) -> str:
    """A JSON list of records; as JSON has neither, infinities and nan become null (``nonfinite`` tells why).

    Without `unicode` it is ASCII.
    """
    plain = _with_odd(records, lambda value: None)
    return json.dumps(plain, indent=2, ensure_ascii=not unicode, allow_nan=False)


def as_csv(records: list[dict[str, Any]]) -> str:
    """CSV with a header; infinities and nan are written ``inf`` and ``nan``, what a record lacks stays empty."""
    from pandas import DataFrame

    return DataFrame(_with_odd(records, str), dtype=object).to_csv(index=False)


def _with_odd(records: Iterable[dict[str, Any]], word: Callable[[float], Any]) -> list[dict[str, Any]]:
    """Records with words for infinities and nan."""
    return [
        {key: word(it) if isinstance(it, float) and not math.isfinite(it) else it for key, it in record.items()}
        for record in records
    ]


def print_safely(lines: Iterable[str]) -> None:
    """Print lines as long as they are, without what a terminal would take for commands."""
    print_lines(new_console(None), map(printable, lines))


def cost_line(experiment: Any, cost: Any, to_compile: str) -> str:
    """That an experiment is valid and what it would cost: a ``spi.running.run.Cost``, and what is to be compiled."""
    cases = [f"{name} ({', '.join(schemes)})" for name, schemes in _named(experiment.cases)]
    seconds = f"{'at most ' if cost.at_most else ''}about {human_time(cost.seconds)} once compiled"
    takes = f"{short(cost.path_steps)} steps of paths, {seconds}"
    return (
        f"{experiment.called}: valid, profile {experiment.profile}: {'; '.join(cases)}; "
        f"{'time not known before' if math.isnan(cost.seconds) else takes}"
        f"{f' (to be compiled: {to_compile})' if to_compile else ''}, {cost.megabytes:.0f} MB"
    )


def _named(cases: Sequence[Any]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Names and schemes of cases; where a parameter is swept, of the case in the spec, with how many values."""
    for case in cases:
        if (sweep := case.sweep) is None:
            yield case.name, case.schemes
        elif all(sweep.places[word] == values[0] for word, values in sweep.parameters.items()):
            counts = " and ".join(f"{len(values)} of {word}" for word, values in sweep.parameters.items())
            yield f"{sweep.case} with {counts.replace(' of', ' values of', 1)}", case.schemes


def result_lines(results: Iterable[Any]) -> Iterator[str]:
    """A list of results (``spi.running.finding.Listed``): the name of each, and a description under it."""
    for one in results:
        counts = sorted({count for count in one.samples if count})
        samples = " to ".join(f"{count:,}" for count in dict.fromkeys([*counts[:1], *counts[-1:]]))
        facts = [one.kind, *[f"{samples} samples"] * bool(samples), one.created]
        yield from filter(None, (one.name, f"    {', '.join(facts)}: {one.title}", f"    {one.how}".rstrip()))
