"""The command line: arguments and messages only."""

import contextlib
import signal
import sys
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from . import reporting, running, starting
from .names import RESULTS, complete_results, stored
from .options import DONE, FAILED, INVALID, STOPPED, As, Overrides, Profile, Samples, Seed, Specs, Stored, end, load
from .signals import STOP
from .streams import drop_unwritable_output, takes_all_characters, tell, write_what_the_terminal_can

app = typer.Typer(
    help="A laboratory for stochastic Poisson integrators.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


_PAGE = 9.0  # inches of the height of a page's text


class Format(StrEnum):
    table = "table"
    json = "json"
    csv = "csv"


class Style(StrEnum):
    screen = "screen"
    paper = "paper"


def _version(wanted: bool) -> None:
    if wanted:
        from .. import __version__

        typer.echo(f"spi {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", "-V", "-v", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """A laboratory for stochastic Poisson integrators."""


app.command()(running.run)
app.command("list")(starting.list_)
app.command()(starting.new)
app.command()(running.merge)
app.command()(running.verify)


@app.command()
def plot(
    sources: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="FILE|SPEC|NAME",
            help="Results, or experiments that were run (default: all results).",
            autocompletion=complete_results,
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of results, and of figures (default: results; beside a FILE).")
    ] = None,
    style: Annotated[
        Style, typer.Option(help="paper: without a title, for a column; <out>/<name>_paper.pdf.")
    ] = Style.screen,
    width: Annotated[
        str | None, typer.Option(help="Width of a figure for a paper: one or two (columns), or e.g. 5.125in, 130mm.")
    ] = None,
    font: Annotated[
        str | None, typer.Option(help="Font of a figure for a paper: serif, sans or an installed TrueType family.")
    ] = None,
    film: Annotated[bool, typer.Option("--film", help="Also write a film of the vorticity: <out>/<name>.gif.")] = False,
) -> None:
    """Draw figures from stored results: <out>/<name>.pdf and .png."""
    from .. import storage
    from ..report import views
    from .progress import ProgressLine

    try:
        views.check_style(style, width, font)
    except ValueError as error:
        end(INVALID, f"--{error}")
    folder = out or RESULTS
    wanted = sources or sorted(folder.glob("*.h5"))
    if not wanted:
        end(INVALID, f"{folder}: no results here; run an experiment first, or name the folder with --out")
    for source in wanted:
        path = stored(source, folder)
        results = storage.read(path)
        with _about(path):
            figure = views.figure(results, style, width, font)
        stem = path.stem if style is Style.screen else f"{path.stem}_paper"
        for written in views.save(figure, out or path.parent, stem):
            tell(f"wrote {written}")
        if style is Style.paper:
            tell(f"caption: {views.caption(figure)}")
            if (height := figure.get_figheight()) > _PAGE:
                more = "take --width two" if figure.get_figwidth() < _PAGE / 2 else "plot fewer cases or panels"
                tell(f"spi: the figure is {height:.1f} inches high, more than a page has; {more}")
        if film:
            with _about(path), ProgressLine(path.stem) as line:
                moving = views.film(results)
                written = views.save_film(moving, out or path.parent, path.stem, line.report_frame)
            tell(f"wrote {written}")


@app.command()
def show(
    source: Stored,
    format: Annotated[Format, typer.Option(help="Output format.")] = Format.table,
) -> None:
    """Print stored results to standard output."""
    from .. import storage
    from ..printing import as_csv, as_json
    from ..report import views

    file = stored(source)
    results = storage.read(file)
    with _about(file):
        if format is Format.table:
            views.print_tables(results)
        else:
            rows = views.rows(results)
            typer.echo((as_json(rows, takes_all_characters()) if format is Format.json else as_csv(rows)).rstrip("\n"))


@app.command()
def check(
    specs: Specs,
    profile: Profile = "laptop",
    overrides: Overrides = None,
    samples: Samples = None,
    seed: Seed = None,
    kind: As = None,
) -> None:
    """Validate experiments and estimate their cost."""
    experiments = load(specs, profile, overrides, samples, seed, kind)
    from ..printing import print_cost, print_reports
    from ..running.run import cost, reports

    for experiment in experiments:
        print_cost(experiment, cost(experiment))
        print_reports(reports(experiment))


@app.command()
def model(specs: Specs, profile: Profile = "laptop", overrides: Overrides = None) -> None:
    """Print the Python source of the models of experiments."""
    from ..running.run import sources

    for experiment in load(specs, profile, overrides, None, None):
        for text in sources(experiment):
            typer.echo(text.rstrip("\n"))


@app.command()
def schema() -> None:
    """Print the JSON Schema of experiment files, for editors."""
    import json

    from ..running.run import layers

    typer.echo(json.dumps(layers().json_schema(), indent=2, ensure_ascii=not takes_all_characters()))


app.command()(reporting.report)
app.command()(starting.doctor)


@contextlib.contextmanager
def _about(path: Path) -> Iterator[None]:
    """Say which file it is whose content cannot be shown."""
    from ..storage import StorageError

    try:
        yield
    except StorageError as error:
        end(INVALID, f"{path}: {error}")
    except ValueError as error:
        end(FAILED, f"{path}: {error}")


def main() -> NoReturn:
    """The entry point: turns the errors that a person can make into one line and an exit code."""
    STOP.listen()
    write_what_the_terminal_can()
    arguments = sys.argv[1:]
    if arguments[:1] == ["help"]:  # `spi help run` means `spi run --help`
        arguments = [*arguments[1:], "--help"]
    try:
        code = _run(arguments)
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    if code == 128 + signal.SIGINT:
        STOP.ignore()
        tell("spi: stopped")
        code = STOPPED
    drop_unwritable_output()
    sys.exit(code or DONE)


def _run(arguments: list[str]) -> int:
    """The exit code of a command, which says in one line what went wrong."""
    try:
        code: int = app(arguments, standalone_mode=False, prog_name="spi")
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever reads the output has seen enough
        return FAILED
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # not only Exception: a stop within Rust may become a panic
        known = _code(error)
        if known != STOPPED:  # what is built or drawn by others may turn a stop into any other error
            STOP.check()
        if known is None:
            raise
        message = _usage(error) if isinstance(error, typer.TyperException) else str(error)
        tell(message if message.startswith("Usage") else "\n".join(f"spi: {line}" for line in message.split("\n")))
        return known


def _usage(error: typer.TyperException) -> str:
    """What is wrong with a command line; where an argument is missing, also what it should be."""
    message = error.format_message().replace("Value error, ", "")  # how pydantic begins what typer says
    argument, context = (getattr(error, name, None) for name in ("param", "ctx"))
    if not (argument and context and message.startswith("Missing argument")):
        return message
    right = argument.help.rstrip(".")
    return f"{message.rstrip('.')}: {right[0].lower()}{right[1:]}; see `{context.command_path} --help`"


def _code(error: BaseException) -> int | None:
    """The exit code of an error that has a message for people, or None."""
    if isinstance(error, typer.TyperException):
        return error.exit_code
    from ..checks.compilable import CompilationError
    from ..running.run import Stopped
    from ..running.workers import WorkersLost
    from ..specs import SpecError
    from ..storage import StorageError

    if isinstance(error, Stopped):
        return STOPPED
    if isinstance(error, SpecError | StorageError):
        return INVALID
    return FAILED if isinstance(error, OSError | CompilationError | WorkersLost) else None
