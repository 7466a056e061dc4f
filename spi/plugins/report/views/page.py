"""Stored results as one HTML page that needs nothing beside it, as LaTeX tables and as CSV."""

import base64
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from datetime import date
from functools import partial
from pathlib import Path
from typing import NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from spi import __version__, storage, views
from spi.printing import latex
from spi.running.compiling import processors
from spi.running.workers import processes
from spi.statistics.claims import VERDICTS
from spi.storage.records import StoredResults

from .sections import ReportSection, html, powers, section

# ---------------------------------------------------------------------------------------------------------------------
# Figures as they stand in a page: SVG among the HTML, or PNG where an SVG would be too large.
# ---------------------------------------------------------------------------------------------------------------------

#: Bytes of the largest SVG that stands in a page.
LARGEST_SVG = 400_000

_DPI = 120  # of a PNG
_HEAD = re.compile(r"^.*?(?=<svg)|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_DRAWN = re.compile(r'(?<= d=")[^"]*|(?<= [xy]=")[^"]*')
_DIGITS = re.compile(r"(\.\d\d)\d+(?!\d*e)")
_REFERENCE = re.compile(r'(\bid="|href="#|url\(#)')


#: Fewer figures than that are drawn by this process alone, since others would take longer to start.
_MANY = 4


def drawn(
    results: Sequence[StoredResults], prefixes: Sequence[str], alts: Sequence[str]
) -> Iterator[Markup | Exception]:
    """The :func:`picture` of each of the results, in their order, or why there is none; several processes draw many."""
    if len(results) < _MANY or processors() == 1:
        yield from map(_tried, results, prefixes, alts)
        return
    with processes(min(processors(), len(results))) as pool:
        yield from pool.executor.map(partial(pool.answer, _tried), results, prefixes, alts)


def _tried(results: StoredResults, prefix: str, alt: str) -> Markup | Exception:
    """Picture, or the error of one that cannot be drawn, so that the others are."""
    try:
        return picture(results, prefix, alt)
    except Exception as error:
        return error


def picture(results: StoredResults, prefix: str, alt: str) -> Markup:
    """Figure of results as HTML, the ids in it beginning with `prefix`, and `alt` the text in its place.

    ValueError if there is none for their kind or nothing to draw.
    """
    from spi.drawing import as_bytes, as_svg

    figure, text = views.figure(results), escape(alt)
    holds_images = any(axes.images for axes in figure.axes)  # of many pixels, which an SVG would repeat
    svg = "" if holds_images else _inline(as_svg(figure), prefix)
    if 0 < len(svg) <= LARGEST_SVG:
        return Markup(svg.replace("<svg ", f'<svg role="img" aria-label="{text}" ', 1))
    png = base64.b64encode(as_bytes(figure, "png", dpi=_DPI)).decode()
    width, height = (round(96 * inches) for inches in figure.get_size_inches())
    return Markup(f'<img src="data:image/png;base64,{png}" width="{width}" height="{height}" alt="{text}">')


def _inline(svg: str, prefix: str) -> str:
    """An SVG as it may stand among HTML: without its head, its ids unlike those of others, with two decimals."""
    svg = _DRAWN.sub(lambda drawn: _DIGITS.sub(r"\1", drawn.group()), _HEAD.sub("", svg))
    return _REFERENCE.sub(rf"\g<1>{prefix}-", svg)


#: More rows than that are folded.
_MOST_ROWS = 12

Tell = Callable[[str], None]  #: told of a file that cannot be shown, in one line
#: Told the number of a figure that is being drawn, of how many, and its name.
ReportPicture = Callable[[int, int, str], None]


class Head(NamedTuple):
    """What stands at the top of a page."""

    title: str = ""  #: empty: how many experiments it has
    lines: tuple[str, ...] = ()


PLAIN = Head()


def _check_names(paths: Sequence[Path]) -> None:
    names = Counter(path.stem for path in paths)
    if twice := next((name for name in names if names[name] > 1), None):
        both = " and ".join(str(path) for path in paths if path.stem == twice)
        raise storage.StorageError(f"{twice}: two results files have this name, {both}; report on them separately")


def files(
    paths: Sequence[Path],
    out: Path,
    latex_folder: Path | None = None,
    data_folder: Path | None = None,
    report: ReportPicture = lambda number, total, name: None,
    tell: Tell = lambda problem: None,
    short: bool = False,
    head: Head = PLAIN,
    read: Callable[[Path], StoredResults] = storage.read,
) -> dict[Path, bytes]:
    """Files of a report on the results files `paths`: path -> content, to be written by ``storage.write_all``.

    These are the page `out`, if `short` one printed page for each experiment, and beside it for each experiment
    ``<latex_folder>/<name>.tex`` with its tables and ``<data_folder>/<name>.csv`` with its numbers, and the further
    tables of :func:`spi.views.exports`, if the folders are given.  `read` gives the results in a file, with the looks
    that the report shows.

    A file that cannot be read or is of an unknown kind has a line on the page in place of its results.  StorageError,
    before anything is drawn, if there is no other, or if two have one name.
    """
    if latex_folder or data_folder:
        _check_names(paths)
    parts: list[_Part] = []
    problems: list[str] = []
    for path in paths:
        try:
            parts.append(_part(path, read(path), anchor(len(parts)), latex_folder, data_folder))
        except Exception as error:  # of whatever kind, since the others can be shown
            problems.append(views.problem(path, error))
    if not parts:
        raise storage.StorageError("\n".join(problems))
    for line in problems:
        tell(line)
    whole = page([one.section for one in parts], list(_pictures(parts, report, tell)), problems, short, head)
    return {out: whole.encode()} | {file: content for one in parts for file, content in one.files.items()}


class _Part(NamedTuple):
    """One file in a report, but for its picture."""

    path: Path
    results: StoredResults
    section: ReportSection
    files: dict[Path, bytes]  #: beside the page


def _part(
    path: Path, results: StoredResults, anchored: str, latex_folder: Path | None, data_folder: Path | None
) -> _Part:
    one = section(path, results, anchored)
    written: dict[Path, bytes] = {}
    if latex_folder:
        written |= {latex_folder / name: text for name, text in views.exports(results, one.name, "latex").items()}
        written[latex_folder / f"{one.name}.tex"] = latex.document(one.name, one.title, one.tables).encode()
    if data_folder:
        written |= {data_folder / name: text for name, text in views.exports(results, one.name, "csv").items()}
    return _Part(path, results, one, written)


def _pictures(parts: Sequence[_Part], report: ReportPicture, tell: Tell) -> Iterator[Markup]:
    sections = [one.section for one in parts]
    alts = [": ".join(filter(None, (one.title, one.result))) for one in sections]
    drawing = drawn([one.results for one in parts], [one.anchor for one in sections], alts)
    for number, one in enumerate(parts):
        report(number + 1, len(parts), one.path.stem)
        picture = next(drawing)
        if isinstance(picture, Exception):
            tell(line := views.problem(one.path, picture))
            picture = Markup("<p>No figure: {}</p>").format(line)
        yield picture


def anchor(number: int) -> str:
    """By which a page refers to one of its experiments, and what the ids in its figure begin with."""
    return f"e{number + 1}"


def page(
    sections: Sequence[ReportSection],
    pictures: Sequence[Markup],
    problems: Sequence[str] = (),
    short: bool = False,
    head: Head = PLAIN,
) -> str:
    """Page: HTML that refers to no other file; `problems` are lines on files that cannot be shown."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"powers": powers, "html": html}
    totals = {verdict: sum(one.verdicts.get(verdict, 0) for one in sections) for verdict in VERDICTS}
    both = list(zip(sections, pictures, strict=True))
    return environment.get_template("page.html").render(
        sections=both,
        totals=totals,
        version=__version__,
        today=date.today(),
        drafts=sum(bool(one.draft) for one in sections),
        machines=dict.fromkeys(one.machine for one in sections),
        most_rows=_MOST_ROWS,
        problems=problems,
        short=short,
        head=head,
    )
