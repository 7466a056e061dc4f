"""The chunks of all parts, computed in this process or by workers: any executor of ``concurrent.futures``.

Local processes are here and Dask's in ``clusters.py``; another executor needs a class like :class:`Processes`.
"""

import contextlib
import threading
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Protocol

from ..ensemble.loop import limited_threads
from ..exact.work import Work, told
from ..kinds.plans import State, sums_of_chunk
from ..statistics.tallies import Chunk
from .compiling import processors
from .load import Source, plans_of
from .orphans import end_all, follow_the_parent

#: A chunk whose worker was lost is handed out again at most so many times; this machine has at most so many workers.
MOST_LOSSES, MOST_WORKERS = 5, 1024

_ONE_AT_A_TIME = threading.Lock()  # parallel kernels may not be started by two threads of a process at once


#: The number of a plan, and work without paths in progress in it.
News = tuple[int, Work]


def compute(
    source: Source, number: int, chunk: Chunk, threads: int, tell: Callable[[News], None] = lambda news: None
) -> Any:
    """The sums over a chunk of plan number `number` of an experiment, with at most so many threads.

    `tell` is called with the state of work without paths.
    """

    def report(work: Work | None) -> None:
        if work is not None:
            tell((number, work))

    with _ONE_AT_A_TIME, limited_threads(threads), told(report):
        return sums_of_chunk(plans_of(source)[number], chunk)


class WorkersLost(RuntimeError):
    """There is nobody left to compute, or what is to be computed ends whoever tries."""


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

    def machines(self) -> set[str]:
        """What ``storage.machine`` says of others than this one, on which they are."""

    def news(self) -> list[News]:
        """The reports of work without paths since the last call."""

    def stuck(self) -> bool:
        """Whether, after a while without an answer, none is to be expected any more."""

    def renewed(self, waiting: dict[Future, Any]) -> list[Any]:
        """Replace what was lost; of `waiting`, future -> task, takes out and returns what was lost with it."""


