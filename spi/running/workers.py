"""Chunks of all parts, computed in this process or by workers.

Workers are an executor of ``concurrent.futures``: one of threads with a process each, or any that a user hands in.
"""

import contextlib
import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any

from .. import storage
from ..ensemble.loop import limited_threads
from ..kinds.plans import State, sums_of_chunk
from ..statistics.tallies import Chunk
from .compiling import processors
from .load import SpecSource, plans_of
from .orphans import follow_the_parent

#: A chunk whose worker was lost is handed out again at most so many times; this machine has at most so many workers.
MOST_LOSSES, MOST_WORKERS = 5, 1024

_ONE_AT_A_TIME = threading.Lock()  # parallel kernels may not be started by two threads of a process at once


def compute(source: SpecSource, number: int, chunk: Chunk, threads: int) -> Any:
    """Sums over a chunk of plan number `number` of an experiment, with at most so many threads."""
    with _ONE_AT_A_TIME, limited_threads(threads):
        return sums_of_chunk(plans_of(source)[number], chunk)


class WorkersLost(RuntimeError):
    """No workers are left, or a chunk ends each of them."""

    @classmethod
    def over_a_chunk(cls, losses: int) -> "WorkersLost":
        """Error where a chunk was handed out as often as it may be."""
        return cls(f"{losses} workers were lost over the same paths; give fewer, with more memory")


class Workers:
    """Base of several processes, here or elsewhere; its methods raise WorkersLost if they are gone for good."""

    size: int  #: the number of chunks that are computed at once

    def __init__(self) -> None:
        self.machines = set[str]()  #: the ``storage.machine`` of those that computed, where it may be another than here

    def submit(self, source: SpecSource, number: int, chunk: Chunk) -> Future:
        """Have :func:`compute` called somewhere, again where its process is lost."""
        raise NotImplementedError

    def result(self, future: Future) -> Any:
        """Result of a future that is done."""
        return future.result()


class Processes(Workers):
    """Worker processes on this machine, among which its processors are shared out.

    A thread hands a chunk to an idle process and waits at its pipe, whose end says that the process was killed.
    """

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size
        self.threads = max(1, processors() // size)
        self.executor = ThreadPoolExecutor(size)
        self.processes: list[SpawnProcess] = []  #: all that were started
        self.idle: list[Connection] = []
        self.closed = False
        self.lock = threading.Lock()

    def submit(self, source: SpecSource, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        return self.executor.submit(self.answer, compute, source, number, chunk, self.threads)

    def answer(self, *call: Any) -> Any:
        """Result of a call, (function, arguments), in one of the processes; a new one where that is lost."""
        for _ in range(MOST_LOSSES + 1):
            try:
                connection = self._taken()
                connection.send(call)
                answer = connection.recv()
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
        """Pipe to a process that is idle, or new."""
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
    """Make all calls that come, and send (result, None) or (None, error)."""
    follow_the_parent()
    with contextlib.suppress(EOFError, OSError):  # the parent is gone
        while True:
            function, *arguments = connection.recv()
            connection.send(_answer(function, *arguments))


def _answer(function: Callable[..., Any], *arguments: Any) -> tuple[Any, Exception | None]:
    """(result, None) or (None, error) of a call."""
    try:
        return function(*arguments), None
    except Exception as error:
        return None, error


@contextlib.contextmanager
def processes(size: int) -> Iterator[Processes]:
    """So many worker processes on this machine, which end with the block."""
    workers = Processes(size)
    try:
        yield workers
    finally:
        workers.close()


class ExecutorWorkers(Workers):
    """Workers of any executor of ``concurrent.futures``; each of its calls is one chunk, on one thread.

    An executor does not say how many calls it makes at once, so it has as many chunks as the largest would need.
    """

    size = MOST_WORKERS

    def __init__(self, executor: Executor) -> None:
        super().__init__()
        self.executor = executor

    def submit(self, source: SpecSource, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        with self._or_lost():
            return self.executor.submit(_compute, source, number, chunk)

    def result(self, future: Future) -> Any:
        """Result of a future that is done."""
        with self._or_lost():
            (result, error), machine = future.result()
        self.machines.add(machine)
        if error is not None:
            raise error
        return result

    @contextlib.contextmanager
    def _or_lost(self) -> Iterator[None]:
        """Within it all errors are those of the executor, as where its processes were killed."""
        try:
            yield
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".rstrip(": ").splitlines()[0]
            raise WorkersLost(f"the executor lost its workers ({reason})") from error


def _compute(source: SpecSource, number: int, chunk: Chunk) -> tuple[tuple[Any, Exception | None], str]:
    """Answer of :func:`compute`, so that what the call raises is an error of the executor, and the machine."""
    return _answer(compute, source, number, chunk, 1), storage.machine()


#: Called with the number of a part after each batch of it, and while work without paths goes on; what it raises ends
#: the work.
Tick = Callable[[int], None]
Piece = tuple[int, Chunk]  #: the number of a part, and a chunk of it

#: Chunks that are handed to each worker at a time, so that none waits for the next.
_AHEAD = 2
#: Seconds after which waiting for a result begins anew, since it cannot be interrupted everywhere.
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


def advance_with(workers: Workers, source: SpecSource, states: Sequence[State], tick: Tick) -> None:
    """Have all chunks computed by workers, of earlier parts first."""
    tick(0)
    left: list[list[Chunk] | None] = [state.missing()[::-1] for state in states]
    waiting = dict[Future, Piece]()
    try:
        while True:
            while len(waiting) < _AHEAD * workers.size and (piece := _next(states, left, waiting.values(), tick)):
                waiting[workers.submit(source, *piece)] = piece
            if not waiting:
                return
            done = wait(waiting, _PATIENCE, return_when=FIRST_COMPLETED).done
            for future in sorted(done, key=_has_failed):  # what is there is not lost with those that fail
                number, chunk = waiting.pop(future)
                states[number].put(chunk, workers.result(future))
                tick(number)
    finally:
        for future in waiting:  # the executor may live on
            future.cancel()


def _has_failed(future: Future) -> bool:
    return future.cancelled() or future.exception() is not None


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


def workers_of(asked: int | Executor | None) -> contextlib.AbstractContextManager[Workers | None]:
    """So many processes on this machine, those behind an executor, or None for neither."""
    if isinstance(asked, Executor):
        return contextlib.nullcontext(ExecutorWorkers(asked))
    return contextlib.nullcontext() if asked is None else processes(asked)
