"""States of plans, taken to their end or part of the way in this process."""

import copy
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from unittest.mock import patch

import numpy as np

from spi import storage
from spi.ensemble import loop
from spi.kinds import blocks
from spi.kinds.plans import State
from spi.plugins import installed
from spi.running import workers
from spi.running.checkpoint import sums_keys
from spi.running.load import plans

#: Fields that a clock decides: those with such ends, and those with such names.
CLOCKS, CLOCKED = ("seconds",), ("ns_per_step", "times")


def ignore(number):
    """Told how far a part is."""


@contextmanager
def batches_of(most):
    """Within it batches have so many blocks each, and those of long times one stretch from snapshot to snapshot."""

    def in_batches(state, advance, left, memory):
        while left(state) > 0:
            state = advance(state, min(most, left(state)))
            yield state

    with ExitStack() as stack:
        stack.enter_context(patch.object(blocks, "in_batches", in_batches))
        stack.enter_context(patch.object(loop, "BATCH_SECONDS", 0.0))
        yield


@contextmanager
def chunks_of(count):
    """Within it whole chunks have so many blocks each, whatever the speed; those of multilevel at least ROUND."""
    with ExitStack() as stack:
        for module in (blocks, blocks):
            stack.enter_context(patch.object(module, "chunk_blocks", lambda steps, dimension: count))
        if "dynamics" in installed():
            stack.enter_context(patch("spi.plugins.dynamics.kinds.long_paths.study.CHUNK_BLOCKS", count))
        yield


def finished(plan, most=None, state=None, tick=ignore):
    """The state of a plan at its end; `most` is the number of blocks of a batch, if it is not to be as time allows."""
    state = State(plan) if state is None else state
    with nullcontext() if most is None else batches_of(most):
        workers.advance_here([state], tick)
        workers.perform_tasks([state], tick)
    return state


def begun(plan, blocks, number=0):
    """The state after so many blocks of one path set, in one batch."""
    state = State(plan)
    with batches_of(blocks):
        for chunk, sums in next(plan.advance(state.path_sets[number].chunks(number), None)):
            state.put(chunk, sums)
    return state


def plain(state):
    """All that a state tells, by the number of a path set, and by None what it knows besides sums."""
    return {number: state.plain(number) for number in (None, *state.tallies)}


def sums_files(experiment, out):
    """The files of sums of an experiment in a folder of results."""
    store = storage.Store(Path(out) / "sums")
    paths = {store.path(key) for plan in plans(experiment) for key in sums_keys(plan).values()}
    return {path for path in paths if path.exists()}


def taken(plan, told):
    """The state that knows what another one told."""
    state = State(plan)
    for number, known in told.items():
        state.merge(number, known)
    return state


def resumed(plan, told, most=None):
    """The state at the end, from what one told on."""
    return finished(plan, most, taken(plan, told))


def snapshots(plan, most=1):
    """What the state tells at the beginning and after every batch; none of it changes any more."""
    state, found, copies = State(plan), [], []

    def tick(number):
        if state.work is None:  # while it works without paths nothing becomes known
            found.append(plain(state))
            copies.append(copy.deepcopy(found[-1]))

    finished(plan, most, state, tick)
    assert all(same_numbers(*one) for one in zip(found, copies, strict=True))
    return found


def check_going_on(plan, most=1, every=1):
    """From each snapshot, or from every so manyth and the last, the same bits follow; returns all snapshots."""
    whole, found = finished(plan), snapshots(plan, most)
    for told in [*found[::every], found[-1]]:
        kept = copy.deepcopy(told)
        assert same_numbers(resumed(plan, told), whole)
        assert same_numbers(told, kept)
    assert not same_numbers(found[0], whole)
    return found


def numbers(known):
    """All numbers but times of a state, of one that is plain, or of sums, by name."""
    if isinstance(known, State):
        known = plain(known)
    if hasattr(known, "_asdict"):
        known = known._asdict()
    if isinstance(known, dict) and None in known:
        path_sets = {f"path_set {number}": _of_a_path_set(one) for number, one in known.items() if number is not None}
        known = {"extra": known[None]["extra"], "answers": known[None]["answers"]} | path_sets
    if not isinstance(known, dict):
        return {"": np.asarray(known)}
    return {
        f"{name}/{inner}": values
        for name, one in known.items()
        if not name.endswith(CLOCKS) and name not in CLOCKED
        for inner, values in numbers(one).items()
    }


def _of_a_path_set(told):
    """What is known of a path set, by the place of its nodes, which may stand in any order."""
    tally, *_ = told["tallies"]  # the others are not wanted
    nodes = {f"node {height} {number}": sums for height, number, sums in tally["nodes"]}
    short = {f"short {index}": sums for index, sums in tally["short"]}
    return nodes | short | {f"digest {index} {paths}": text for index, paths, text in told["digests"]}


def same_numbers(a, b):
    """Whether all numbers but times are the same to the last bit, and in arrays of the same shape."""
    a, b = numbers(a), numbers(b)
    return a.keys() == b.keys() and all(_same_bits(values, b[name]) for name, values in a.items())


def _same_bits(a, b):
    return (a.dtype, a.shape) == (b.dtype, b.shape) and a.tobytes() == b.tobytes()
