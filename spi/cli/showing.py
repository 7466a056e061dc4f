"""The commands that show stored results: show, plot, and as a page report."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.core import TyperCommand

from .listing import print_results
from .options import (
    FAILED,
    INVALID,
    RESULTS,
    ResultsFolder,
    RunOptions,
    Several,
    complete_results,
    end,
    run_options,
    stored,
)
from .terminal import STOP, takes_all_characters, tell

if TYPE_CHECKING:
    from ..storage.records import Results


@run_options("trust_code")
def show(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE|SPEC|NAME",
            help="A file of results, or an experiment that was run, with the options of the run (default: a list).",
            autocompletion=complete_results,
        ),
    ] = None,
    results: ResultsFolder = RESULTS,
    format: Annotated[Literal["table", "json", "csv"], typer.Option(help="Output format.")] = "table",
    *,
    options: RunOptions,
) -> None:
    """Print stored results to standard output; without a name, list what results there are."""
    from .. import storage
    from ..printing import as_csv, as_json
    from ..report import views

    if source is None:
        print_results(results)
        return
    (file,) = stored([source], results, options)
    stored_results = storage.read(file)
    with _about(file):
        if format == "table":
            views.print_tables(stored_results)
        else:
            rows = views.rows(stored_results)
            typer.echo((as_json(rows, takes_all_characters()) if format == "json" else as_csv(rows)).rstrip("\n"))


@run_options("trust_code")
def plot(
    sources: Several = None,
    results: ResultsFolder = RESULTS,
    out: Annotated[Path | None, typer.Option(help="Folder of figures (default: that of the results).")] = None,
    style: Annotated[
        Literal["screen", "paper"],
        typer.Option(help="paper: without a title, for a column; <out>/<name>_paper.pdf."),
    ] = "screen",
    width: Annotated[
        str | None, typer.Option(help="Width of a figure for a paper: one or two (columns), or e.g. 5.125in, 130mm.")
    ] = None,
    font: Annotated[
        str | None, typer.Option(help="Font of a figure for a paper: serif, sans or an installed TrueType family.")
    ] = None,
    film: Annotated[bool, typer.Option("--film", help="Also write a film of the vorticity: <out>/<name>.gif.")] = False,
    *,
    options: RunOptions,
) -> None:
    """Draw figures from stored results: <out>/<name>.pdf and .png."""
    from .. import storage
    from ..drawing import page
    from ..drawing.style import caption
    from ..report import views

    try:
        page.named(style, width, font)
    except ValueError as error:
        end(INVALID, f"--{error}")

    def draw(path: Path) -> None:
        stored_results = storage.read(path)
        with _about(path):
            figure = views.figure(stored_results, style, width, font)
        folder = out or path.parent
        for written in views.save(figure, folder, path.stem if style == "screen" else f"{path.stem}_paper"):
            tell(f"wrote {written}")
        if style == "paper":
            tell(f"caption: {caption(figure)}")
        if film:
            _write_film(path, stored_results, folder)

    _each(draw, stored(sources, results, options))


def _each(act: Callable[[Path], None], paths: Sequence[Path]) -> None:
    """Act on every file; one of several that cannot be shown has a line, and ends the command when all are done."""
    from ..report.page import problem

    if len(paths) == 1:
        act(paths[0])
        return
    codes = []
    for path in paths:
        try:
            act(path)
        except typer.Exit as ended:
            codes.append(ended.exit_code)
        except Exception as error:
            STOP.check()  # which may have become any other error
            tell(f"spi: {problem(path, error)}")
            codes.append(INVALID)
    if codes:
        raise typer.Exit(max(codes))


def _write_film(path: Path, results: "Results", folder: Path) -> None:
    from ..report import views
    from .progress import ProgressLine

    with _about(path), ProgressLine(path.stem) as line:
        moving = views.film(results)

        def frame(done: int, total: int) -> None:
            line.report_work(done + 1, total, "drawing the frames of a film")

        written = views.save_film(moving, folder, path.stem, frame)
    tell(f"wrote {written}")


#: Options of `spi report` whose value may be left out, and what it is then.
_FOLDERS = {"--latex": "tables", "--data": "curves"}
_OF_LATEX = "Folder for the tables as LaTeX, <latex>/<name>.tex; without a value tables."
_OF_DATA = "Folder for the curves as CSV, <data>/<name>.csv; without a value curves."


class Report(TyperCommand):
    """`spi report`, where an option behind which another one follows, or nothing, has its usual value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The arguments that are left, as of every command."""
        whole: list[str] = []
        for argument, follows in zip(args, [*args[1:], "-"], strict=False):
            whole += [argument, _FOLDERS[argument]] if argument in _FOLDERS and follows[:1] == "-" else [argument]
        return super().parse_args(ctx, whole)


@run_options("trust_code")
def report(
    sources: Several = None,
    results: ResultsFolder = RESULTS,
    out: Annotated[Path, typer.Option(help="File name of the page.")] = Path("report.html"),
    latex: Annotated[Path | None, typer.Option(help=_OF_LATEX)] = None,
    data: Annotated[Path | None, typer.Option(help=_OF_DATA)] = None,
    short: Annotated[bool, typer.Option("--short", help="One printed page for each experiment.")] = False,
    *,
    options: RunOptions,
) -> None:
    """Write results to one self-contained HTML page.

    A file that cannot be shown has a line there, and the exit code is 2.
    """
    from ..report.page import files
    from ..storage import write_all
    from .progress import ProgressLine

    paths = stored(sources, results, options)
    problems: list[str] = []
    with ProgressLine(out.name) as line:

        def drawing(number: int, total: int, name: str) -> None:
            line.report_work(number, total, f"drawing {name}")

        written = files(paths, out, latex, data, drawing, problems.append, short)
    STOP.check()  # what is drawn by others may turn a stop into any other error
    write_all(written)
    tell(f"wrote {out}")
    for folder in filter(None, (latex, data)):
        count = sum(file.parent == folder and file != out for file in written)
        tell(f"wrote {count} file{'s' * (count > 1)} into {folder}")
    for problem in problems:
        tell(f"spi: {problem}")
    if problems:
        raise typer.Exit(INVALID)


@contextlib.contextmanager
def _about(path: Path) -> Iterator[None]:
    """Within it an error over content that cannot be shown names the file."""
    from ..storage import StorageError

    try:
        yield
    except StorageError as error:
        end(INVALID, f"{path}: {error}")
    except ValueError as error:
        end(FAILED, f"{path}: {error}")
