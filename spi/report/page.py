"""Stored results as one HTML page that needs nothing beside it, as LaTeX tables and as CSV."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from .. import __version__, storage
from ..printing import as_csv
from ..report import views
from ..statistics.claims import VERDICTS
from ..storage.records import Results
from . import latex
from .pictures import drawn
from .sections import Section, section

#: More rows than that are folded.
_MOST_ROWS = 12

Tell = Callable[[str], None]  #: told of a file that cannot be shown, in one line
Report = Callable[[int, int, str], None]  #: told the number of a figure that is being drawn, of how many, and its name


def files(
    paths: Sequence[Path],
    out: Path,
    latex_folder: Path | None = None,
    data_folder: Path | None = None,
    report: Report = lambda number, total, name: None,
    tell: Tell = lambda problem: None,
) -> dict[Path, bytes]:
    """The files of a report on the results files `paths`: path -> content, to be written by ``storage.write_all``.

    These are the page `out` and, for each experiment, ``<latex_folder>/<name>.tex`` with its tables and
    ``<data_folder>/<name>.csv`` with one record per point of its curves, if the folders are given.

    A file that cannot be read or is of an unknown kind has a line on the page in place of its results.  StorageError,
    before anything is drawn, if there is no other, or if two have one name.
    """
    names = Counter(path.stem for path in paths)
    if (latex_folder or data_folder) and (twice := next((name for name in names if names[name] > 1), None)):
        both = " and ".join(str(path) for path in paths if path.stem == twice)
        raise storage.StorageError(f"{twice}: two results files have this name, {both}; report on them separately")
    told: list[_Told] = []
    problems: list[str] = []
    for path in paths:
        try:
            told.append(_told(path, anchor(len(told)), latex_folder, data_folder))
        except Exception as error:  # of whatever kind, since the others can be shown
            problems.append(problem(path, error))
    if not told:
        raise storage.StorageError("\n".join(problems))
    for line in problems:
        tell(line)
    whole = page([one.section for one in told], list(_pictures(told, report, tell)), problems)
    return {out: whole.encode()} | {file: content for one in told for file, content in one.files.items()}


class _Told(NamedTuple):
    """What there is of one file but its picture."""

    path: Path
    results: Results
    section: Section
    files: dict[Path, bytes]  #: beside the page


def _told(path: Path, anchored: str, latex_folder: Path | None, data_folder: Path | None) -> _Told:
    results = storage.read(path)
    one, written = section(path, results, anchored), {}
    if latex_folder:
        written[latex_folder / f"{one.name}.tex"] = latex.document(one.name, one.title, one.tables).encode()
    if data_folder:
        written[data_folder / f"{one.name}.csv"] = as_csv(views.rows(results)).encode()
    return _Told(path, results, one, written)


def problem(path: Path, error: Exception) -> str:
    """One line on a file that cannot be shown: what an error says to people, or what it is."""
    for_people = isinstance(error, storage.StorageError) or type(error) is ValueError
    text = " ".join(str(error).split()) if for_people else f"cannot be shown ({' '.join(repr(error).split())})"
    return text if text.startswith(f"{path}: ") else f"{path}: {text}"


def _pictures(told: Sequence[_Told], report: Report, tell: Tell) -> Iterator[Markup]:
    drawing = drawn([one.results for one in told], [one.section.anchor for one in told])
    for number, one in enumerate(told):
        report(number + 1, len(told), one.path.stem)
        picture = next(drawing)
        if isinstance(picture, Exception):
            tell(line := problem(one.path, picture))
            picture = Markup("<p>No figure: {}</p>").format(line)
        yield picture


def anchor(number: int) -> str:
    """By which a page refers to one of its experiments, and what the ids in its figure begin with."""
    return f"e{number + 1}"


def page(sections: Sequence[Section], pictures: Sequence[Markup], problems: Sequence[str] = ()) -> str:
    """The page: HTML that refers to no other file; `problems` are lines on files that cannot be shown."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    totals = {verdict: sum(one.verdicts.get(verdict, 0) for one in sections) for verdict in VERDICTS}
    both = list(zip(sections, pictures, strict=True))
    return environment.get_template("page.html").render(
        sections=both, totals=totals, version=__version__, most_rows=_MOST_ROWS, problems=problems
    )
