"""What one core can do, and what the compiler made of a kernel: bounds for the times in the table."""

import re
import time
from collections import Counter

import numpy as np

from spi.compiler.dispatch import kernel
from spi.numerics.rng import LANES, STEPS_PER_DRAW, draw_increments

_WIDTHS = {"zmm": 512, "ymm": 256, "xmm": 128}
_PACKED = re.compile(r"\bv?(?:f?n?m(?:add|sub)\d*|add|sub|mul|div|sqrt)pd\s[^\n]*?%([xyz]mm)")
_CHAIN = 8  # multiply-adds of a lane, one after the other
_CHAINED_LANES = 256  # so many that none waits for another


def best_time(work, repeats=7):
    """Processor seconds of the fastest of several repetitions; the first, which may compile, does not count."""
    work()
    best = np.inf
    for _ in range(repeats):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return best


@kernel
def multiply_and_add(x, factor, rounds):
    for _ in range(rounds):
        for lane in range(_CHAINED_LANES):
            y = x[lane]
            for _ in range(_CHAIN):
                y = y * factor + factor
            x[lane] = y


def arithmetic_peak():
    """Floating-point operations per ns of one core: multiply-adds in registers, as many as can be in flight."""
    x, rounds = np.ones(_CHAINED_LANES), 1000
    seconds = best_time(lambda: multiply_and_add(x, 0.5, rounds), 200)
    return 2e-9 * _CHAIN * _CHAINED_LANES * rounds / seconds


@kernel
def draw(draws, words, normals):
    zero = np.uint64(0)
    for n in range(draws):
        draw_increments(zero, zero, zero, np.uint64(n), zero, 1.0, words, normals, LANES)


def ns_per_normal():
    """Random numbers alone, into the same small array again and again."""
    n, draws = STEPS_PER_DRAW * LANES, 20000
    words, normals = np.empty(n, np.uint64), np.empty(n)
    return 1e9 * best_time(lambda: draw(draws, words, normals)) / (n * draws)


def vector_width(assembly):
    """(bits, share): the width of most arithmetic instructions on packed doubles, or None if there are none."""
    found = Counter(_PACKED.findall(assembly))
    if not found:
        return None
    register, times = found.most_common(1)[0]
    return _WIDTHS[register], times / found.total()
