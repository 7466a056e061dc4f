"""Commands that show stored results, and what there is: show, plot and list."""

import contextlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import typer

from ..specs.figures import read_figure
from .options import (
    INVALID,
    RESULTS,
    ResultsFolder,
    RunOptions,
    Several,
    complete_results,
    end,
    figure_options,
    found,
    of_plugins,
    run_options,
)
from .terminal import STOP, takes_all_characters, tell

if TYPE_CHECKING:
    from rich.console import Console

    from ..drawing.film import Film
    from ..running.finding import Found
    from ..storage.records import StoredResults


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
    format: Annotated[Literal["table", "json", "csv", "latex"], typer.Option(help="Output format.")] = "table",
    table: Annotated[
        str | None, typer.Option(help="A table of numbers by its name, or by that of a column (default: the main one).")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write all tables into this folder, <out>/<name>.<table>.csv, .json or .tex.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Also print tables in which a line says enough.")] = False,
    *,
    options: RunOptions,
) -> None:
    """Print stored results to standard output; without a name, list what results there are."""
    from .. import storage, views

    if source is None:
        print_results(results)
        return
    (one,) = found([source], results, options)
    file, stored_results = one.path, one.read()
    with _about(file):
        if out is not None:
            files = views.exports(stored_results, file.stem, "csv" if format == "table" else format)
            storage.write_all({out / name: content for name, content in files.items()})
            for name in files:
                tell(f"wrote {out / name}")
            if format == "latex":
                tell(f"tables of more than {views.MOST_LATEX_ROWS} rows are written as CSV or JSON only")
            return
        names = [*views.data_tables(stored_results)]
        if format == "table" and table is None:
            views.print_tables(stored_results, everything=everything)
        else:
            _print_numbers(stored_results, file.stem, format, table)
    if table is None and len(names) > 1:
        tell(f"tables of numbers: {', '.join(names)}; --table NAME prints one, --out FOLDER writes all")


def _print_numbers(results: "StoredResults", name: str, format: str, table: str | None) -> None:
    """Print a table in a format; as LaTeX without its name what is printed."""
    from .. import views
    from ..printing import as_csv, as_json

    if format == "latex":
        text = views.as_latex(results, name, views.data_table(results, table) if table else None)
    elif format == "table":
        views.print_data(views.data_table(results, table or ""))
        return
    else:
        rows = views.data_table(results, table or "").rows
        text = as_json(rows, takes_all_characters()) if format == "json" else as_csv(rows)
    typer.echo(text.rstrip("\n"))


@run_options("trust_code")
@figure_options
def plot(
    sources: Several = None,
    results: ResultsFolder = RESULTS,
    out: Annotated[Path | None, typer.Option(help="Folder of figures (default: that of the results).")] = None,
    film: Annotated[bool, typer.Option("--film", help="Also write a film of the states: <out>/<name>.gif.")] = False,
    mp4: Annotated[bool, typer.Option("--mp4", help="Also write it as <out>/<name>.mp4, by ffmpeg.")] = False,
    fps: Annotated[
        float | None, typer.Option(help="Frames of a film in a second (default: for 8 seconds).", min=0.1, max=100)
    ] = None,
    *,
    chosen: dict[str, Any],
    options: RunOptions,
) -> None:
    """Draw figures from stored results: <out>/<name>.pdf and .png."""
    from .. import views
    from ..drawing.style import caption, has_caption

    try:
        read_figure(chosen)
    except ValueError as error:
        name, _, message = str(error).partition(": ")
        end(INVALID, f"--{name.replace('_', '-')}: {message}")
    films = {"--film": "gif"} if film else {}
    films |= {"--mp4": "mp4"} if mp4 else {}
    _check_films(films, sources or (), fps)

    def draw(one: "Found") -> None:
        path, stored_results = one.path, one.read()
        with _about(path):
            words = views.chosen(stored_results, **chosen)
            figure = views.figure(stored_results, **chosen)
        folder, is_paper = out or path.parent, words.get("style") == "paper"
        for written in views.save(figure, folder, f"{path.stem}_paper" if is_paper else path.stem):
            tell(f"wrote {written}")
        if has_caption(figure):
            tell(f"caption: {caption(figure)}")
        for option, form in films.items():
            with _about(path, f"; leave out {option}"):
                moving = views.film(stored_results, **chosen)
            _write_film(path, moving, folder, form, fps)

    _each(draw, found(sources, results, options))


def _check_films(films: Mapping[str, str], sources: Sequence[Path], fps: float | None) -> None:
    """End the command, before anything is drawn, where its films, format by option, cannot be made."""
    if name := next((source for source in sources if source.suffix in (".gif", ".mp4")), None):
        option = "--mp4" if name.suffix == ".mp4" else "--film"
        end(INVALID, f"{name}: is no file of results; use {option} alone, which writes <out>/<name>{name.suffix}")
    if fps is not None and not films:
        end(INVALID, "--fps: is for films; add --film or --mp4")
    for option, form in films.items():
        from ..drawing.film import fault

        if message := fault(form):
            end(INVALID, f"{option}: {message}")


