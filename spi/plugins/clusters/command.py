"""Commands `spi merge` and `spi verify`, and the options --shard and --dask of `spi run`."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spi.cli.options import (
    CLAIM_FAILED,
    COMPUTE,
    INVALID,
    LOOK,
    RESULTS,
    Command,
    Compute,
    Fresh,
    Out,
    ResultsFile,
    ResultsFolder,
    RunOptions,
    Specs,
    Threads,
    Way,
    end,
    load,
    run_options,
    stored,
)
from spi.cli.terminal import tell

if TYPE_CHECKING:
    from spi.running.run import Limits, Watch
    from spi.specs import Experiment


@contextmanager
def _shard(text: str) -> Iterator[Compute]:
    """One shard of each experiment."""
    from spi.running.checkpoint import MOST_SHARDS, Shard

    from .running import shards

    try:
        mine = Shard.of(text)
    except ValueError:
        end(INVALID, f"--shard: is '{text}'; must be a number and a count of at most {MOST_SHARDS}, e.g. 1/4")

    def compute(experiment: "Experiment", out: Path, fresh: bool, watch: "Watch", limits: "Limits") -> None:
        folder = shards.run_shard(experiment, mine, out, fresh, watch, limits)
        tell(f"wrote shard {text} to {folder}; `spi merge` with the same spec and options merges all shards")

    yield compute


@contextmanager
def _dask(address: str) -> Iterator[Compute]:
    """All chunks on a Dask cluster."""
    from spi import DISTRIBUTION
    from spi.running.run import run
    from spi.running.workers import workers_of

    try:
        from distributed import Client

        for name in ("distributed", "distributed.client"):  # a line says the same as its tracebacks
            logging.getLogger(name).setLevel(logging.CRITICAL)
        client = Client(address)
    except ImportError:
        end(INVALID, f"--dask: Dask is not installed; run pip install '{DISTRIBUTION}[dask]'")
    except (OSError, ValueError) as error:
        end(INVALID, f"--dask: {address}: {error}; give tcp://HOST:PORT of a scheduler")
    with client, workers_of(client.get_executor()) as workers:
        yield partial(run, workers=workers)


_HELP = "Compute shard I of N only; `spi merge` puts them together."
SHARD = Way(Annotated[str | None, typer.Option(metavar="I/N", help=_HELP)], _shard)
_HELP = "Address of the scheduler of a Dask cluster."
DASK = Way(Annotated[str | None, typer.Option(metavar="ADDRESS", help=_HELP)], _dask)


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
    from spi.cli.running import prepare, show_each

    from .running import shards

    prepare(threads)
    show_each(experiments, lambda experiment, watch: shards.merge(experiment, out, fresh, watch))


@run_options()
def verify(
    source: ResultsFile,
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
    from spi import storage
    from spi.cli.progress import ProgressLine
    from spi.cli.running import any_wrong, prepare
    from spi.printing import print_safely

    from .running.verify import verify

    (file,) = stored([source], results, options)
    prepare(threads)
    with ProgressLine(file.stem) as line:

        def report(number: int, total: int, chunk: str) -> None:
            line.report_work(number, total, f"computing {chunk}")

        verification = verify(file, None if everything else chunks, report, options.trust_code)
    print_safely(f"{file}: {line}" for line in verified(verification))
    if any_wrong(file.stem, storage.read(file)) or not verification.sound:
        raise typer.Exit(CLAIM_FAILED)


def verified(check: Any) -> Iterator[str]:
    """Outcome of a check of results, a ``Verification``, line by line."""
    count = len(check.checked)
    equal = "equal to the last bit" if not check.different else f"{len(check.different)} of them different"
    if check.chunks:
        yield f"{count} of {check.chunks} chunks of paths were computed again, {equal}"
    if check.whole:
        how = "derived again from these paths" if check.chunks else "computed again, without paths"
        yield f"all numbers but times were {how}"
    if check.sums:
        yield f"all numbers were derived again from the sums over paths in {check.sums}"
    if check.sums and not check.whole:
        yield "--all computes these sums again as well"
    if not check.sums and not check.whole:
        yield "its numbers were not derived again: their sums over paths are not beside it, and --all was not given"
    yield from (f"different: {label}" for label in check.different)
    yield from (f"wrong: {label}" for label in check.wrong)
    if check.sound:
        return
    yield "what is not as it was when they were computed:"
    yield from check.causes or ("nothing that the file tells: the results, or this machine, are not to be trusted",)


MERGE = Command(merge, COMPUTE)
VERIFY = Command(verify, LOOK)
