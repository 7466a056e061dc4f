"""The normals at 10^8 draws, too many for the tests: moments, distance to the normal law, tails, and time per normal.

    python benchmarks/normals_offline.py [--draws 100000000] [--seed 1]

Takes some seconds and little memory.  Exits with 1 if a number lies outside its bound.

Supports: no page; it is for finding, and times the random numbers by themselves.

Short form: --draws 100000
"""

import argparse
import math
import sys
import time

import numpy as np

from spi.compiler.dispatch import kernel
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW, draw_increments

BOUND = 4.5  # standard errors
POWERS = 8
TAILS = np.array([1.0, 2.0, 3.0, 4.0, 4.5, 5.0, 5.5])
BINS_PER_UNIT, HALF_WIDTH = 2**17, 7  # no normal exceeds 6.77
PER_CALL = STEPS_PER_DRAW * LANES


@kernel
def survey(seed, draws, first_block, blocks, words, normals, powers, tails, above, below, histogram):
    """Add the normals of some blocks to the sums of powers, the tail counts and the histogram."""
    for block in range(first_block, first_block + blocks):
        for draw in range(draws):
            draw_increments(
                seed, np.uint64(BROWNIAN), np.uint64(0), np.uint64(draw), np.uint64(block), 1.0, words, normals, LANES
            )
            for x in normals:
                y = 1.0
                for k in range(powers.size):
                    y *= x
                    powers[k] += y
                for k in range(tails.size):
                    above[k] += x > tails[k]
                    below[k] += x < -tails[k]
                histogram[math.floor(x * BINS_PER_UNIT) + HALF_WIDTH * BINS_PER_UNIT] += 1


@kernel
def only_draw(seed, draws, blocks, words, normals):
    """As a simulation uses them: into the same small array again and again."""
    total = 0.0
    for block in range(blocks):
        for draw in range(draws):
            draw_increments(
                seed, np.uint64(BROWNIAN), np.uint64(0), np.uint64(draw), np.uint64(block), 1.0, words, normals, LANES
            )
            total += normals[0]
    return total


def upper_tail(x):
    return 0.5 * math.erfc(x / math.sqrt(2.0))


def even_moment(k):
    """E x^k of a standard normal."""
    return math.prod(range(k - 1, 0, -2)) if k % 2 == 0 else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=10**8)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    seed = np.uint64(options.seed)
    draws, blocks_per_chunk = 64, 16
    chunks = -(-options.draws // (draws * blocks_per_chunk * PER_CALL))
    n = chunks * draws * blocks_per_chunk * PER_CALL

    words, normals = np.empty(PER_CALL, np.uint64), np.empty(PER_CALL)
    above, below = np.zeros(TAILS.size, np.int64), np.zeros(TAILS.size, np.int64)
    histogram = np.zeros(2 * HALF_WIDTH * BINS_PER_UNIT, np.int64)
    sums = []  # one array per chunk, so that rounding does not build up over 10^8 additions
    for chunk in range(chunks):
        sums.append(np.zeros(POWERS))
        first = chunk * blocks_per_chunk
        survey(seed, draws, first, blocks_per_chunk, words, normals, sums[-1], TAILS, above, below, histogram)
    moments = np.sum(sums, axis=0) / n
    good = True

    print(f"{n:.4g} normals, seed {options.seed}; z = deviation in standard errors, all |z| <= {BOUND} expected\n")
    print(f"{'moment':>8} {'measured':>14} {'exact':>8} {'z':>7}")
    for k in range(1, POWERS + 1):
        z = (moments[k - 1] - even_moment(k)) / math.sqrt((even_moment(2 * k) - even_moment(k) ** 2) / n)
        good &= abs(z) <= BOUND
        print(f"{k:>8} {moments[k - 1]:>14.8f} {even_moment(k):>8} {z:>7.2f}")

    print(f"\n{'beyond':>8} {'above':>10} {'below':>10} {'expected':>12} {'z above':>8} {'z below':>8}")
    for tail, up, down in zip(TAILS, above, below, strict=True):
        expected = n * upper_tail(tail)
        error = math.sqrt(expected * (1.0 - upper_tail(tail)))
        z_up, z_down = (up - expected) / error, (down - expected) / error
        good &= max(abs(z_up), abs(z_down)) <= BOUND
        print(f"{tail:>8} {up:>10} {down:>10} {expected:>12.1f} {z_up:>8.2f} {z_down:>8.2f}")

    # Between the edges of the bins the distance can be larger by the mass of one bin, at most.
    edges = np.arange(-HALF_WIDTH * BINS_PER_UNIT, HALF_WIDTH * BINS_PER_UNIT + 1) / BINS_PER_UNIT
    law = np.array([upper_tail(-x) for x in edges])
    at_edges = np.max(np.abs(np.concatenate([[0], np.cumsum(histogram)]) / n - law))
    distance, bound = at_edges + np.max(np.diff(law)), 1.6276 / math.sqrt(n)
    good &= distance <= bound
    print(f"\nKolmogorov-Smirnov distance at most {distance:.3e}, 1 % bound {bound:.3e}, ratio {distance / bound:.2f}")

    only_draw(seed, 1, 1, words, normals)
    times = []
    for _ in range(7):
        start = time.perf_counter()
        only_draw(seed, 64, 256, words, normals)
        times.append((time.perf_counter() - start) / (64 * 256 * PER_CALL))
    start = time.perf_counter()
    np.random.default_rng(1).standard_normal(10**6)
    numpy_time = (time.perf_counter() - start) / 10**6
    print(f"\none thread: {1e9 * min(times):.2f} ns per normal (best of {len(times)}), ", end="")
    print(f"NumPy's ziggurat {1e9 * numpy_time:.2f} ns, ratio {numpy_time / min(times):.1f}")
    print("\nall within bounds" if good else "\nOUT OF BOUNDS")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
