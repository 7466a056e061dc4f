"""Command `spi report`."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from spi.cli.options import INVALID, LOOK, RESULTS, Command, ResultsFolder, RunOptions, Several, found, run_options
from spi.cli.terminal import STOP, tell

#: Options of `spi report` whose value may be left out, and what it is then.
_FOLDERS = {"--latex": "tables", "--data": "curves"}
_OF_LATEX = "Folder for the tables as LaTeX, <latex>/<name>.tex, ...; without a value tables."
_OF_DATA = "Folder for all numbers as CSV, <data>/<name>.csv, ...; without a value curves."


class ReportCommand(TyperCommand):
    """`spi report`, where an option behind which another one follows, or nothing, has its usual value."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Arguments that are left, as of every command."""
        whole: list[str] = []
        for argument, follows in zip(args, [*args[1:], "-"], strict=False):
            whole += [argument, _FOLDERS[argument]] if argument in _FOLDERS and follows[:1] == "-" else [argument]
        return super().parse_args(ctx, whole)


def write_report(paths: Sequence[Path], out: Path, **how: Any) -> tuple[Collection[Path], list[str]]:
    """Write the files of a report, see ``views.page.files``, with a line of progress: these, and what is not shown."""
    from spi.cli.progress import ProgressLine
    from spi.storage import write_all

    from .views.page import files

    problems: list[str] = []
    with ProgressLine(out.name) as line:

        def drawing(number: int, total: int, name: str) -> None:
            line.report_work(number, total, f"drawing {name}")

        written = files(paths, out, report=drawing, tell=problems.append, **how)
    STOP.check()  # what is drawn by others may turn a stop into any other error
    write_all(written)
    return written, problems


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
    each = found(sources, results, options)
    read = {one.path: one.read for one in each}  # with the looks that the spec file has now
    written, problems = write_report(
        [*read], out, latex_folder=latex, data_folder=data, short=short, read=lambda path: read[path]()
    )
    tell(f"wrote {out}")
    for folder in filter(None, (latex, data)):
        count = sum(file.parent == folder and file != out for file in written)
        tell(f"wrote {count} file{'s' if count > 1 else ''} into {folder}")
    for problem in problems:
        tell(f"spi: {problem}")
    if problems:
        raise typer.Exit(INVALID)


COMMAND = Command(report, LOOK, cls=ReportCommand)
