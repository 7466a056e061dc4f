"""States of parts taken to their end, in this process or by workers."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait

from ..kinds.state import State
from ..statistics.tallies import Chunk
from .loading import Source
from .workers import MOST_LOSSES, Workers

Tick = Callable[[int], None]  #: told the number of a part after each batch of it; whatever it raises ends the work
Task = tuple[int, Chunk]  #: the number of a part, and a chunk of it

#: Chunks that are handed to each worker at a time, so that none waits for the next.
_AHEAD = 2

#: Seconds without an answer after which it is asked whether the workers are stuck.
_PATIENCE = 10.0


def advance_here(states: Sequence[State], tick: Tick) -> None:
    """Compute all chunks in this process, on all of its threads."""
    for number, state in enumerate(states):
        tick(number)
        while True:
            _advance_chunks(number, state, state.missing(), tick)
            if not settle(state):
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
    queue, waiting = _Queue(states), dict[Future, Task]()
    losses = Counter[Task]()
    while True:
        while len(waiting) < _AHEAD * workers.size and (task := queue.next()) is not None:
            waiting[workers.submit(source, *task)] = task
        if not waiting:
            return
        lost = []
        done = wait(waiting, _PATIENCE, return_when=FIRST_COMPLETED).done
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
                raise RuntimeError(f"{losses[task]} workers were lost over the same chunk, {task}")
            waiting[workers.submit(source, *task)] = task


class _Queue:
    """Hands out the chunks of all parts, of earlier parts first."""

    def __init__(self, states: Sequence[State]) -> None:
        self.states = states
        self.left = [state.missing()[::-1] for state in states]
        self.under_way = [0] * len(states)
        self.finished = [False] * len(states)

    def next(self) -> Task | None:
        """A chunk that can be computed now; None if there is none until others are done."""
        for number, state in enumerate(self.states):
            while not (self.left[number] or self.under_way[number] or self.finished[number]):
                self.finished[number] = not settle(state)
                self.left[number] = state.missing()[::-1]
            if self.left[number]:
                self.under_way[number] += 1
                return number, self.left[number].pop()
        return None

    def done(self, number: int) -> None:
        """A chunk of a part is done."""
        self.under_way[number] -= 1


def finish(states: Sequence[State], tick: Tick) -> None:
    """Do what remains when all paths are done, in this process alone."""
    for number, state in enumerate(states):
        for more in state.plan.finish(state):
            state.more = more
            tick(number)


def settle(state: State) -> bool:
    """Ask the plan for further paths; whether it said something new."""
    more = state.plan.settle(state)
    if more is not None:
        state.more = more
    return more is not None


def _advance_chunks(number: int, state: State, missing: Sequence[Chunk], tick: Tick) -> None:
    """Compute chunks of part number `number` that are missing, from what is known of each."""
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
