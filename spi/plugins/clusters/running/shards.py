"""An experiment divided among several runs, on one machine or many, without anything that would have to schedule them.

Each run computes one shard of the chunks that are wanted for now and keeps their sums in a file of its own; merging
puts the files together.  Shards may be run in any order, at the same time or not, and again after a loss.
"""

import shlex
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from spi import specs, storage
from spi.kinds.plans import State
from spi.running.checkpoint import Limits, Shard, Stopped
from spi.running.run import NOBODY, USUAL, Session, Watch
from spi.running.workers import Piece, advance_some_here, allocate

#: The largest number of missing shards that are named.
_NAMED = 8


def run_shard(
    experiment: specs.Experiment,
    shard: Shard,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
) -> Path:
    """Compute one shard of what an experiment wants for now, and return the folder with its sums.

    With `fresh` those of an earlier run of it are not looked at.  Raises StorageError and Stopped as
    :func:`spi.running.run.run` does.
    """
    session = Session(experiment, out, fresh, watch, limits, shard)
    session.take()  # of earlier rounds
    mine = set(_shards(session.states, shard.count)[shard.number - 1])
    if not fresh:
        session.take(shard.ending)
    with session.saved_at_the_end():
        if mine.intersection(session.missing()):
            session.compile()
        advance_some_here(session.states, mine, session.batch_done)
        session.save()
    return session.store.folder


def merge(
    experiment: specs.Experiment,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
) -> Path:
    """Put the shards that :func:`run_shard` computed together, write the results file and return its path.

    Raises StorageError as ``spi.running.run.run`` does, or if there are no shards; Stopped if some are missing, or if
    a multilevel estimator, now that it knows the variances, wants further paths: then they are to be run again.
    """
    session = Session(experiment, out, fresh, watch, limits)
    session.resume()
    with session.saved_at_the_end():
        _need_all(session)
        for number, state in enumerate(session.states):
            while not state.missing() and allocate(number, state, session.batch_done):
                pass
        if left := session.missing():
            session.save()
            session.remove_shards()
            raise Stopped(
                f"all shards of this round are complete, and further chunks are needed ({len(left)}): run all shards "
                f"of {experiment.called} again, then `spi merge`"
            )
        return session.finish()


def _need_all(session: Session) -> None:
    """Raise Stopped, with the names of the shards to which missing chunks belong, if there are any."""
    missing, shards, called = set(session.missing()), session.shards(), session.experiment.called
    if not missing:
        return
    if not shards:
        raise storage.StorageError(
            f"{session.store.folder}: no shards of {called} here; "
            f"`spi run {shlex.quote(Path(called).as_posix())} --shard 1/4` computes the first of four"
        )
    count = max(shard.count for shard in shards)
    lacking = []
    for number, chunks in enumerate(_shards(session.states, count), 1):
        if left := missing.intersection(chunks):
            state = "unfinished" if Shard(number, count) in shards else "missing"
            lacking.append(f"shard {number} of {count} is {state} ({len(left)} of its {len(chunks)} chunks)")
    more = [f"and {len(lacking) - _NAMED} others"] if len(lacking) > _NAMED else []
    raise Stopped(f"{'; '.join(lacking[:_NAMED] + more)}: run it, then `spi merge` again")


def _shards(states: Sequence[State], count: int) -> list[list[Piece]]:
    """Chunks that are wanted for now, in `count` shards of about equal work: (number of a part, chunk)."""
    pieces, work = [], []
    for number, state in enumerate(states):
        for i, path_set in enumerate(state.path_sets):
            for chunk in path_set.chunks(i):
                pieces.append((number, chunk))
                work.append(chunk.blocks / path_set.chunk_blocks)
    middles = np.cumsum(work) - np.array(work) / 2
    shards: list[list[Piece]] = [[] for _ in range(count)]
    for piece, place in zip(pieces, middles / max(sum(work), 1e-300) * count, strict=True):
        shards[min(int(place), count - 1)].append(piece)
    return shards
