"""Where chunks are computed when it is not this process: any executor of ``concurrent.futures``.

Local processes and Dask are there; another engine with that interface needs a class like :class:`Processes`.
"""

import contextlib
import logging
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, Protocol

from ..ensemble.loop import limited_threads
from ..kinds.plans import sums_of_chunk
from ..statistics.tallies import Chunk
from .compiling import processors
from .loading import Source, plans_of

#: A chunk whose worker was lost is handed out again at most so many times.
MOST_LOSSES = 5

_ONE_AT_A_TIME = threading.Lock()  # parallel kernels may not be started by two threads of a process at once


def compute(source: Source, number: int, chunk: Chunk, threads: int) -> Any:
    """The sums over a chunk of plan number `number` of an experiment, with at most so many threads."""
    with _ONE_AT_A_TIME, limited_threads(threads):
        return sums_of_chunk(plans_of(source)[number], chunk)


class Workers(Protocol):
    """Several processes, here or elsewhere."""

    @property
    def size(self) -> int:
        """How many there are."""

    @property
    def lost(self) -> tuple[type[BaseException], ...]:
        """What a future raises whose worker was lost."""

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have :func:`compute` called somewhere."""

    def stuck(self) -> bool:
        """Whether, after a while without an answer, none is to be expected any more."""

    def renewed(self, waiting: dict[Future, Any]) -> list[Any]:
        """Replace what was lost; of `waiting`, future -> task, takes out and returns what was lost with it."""


class Processes:
    """Worker processes on this machine, among which its processors are shared out."""

    lost: tuple[type[BaseException], ...] = (BrokenExecutor,)

    def __init__(self, size: int) -> None:
        self.size = size
        self.threads = max(1, processors() // size)
        self.executor = self._start()

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        try:
            return self.executor.submit(compute, source, number, chunk, self.threads)
        except BrokenExecutor as error:  # one was lost since anybody looked
            future: Future = Future()
            future.set_exception(error)
            return future

    def stuck(self) -> bool:
        """Whether one has ended and the executor, which is told at once, has not said so.

        One that is killed while it writes its answer leaves the executor waiting for the rest of it, and the others for
        the lock that it held.
        """
        return any(not process.is_alive() for process in list((self.executor._processes or {}).values()))

    def renewed(self, waiting: dict[Future, Any]) -> list[Any]:
        """Start all anew: when one is lost, the executor of the standard library gives up all."""
        answers: Any = self.executor._result_queue if self.stuck() else None
        self.close()
        if answers:  # nobody is left who could write, so that the executor learns that nothing comes any more
            answers._writer.close()
        self.executor = self._start()
        lost = list(waiting.values())
        waiting.clear()
        return lost

    def close(self) -> None:
        """End all, whatever they do."""
        left = list((self.executor._processes or {}).values())  # the method for it comes with Python 3.14
        self.executor.shutdown(wait=False, cancel_futures=True)
        for process in left:
            process.terminate()

    def _start(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.size, mp_context=get_context("spawn"), initializer=_leave_signals_to_the_parent)


def _leave_signals_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


class Dask:
    """The workers of a Dask cluster, one thread each."""

    def __init__(self, client: Any) -> None:
        from distributed.scheduler import KilledWorker

        self.lost: tuple[type[BaseException], ...] = (KilledWorker,)
        self.client = client
        self.executor: Executor = client.get_executor(pure=False)

    @property
    def size(self) -> int:
        """How many threads its workers have, at the moment."""
        return max(1, sum(self.client.nthreads().values()))

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        return self.executor.submit(compute, source, number, chunk, 1)

    def stuck(self) -> bool:
        """No: a cluster sees to its own workers."""
        return False

    def renewed(self, waiting: dict[Future, Any]) -> list[Any]:
        """Nothing else: a cluster sees to its own workers."""
        return []


@contextlib.contextmanager
def processes(size: int) -> Iterator[Processes]:
    """So many worker processes on this machine, which end with the block."""
    workers = Processes(size)
    try:
        yield workers
    finally:
        workers.close()


@contextlib.contextmanager
def dask(address: str) -> Iterator[Dask]:
    """The workers of the scheduler at an address, or ``local:N`` for N of its own on this machine.

    Raises ImportError if Dask is not installed, ValueError if `address` is none, OSError if nobody answers.
    """
    import dask.config
    from distributed import Client, LocalCluster

    # A worker that is lost makes every chunk it had suspect, and four such suspicions end a chunk for good; chunks are
    # independent, so only what is lost over and over is given up (MOST_LOSSES).
    with dask.config.set({"distributed.scheduler.allowed-failures": MOST_LOSSES}), contextlib.ExitStack() as stack:
        if address.startswith("local:"):
            size = int(address.removeprefix("local:"))
            quiet = {"dashboard_address": None, "silence_logs": logging.ERROR}
            cluster = LocalCluster(n_workers=size, threads_per_worker=1, processes=True, **quiet)
            address = stack.enter_context(cluster)
        yield Dask(stack.enter_context(Client(address)))
