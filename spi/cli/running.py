"""Commands that compute: run and trace."""

import math
import re
import shlex
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..plugins import imported, offers
from .options import (
    CLAIM_FAILED,
    INVALID,
    Compute,
    Fresh,
    Out,
    RunOptions,
    SeveralSpecs,
    Threads,
    complete_spec,
    end,
    load,
    run_options,
    way_options,
)
from .showing import members
from .terminal import STOP, for_whoever_reads, tell

if TYPE_CHECKING:
    from ..running.run import Limits, Watch
    from ..specs import Experiment
    from ..storage.records import StoredResults

MaxTime = Annotated[
    str | None, typer.Option(help="Stop after this long (90s, 45m, 3h); run the same command again to resume.")
]
CheckpointTime = Annotated[str, typer.Option(help="Save progress at least this often (5s, 1m).")]


@way_options
@run_options()
def run(
    specs: SeveralSpecs = None,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
    max_time: MaxTime = None,
    checkpoint: CheckpointTime = "5s",
    workers: Annotated[int | None, typer.Option(help="Number of processes on this machine.", min=1, max=1024)] = None,
    group: Annotated[
        str | None, typer.Option(help="All experiments of a group that `spi list` shows, as paper.", metavar="WORD")
    ] = None,
    confirmed: Annotated[
        bool, typer.Option("--confirmed", help="Exit code 4 unless the results confirm every claim.")
    ] = False,
    *,
    ways: dict[str, Any],
    options: RunOptions,
) -> None:
    """Run experiments: write <out>/<name>.h5 and print a table.

    Exit code 4 if the results contradict a claim of a spec.
    """
    named = [*(specs or ()), *(members(group) if group else ())]
    if not named:
        end(
            INVALID,
            "missing argument 'SPEC'; name an experiment that `spi list` shows, or a group, see `spi run --help`",
        )
    experiments = load(named, options)
    from ..running.remarks import warnings

    if len(given := [*["workers"] * (workers is not None), *ways]) > 1:
        end(INVALID, f"{' and '.join(f'--{name}' for name in given)} exclude one another; give one of them")
    limits = limits_of(max_time, checkpoint)
    with ExitStack() as stack:
        if ways:
            ((name, value),) = ways.items()
            compute = stack.enter_context(imported(offers("ways")[name]).start(value))
        else:
            compute = stack.enter_context(_here(workers))
        prepare(threads)
        for experiment in experiments:
            for warning in warnings(experiment):
                tell(f"{experiment.called}: {warning}")
        show_each(experiments, lambda experiment, watch: compute(experiment, out, fresh, watch, limits), confirmed)


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
def _here(size: int | None) -> Iterator[Compute]:
    """Compute in this process, or in so many others of this machine."""
    from ..running.run import run
    from ..running.workers import workers_of

    with workers_of(size) as workers:
        yield partial(run, workers=workers)


def any_wrong(name: str, results: "StoredResults", confirmed: bool = False) -> bool:
    """Report the verdicts on the claims of an experiment; whether one is contradicted, or is not `confirmed`."""
    from .. import views
    from ..printing.tables import remarks
    from ..statistics.claims import CONFIRMED, CONTRADICTED

    judged = views.verdicts(results)
    for remark in remarks(name, judged):
        tell(remark)
    return any(claim.verdict == CONTRADICTED or (confirmed and claim.verdict != CONFIRMED) for claim in judged)


def show_each(
    experiments: "list[Experiment]", compute: "Callable[[Experiment, Watch], Path | None]", confirmed: bool = False
) -> None:
    """Compute each experiment, print the tables of its results, if it has any yet, and judge its claims."""
    from .. import storage, views
    from ..running.checkpoint import Stopped
    from .progress import ProgressLine

    wrong = False
    for number, experiment in enumerate(experiments, start=1):
        path = None
        try:
            with ProgressLine(experiment.name) as line:
                path = compute(experiment, line.watch)
            if path is None:
                continue
            results = storage.read(path)
            with for_whoever_reads():
                views.print_tables(results)
            wrong |= any_wrong(experiment.name, results, confirmed)
            if number == len(experiments):
                STOP.ignore()  # all is done
        except KeyboardInterrupt:
            if path is None:
                raise
            raise Stopped(
                f"stopped; the results are in {path}: run the same command again to go on from there"
            ) from None
        tell(f"results: {path}; `spi plot {shlex.quote(path.as_posix())}` draws them")
    if wrong:
        raise typer.Exit(CLAIM_FAILED)
