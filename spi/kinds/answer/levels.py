"""The paths of an answer: those of a difference between neighbouring levels, and those of one level alone."""

import math
from typing import Any

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, PAIRS_REVERSED, grid
from spi.ensemble.points import dimensions_of
from spi.ensemble.streams import RandomStream
from spi.kinds.samples import Sample
from spi.numerics.rng import ANSWERS, LANES
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS
from spi.schemes import typical_ns
from spi.schemes.splitting import has_antithetic_path

from .keys import FINEST

LEVELS = FINEST + 1  #: levels 0, ..., FINEST
ALONG = 2 * LEVELS  #: behind differences and values, the path sets of values along quasi-random points
AGAINST = 3 * LEVELS  #: behind these, those of differences from the reference scheme on the same noise
SETS = 4 * LEVELS  #: path sets of a scheme

#: What a path costs besides its steps, its beginning and phi at its end, and the sums over a quantity of a function;
#: measured, of typical speed.
PATH_NS, SUM_NS = 25.0, 15.0

#: The quantities of a path set: DIFFERENCE, at the fine step minus at the coarse one, and VALUE, at the fine step on
#: one path; of a level alone the value only.  From a reference scheme DIFFERENCE is that at the fine step, VALUE how
#: much less it is than at the coarse one.
DIFFERENCE, VALUE = range(2)


def paths_of_set(case: Any, row: Any, number: int) -> Sample:
    """Those of path set number `number` of all: of scheme number // SETS, whose row of the table is `row`."""
    own, record = number % SETS, row.record
    level, alone = own % LEVELS, own >= LEVELS  # along points or not
    shape: dict[str, Any] = {"doublings": (0,)}
    weights = [[1.0]]
    if not alone and has_antithetic_path(record):
        shape = {"doublings": (0, 0, 1, 1), "reversals": (AS_TOSSED, PAIRS_REVERSED, AS_TOSSED, COINS_TURNED)}
        weights = [[0.5, 0.5, -0.5, -0.5], [1.0, 0.0, 0.0, 0.0]]
    elif own >= AGAINST:
        shape = {"doublings": (0, 1)}
        weights = [[1.0, 0.0, -1.0, 0.0], [1.0, -1.0, -1.0, 1.0]]
    elif not alone:
        shape = {"doublings": (0, 1)}
        weights = [[1.0, -1.0], [1.0, 0.0]]
    steps, h = 2**level, case.final_time / 2.0**level
    records = [record, case.row(case.reference_scheme).record] if own >= AGAINST and case.reference_scheme else [record]
    terms = fourier_terms(case.model, records, h, areas=case.areas)
    times = grid(h, steps, by_reference=(0,) * len(shape["doublings"]), area_terms=terms, **shape)
    stream = RandomStream(np.uint64(case.seed), np.uint64(ANSWERS + 2 * number))
    return Sample.of(times, stream, weights)


def seconds_of(case: Any, row: Any, sample: Sample) -> float:
    """Of one sample of a path set, by one thread of typical speed."""
    quantities, count = sample.weights.shape
    besides = PATH_NS * count + SUM_NS * quantities * len(case.functions)
    return 1e-9 * (typical_ns(row, case.model) * sample.steps + besides)


def most_points(row: Any, model: Any) -> int:
    """Up to which level a scheme can follow quasi-random points."""
    return sum(dimensions_of(row.record, None, model, 2**level)[1] <= MOST_DIMENSIONS for level in range(LEVELS)) - 1


def power_of_two(paths: float) -> int:
    """So many paths as there may be along points, at least."""
    return max(LEAST_PATHS, 1 << math.ceil(math.log2(max(paths, 1.0))))


def whole_blocks(paths: np.ndarray, least: int) -> np.ndarray:
    """Numbers of paths as multiples of so many blocks, 0 where there are none."""
    size = least * LANES
    return (np.ceil(np.minimum(paths, 1e15) / size) * size).astype(np.int64)
