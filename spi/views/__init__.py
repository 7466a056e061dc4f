"""Stored results as readings, tables and figures, by the kind of experiment that they are of."""

import difflib
import json
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from ..kinds import KINDS
from ..printing import as_csv, as_json, latex, sweeps, tables
from ..printing.rows import DataTable, tables_of
from ..printing.tables import StyledText, TextTable, printed, show_items
from ..printing.text import new_console, printable
from ..specs import sweep
from ..specs.document import Document, SpecError
from ..specs.figures import read_figure
from ..specs.keys import suggestion
from ..statistics import claims
from ..statistics.crossings import Crossing, crossings, lines_of
from ..statistics.curves import Curve, curves
from ..storage import StorageError, write_all
from ..storage.records import Group, StoredResults
from ..storage.stored import Stored, by_case

if TYPE_CHECKING:
    from ..drawing import Figure
    from ..drawing.film import Film
    from ..drawing.layout import PanelFigure


#: What of a reading is told above its figure.
_FACTS = ("step", "reference_step", "reference_scheme", "samples")


class SweptCase(NamedTuple):
    """A case that is swept."""

    name: str
    title: str
    readings: list[Stored]  #: of all values
    curves: list[Curve]


def wholes(read: Sequence[Stored], of: Sequence[str] = ()) -> list[SweptCase]:
    """Cases that are swept, in the order of the file, with curves of some quantities; none if no parameter is."""
    swept = [one for one in read if one.about.swept]
    return [
        _whole([one for one in swept if one.about.owner == owner], of)
        for owner in dict.fromkeys(one.about.owner for one in swept)
    ]


def _whole(read: list[Stored], of: Sequence[str]) -> SweptCase:
    swept: Any = read[0].about.swept
    quantities = [one for case in by_case(read) for one in claims.quantities(case)]
    known = dict.fromkeys(one.name for one in quantities)
    if other := next((name for name in of if name not in known), None):
        raise ValueError(f"panels: {'; '.join(sweep.unknown(other, known))}")
    shown = [curve for curve in curves(quantities, of or swept.of or read[0].headline) if curve.is_known]
    return SweptCase(swept.owner, swept.title, read, shown)


def crossings_of(results: StoredResults, read: Sequence[Stored]) -> list[Crossing]:
    """Crossings of the curves of the quantity that the key ``figure`` of the spec names, of cases or second values."""
    if not (of := chosen(results).get("crossing")):
        return []
    owners: dict[str, list[Stored]] = {}
    for one in read:
        if one.about.swept:
            owners.setdefault(one.about.owner, []).append(one)
    cases = []
    for owner, own in owners.items():
        quantities = [one for case in by_case(own) for one in claims.quantities(case)]
        cases.append((owner, curves(quantities, [*dict.fromkeys(one.name for one in quantities)])))
    return crossings(lines_of(cases, of))


def readings(results: StoredResults) -> list[Stored]:
    """Groups as the records of the kind, see ``kinds/*/results.py``.

    StorageError where they are of an unknown kind, or a group lacks what its kind needs, as those may be that another
    version of spi wrote.
    """
    kind: Any = results.attributes.get("kind")
    if kind not in KINDS:
        raise StorageError(f"these are results of kind {kind!r}; known kinds: {', '.join(KINDS)}")
    return [_reading(kind, group) for group in results.groups]


def _reading(kind: str, group: Group) -> Stored:
    try:
        return KINDS[kind].results.Record.of(group)
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        reason = f"it has no {error}" if isinstance(error, KeyError) else " ".join(str(error).split())
        whose = f"the group {group.name} cannot be read as results of kind {kind} ({reason})"
        raise StorageError(f"{whose}; run the experiment again with --fresh") from error


def title(results: StoredResults, read: Sequence[Stored]) -> str:
    """Title of results in tables, figures and reports."""
    stated = results.attributes.get("title", "")
    return read[0].titled(stated, read) if read else stated


def facts(read: Sequence[Stored]) -> list[str]:
    """Parameters that readings have in common, in mathtext."""
    from ..drawing import style

    own = [{name: getattr(one, name, None) for name in _FACTS} for one in read]
    shared, _ = style.split_facts([style.facts(one, **of) for one, of in zip(read, own, strict=True)])
    return shared


def verdicts(results: StoredResults) -> list[claims.Verdict]:
    """Verdicts on the claims stored with results, case by case; StorageError if they cannot be read."""
    return [] if results.attributes.get("expect") is None else _judged(results, readings(results))


