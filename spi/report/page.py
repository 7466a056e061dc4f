"""Stored results as one HTML page that needs nothing beside it, as LaTeX tables and as CSV."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

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

Report = Callable[[int, int, str], None]  #: told the number of a figure that is being drawn, of how many, and its name


def files(
    paths: Sequence[Path],
    out: Path,
    latex_folder: Path | None = None,
    data_folder: Path | None = None,
    report: Report = lambda number, total, name: None,
) -> dict[Path, bytes]:
    """The files of a report on the results files `paths`: path -> content, to be written by ``storage.write_all``.

    These are the page `out` and, for each experiment, ``<latex_folder>/<name>.tex`` with its tables and
    ``<data_folder>/<name>.csv`` with one record per point of its curves, if the folders are given.

    StorageError, before anything is drawn, if a file cannot be read, is of an unknown kind, or two have one name.
    """
    found = [storage.read(path) for path in paths]
    names = Counter(path.stem for path in paths)
    if (latex_folder or data_folder) and (twice := next((name for name in names if names[name] > 1), None)):
        both = " and ".join(str(path) for path in paths if path.stem == twice)
        raise storage.StorageError(f"{twice}: two results files have this name, {both}; report on them separately")
    each = list(_sections(paths, found))
    written: dict[Path, bytes] = {}
    for one, results in zip(each, found, strict=True):
        if latex_folder:
            written[latex_folder / f"{one.name}.tex"] = latex.document(one.name, one.title, one.tables).encode()
        if data_folder:
            written[data_folder / f"{one.name}.csv"] = as_csv(views.rows(results)).encode()
    return {out: page(each, list(_pictures(paths, found, report))).encode(), **written}


def _sections(paths: Sequence[Path], found: Sequence[Results]) -> Iterator[Section]:
    for number, (path, results) in enumerate(zip(paths, found, strict=True)):
        try:
            yield section(path, results, anchor(number))
        except (ValueError, storage.StorageError) as error:
            raise storage.StorageError(f"{path}: {error}") from error


def _pictures(paths: Sequence[Path], found: Sequence[Results], report: Report) -> Iterator[Markup]:
    drawing = drawn(found, [anchor(number) for number in range(len(found))])
    for number, path in enumerate(paths):
        report(number + 1, len(paths), path.stem)
        try:
            yield next(drawing)
        except ValueError as error:
            raise storage.StorageError(f"{path}: {error}") from error


def anchor(number: int) -> str:
    """By which a page refers to one of its experiments, and what the ids in its figure begin with."""
    return f"e{number + 1}"


def page(sections: Sequence[Section], pictures: Sequence[Markup]) -> str:
    """The page: HTML that refers to no other file."""
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
        sections=both, totals=totals, version=__version__, most_rows=_MOST_ROWS
    )
