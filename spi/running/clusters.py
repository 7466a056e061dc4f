"""The workers of a Dask cluster, on this machine or others."""

import contextlib
import logging
import re
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor, Future
from typing import Any

from .. import storage
from ..exact.work import Work, reporting_to
from ..statistics.tallies import Chunk
from .load import Source
from .orphans import end_with_parent
from .workers import MOST_LOSSES, MOST_WORKERS, Workers, WorkersLost, compute, processes

_GONE = "the scheduler of the Dask cluster does not answer any more"


class Dask(Workers):
    """The workers of a Dask cluster, one thread each."""

    def __init__(self, client: Any) -> None:
        super().__init__()
        self.client = client
        self.executor: Executor = client.get_executor(pure=False)
        self.topic = f"spi {client.id}"
        client.subscribe_topic(self.topic, self._heard)

    @property
    def size(self) -> int:
        """The number of threads of its workers, at the moment."""
        with self._reached():
            return max(1, sum(self.client.nthreads().values()))

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        with self._reached():
            return self.executor.submit(_compute, self.topic, source, number, chunk)

    def result(self, future: Future) -> Any:
        """The result of a future that is done; Dask cancels those of a scheduler that is gone."""
        from distributed.scheduler import KilledWorker

        try:
            return future.result()
        except KilledWorker as error:
            raise WorkersLost.over_a_chunk(error.allowed_failures + 1) from None
        except CancelledError:
            raise WorkersLost(_GONE) from None

    def machines(self) -> set[str]:
        """The machines of its workers, at the moment."""
        with self._reached():
            return set(self.client.run(storage.machine, on_error="ignore").values())

    def check(self) -> None:
        """Notice that the scheduler is gone for longer than Dask waits for it; to the workers it sees itself."""
        if self.client.status in ("closing", "closed"):
            raise WorkersLost(_GONE)

    def _heard(self, event: tuple[float, Any]) -> None:
        _, (number, *work) = event
        self.reports.append((number, Work(*work)))

    @contextlib.contextmanager
    def _reached(self) -> Iterator[None]:
        """Within it all that is raised because the scheduler is gone becomes one error with a line."""
        try:
            yield
        except Exception as error:
            if isinstance(error, OSError):
                raise WorkersLost(_GONE) from None
            self.check()
            raise


def _compute(topic: str, source: Source, number: int, chunk: Chunk) -> Any:
    """The sums over a chunk, in a worker, which logs its work without paths for the client."""
    from distributed import get_worker

    def report(work: Work | None) -> None:
        if work is not None:
            title, *seconds = work
            get_worker().log_event(topic, (number, title, *map(float, seconds)))

    with reporting_to(report):
        return compute(source, number, chunk, 1)


@contextlib.contextmanager
def _without_its_log() -> Iterator[None]:
    """Within it Dask logs nothing: a line says the same as its tracebacks, as of a scheduler that is gone."""
    logs = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [log.level for log in logs]
    for log in logs:
        log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        for log, level in zip(logs, levels, strict=True):
            log.setLevel(level)


@contextlib.contextmanager
def connected(address: str) -> Iterator[Dask]:
    """The workers of the scheduler at an address, or ``local:N`` for N of its own on this machine.

    Raises ImportError if Dask is not installed, ValueError if `address` is none, OSError if nobody answers.
    """
    import dask.config
    from distributed import Client, LocalCluster

    # A worker that is lost makes all its chunks suspect, and four suspicions end one; but chunks are independent.
    settings: dict[str, Any] = {f"distributed.{role}.http.routes": [] for role in ("scheduler", "worker")}  # no pages
    settings["distributed.scheduler.allowed-failures"] = MOST_LOSSES
    with _without_its_log(), dask.config.set(settings), contextlib.ExitStack() as stack:
        if address.startswith("local:"):
            size = int(address[6:]) if re.fullmatch("local:[0-9]{1,9}", address) else 0
            if not 1 <= size <= MOST_WORKERS:
                raise ValueError(f"N must be from 1 to {MOST_WORKERS}")
            quiet: Any = {"scheduler_kwargs": {"dashboard_address": "127.0.0.1:0"}, "dashboard_address": None}
            quiet |= {"silence_logs": logging.ERROR, "threads_per_worker": 1, "processes": True}
            client = stack.enter_context(Client(stack.enter_context(LocalCluster(n_workers=size, **quiet))))
            client.register_worker_callbacks(end_with_parent)
        else:
            client = stack.enter_context(Client(address))
        yield Dask(client)


def workers_of(place: int | str | None) -> contextlib.AbstractContextManager[Workers | None]:
    """So many processes on this machine, the cluster at an address as in :func:`connected`, or None for neither."""
    if place is None:
        return contextlib.nullcontext()
    return connected(place) if isinstance(place, str) else processes(place)
