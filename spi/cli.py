"""The command line: arguments and messages only."""

import math
import re
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

    from .run import Progress, Slice, Watch
    from .spec import Experiment
    from .workers import Workers

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


Threads = Annotated[int | None, typer.Option(help="Threads (default: all).", min=1)]
Fresh = Annotated[bool, typer.Option("--fresh", help="Begin anew; replace results of another spec.")]
MaxTime = Annotated[str | None, typer.Option(help="Stop after so long, as in 90s, 45m, 3h; the same command goes on.")]
Checkpoint = Annotated[str, typer.Option(help="Keep what is done at least this often, as in 5s, 1m.")]


@app.command()
def run(
    specs: Specs,
    profile: Profile = "laptop",
    overrides: Overrides = None,
    samples: Samples = None,
    seed: Seed = None,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
    max_time: MaxTime = None,
    checkpoint: Checkpoint = "5s",
    part: Annotated[
        str | None, typer.Option(metavar="I/N", help="Compute part I of N only; `spi merge` puts them together.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Compute in so many processes of this machine.", min=1)] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Compute on a Dask cluster, as in tcp://host:8786 or local:4.")
    ] = None,
) -> None:
    """Run experiments: write <out>/<name>.h5 and print a table."""
    experiments = _load(specs, profile, overrides, samples, seed)
    from . import run as runner

    if sum(option is not None for option in (part, workers, dask)) > 1:
        _end(INVALID, "--part, --workers and --dask exclude one another; give one of them")
    slice_ = _slice(part)
    session = _Session(threads, max_time, checkpoint)
    with _workers(workers, dask) as pool:
        for experiment in experiments:
            with _ProgressLine(experiment.name, session.stop) as line:
                if slice_ is not None:
                    path = runner.run_slice(experiment, slice_, out, fresh, line.watch, session.limits)
                else:
                    path = runner.run(experiment, out, fresh, line.watch, session.limits, pool)
            if slice_ is not None:
                typer.echo(f"wrote {path}; `spi merge {experiment.path}` puts all parts together", err=True)
            else:
                _show(path)


@app.command()
def merge(
    specs: Specs,
    profile: Profile = "laptop",
    overrides: Overrides = None,
    samples: Samples = None,
    seed: Seed = None,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
) -> None:
    """Put parts that `spi run --part` computed together: write <out>/<name>.h5 and print a table."""
    experiments = _load(specs, profile, overrides, samples, seed)
    from . import run as runner

    session = _Session(threads, None, "5s")
    for experiment in experiments:
        with _ProgressLine(experiment.name, session.stop) as line:
            path = runner.merge(experiment, out, fresh, line.watch, session.limits)
        _show(path)


@app.command()
def verify(
    file: Annotated[Path, typer.Argument(help="A results file.")],
    chunks: Annotated[int, typer.Option(help="How many chunks of paths to compute again, at random.", min=1)] = 8,
    threads: Threads = None,
) -> None:
    """Compute a random selection of the paths behind stored results again, and compare bit for bit."""
    from .printing import print_verification
    from .verification import verify

    _Session(threads, None, "5s")
    found = verify(file, chunks)
    print_verification(file, found)
    if found.different:
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


class _Session:
    """What holds for all experiments of one command: threads, limits, and how it is stopped."""

    def __init__(self, threads: int | None, max_time: str | None, checkpoint: str) -> None:
        from . import CACHE_PROBLEM
        from .ensemble import use_threads
        from .run import Limits

        most = math.inf if max_time is None else _seconds("--max-time", max_time)
        self.limits = Limits(_seconds("--checkpoint", checkpoint), most)
        if threads is not None:
            try:
                use_threads(threads)
            except ValueError as error:
                _end(INVALID, f"--threads: {error}")
        if CACHE_PROBLEM:
            typer.echo(f"spi: {CACHE_PROBLEM}; what is compiled cannot be kept for the next run", err=True)
        self.stop = _Stop()


def _seconds(option: str, text: str) -> float:
    """A time such as 90s, 45m, 3h or 1.5d."""
    found = re.fullmatch(r"([0-9]+(?:[.][0-9]+)?) *(s|m|h|d)", text.strip())
    if not found:
        _end(INVALID, f"{option}: is '{text}'; must be a number and a unit, as in 90s, 45m, 3h or 2d")
    return float(found[1]) * {"s": 1, "m": 60, "h": 3600, "d": 86400}[found[2]]


def _slice(text: str | None) -> "Slice | None":
    """Which part of how many."""
    from .run import Slice

    try:
        return None if text is None else Slice.of(text)
    except ValueError:
        _end(INVALID, f"--part: is '{text}'; must be the number of a part and how many there are, as in 1/4 .. 4/4")


@contextmanager
def _workers(size: int | None, address: str | None) -> Iterator["Workers | None"]:
    """The processes that compute, None for this one alone."""
    from . import workers

    with ExitStack() as stack:
        pool: Workers | None = None
        if size is not None:
            pool = stack.enter_context(workers.processes(size))
        elif address is not None:
            try:
                pool = stack.enter_context(workers.dask(address))
            except ImportError:
                _end(INVALID, "--dask: Dask is not installed; say pip install 'spi[dask]'")
            except (OSError, ValueError) as error:
                _end(INVALID, f"--dask: {address}: {error}; give tcp://HOST:PORT of a scheduler, or local:N")
        yield pool


def _show(path: Path) -> None:
    """Print the tables of a results file that has just been written."""
    from . import storage, views

    views.print_tables(storage.read(path))
    typer.echo(f"wrote {path}; `spi plot {path}` draws it", err=True)


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

    @property
    def watch(self) -> "Watch":
        """What a run is given to tell how far it is."""
        from .run import Watch

        return Watch(self.report, self.report_compiling, self.tell)

    def tell(self, news: str) -> None:
        (self.bar.console.print if self.bar else partial(typer.echo, err=True))(f"spi: {news}")

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
