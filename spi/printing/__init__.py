"""Numbers as JSON, CSV and text, and what an experiment would cost."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import IO, Any

from .text import is_odd, new_console, printable


def as_json(records: Iterable[dict[str, Any]], unicode: bool = True) -> str:
    """A JSON list of records; as JSON has neither, infinities and nan become null (``nonfinite`` tells why).

    Without `unicode` it is ASCII.
    """
    plain = [{key: None if is_odd(value) else value for key, value in record.items()} for record in records]
    return json.dumps(plain, indent=2, ensure_ascii=not unicode, allow_nan=False)


def as_csv(records: list[dict[str, Any]]) -> str:
    """CSV with a header; infinities and nan are written ``inf`` and ``nan``, what a record lacks stays empty."""
    from pandas import DataFrame

    plain = [{key: str(value) if is_odd(value) else value for key, value in record.items()} for record in records]
    return DataFrame(plain, dtype=object).to_csv(index=False)


def print_cost(experiment: Any, cost: Any, file: IO[str] | None = None) -> None:
    """Print that an experiment is valid and what it would cost (a ``spi.running.run.Cost``)."""
    cases = [f"{name} ({', '.join(schemes)})" for name, schemes in _named(experiment.cases)]
    seconds = f"{'at most ' * cost.at_most}about {cost.seconds:.2g} s once compiled"
    takes = f"{cost.path_steps:.2g} steps of paths, {seconds}"
    new_console(file).print(
        f"{printable(experiment.called)}: valid, profile {experiment.profile}: {'; '.join(cases)}; "
        f"{'time not known before' if math.isnan(cost.seconds) else takes}, {cost.megabytes:.0f} MB",
        markup=False,
        soft_wrap=True,
    )


def _named(cases: Sequence[Any]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """The names and schemes of cases; where a parameter is swept, of the case in the spec, with how many values."""
    for case in cases:
        if (sweep := case.sweep) is None or sweep.value is None:
            yield case.name, case.schemes
        elif (sweep.value, sweep.second_value) == (sweep.values[0], next(iter(sweep.second_values), None)):
            other = f" and {len(sweep.second_values)} of {sweep.second_word}" * bool(sweep.second_word)
            yield f"{sweep.case} with {len(sweep.values)} values of {sweep.word}{other}", case.schemes


def print_remarks(experiment: Any, remarks: Iterable[str], file: IO[str] | None = None) -> None:
    """Print what of an experiment will not be computed, or not as it was asked for."""
    console = new_console(file)
    for line in remarks:
        console.print(f"{printable(experiment.called)}: {printable(line)}", markup=False, soft_wrap=True)


def print_reports(reports: Mapping[str, Sequence[str]], file: IO[str] | None = None) -> None:
    """Print what was found of systems that were generated: lines by the name of the system and its cases."""
    console = new_console(file)
    for name, lines in reports.items():
        for line in (f"{name}:", *(f"  {line}" for line in lines)):
            console.print(printable(line), markup=False, highlight=False, soft_wrap=True)


def print_verification(path: Any, found: Any, file: IO[str] | None = None) -> None:
    """Print what came out when results were checked (a ``spi.running.verify.Verification``)."""
    console = new_console(file)
    for line in _verified(found):
        console.print(f"{printable(path)}: {line}", markup=False, soft_wrap=True)


def _verified(found: Any) -> Iterator[str]:
    """What came out, line by line."""
    count = len(found.checked)
    equal = "equal to the last bit" if not found.different else f"{len(found.different)} of them different"
    yield f"{count} of {found.chunks} chunks of paths were computed again, {equal}"
    if found.whole:
        yield "all numbers but times were derived again from these paths"
    if found.sums:
        yield f"all numbers were derived again from the sums over paths in {printable(found.sums)}"
    if found.sums and not found.whole:
        yield f"of these sums those over {found.tied} of {found.chunks} chunks were computed again; --all computes all"
    if not found.sums and not found.whole:
        yield "its numbers were not derived again: their sums over paths are not beside it, and --all was not given"
    yield from (f"different: {label}" for label in found.different)
    yield from (f"wrong: {what}" for what in found.wrong)
    if found.sound:
        return
    yield "what is not as it was when they were computed:"
    yield from found.causes or ("nothing that the file tells: the results, or this machine, are not to be trusted",)
