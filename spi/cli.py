"""The command line: arguments and messages only."""

import signal
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

    from .run import Progress
    from .spec import Experiment

DONE, FAILED, INVALID, STOPPED, BROKEN = 0, 1, 2, 3, 4

app = typer.Typer(
    help="A laboratory for stochastic Poisson integrators.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class Format(StrEnum):
    table = "table"
    json = "json"
    csv = "csv"


def _version(wanted: bool) -> None:
    if wanted:
        from . import __version__

        typer.echo(f"spi {__version__}")
        raise typer.Exit


@app.callback()
def _common(version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True)] = False) -> None:
    """A laboratory for stochastic Poisson integrators."""


Specs = Annotated[list[Path], typer.Argument(metavar="SPEC...", help="Experiment files (YAML).")]
Profile = Annotated[str, typer.Option(help="laptop (the file itself), paper or quick.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the spec.")]
Samples = Annotated[str | None, typer.Option(help="Number of paths; short for --set samples=N.")]
Seed = Annotated[str | None, typer.Option(help="Seed; short for --set seed=S.")]
Out = Annotated[Path, typer.Option(help="Folder of results.")]


@app.command()
def run(
    specs: Specs,
    profile: Profile = "laptop",
    overrides: Overrides = None,
    samples: Samples = None,
    seed: Seed = None,
    threads: Annotated[int | None, typer.Option(help="Threads (default: all).", min=1)] = None,
    out: Out = Path("results"),
    fresh: Annotated[bool, typer.Option("--fresh", help="Begin anew; replace results of another spec.")] = False,
) -> None:
    """Run experiments: write <out>/<name>.h5 and print a table; exit code 4 if a claim of the spec is broken."""
    experiments = _load(specs, profile, overrides, samples, seed)
    from . import CACHE_PROBLEM, claims, storage, views
    from . import run as runner
    from .ensemble import use_threads
    from .printing.claims import remarks

    if threads is not None:
        try:
            use_threads(threads)
        except ValueError as error:
            _end(INVALID, f"--threads: {error}")
    if CACHE_PROBLEM:
        typer.echo(f"spi: {CACHE_PROBLEM}; what is compiled cannot be kept for the next run", err=True)
    stop, broken = _Stop(), False
    for experiment in experiments:
        with _ProgressLine(experiment.name, stop) as line:
            path = runner.run(experiment, out, fresh, line.report, line.report_compiling)
        results = views.expecting(storage.read(path), experiment.expect)
        views.print_tables(results)
        judged = views.verdicts(results)
        for remark in remarks(experiment.name, judged):
            typer.echo(remark, err=True)
        typer.echo(f"wrote {path}; `spi plot {path}` draws it", err=True)
        broken |= any(one.verdict == claims.BROKEN for one in judged)
    if broken:
        raise typer.Exit(BROKEN)


@app.command()
def plot(
    sources: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE|SPEC...]", help="Results or experiment files (default: all).")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of results, and of figures (default: results; beside a FILE).")
    ] = None,
) -> None:
    """Draw figures from stored results: <out>/<name>.pdf and .png."""
    from . import storage, views
    from .drawing import save
    from .run import results_of

    folder = out or Path("results")
    stored = sources or sorted(p for p in folder.glob("*.h5") if not p.name.endswith(".checkpoint.h5"))
    if not stored:
        _end(INVALID, f"{folder}: no results here; run an experiment first, or name the folder with --out")
    for source in stored:
        path = results_of(source, folder) if source.suffix in (".yaml", ".yml") else source
        try:
            files = save(views.figure(storage.read(path)), out or path.parent, path.stem)
        except ValueError as error:
            _end(FAILED, f"{path}: {error}")
        for written in files:
            typer.echo(f"wrote {written}", err=True)


@app.command()
def show(
    file: Annotated[Path, typer.Argument(help="A results file.")],
    format: Annotated[Format, typer.Option(help="How to print.")] = Format.table,
) -> None:
    """Print stored results to standard output."""
    from . import storage, views
    from .printing import as_csv, as_json

    results = storage.read(file)
    if format is Format.table:
        views.print_tables(results)
    else:
        write = as_json if format is Format.json else as_csv
        typer.echo(write(views.rows(results)).rstrip("\n"))


@app.command("list")
def list_(
    folder: Annotated[Path, typer.Option("--experiments", help="Folder of experiments.")] = Path("experiments"),
) -> None:
    """List models, schemes and experiments."""
    from .models import MODELS
    from .printing import print_catalogue
    from .run import load
    from .schemes import SCHEMES

    print_catalogue(MODELS, SCHEMES, [load(path) for path in sorted(folder.glob("*.yaml"))])