def _each(act: Callable[["Found"], None], each: Sequence["Found"]) -> None:
    """Act on all results; of several those that cannot be shown have a line, and end the command when all are done."""
    from .. import views

    if len(each) == 1:
        act(each[0])
        return
    codes = []
    for one in each:
        try:
            act(one)
        except typer.Exit as ended:
            codes.append(ended.exit_code)
        except Exception as error:
            STOP.check()  # which may have become any other error
            tell(f"spi: {views.problem(one.path, error)}")
            codes.append(INVALID)
    if codes:
        raise typer.Exit(max(codes))


def _write_film(path: Path, moving: "Film", folder: Path, form: str, fps: float | None) -> None:
    from .. import views
    from .progress import ProgressLine

    with _about(path), ProgressLine(path.stem) as line:

        def frame(done: int, total: int) -> None:
            line.report_work(done + 1, total, "drawing the frames of a film")

        written = views.save_film(moving, folder, path.stem, frame, form, fps)
    tell(f"wrote {written}")


@contextlib.contextmanager
def _about(path: Path, remedy: str = "") -> Iterator[None]:
    """Within it an error over content that cannot be shown names the file, and has a remedy behind it."""
    from ..storage import StorageError

    try:
        yield
    except (StorageError, ValueError) as error:
        end(INVALID, f"{path}: {error}{remedy}")


# ---------------------------------------------------------------------------------------------------------------------
# The command `spi list`: what there is, by groups on a terminal, and one record a line elsewhere.
# ---------------------------------------------------------------------------------------------------------------------


#: The groups of experiments, and those in them; with those of plug-ins that are here.
GROUPS = {
    "paper": "the figures of the paper, 1 to 17",
    "errors": "strong and weak errors of schemes, and what they cost",
    "dynamics": "paths, and what is known of them over time",
    **of_plugins("groups"),
    "yours": "those in the folder --experiments",
}
WORDS = ("experiments", *GROUPS, "models", "schemes", "kinds", "results")


def word(text: str) -> str:
    """A word of the command line; BadParameter if it is none of these.

    A ``Literal`` would have all of them in one line of the help text.
    """
    if text not in WORDS:
        raise typer.BadParameter(f"{text!r} is not one of {', '.join(WORDS)}.")
    return text


class ListedPart(NamedTuple):
    """A part of the list: records of one sort, the first column their names and the last one texts."""

    word: str  #: by which it is asked for
    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


def list_(
    only: Annotated[
        str | None,
        typer.Argument(
            metavar="WORD",
            parser=word,
            help=f"experiments, or a group of them: {', '.join(GROUPS)}; models, schemes, kinds or results.",
        ),
    ] = None,
    folder: Annotated[Path, typer.Option("--experiments", help="Folder with your experiments.")] = Path("experiments"),
    results: ResultsFolder = RESULTS,
) -> None:
    """List experiments, models, schemes, kinds of experiment and results.

    Without a word, on a terminal, the groups.  The experiments are those that come with spi, and those in ./experiments
    if that folder exists.  Elsewhere than on a terminal each record is one line, with its whole title.
    """
    from ..printing.text import new_console

    problems: list[str] = []
    console = new_console(None)
    if only == "results":
        print_results(results, not console.is_terminal)
        return
    parts = [part for part in _parts(only, folder, problems) if only in (None, "experiments", part.word)]
    if not console.is_terminal:
        _print_lines(console, parts)
    elif only is None:
        _print_groups(console, parts)
    else:
        for part in parts:
            _print_table(console, part)
    for problem in problems:
        tell(f"spi: {problem}")
    if problems:
        raise typer.Exit(INVALID)


def _parts(only: str | None, folder: Path, problems: list[str]) -> Iterable[ListedPart]:
    """Parts of the list, at least that which is asked for; adds the mistakes in experiments to `problems`."""
    if only in (None, "experiments", *GROUPS):
        yield from _experiments(folder, problems)
    if only in (None, "models"):
        from ..models import MODELS

        docs = {name: " ".join((cls.__doc__ or "").split("\n\n")[0].split()) for name, cls in MODELS.items()}
        fields = {name: f"parameters: {', '.join(getattr(cls, '_fields', ()))}" for name, cls in MODELS.items()}
        rows = [(name, f"{text.rstrip('.')}; {fields[name]}") for name, text in docs.items()]
        yield ListedPart("models", "models", ["name", "equations and parameters"], rows)
    if only in (None, "schemes"):
        from ..printing.text import fraction
        from ..schemes import SCHEMES

        orders = {
            name: map(fraction, (row.strong_order, row.strong_order_commuting, row.weak_order))
            for name, row in SCHEMES.items()
        }
        schemes = [(name, *orders[name], f"{row.label}; preserves {row.preserves}") for name, row in SCHEMES.items()]
        yield ListedPart("schemes", "schemes", ["name", "strong\norder", "with one\nnoise", "weak\norder", ""], schemes)
    if only in (None, "kinds"):
        from ..kinds import KINDS

        kinds = [(name, (kind.keys.Case.__doc__ or "").split("\n\n")[0]) for name, kind in KINDS.items()]
        yield ListedPart("kinds", "kinds of experiment", ["name", "results"], kinds)