def _judged(results: StoredResults, read: list[Stored]) -> list[claims.Verdict]:
    """The same from readings that have been made already."""
    try:
        stated = claims.of_text(results.attributes.get("expect"))
    except ValueError as error:
        raise StorageError(f"the claims in the results file are damaged: {error}; run the experiment again") from None
    if not stated:
        return []
    return claims.judge(stated, [one for case in by_case(read) for one in claims.quantities(case)])


def data_tables(results: StoredResults) -> dict[str, DataTable]:
    """Tables of all numbers with their intervals by name, the main one first; see ``spi.printing.rows``.

    Where claims are stored, the main one has their verdicts in columns such as ``claim[order]``.
    """
    read = readings(results)
    judged, owners = _judged(results, read), {one.about.case: one.about.owner for one in read}
    found = tables_of(read)
    for main in [*found.values()][:1]:
        main.further = lambda row: tables.columns(row, owners[row["case"]], judged)
    if rows := order_rows(read):
        alike = {"quantity"} if {row["quantity"] for row in rows} == {"order"} else set()
        found["orders"] = DataTable("orders", (), own=[{x: row[x] for x in row if x not in alike} for row in rows])
    if rows := sweeps.crossing_rows(crossings_of(results, read)):
        found["crossings"] = DataTable("crossings", (), own=rows)
    return found


def order_rows(read: Sequence[Stored]) -> list[dict[str, Any]]:
    """A row for each fitted order, with its 95 % interval and the one by theory; without what is empty in all."""
    fitted = [one for case in by_case(read) for one in claims.orders_of(case)]
    rows = [
        {
            **{"case": one.about.case, "scheme": one.about.variant, "estimator": one.about.estimator},
            **{"function": one.function, "quantity": one.name},
            **{"order": one.value, "order_low": one.low, "order_high": one.high, "expected": one.expected},
        }
        for one in fitted
    ]
    empty = {name for name in ("estimator", "function") if not any(row[name] for row in rows)}
    return [{name: value for name, value in row.items() if name not in empty} for row in rows]


