"""The commands that compute: run, merge, verify."""

import logging
import math
import re
import shlex
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import (
    CLAIM_FAILED,
    INVALID,
    RESULTS,
    Fresh,
    Out,
    ResultsFolder,
    RunOptions,
    Specs,
    Stored,
    Threads,
    complete_spec,
    end,
    load,
    run_options,
    stored,
)
from .terminal import STOP, for_whoever_reads, tell

if TYPE_CHECKING:
    from ..running.run import Limits, Watch
    from ..running.workers import Workers
    from ..specs import Experiment
    from ..storage.records import Results

MaxTime = Annotated[
    str | None, typer.Option(help="Stop after this long (90s, 45m, 3h); run the same command again to resume.")
]
Checkpoint = Annotated[str, typer.Option(help="Save progress at least this often (5s, 1m).")]


@run_options()
def run(
    specs: Specs,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
    max_time: MaxTime = None,
    checkpoint: Checkpoint = "5s",
    shard: Annotated[
        str | None, typer.Option(metavar="I/N", help="Compute shard I of N only; `spi merge` puts them together.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Number of processes on this machine.", min=1, max=1024)] = None,
    dask: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Address of the scheduler of a Dask cluster.")
    ] = None,
    confirmed: Annotated[
        bool, typer.Option("--confirmed", help="Exit code 4 unless the results confirm every claim.")
    ] = False,
    *,
    options: RunOptions,
) -> None:
    """Run experiments: write <out>/<name>.h5 and print a table.

    Exit code 4 if the results contradict a claim of a spec.
    """
    experiments = load(specs, options)
    from ..running import run as runner
    from ..running import shards
    from ..running.checkpoint import MOST_SHARDS, Shard
    from ..running.remarks import warnings
    from .progress import ProgressLine

    if sum(option is not None for option in (shard, workers, dask)) > 1:
        end(INVALID, "--shard, --workers and --dask exclude one another; give one of them")
    try:
        mine = Shard.of(shard) if shard is not None else None
    except ValueError:
        end(INVALID, f"--shard: is '{shard}'; must be a number and a count of at most {MOST_SHARDS}, e.g. 1/4")
    limits = limits_of(max_time, checkpoint)
    prepare(threads)
    for experiment in experiments:
        for warning in warnings(experiment):
            tell(f"{experiment.called}: {warning}")
    if mine is not None:
        for experiment in experiments:
            with ProgressLine(experiment.name) as line:
                folder = shards.run_shard(experiment, mine, out, fresh, line.watch, limits)
            tell(f"wrote shard {shard} to {folder}; `spi merge` with the same spec and options merges all shards")
        return
    with _workers(workers, dask) as pool:

        def compute(experiment: "Experiment", watch: "Watch") -> Path:
            return runner.run(experiment, out, fresh, watch, limits, pool)

        _show_each(experiments, compute, confirmed)


@run_options()
def merge(
    specs: Specs,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
    *,
    options: RunOptions,
) -> None:
    """Merge the shards that `spi run --shard` computed.

    Then write the results and print the table as `spi run` does.
    """
    experiments = load(specs, options)
    from ..running import shards

    prepare(threads)
    _show_each(experiments, lambda experiment, watch: shards.merge(experiment, out, fresh, watch))


@run_options()
def trace(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="SPEC|FILE",
            help="An experiment file (YAML), a name listed by `spi list`, or a file of results.",
            autocompletion=complete_spec,
        ),
    ],
    path: Annotated[
        int | None, typer.Option(help="Number of the path (default: the first that diverges).", min=0)
    ] = None,
    *,
    options: RunOptions,
) -> None:
    """Print the flows of the step in which a path became NaN or infinite.

    The paths are those of a run with this spec and these options.  A line for each flow has its time and angle, and by
    how much H and the Casimir functions have changed since the beginning of the step.  A path given by --path may stay
    finite: then the step is the one that changes a Casimir function most.
    """
    (experiment,) = load([source], options)
    from ..printing import print_safely
    from ..running import tracing
    from ..running.compiling import compile_missing
    from ..running.run import kernel_calls, plans
    from .progress import ProgressLine

    with ProgressLine(experiment.name) as line:
        found = tracing.trace(
            plans(experiment),
            path,
            lambda done, total: line.report_work(done + 1, total, "looking for a path that diverges"),
            lambda plan: compile_missing(kernel_calls([plan]), line.watch.report_compiling),
        )
        lines = [*found.lines()] if found else [f"{experiment.called}: all paths stay finite; --path looks at one"]
    print_safely(lines)


