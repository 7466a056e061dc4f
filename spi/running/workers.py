"""The chunks of all parts, computed in this process or by workers.

Workers are an executor of ``concurrent.futures``: here of threads with a process each, below that of Dask.
"""

import contextlib
import logging
import re
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ThreadPoolExecutor, wait
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from .. import storage
from ..ensemble.loop import limited_threads
from ..exact.work import Work, reporting_to
from ..kinds.plans import State, sums_of_chunk
from ..statistics.tallies import Chunk
from .compiling import processors
from .load import Source, plans_of
from .orphans import end_with_parent, follow_the_parent

#: A chunk whose worker was lost is handed out again at most so many times; this machine has at most so many workers.
MOST_LOSSES, MOST_WORKERS = 5, 1024

_ONE_AT_A_TIME = threading.Lock()  # parallel kernels may not be started by two threads of a process at once


def compute(source: Source, number: int, chunk: Chunk, threads: int) -> Any:
    """The sums over a chunk of plan number `number` of an experiment, with at most so many threads."""
    with _ONE_AT_A_TIME, limited_threads(threads):
        return sums_of_chunk(plans_of(source)[number], chunk)


class WorkersLost(RuntimeError):
    """No workers are left, or a chunk ends each of them."""

    @classmethod
    def over_a_chunk(cls, losses: int) -> "WorkersLost":
        """The error where a chunk was handed out as often as it may be."""
        return cls(f"{losses} workers were lost over the same paths; give fewer, with more memory")


#: The number of a plan, and work without paths in progress in it.
News = tuple[int, Work]


