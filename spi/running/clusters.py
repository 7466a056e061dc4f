"""The workers of a Dask cluster, on this machine or others."""

import contextlib
import logging
import re
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor, Future
from functools import partial
from typing import Any

from .. import storage
from ..exact.work import Work
from ..statistics.tallies import Chunk
from .load import Source
from .orphans import end_with_parent
from .workers import MOST_LOSSES, MOST_WORKERS, News, WorkersLost, compute

_GONE = "the scheduler of the Dask cluster does not answer any more"


class Dask:
    """The workers of a Dask cluster, one thread each."""

    def __init__(self, client: Any) -> None:
        from distributed.scheduler import KilledWorker

        self.lost: tuple[type[BaseException], ...] = (KilledWorker, CancelledError)  # with a worker, or the scheduler
        self.client = client
        self.executor: Executor = client.get_executor(pure=False)
        self.reports: list[News] = []
        self.topic = f"spi {client.id}"
        client.subscribe_topic(self.topic, self._hear)

    @property
    def size(self) -> int:
        """How many threads its workers have, at the moment."""
        with self._asked():
            return max(1, sum(self.client.nthreads().values()))

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        with self._asked():
            return self.executor.submit(compute, source, number, chunk, 1, partial(_log, self.topic))

    def machines(self) -> set[str]:
        """Those of its workers, at the moment."""
        with self._asked():
            return set(self.client.run(storage.machine, on_error="ignore").values())

    def news(self) -> list[News]:
        """The reports since the last call."""
        count = len(self.reports)  # another thread adds to them
        found, self.reports[:count] = self.reports[:count], []
        return found

    def stuck(self) -> bool:
        """Whether the scheduler is gone for longer than Dask waits for it; to the workers it sees itself."""
        return self.client.status in ("closing", "closed")

    def renewed(self, waiting: dict[Future, Any]) -> list[Any]:
        """Nothing else, unless the scheduler is gone."""
        if self.stuck():
            raise WorkersLost(_GONE)
        return []

    def _hear(self, event: tuple[float, Any]) -> None:
        _, (number, *work) = event
        self.reports.append((number, Work(*work)))

    @contextlib.contextmanager
    def _asked(self) -> Iterator[None]:
        """Within it what is raised because the scheduler is gone becomes one error with a line."""
        try:
            yield
        except Exception as error:
            if isinstance(error, OSError) or self.stuck():
                raise WorkersLost(_GONE) from None
            raise


def _log(topic: str, news: News) -> None:
    """Tell a client, from a worker, of work without paths."""
    from distributed import get_worker

    number, (title, *seconds) = news
    get_worker().log_event(topic, (number, title, *map(float, seconds)))


@contextlib.contextmanager
def _without_its_log() -> Iterator[None]:
    """Within it Dask logs nothing: what it says with a traceback, as of a scheduler that is gone, is told in a line."""
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
    settings: dict[str, Any] = {f"distributed.{one}.http.routes": [] for one in ("scheduler", "worker")}  # no pages
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
