"""Stored results as readings, tables and figures, by the kind of experiment that they are of."""

from typing import IO, TYPE_CHECKING, Any

from .kinds import KINDS
from .printing import anything
from .printing.text import new_console
from .records import Reading, Results, by_case

if TYPE_CHECKING:
    from .drawing import Figure


def readings(results: Results) -> list[Reading]:
    """What the kind of the results makes of each group: records with named fields, see ``kinds/*/reading.py``."""
    read = KINDS[results.attributes["kind"]].reading.read
    return [read(group) for group in results.groups]


def rows(results: Results) -> list[dict[str, Any]]:
    """One flat record per case, scheme and point of the first axis (of errors step sizes, else times)."""
    if results.attributes.get("kind") not in KINDS:
        return list(anything.rows(results.groups))
    return list(KINDS[results.attributes["kind"]].table.rows(readings(results)))


def print_tables(results: Results, file: IO[str] | None = None) -> None:
    """Print the tables of each case to ``file`` (standard output if None), in colour if that is a terminal.

    Of results of an unknown kind all numbers are printed.
    """
    console = new_console(file)
    title = results.attributes.get("title")
    if title:
        console.print(title, style="bold", markup=False)
    if results.attributes.get("kind") not in KINDS:
        anything.show(console, results.groups)
        return
    for case in by_case(readings(results)):
        heading = case[0].about.case_title
        KINDS[results.attributes["kind"]].table.show(console, "" if heading == title else heading, case)


def figure(results: Results) -> "Figure":
    """The matplotlib figure of results; ValueError if there is none for their kind or nothing to draw."""
    from .drawing import style

    kind = results.attributes.get("kind")
    if kind not in KINDS:
        raise ValueError(f"there is no figure for results of kind {kind!r}; known kinds: {', '.join(KINDS)}")
    cases = by_case(readings(results))
    if not cases:
        raise ValueError("the results hold no scheme, so there is nothing to draw")
    with style.applied():
        return KINDS[kind].figure.draw(results.attributes.get("title", ""), cases)