@app.command()
def check(
    specs: Specs, profile: Profile = "laptop", overrides: Overrides = None, samples: Samples = None, seed: Seed = None
) -> None:
    """Validate experiments and say what they would cost."""
    experiments = _load(specs, profile, overrides, samples, seed)
    from .printing import print_cost
    from .run import cost

    for experiment in experiments:
        print_cost(experiment, cost(experiment))


@app.command()
def schema() -> None:
    """Print the JSON Schema of experiment files, for editors."""
    import json

    from .run import layers

    typer.echo(json.dumps(layers().json_schema(), indent=2, ensure_ascii=False))


def _load(
    specs: list[Path], profile: str, overrides: list[str] | None, samples: str | None, seed: str | None
) -> list["Experiment"]:
    """All experiments, before anything runs."""
    from .run import load

    overrides = list(overrides or [])
    overrides += [f"samples={samples}"] if samples is not None else []
    overrides += [f"seed={seed}"] if seed is not None else []
    return [load(path, profile, overrides) for path in specs]


class _Stop:
    """Ctrl-C, or SIGTERM, a batch system's way to say it.

    While Numba compiles, the exception that Python raises then can get lost; so it is also remembered.
    """

    def __init__(self) -> None:
        self.wanted = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._wanted)

    def _wanted(self, *_: object) -> None:
        self.wanted = True
        raise KeyboardInterrupt

    def check(self) -> None:
        if self.wanted:
            raise KeyboardInterrupt


class _ProgressLine:
    """One line on a terminal: paths done, rate, time left, current standard error."""

    def __init__(self, name: str, stop: _Stop) -> None:
        self.name = name
        self.stop = stop
        self.bar: Bar | None = None
        self.task: TaskID | None = None

    def __enter__(self) -> "_ProgressLine":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = [
                TextColumn("{task.description}"),
                BarColumn(20),
                MofNCompleteColumn(),
                TextColumn("{task.fields[news]}"),
                TimeRemainingColumn(),
            ]
            self.bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    def report_compiling(self, number: int, total: int, name: str) -> None:
        self.stop.check()
        if self.bar:
            description = f"{self.name} compiling {number} of {total}: {name}"
            self._show(self.bar, None, description, total, number - 1, "once, some seconds for each scheme")

    def report(self, progress: "Progress") -> None:
        self.stop.check()
        if not self.bar:
            return
        description = f"{self.name} {progress.number + 1}/{progress.parts} {progress.case} {progress.part}"
        news = "starting"
        if progress.done:
            rate = f"{progress.done / progress.seconds:.3g} paths/s, " if isinstance(progress.done, int) else ""
            news = f"{rate}standard error {progress.stderr:.1e}"
        self._show(self.bar, progress.number, description, progress.total, progress.done, news)

    def _show(self, bar: "Bar", part: int | None, description: str, total: float, completed: float, news: str) -> None:
        """Show how far a part is, None for the compilation before them."""
        if self.task is None or bar.tasks[-1].fields["part"] != part:
            if self.task is not None:
                bar.remove_task(self.task)
            self.task = bar.add_task(description, part=part, total=total, completed=int(completed), news=news)
        bar.update(self.task, description=description, total=total, completed=completed, news=news)


def _end(code: int, message: str) -> NoReturn:
    typer.echo(f"spi: {message}", err=True)
    raise typer.Exit(code)


def main() -> NoReturn:
    """The entry point: turns the errors that a person can make into one line and an exit code."""
    try:
        code = app(standalone_mode=False, prog_name="spi")
    except Exception as error:
        code = _code(error)
        if code is None:
            raise
        message = error.format_message() if isinstance(error, typer.TyperException) else str(error)
        typer.echo(message if message.startswith("Usage") else f"spi: {message}", err=True)
    if code == 128 + signal.SIGINT:
        typer.echo("spi: stopped", err=True)
        code = STOPPED
    sys.exit(code or DONE)


def _code(error: Exception) -> int | None:
    """The exit code of an error that has a message for people, or None."""
    if isinstance(error, typer.TyperException):
        return error.exit_code
    from .run import Stopped
    from .spec import SpecError
    from .storage import StorageError

    if isinstance(error, Stopped):
        return STOPPED
    if isinstance(error, SpecError | StorageError):
        return INVALID
    return FAILED if isinstance(error, OSError) else None
