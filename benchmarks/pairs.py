"""One scheme on one model: compiled, and timed beside its naive twin.

Ours counts everything a path needs: random numbers, increments, angle checks.
"""

import math
import time
from typing import NamedTuple

import generic
import naive
import numba
import numpy as np
from examples import STEP, example, row
from machine import vector_width

from spi.ensemble.increments import RandomStream
from spi.ensemble.loop import empty_report, for_kernels, grid, integrate, states_at, use_threads
from spi.ensemble.observer import last_states_only
from spi.ensemble.protocol import noises
from spi.ensemble.scheme_protocol import tosses
from spi.numerics.rng import BROWNIAN, LANES

REPEATS = 9
SECONDS = 0.012  # of one repetition, about
BLOCKS = 8
PATHS = 64  # of the naive twins
_MOST_STEPS = 2**13
THREADS = min(2, numba.config.NUMBA_NUM_THREADS)


class Times(NamedTuple):
    """ns per step and path."""

    one_thread: float
    more_threads: float
    naive: float  # on one thread; NaN if there is no twin


def our_work(scheme, model, initial, steps, *, h=STEP, truncate=False, blocks=BLOCKS):
    """A function that runs the bare ensemble at one step size."""
    noise, report = RandomStream(np.uint64(1), np.uint64(BROWNIAN)), empty_report(blocks, 1)
    times = grid(h, steps, truncate=truncate)
    start, nothing = states_at(initial, scheme, model, times, blocks), last_states_only(times)
    records = for_kernels(scheme, model, start, times)
    return lambda: integrate(*records[:2], start.copy(), records[3], noise, nothing, report, 0, blocks * LANES)


class Pair:
    """Both kernels of a model and a scheme, compiled."""

    def __init__(self, model_name, scheme_name):
        model, initial = example(model_name)
        entry = row(scheme_name)
        known = set(integrate.signatures)
        self.ours = lambda steps: our_work(entry.record, model, initial, steps, truncate=entry.needs_truncation)
        self.ours(4)()
        (signature,) = set(integrate.signatures) - known
        self.width = vector_width(integrate.inspect_asm(signature))
        self.twin, self.naive = naive_work(model_name, scheme_name, entry.record, model, initial)
        if self.naive:
            self.naive(4)()

    def times(self):
        """The best of several repetitions, interleaved because the machine is noisy."""
        ours = sized(self.ours)
        path_steps, naive_path_steps = BLOCKS * LANES * ours.steps, 1
        if self.naive:
            twin = sized(self.naive)
            naive_path_steps = PATHS * twin.steps
        best = [math.inf] * 3
        for _ in range(REPEATS):
            for i, threads in enumerate((1, THREADS)):
                use_threads(threads)
                best[i] = min(best[i], seconds(ours.work))
            use_threads(1)
            best[2] = min(best[2], seconds(twin.work)) if self.naive else math.nan
        sizes = path_steps, path_steps, naive_path_steps
        return Times(*(1e9 * s / n for s, n in zip(best, sizes, strict=True)))


def naive_work(model_name, scheme_name, scheme, model, initial):
    """("hand" or "generic", a function steps -> work) of the naive twin, or (None, None)."""
    by_hand, m = naive.STEPS.get((model_name, scheme_name)), noises(model)
    if by_hand:
        loop, (parameters, start) = naive.loop(by_hand, m), naive.arguments(model_name, model, initial)
        out = np.empty((PATHS, len(start)), type(start[0]))
        return "hand", lambda steps: lambda: loop(parameters, STEP, start, PATHS, steps, out)
    step = generic.twin(scheme, model)
    if step is None:
        return None, None
    loop, out = generic.loop(step, m, bool(tosses(scheme))), np.empty((PATHS, len(initial)))
    return "generic", lambda steps: lambda: loop(scheme, model, STEP, initial, PATHS, steps, out)


class Sized(NamedTuple):
    """Work that takes about SECONDS."""

    steps: int
    work: object


def sized(make):
    use_threads(1)
    steps = 64
    while min(seconds(make(steps)) for _ in range(2)) < 0.7 * SECONDS and steps < _MOST_STEPS:
        steps *= 2
    return Sized(steps, make(steps))


def seconds(work):
    began = time.perf_counter()
    work()
    return time.perf_counter() - began