@run_options()
def verify(
    source: Stored,
    results: ResultsFolder = RESULTS,
    chunks: Annotated[int, typer.Option(help="Number of randomly chosen chunks of paths to recompute.", min=1)] = 8,
    everything: Annotated[bool, typer.Option("--all", help="Recompute all chunks, whatever --chunks says.")] = False,
    threads: Threads = None,
    *,
    options: RunOptions,
) -> None:
    """Recompute some of the paths behind stored results and compare bit for bit.

    All numbers in the file are derived again from the sums over paths, if these are next to it, or with --all from the
    paths.  The claims stored with the results are judged as well.  Exit code 4 if anything is different.

    Python code in the file, of a model that is not built in, is run only if an equal file exists at the path that the
    spec names, seen from here or from ./experiments, or with --trust-code.
    """
    from .. import storage
    from ..printing import print_safely, verified
    from ..running.verify import verify
    from .progress import ProgressLine

    (file,) = stored([source], results, options)
    prepare(threads)
    with ProgressLine(file.stem) as line:

        def report(number: int, total: int, chunk: str) -> None:
            line.report_work(number, total, f"computing {chunk}")

        verification = verify(file, None if everything else chunks, report, options.trust_code)
    print_safely(f"{file}: {line}" for line in verified(verification))
    if _any_wrong(file.stem, storage.read(file)) or not verification.sound:
        raise typer.Exit(CLAIM_FAILED)


def prepare(threads: int | None) -> None:
    """Set the number of threads, and warn before anything is compiled."""
    from .. import CACHE_PROBLEM
    from ..ensemble.loop import use_threads

    if threads is not None:
        try:
            use_threads(threads)
        except ValueError as error:
            end(INVALID, f"--threads: {error}")
    if CACHE_PROBLEM:
        tell(f"spi: {CACHE_PROBLEM}; compiled kernels cannot be saved for the next run")


def limits_of(max_time: str | None, checkpoint: str) -> "Limits":
    from ..running.run import Limits

    most = math.inf if max_time is None else _seconds("--max-time", max_time)
    return Limits(_seconds("--checkpoint", checkpoint), most)


def _seconds(option: str, text: str) -> float:
    """A time such as 90s, 45m, 3h or 1.5d."""
    match = re.fullmatch(r"([0-9]+(?:[.][0-9]+)?) *(s|m|h|d)", text.strip())
    if not match:
        end(INVALID, f"{option}: is '{text}'; must be a number and a unit, e.g. 90s, 45m, 3h or 2d")
    return float(match[1]) * {"s": 1, "m": 60, "h": 3600, "d": 86400}[match[2]]


@contextmanager
def _workers(size: int | None, address: str | None) -> Iterator["Workers | None"]:
    """The processes that compute, None for this one alone."""
    from .. import DISTRIBUTION
    from ..running.workers import workers_of

    with ExitStack() as stack:
        executor = None
        if address is not None:
            try:
                from distributed import Client

                for name in ("distributed", "distributed.client"):  # a line says the same as its tracebacks
                    logging.getLogger(name).setLevel(logging.CRITICAL)
                executor = stack.enter_context(Client(address)).get_executor()
            except ImportError:
                end(INVALID, f"--dask: Dask is not installed; run pip install '{DISTRIBUTION}[dask]'")
            except (OSError, ValueError) as error:
                end(INVALID, f"--dask: {address}: {error}; give tcp://HOST:PORT of a scheduler")
        yield stack.enter_context(workers_of(size if executor is None else executor))


def _any_wrong(name: str, results: "Results", confirmed: bool = False) -> bool:
    """Report the verdicts on the claims of an experiment; whether one is contradicted, or is not `confirmed`."""
    from .. import views
    from ..printing.tables import remarks
    from ..statistics.claims import CONFIRMED, CONTRADICTED

    judged = views.verdicts(results)
    for remark in remarks(name, judged):
        tell(remark)
    return any(claim.verdict == CONTRADICTED or (confirmed and claim.verdict != CONFIRMED) for claim in judged)


def _show_each(
    experiments: "list[Experiment]", compute: "Callable[[Experiment, Watch], Path]", confirmed: bool = False
) -> None:
    """Compute each experiment, print the tables of its results, and judge its claims."""
    from .. import storage, views
    from .progress import ProgressLine

    wrong = False
    for number, experiment in enumerate(experiments, start=1):
        with ProgressLine(experiment.name) as line:
            path = compute(experiment, line.watch)
        results = storage.read(path)
        with for_whoever_reads():
            views.print_tables(results)
        wrong |= _any_wrong(experiment.name, results, confirmed)
        if number == len(experiments):
            STOP.ignore()  # all is done
        tell(f"results: {path}; `spi plot {shlex.quote(path.as_posix())}` draws them")
    if wrong:
        raise typer.Exit(CLAIM_FAILED)
