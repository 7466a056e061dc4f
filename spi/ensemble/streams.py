"""Streams of keyed random numbers, and what every noise answers that the loop over time makes, or finds, by itself."""

from typing import NamedTuple

import numpy as np

from ..numerics.rng import BROWNIAN


def in_one_call(noise, scheme, model, times, first, blocks, end):
    """(grid, noise, first block, end of paths) of the calls of the loop that together make all steps of a grid."""
    return ((times, noise, first, end),)


def as_many_blocks(noise, model, times):
    """How many blocks fit into memory, as far as their noise is concerned: any number."""
    return 2**62


def itself(noise):
    """A noise of the same type whose numbers are quickly made, for calls that only have kernels compiled."""
    return noise


class RandomStream(NamedTuple):
    """Which random numbers: the 64-bit seed and one of the streams of ``spi.numerics.rng``, as uint64."""

    seed: np.uint64
    stream: np.uint64

    @property
    def keys(self):
        """Of what the random numbers of these paths are functions: itself."""
        return self

    for_a_trial, most_blocks, pieces = property(itself), as_many_blocks, in_one_call


def brownian(seed):
    """The increments of the paths of a seed."""
    return RandomStream(np.uint64(seed), np.uint64(BROWNIAN))
