"""``make test-bounds``: with NUMBA_BOUNDSCHECK=1 a place outside of an array is an error, also in vectors."""

import os
import subprocess
import sys

import pytest
from helpers import COMPILED

pytestmark = pytest.mark.skipif(not COMPILED, reason="about the compiler")

#: Kernels that are given arrays, and lengths with which they read or write behind them.
PROGRAM = """
import sys
import numpy as np
from numba import prange
from spi.compiler.dispatch import device, kernel
from spi.compiler.vectors import WIDTH, gather, load, multiply_tile, store, without_refcount

@kernel
def alone(x, n):
    return without_refcount(x)[n - 1]

@kernel
def loaded(x, n):
    store(x, 0, load(x, n - WIDTH))

@kernel
def gathered(x, n):
    store(x, 0, gather(x, n - WIDTH, np.arange(WIDTH), 0))

@device(inline=False)
def write(x, i):
    store(x, i, load(x, 0))

@kernel(parallel=True)
def in_parallel(x, n):
    for row in prange(1):
        write(without_refcount(x), n - WIDTH)

@kernel
def tiles(x, n):
    multiply_tile(x, 0, 1, x, 0, 16, x, n - 16, 16, 1)

memory = np.ones(64)
for function in (alone, loaded, gathered, in_parallel, tiles):
    for n in (32, 33):
        try:
            function(memory[:32], n)
            print(function.__name__, n, "none")
        except (IndexError, SystemError) as error:  # the latter from a parallel loop
            print(function.__name__, n, error.__cause__ or error)
"""


def outcome(tmp_path, **more):
    """The lines of the program, with one cache for all."""
    (tmp_path / "bounds.py").write_text(PROGRAM)
    environment = {**os.environ, "SPI_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_BOUNDSCHECK": "", **more}
    command = [sys.executable, tmp_path / "bounds.py"]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=300)
    return [line.split(maxsplit=2) for line in answer.stdout.splitlines()]


def test_places_outside_of_arrays_are_errors_where_that_is_asked_for(tmp_path):
    """Kernels of both kinds lie in one cache, and neither is taken for the other."""
    for _ in range(2):
        assert [error for _, _, error in outcome(tmp_path)] == ["none"] * 10
        for name, n, error in outcome(tmp_path, NUMBA_BOUNDSCHECK="1"):
            assert error == ("none" if n == "32" else "index is out of bounds"), (name, n)