def _experiments(folder: Path, problems: list[str]) -> Iterable[ListedPart]:
    """Experiments that come with spi, of the groups that are here, and those in a folder, by group."""
    from ..running import shipped
    from ..running.load import headings

    rows: dict[str, list[tuple[str, str, str]]] = {group: [] for group in GROUPS}
    for path, heading in headings(map(shipped.path_of, shipped.names()))[0].items():
        if (group := "paper" if heading.figure else heading.group) in rows:
            rows[group].append((path.stem, str(heading.figure or "-"), heading.title))
    rows["paper"].sort(key=lambda row: int(row[1]))
    if folder.is_dir() and not folder.samefile(shipped.folder()):
        others, mistakes = headings(sorted(folder.glob("*.yaml")))
        rows["yours"] = [(str(path), str(heading.figure or "-"), heading.title) for path, heading in others.items()]
        problems += mistakes
    for group, members in rows.items():
        if members:
            yield ListedPart(group, f"{group}: {GROUPS[group]}", ["name", "figure", "title"], members)


def members(group: str) -> list[Path]:
    """Experiments of a group, as `spi list` has them; those in the folder experiments as paths.

    SpecError if there is no such group, or none in it.
    """
    from ..specs import SpecError
    from ..specs.keys import suggestion

    if group not in GROUPS:
        raise SpecError(f"--group: '{group}' is not a group of experiments; {suggestion(group, GROUPS)}")
    problems: list[str] = []
    parts = _experiments(Path("experiments"), problems)
    found = [Path(row[0]) for part in parts if part.word == group for row in part.rows]
    if group == "yours" and problems:
        raise SpecError(*problems)
    if not found:
        raise SpecError("--group: there is no folder experiments with a file here; write one with `spi new`")
    return found


def print_results(folder: Path, one_line: bool = False) -> None:
    """Print the list of results in a folder, each in a few lines or in one."""
    from ..printing import print_safely, result_lines
    from ..running.finding import listed

    results, problems = listed(folder)
    if not results and not problems:
        end(INVALID, f"{folder}: no results here; run an experiment first, or name the folder with --results")
    lines = result_lines(results)
    if one_line:
        lines = (re.sub(r"\n +", "  ", "\n".join(result_lines([result]))) for result in results)
    print_safely(lines)
    for problem in problems:
        tell(f"spi: {problem}")


# ---------------------------------------------------------------------------------------------------------------------
# On a terminal and elsewhere
# ---------------------------------------------------------------------------------------------------------------------


def _print_lines(console: "Console", parts: Sequence[ListedPart]) -> None:
    """One record a line, behind the word for its part."""
    from ..printing.text import print_lines, printable

    for part in parts:
        widths = [max(map(len, column)) for column in zip(*part.rows, strict=True)]
        for row in part.rows:
            cells = [f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)]
            print_lines(console, ["  ".join([f"{part.word:<9}", *map(printable, cells)]).rstrip()])


def _print_groups(console: "Console", parts: Sequence[ListedPart]) -> None:
    """A line for each group of experiments, the names of all else, and what shows more."""
    from ..printing.text import print_lines, printable, wrapped

    groups = [part for part in parts if part.word in GROUPS]
    print_lines(console, ["experiments: `spi run NAME` runs one, `spi list paper` lists a group"])
    print_lines(console, (f"  {part.word:<10}{len(part.rows):>3}  {GROUPS[part.word]}" for part in groups))
    for part in parts[len(groups) :]:
        names = ", ".join(row[0] for row in part.rows)
        print_lines(console, [wrapped(printable(f"{part.title}: {names}"), console.width)])
    print_lines(console, ["`spi list WORD` tells more: experiments, paper, ..., models, schemes, kinds, results"])


def _print_table(console: "Console", part: ListedPart) -> None:
    """A table as wide as the terminal, whose last column wraps."""
    from rich.text import Text

    from ..printing.text import new_table

    table: Any = new_table(part.title, part.headings, left=1)
    table.columns[-1].justify, table.columns[-1].no_wrap = "left", False
    for row in part.rows:
        table.add_row(*map(Text, row))
    console.print(table)
    console.print()
