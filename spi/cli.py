"""The command line: arguments and messages only."""

import signal
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

DONE, FAILED, INVALID, STOPPED = 0, 1, 2, 3

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


def _version(wanted: bool):
    if wanted:
        from . import __version__

        typer.echo(f"spi {__version__}")
        raise typer.Exit


@app.callback()
def _common(version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True)] = False):
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
):
    """Run experiments: write <out>/<name>.h5 and print a table."""
    experiments = _load(specs, profile, overrides, samples, seed)
    from . import run as runner
    from . import store, tables
    from .ensemble import use_threads

    if threads is not None:
        try:
            use_threads(threads)
        except ValueError as error:
            _end(INVALID, f"--threads: {error}")
    stop = _Stop()
    for experiment in experiments:
        with _ProgressLine(experiment.name, stop) as line:
            path = runner.run(experiment, out, fresh, line.report)
        tables.print_table(store.read(path))
        typer.echo(f"wrote {path}; `spi plot {path}` draws it", err=True)


@app.command()
def plot(
    sources: Annotated[
        list[Path] | None, typer.Argument(metavar="[FILE|SPEC...]", help="Results or experiment files (default: all).")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder of results, and of figures (default: results; beside a FILE).")
    ] = None,
):
    """Draw figures from stored results: <out>/<name>.pdf and .png."""
    from . import plot as plotter
    from . import store
    from .run import results_of

    folder = out or Path("results")
    stored = sources or sorted(p for p in folder.glob("*.h5") if not p.name.endswith(".checkpoint.h5"))
    if not stored:
        _end(INVALID, f"{folder}: no results here; run an experiment first, or name the folder with --out")
    for source in stored:
        path = results_of(source, folder) if source.suffix in (".yaml", ".yml") else source
        try:
            files = plotter.save(store.read(path), out or path.parent, path.stem)
        except ValueError as error:
            _end(FAILED, f"{path}: {error}")
        for written in files:
            typer.echo(f"wrote {written}", err=True)


@app.command()
def show(
    file: Annotated[Path, typer.Argument(help="A results file.")],
    format: Annotated[Format, typer.Option(help="How to print.")] = Format.table,
):
    """Print stored results to standard output."""
    from . import store, tables

    results = store.read(file)
    if format is Format.table:
        tables.print_table(results)
    else:
        write = tables.as_json if format is Format.json else tables.as_csv
        typer.echo(write(tables.rows(results)).rstrip("\n"))


@app.command("list")
def list_(folder: Annotated[Path, typer.Option("--experiments", help="Folder of experiments.")] = Path("experiments")):
    """List models, schemes and experiments."""
    from .models import MODELS
    from .schemes import SCHEMES
    from .spec import load
    from .tables import print_catalogue

    print_catalogue(MODELS, SCHEMES, [load(path) for path in sorted(folder.glob("*.yaml"))])


@app.command()
def check(
    specs: Specs, profile: Profile = "laptop", overrides: Overrides = None, samples: Samples = None, seed: Seed = None
):
    """Validate experiments and say what they would cost."""
    experiments = _load(specs, profile, overrides, samples, seed)
    from . import tables
    from .run import cost

    for experiment in experiments:
        tables.print_cost(experiment, cost(experiment))


@app.command()
def schema():
    """Print the JSON Schema of experiment files, for editors."""
    import json

    from .spec import json_schema

    typer.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))


def _load(specs, profile, overrides, samples, seed):
    """All experiments, before anything runs."""
    from .spec import load

    overrides = list(overrides or [])
    overrides += [f"samples={samples}"] if samples is not None else []
    overrides += [f"seed={seed}"] if seed is not None else []
    return [load(path, profile, overrides) for path in specs]


class _Stop:
    """Ctrl-C, or SIGTERM, a batch system's way to say it.

    While Numba compiles, the exception that Python raises then can get lost; so it is also remembered.
    """

    def __init__(self):
        self.wanted = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._wanted)

    def _wanted(self, *_):
        self.wanted = True
        raise KeyboardInterrupt

    def check(self):
        if self.wanted:
            raise KeyboardInterrupt


class _ProgressLine:
    """One line on a terminal: paths done, rate, time left, current standard error."""

    def __init__(self, name, stop):
        self.name = name
        self.stop = stop
        self.bar = None
        self.task = None

    def __enter__(self):
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
            self._tell_of_compilation()
        return self

    def __exit__(self, *_):
        if self.bar:
            self.bar.stop()

    def _tell_of_compilation(self):
        from . import kernels_are_cached

        if not kernels_are_cached():
            self.bar.console.print("first run: compiling, once, about 10 s for each scheme")

    def report(self, progress):
        self.stop.check()
        if not self.bar:
            return
        description = f"{self.name} {progress.part + 1}/{progress.parts} {progress.case} {progress.scheme}"
        news = "starting"
        if progress.done:
            rate = f"{progress.done / progress.seconds:.3g} paths/s, " if isinstance(progress.done, int) else ""
            news = f"{rate}standard error {progress.stderr:.1e}"
        if self.task is None or self.bar.tasks[-1].fields["part"] != progress.part:
            if self.task is not None:
                self.bar.remove_task(self.task)
            self.task = self.bar.add_task(
                description, total=progress.total, completed=progress.done, news=news, part=progress.part
            )
        self.bar.update(self.task, total=progress.total, completed=progress.done, news=news)


def _end(code, message):
    typer.echo(f"spi: {message}", err=True)
    raise typer.Exit(code)


def main():
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


def _code(error):
    """The exit code of an error that has a message for people, or None."""
    if isinstance(error, typer.TyperException):
        return error.exit_code
    from .run import Stopped
    from .spec import SpecError
    from .store import StoreError

    if isinstance(error, Stopped):
        return STOPPED
    if isinstance(error, SpecError | StoreError):
        return INVALID
    return FAILED if isinstance(error, OSError) else None