class Workers:
    """The base of several processes, here or elsewhere; its methods raise WorkersLost if they are gone for good."""

    def __init__(self) -> None:
        self.reports: list[News] = []  #: of work without paths

    @property
    def size(self) -> int:
        """The number of chunks that are computed at once."""
        raise NotImplementedError

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have :func:`compute` called somewhere, again where its process is lost."""
        raise NotImplementedError

    def result(self, future: Future) -> Any:
        """The result of a future that is done."""
        return future.result()

    def news(self) -> list[News]:
        """The reports of work without paths since the last call."""
        reports, self.reports = self.reports, []
        return reports

    def check(self) -> None:
        """Called when nothing was done for a while."""

    def machines(self) -> set[str]:
        """The ``storage.machine`` of all machines but this one on which they are."""
        return set()


class Processes(Workers):
    """Worker processes on this machine, among which its processors are shared out.

    A thread hands a chunk to an idle process and waits at its pipe, whose end says that the process was killed.
    """

    size: int = 0

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size
        self.threads = max(1, processors() // size)
        self.executor = ThreadPoolExecutor(size)
        self.processes: list[SpawnProcess] = []  #: all that were started
        self.idle: list[Connection] = []
        self.closed = False
        self.lock = threading.Lock()

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        return self.executor.submit(self.answer, compute, source, number, chunk, self.threads, plan=number)

    def answer(self, *call: Any, plan: int = 0) -> Any:
        """The result of a call, (function, arguments), in one of the processes; a new one where that is lost."""
        for _ in range(MOST_LOSSES + 1):
            try:
                connection = self._taken()
                connection.send(call)
                while isinstance(answer := connection.recv(), Work):
                    self.reports.append((plan, answer))
            except (EOFError, OSError):
                if self.closed:
                    break
                continue
            self.idle.append(connection)
            result, error = answer
            if error is not None:
                raise error
            return result
        raise WorkersLost.over_a_chunk(MOST_LOSSES + 1)

    def close(self) -> None:
        """End all, whatever they do."""
        with self.lock:
            self.closed = True
        for process in self.processes:
            process.kill()
            process.join()
        self.executor.shutdown(cancel_futures=True)

    def _taken(self) -> Connection:
        """The pipe to a process that is idle, or new."""
        with self.lock:
            if self.closed:
                raise EOFError
            if self.idle:
                return self.idle.pop()
            context = get_context("spawn")
            connection, theirs = context.Pipe()
            with theirs:
                process = context.Process(target=_serve, args=(theirs,), daemon=True)
                process.start()
            self.processes.append(process)
            return connection


def _serve(connection: Connection) -> None:
    """Make all calls that come, send reports of work without paths, and (result, None) or (None, error)."""
    follow_the_parent()

    def report(work: Work | None) -> None:
        if work is not None:
            connection.send(work)

    with contextlib.suppress(EOFError, OSError):  # the parent is gone
        while True:
            function, *arguments = connection.recv()
            answer: tuple[Any, Exception | None]
            try:
                with reporting_to(report):
                    answer = function(*arguments), None
            except Exception as error:
                answer = None, error
            connection.send(answer)


@contextlib.contextmanager
def processes(size: int) -> Iterator[Processes]:
    """So many worker processes on this machine, which end with the block."""
    workers = Processes(size)
    try:
        yield workers
    finally:
        workers.close()


#: Called with the number of a part after each batch of it, and while work without paths goes on; what it raises ends
#: the work.
Tick = Callable[[int], None]
Piece = tuple[int, Chunk]  #: the number of a part, and a chunk of it

#: Chunks that are handed to each worker at a time, so that none waits for the next.
_AHEAD = 2
#: Seconds without a result after which reports are shown, and the workers checked.
_PATIENCE = 0.5


def advance_here(states: Sequence[State], tick: Tick) -> None:
    """Compute all chunks in this process, on all of its threads."""
    for number, state in enumerate(states):
        tick(number)
        while True:
            _advance_chunks(number, state, state.missing(), tick)
            if not allocate(number, state, tick):
                break
            tick(number)


def advance_some_here(states: Sequence[State], pieces: Collection[Piece], tick: Tick) -> None:
    """Compute the missing ones among some chunks, and nothing that only they would lead to, in this process."""
    for number, state in enumerate(states):
        tick(number)
        _advance_chunks(number, state, [chunk for chunk in state.missing() if (number, chunk) in pieces], tick)


def advance_with(workers: Workers, source: Source, states: Sequence[State], tick: Tick) -> None:
    """Have all chunks computed by workers, of earlier parts first."""
    tick(0)
    left: list[list[Chunk] | None] = [state.missing()[::-1] for state in states]
    waiting = dict[Future, Piece]()
    while True:
        while len(waiting) < _AHEAD * workers.size and (piece := _next(states, left, waiting.values(), tick)):
            waiting[workers.submit(source, *piece)] = piece
        if not waiting:
            return
        done = wait(waiting, _PATIENCE, return_when=FIRST_COMPLETED).done
        _show(workers.news(), {number for number, _ in waiting.values()}, states, tick)
        for future in done:
            number, chunk = waiting.pop(future)
            states[number].put(chunk, workers.result(future))
            tick(number)
        if not done:
            workers.check()


def _show(news: Sequence[News], at_work: Collection[int], states: Sequence[State], tick: Tick) -> None:
    """Report the last news of the first of the parts `at_work` that have any."""
    last = {number: work for number, work in news if number in at_work}
    if last:
        state = states[min(last)]
        state.work = last[min(last)]
        try:
            tick(min(last))
        finally:
            state.work = None


def _next(
    states: Sequence[State], left: list[list[Chunk] | None], under_way: Collection[Piece], tick: Tick
) -> Piece | None:
    """Take a chunk that can be computed now out of `left`, None for a part that is done; None until others are done."""
    for number, state in enumerate(states):
        while left[number] == [] and not any(number == part for part, _ in under_way):
            left[number] = state.missing()[::-1] if allocate(number, state, tick) else None
        if chunks := left[number]:
            return number, chunks.pop()
    return None


def perform_tasks(states: Sequence[State], tick: Tick) -> None:
    """Do what remains when all paths are done, in this process alone."""
    for number, state in enumerate(states):
        with state.working(partial(tick, number)):
            for task in state.open_tasks():
                state.perform(task)
                tick(number)


def allocate(number: int, state: State, tick: Tick) -> bool:
    """Ask the plan of part number `number` for further paths; whether there is a new allocation."""
    with state.working(partial(tick, number)):
        extra = state.plan.next_allocation(state)
    if extra is not None:
        state.decide(extra)
    return extra is not None


def _advance_chunks(number: int, state: State, missing: Sequence[Chunk], tick: Tick) -> None:
    """Compute chunks of part number `number` that are missing, each from its first path that is missing."""
    with state.working(partial(tick, number)):
        for chunks in _runs(missing, state):
            for added in state.plan.advance(chunks, state.tally(chunks[0].path_set).known(chunks[0])):
                for chunk, sums in added:
                    state.put(chunk, sums)
                tick(number)


def _runs(chunks: Sequence[Chunk], state: State) -> Iterator[list[Chunk]]:
    """Chunks as runs of consecutive ones; one that is partly computed begins a run."""
    run: list[Chunk] = []
    for chunk in chunks:
        follows = run and (chunk.path_set, chunk.index) == (run[-1].path_set, run[-1].index + 1)
        if run and (not follows or state.tally(chunk.path_set).known(chunk) is not None):
            yield run
            run = []
        run.append(chunk)
    if run:
        yield run


# ---------------------------------------------------------------------------------------------------------------------
# The workers of a Dask cluster, on this machine or others.
# ---------------------------------------------------------------------------------------------------------------------


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
