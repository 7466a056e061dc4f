"""The command that turns stored results into a page."""

from pathlib import Path
from typing import Annotated

import typer

from .names import RESULTS, complete_results, stored
from .options import INVALID, end
from .streams import tell


def report(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE|SPEC|NAME",
            help="Results, or experiments that were run (default: all results).",
            autocompletion=complete_results,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="File name of the page.")] = Path("report.html"),
    results: Annotated[Path, typer.Option(help="Folder of results.")] = RESULTS,
    latex: Annotated[Path | None, typer.Option(help="Folder for the tables as LaTeX: <latex>/<name>.tex.")] = None,
    data: Annotated[Path | None, typer.Option(help="Folder for the curves as CSV: <data>/<name>.csv.")] = None,
) -> None:
    """Write results to one self-contained HTML page."""
    from ..report.page import files
    from ..storage import write_all
    from .progress import ProgressLine

    for option, folder in (("--latex", latex), ("--data", data)):
        if str(folder).startswith("-"):  # an option was taken for its value
            end(INVALID, f"{option}: is '{folder}'; must be a folder, e.g. {option} tables")
    wanted = sources or sorted(results.glob("*.h5"))
    if not wanted:
        end(INVALID, f"{results}: no results here; run an experiment first, or name the folder with --results")
    paths = [stored(source, results) for source in wanted]
    with ProgressLine(out.name) as line:
        written = files(paths, out, latex, data, line.report_figure)
    write_all(written)
    tell(f"wrote {out}")
    for folder in filter(None, (latex, data)):
        tell(f"wrote {len(paths)} file{'s' * (len(paths) > 1)} into {folder}")