def data_table(results: StoredResults, name: str = "") -> DataTable:
    """Table of this name, or that with a column of this name, the main one by default; ValueError if there is none."""
    found = data_tables(results)
    if not found:
        raise ValueError("the results hold no scheme, so there is no table")
    chosen = {column: table for table in reversed(found.values()) for column in table.numbers} | found
    if not name:
        return next(iter(found.values()))
    if name not in chosen:
        near = difflib.get_close_matches(name, chosen, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise ValueError(f"there is no table {name}; tables: {', '.join(found)}{meant}")
    return chosen[name]


def rows(results: StoredResults) -> list[dict[str, Any]]:
    """Rows of the main table; none of results that hold no scheme."""
    return next((table.rows for table in data_tables(results).values()), [])


#: A table of more rows is not written as LaTeX.
MOST_LATEX_ROWS = 400


def exports(results: StoredResults, name: str, format: str) -> dict[str, bytes]:
    """Files with all tables, of the format "csv", "json" or "latex": name of a file -> content.

    These are ``<name>.csv`` with the main table and ``<name>.<table>.csv`` with each further one; as LaTeX
    ``<name>.tex`` with what is printed, and each table that has at most :data:`MOST_LATEX_ROWS` rows.
    """
    found = data_tables(results)
    if format != "latex":
        write = as_json if format == "json" else as_csv
        stems = [name if i == 0 else f"{name}.{one}" for i, one in enumerate(found)]
        both = zip(stems, found.values(), strict=True)
        return {f"{stem}.{format}": write(table.rows).encode() for stem, table in both}
    whole = {f"{name}.tex": as_latex(results, name).encode()}
    few = {one: table for one, table in found.items() if len(table.rows) <= MOST_LATEX_ROWS}
    return whole | {f"{name}.{one}.tex": as_latex(results, name, table).encode() for one, table in few.items()}


def as_latex(results: StoredResults, name: str, table: DataTable | None = None) -> str:
    """A table as LaTeX, by default those that are printed."""
    shown = [item for items, _ in by_cases(results) for item in items] if table is None else [table.as_text()]
    grids = [latex.Titled.of(item) for item in shown if isinstance(item, TextTable)]
    label = name if table is None else f"{name}-{table.name}"
    return latex.document(label, title(results, readings(results)), grids)


def titles(cases: Sequence[Sequence[Stored]]) -> list[str]:
    """Titles of the cases, with their names where several have one title."""
    abouts = [case[0].about for case in cases]
    counts = Counter(about.case_title for about in abouts)
    return [
        f"{about.case_title} ({about.case})" if counts[about.case_title] > 1 else about.case_title for about in abouts
    ]


def print_tables(results: StoredResults, file: IO[str] | None = None, everything: bool = False) -> None:
    """:func:`show` to ``file`` (standard output if None), in colour if that is a terminal."""
    show(results, new_console(file), everything)


def print_data(table: DataTable) -> None:
    """Print a table of numbers to standard output."""
    show_items(new_console(None), [table.as_text()])


def show(results: StoredResults, console: Any, everything: bool = False) -> None:
    """Print the tables of each case to a ``rich.console.Console``; under them stand its claims with their verdicts.

    Tables in which a line says enough are that line, unless `everything` is asked for.
    """
    cases = list(by_cases(results, everything))  # before anything is printed: they may not be readable
    lines = sweeps.crossing_lines(crossings_of(results, readings(results)))
    if title := results.attributes.get("title"):
        console.print(printable(title), style="bold", markup=False)
    for items, judged in cases:
        show_items(console, items)
        tables.show(console, judged)
    show_items(console, [StyledText(line) for line in lines])


def by_cases(
    results: StoredResults, everything: bool = False
) -> Iterator[tuple[list[TextTable | StyledText], list[claims.Verdict]]]:
    """Tables and lines of each case, swept ones as a whole, and the verdicts on its claims."""
    read, title = readings(results), results.attributes.get("title")
    judged, swept = _judged(results, read), wholes(read)
    for whole in swept:
        heading = "" if whole.title == title else printable(whole.title)
        yield list(sweeps.tables(heading, whole.curves)), [one for one in judged if one.claim.case == whole.name]
    cases = [] if swept else by_case(read)
    for case, case_title in zip(cases, titles(cases), strict=True):
        heading = "" if case_title == title else printable(case_title)
        yield list(printed(heading, case, everything)), [one for one in judged if one.claim.case == case[0].about.case]


def chosen(results: StoredResults, **given: Any) -> dict[str, Any]:
    """What is chosen of the figure of results: by the key ``figure`` of their spec, and above that what is given.

    ValueError, with the reason, about a word that is none of ``spi.specs.figures.FIGURE_KEYS``, or its value.
    """
    stored = json.loads(results.attributes.get("figure_keys") or "{}")
    return read_figure(stored) | read_figure(given)


def figure(results: StoredResults, **given: Any) -> "PanelFigure":
    """Matplotlib figure of results; its ``panels`` are the axes of its panels.

    It is as wide and high as its panels want to be.  The words that may be given, those of ``FIGURE_KEYS`` in
    ``spi.specs.figures``, are the options of ``spi plot`` and the keys of ``figure`` in a spec: ``panels``, ``log``,
    ``xlim``, ``width``, ...  In the style "paper" it is one column wide and its text has 8 points of "serif" by
    default; title and parameters are then left to the caption, see ``spi.drawing.style.caption``.  ValueError if there
    is no figure for their kind, nothing to draw, no room for the panels, or if a word or its value is wrong.
    """
    from ..drawing import fitting, page

    kind: Any = results.attributes.get("kind")
    if kind not in KINDS:
        raise ValueError(f"there is no figure for results of kind {kind!r}; known kinds: {', '.join(KINDS)}")
    read, words = readings(results), chosen(results, **given)
    if not read:
        raise ValueError("the results hold no scheme, so there is nothing to draw")
    with page.applied(page.named(**words)):
        heading = words.get("title") or title(results, read)
        over = wholes(read, words.get("panels", ()))
        if of := read_figure(given).get("crossing"):
            _check_crossing(of, over, words)
        drawn: PanelFigure = (
            _swept_figure(heading, over, results)
            if over
            else KINDS[kind].figure.draw(heading, by_case(_with_formulas(results, read)))
        )
        page.current().check_labels(read_figure(given).get("labels", ()))
        fitting.settle(drawn)
        return drawn


def _check_crossing(of: str, cases: Sequence[SweptCase], words: dict[str, Any]) -> None:
    """Raise ValueError about a crossing that a person asked for now, and that is of no lines in the figure."""
    curves = [curve for whole in cases for curve in whole.curves]
    if not curves:
        raise ValueError("crossing: is for lines over a swept word, and nothing is swept; leave it out")
    known = dict.fromkeys(name for curve in curves for name in (curve.function, curve.name) if name)
    if of not in known:
        raise ValueError(f"crossing: has '{of}'; {suggestion(of, known)}")
    if (second := curves[0].second_word) and not words.get("overlay"):
        raise ValueError(f"crossing: is of lines, and two words make a map; add overlay: {second}")


def _swept_figure(title: str, cases: Sequence[SweptCase], results: StoredResults) -> "PanelFigure":
    """Curves over the parameter, or maps over two, a line of panels for each case; ValueError if nothing is known."""
    from ..drawing import page
    from ..drawing.sweeps import draw, draw_maps, each_value

    drawn = [
        (whole.title, whole.curves, facts(_with_formulas(results, whole.readings))) for whole in cases if whole.curves
    ]
    if not drawn:
        raise ValueError("nothing that is to be shown over the swept parameter is known; choose with sweep.of")
    spec = results.attributes.get("spec", "")
    texts = _formulas(spec, "functions"), _formulas(spec, "reference")
    words = {curve.second_word for _, curves, _ in drawn for curve in curves}
    if words == {page.current().chosen.get("overlay")}:
        drawn = [(name, each_value(curves), facts) for name, curves, facts in drawn]
        with page.without("overlay"):
            return draw(title, drawn, *texts)
    return draw_maps(title, drawn) if any(words) else draw(title, drawn, *texts)


def _formulas(spec: str, key: str) -> dict[str, str]:
    """Formulas of a key of a spec by their names, with the swept parameters in them; none if that cannot be read.

    Without those of which a case has its own.
    """
    try:
        whole: Any = Document(spec, str).data
        functions, cases = whole[key], whole.get("cases") or ()
    except (SpecError, AttributeError, TypeError, KeyError):
        return {}
    own = {name for case in cases if isinstance(case, dict) for name in case.get(key) or ()}
    named = functions.items() if isinstance(functions, dict) else ()
    return {str(name): str(text) for name, text in named if isinstance(text, str | int | float) and name not in own}


def _with_formulas(results: StoredResults, read: list[Stored]) -> list[Stored]:
    """Records with the formulas of the spec in place of the numbers of parameters that follow from a swept word.

    They keep their numbers where the model in the spec is not what was run: with overrides, or with models of cases.
    """
    from ..drawing.style import Formulas

    words = {word for one in read for word in (*(one.about.swept.places if one.about.swept else ()), one.get("sweep"))}
    try:
        whole: Any = Document(str(results.attributes["spec"]), str).data
        model, own = whole["model"], [case for case in whole.get("cases") or () if "model" in case]
        given = {**model, **(model.get("parameters") or {})}
    except (SpecError, AttributeError, TypeError, KeyError):
        return read
    if own or len(results.attributes.get("overrides", ())):
        return read
    found = {}
    for name, value in given.items():
        texts = Formulas(map(str, value if isinstance(value, list) else [value]))
        used = {word for text in texts for word in re.findall(r"[A-Za-z_]\w*", text)}
        if (
            used & words
            and name not in words
            and not isinstance(value, dict)
            and not used & {*given.get("variables", ())}
        ):
            found[name] = texts
    about = [replace(one.about, parameters=one.about.parameters | found) for one in read]
    return [replace(one, about=its) for one, its in zip(read, about, strict=True)]


def film(results: StoredResults, **given: Any) -> "Film":
    """Film of results; ValueError if there is none for their kind, or nothing that moves.

    What may be given is the same as for :func:`figure`: a film has its width, height and letters.
    """
    from ..drawing import page

    kind: Any = results.attributes.get("kind")
    draw = getattr(KINDS[kind].figure, "film", None) if kind in KINDS else None
    if draw is None:
        raise ValueError(f"there is no film of results of kind {kind!r}, only of trajectories")
    with page.applied(page.named(**chosen(results, **given))):
        film: Film = draw(results.attributes.get("title", ""), by_case(readings(results)))
        return film


def problem(path: Path, error: Exception) -> str:
    """One line on a file that cannot be shown: what an error says to people, or what it is."""
    for_people = isinstance(error, StorageError) or type(error) is ValueError
    text = " ".join(str(error).split()) if for_people else f"cannot be shown ({' '.join(repr(error).split())})"
    return text if text.startswith(f"{path}: ") else f"{path}: {text}"


def save_film(
    film: "Film",
    folder: str | Path,
    stem: str,
    report: Callable[[int, int], None],
    form: str = "gif",
    fps: float | None = None,
) -> Path:
    """Write ``<stem>.gif``, or ``.mp4``, into ``folder``, whole or not at all; StorageError if that is not possible.

    `report` is told the frames drawn and how many there are; there are `fps` a second.  ValueError about an MP4 if
    there is no ffmpeg.
    """
    from ..drawing.film import as_bytes

    path = Path(folder, f"{stem}.{form}")
    write_all({path: as_bytes(film, form, report, fps)})
    return path


def save(figure: "Figure", folder: str | Path, stem: str) -> tuple[Path, ...]:
    """Write ``<stem>.pdf`` and ``<stem>.png`` into ``folder``, both or none; StorageError if that is not possible."""
    from ..drawing import as_bytes

    files = {Path(folder, f"{stem}.{form}"): as_bytes(figure, form) for form in ("pdf", "png")}
    write_all(files)
    return tuple(files)
