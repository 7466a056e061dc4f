"""Numbers as JSON, CSV and text, and what an experiment would cost."""

import json
from collections.abc import Iterable, Mapping, Sequence
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
    cases = [f"{case.name} ({', '.join(case.schemes)})" for case in experiment.cases]
    new_console(file).print(
        f"{printable(experiment.called)}: valid, profile {experiment.profile}: {'; '.join(cases)}; "
        f"{cost.path_steps:.2g} steps of paths, {'at most ' * cost.at_most}about {cost.seconds:.2g} s once compiled, "
        f"{cost.megabytes:.0f} MB",
        markup=False,
        soft_wrap=True,
    )


def print_reports(reports: Mapping[str, Sequence[str]], file: IO[str] | None = None) -> None:
    """Print what was found of systems that were generated: lines by the name of the system and its cases."""
    console = new_console(file)
    for name, lines in reports.items():
        for line in (f"{name}:", *(f"  {line}" for line in lines)):
            console.print(printable(line), markup=False, highlight=False, soft_wrap=True)


def print_verification(path: Any, found: Any, file: IO[str] | None = None) -> None:
    """Print what came out when paths were computed again (a ``spi.running.verify.Verification``)."""
    console = new_console(file)

    def write(line: str) -> None:
        console.print(line, markup=False, soft_wrap=True)

    write(f"{path}: {len(found.checked)} of {found.chunks} chunks of paths were computed again")
    if not found.different:
        write("all are equal to the last bit")
        return
    for label in found.different:
        write(f"different: {label}")
    write(f"{len(found.different)} of {len(found.checked)} are different; what is not as it was then:")
    for cause in found.causes or ("nothing that the file tells: the results, or this machine, are not to be trusted",):
        write(f"  {cause}")
