"""Tables of claims and their verdicts."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from ..statistics.claims import CONFIRMED, CONSISTENT, CONTRADICTED, VERDICTS, Quantity, Verdict
from .tables import Cell, Grid
from .text import narrowed, power_of_two, print_whole, room, short

if TYPE_CHECKING:
    from rich.console import Console

_STYLES = {CONFIRMED: "", CONSISTENT: "", CONTRADICTED: "bold red"}


def show(console: "Console", verdicts: Sequence[Verdict]) -> None:
    """Print the claims of a case, what came out and the verdict; nothing if there are none."""
    if not verdicts:
        return
    for then in (" ", "\n"):  # intervals and swept values stand in lines of their own where there is no room
        table = grid(verdicts, then).as_rich()
        table.columns[1].no_wrap = False
        if narrowed(console, table) <= room(console):
            break
    print_whole(console, table)
    console.print()


def grid(verdicts: Sequence[Verdict], then: str = " ") -> Grid:
    """The table of claims, with `then` before intervals and further swept values."""
    rows = []
    for one in verdicts:
        result, at = re.sub(r" (?=[\[(])", then, came_out(one)), _at(one).replace(", ", f",{then}")
        verdict = Cell(one.verdict, _STYLES.get(one.verdict, "yellow"))
        rows.append([*map(Cell, (one.subject, one.claim.text, result, at)), verdict])
    return Grid("claims", ["scheme", "claim", "result (95 %)", "at", ""], [rows], left=5)


def _at(one: Verdict) -> str:
    """The step size and the swept value of what came out."""
    quantity = one.found
    h = f"h = {power_of_two(quantity.h)}" if quantity and quantity.h is not None else ""
    swept = quantity.swept_places.items() if quantity else ()
    return ", ".join(filter(None, (h, *(f"{word} = {value:g}" for word, value in swept))))


def came_out(one: Verdict) -> str:
    """The value with its interval, and what of it is not finite."""
    if one.found is None:
        return "not computed"
    return _number(one.found) + f" ({one.found.lost})" * bool(one.found.lost)


def _number(quantity: Quantity) -> str:
    value, low, high = quantity.value, quantity.low, quantity.high
    if value != value:
        return "not resolved"
    form = ".3f" if abs(value) < 100 and abs(value) >= 0.01 else ".2e"
    interval = "" if low == value == high else f" [{short(low, form)}, {short(high, form)}]"
    return f"{short(value, form if interval else '.3g')}{interval}"


def remarks(name: str, verdicts: Sequence[Verdict]) -> Iterator[str]:
    """The number of claims with each verdict, and :func:`complaints`; nothing if there are no claims."""
    counts = Counter(one.verdict for one in verdicts)
    if counts:
        yield f"{name}: claims: {', '.join(f'{counts[one]} {one}' for one in VERDICTS if counts[one])}"
    yield from (f"{name}: {verdict}: case {details}" for verdict, details in complaints(verdicts))


def complaints(verdicts: Iterable[Verdict]) -> list[tuple[str, str]]:
    """The verdict and the result of each claim that is neither confirmed nor consistent with the results."""
    return [
        (one.verdict, f"{one.claim.case}: {one.subject}: {one.claim.text}; result: {came_out(one)}")
        for one in verdicts
        if one.verdict not in (CONFIRMED, CONSISTENT)
    ]


def columns(record: dict[str, Any], owner: str, verdicts: Sequence[Verdict]) -> dict[str, str]:
    """Columns of a row of CSV and JSON with the verdicts on its case, scheme, eps, estimator and test function.

    That is the worst verdict on each quantity, ``claim[order]``, whatever the step size and the swept value of the
    record; `owner` is the case in the spec.
    """
    worst: dict[str, str] = {}
    for one in verdicts:
        if one.found and one.found.about.owner == owner and _is_about(one.found, record):
            name = f"claim[{one.claim.quantity}]"
            worst[name] = max(worst.get(name, CONFIRMED), one.verdict, key=VERDICTS.index)
    return worst


def _is_about(quantity: Quantity, record: dict[str, Any]) -> bool:
    about, extrapolate = quantity.about, record.get("extrapolate") or 0
    own = {"scheme": about.scheme, "eps": about.eps, "estimator": about.estimator, "function": quantity.function}
    return extrapolate == about.extrapolate and all(
        record.get(name) in (value, None) for name, value in own.items() if value not in (None, "")
    )