class Processes:
    """Worker processes on this machine, among which its processors are shared out."""

    lost: tuple[type[BaseException], ...] = (BrokenExecutor,)
    machines = staticmethod(set[str])  #: none but this one

    def __init__(self, size: int) -> None:
        self.size = size
        self.threads = max(1, processors() // size)
        self.executor = self._start()

    def submit(self, source: Source, number: int, chunk: Chunk) -> Future:
        """Have a chunk computed by one of them."""
        try:
            return self.executor.submit(compute, source, number, chunk, self.threads, _send)
        except BrokenExecutor as error:  # one was lost since anybody looked
            future: Future = Future()
            future.set_exception(error)
            return future

    def news(self) -> list[News]:
        """The reports since the last call."""
        found = []
        while self.reports.poll():
            found.append(self.reports.recv())
        return found

    def stuck(self) -> bool:
        """Whether one has ended and the executor, which is told at once, has not said so.

        One that is killed while it writes its answer leaves the executor waiting for the rest of it, and the others for
        the lock that it held.
        """
        return any(not process.is_alive() for process in list((self.executor._processes or {}).values()))

    def renewed(self, waiting: dict[Future, Any]) -> list[Any]:
        """Start all anew: when one is lost, the executor of the standard library gives up all."""
        self.close()
        self.executor = self._start()
        lost = list(waiting.values())
        waiting.clear()
        return lost

    def close(self) -> None:
        """End all, whatever they do."""
        end_all(self.executor)

    def _start(self) -> ProcessPoolExecutor:
        context = get_context("spawn")
        self.reports, theirs = context.Pipe(duplex=False)
        return ProcessPoolExecutor(self.size, mp_context=context, initializer=_begin, initargs=(theirs,))


_REPORTS: list[Connection] = []  #: of a worker process, to the one that started it


def _begin(reports: Connection) -> None:
    """The begin of a worker process."""
    follow_the_parent()
    _REPORTS.append(reports)


def _send(news: News) -> None:
    """Tell the process that started this one; so short a message is written at once, so that no lock is needed."""
    _REPORTS[0].send(news)


@contextlib.contextmanager
def processes(size: int) -> Iterator[Processes]:
    """So many worker processes on this machine, which end with the block."""
    workers = Processes(size)
    try:
        yield workers
    finally:
        workers.close()


#: Told the number of a part after each batch of it, and while work without paths goes on; what it raises ends the work.
Tick = Callable[[int], None]
Task = tuple[int, Chunk]  #: the number of a part, and a chunk of it

#: Chunks that are handed to each worker at a time, so that none waits for the next.
_AHEAD = 2
#: Seconds without an answer after which reports are read, and it is asked whether the workers are stuck.
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


def advance_some_here(states: Sequence[State], tasks: Collection[Task], tick: Tick) -> None:
    """Compute those of some chunks that are missing, and nothing that only they would lead to, in this process."""
    for number, state in enumerate(states):
        tick(number)
        _advance_chunks(number, state, [chunk for chunk in state.missing() if (number, chunk) in tasks], tick)


def advance_with(workers: Workers, source: Source, states: Sequence[State], tick: Tick) -> None:
    """Have all chunks computed by workers; what one of them loses is handed out again."""
    tick(0)
    queue, waiting = _Queue(states, tick), dict[Future, Task]()
    losses = Counter[Task]()
    while True:
        while len(waiting) < _AHEAD * workers.size and (task := queue.next()) is not None:
            waiting[workers.submit(source, *task)] = task
        if not waiting:
            return
        lost = []
        done = wait(waiting, _PATIENCE, return_when=FIRST_COMPLETED).done
        _show(workers.news(), {number for number, _ in waiting.values()}, states, tick)
        for future in done:
            number, chunk = task = waiting.pop(future)
            try:
                states[number].put(chunk, future.result())
            except workers.lost:
                lost.append(task)
                continue
            queue.done(number)
            tick(number)
        if lost or (not done and workers.stuck()):
            lost += workers.renewed(waiting)
        for task in lost:
            losses[task] += 1
            if losses[task] > MOST_LOSSES:
                raise WorkersLost(f"{losses[task]} workers were lost over the same paths; give fewer, with more memory")
            waiting[workers.submit(source, *task)] = task


def _show(news: Sequence[News], at_work: Collection[int], states: Sequence[State], tick: Tick) -> None:
    """Report the last news of the first of the parts `at_work` that have any."""
    last = {number: work for number, work in news if number in at_work}
    if last:
        number = min(last)
        states[number].work = last[number]
        try:
            tick(number)
        finally:
            states[number].work = None


class _Queue:
    """Hands out the chunks of all parts, of earlier parts first."""

    def __init__(self, states: Sequence[State], tick: Tick) -> None:
        self.states, self.tick = states, tick
        self.left = [state.missing()[::-1] for state in states]
        self.under_way = [0] * len(states)
        self.finished = [False] * len(states)

    def next(self) -> Task | None:
        """A chunk that can be computed now; None if there is none until others are done."""
        for number, state in enumerate(self.states):
            while not (self.left[number] or self.under_way[number] or self.finished[number]):
                self.finished[number] = not allocate(number, state, self.tick)
                self.left[number] = state.missing()[::-1]
            if self.left[number]:
                self.under_way[number] += 1
                return number, self.left[number].pop()
        return None

    def done(self, number: int) -> None:
        """A chunk of a part is done."""
        self.under_way[number] -= 1


def finalise(states: Sequence[State], tick: Tick) -> None:
    """Do what remains when all paths are done, in this process alone."""
    for number, state in enumerate(states):
        with state.working(partial(tick, number)):
            for extra in state.plan.finalise(state):
                state.extra = extra
                tick(number)


def allocate(number: int, state: State, tick: Tick) -> bool:
    """Ask the plan of part number `number` for further paths; whether it said something new."""
    with state.working(partial(tick, number)):
        extra = state.plan.next_allocation(state)
    if extra is not None:
        state.extra = extra
    return extra is not None


def _advance_chunks(number: int, state: State, missing: Sequence[Chunk], tick: Tick) -> None:
    """Compute chunks of part number `number` that are missing, from what is known of each."""
    with state.working(partial(tick, number)):
        for chunks in _runs(missing, state):
            for added in state.plan.advance(chunks, state.tally(chunks[0].path_set).known(chunks[0])):
                for chunk, sums in added:
                    state.put(chunk, sums)
                tick(number)


def _runs(chunks: Sequence[Chunk], state: State) -> Iterator[list[Chunk]]:
    """Chunks as runs of consecutive ones; one of which something is known begins a run."""
    run: list[Chunk] = []
    for chunk in chunks:
        follows = run and (chunk.path_set, chunk.index) == (run[-1].path_set, run[-1].index + 1)
        if run and (not follows or state.tally(chunk.path_set).known(chunk) is not None):
            yield run
            run = []
        run.append(chunk)
    if run:
        yield run
