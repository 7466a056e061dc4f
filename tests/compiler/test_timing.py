"""What compiling takes is told apart from what kernels take."""

import time

import numba
import numpy as np
from helpers import compiled_only

from spi.compiler.timing import compiling


@compiled_only
def test_the_time_of_compiling_is_counted_and_that_of_running_is_not():
    @numba.njit
    def total(x, times):
        value = 0.0
        for _ in range(times):
            for one in x:
                value = 0.5 * value + one
        return value

    began, x = time.process_time(), np.ones(1000)
    with compiling() as clock:
        total(x, 1)
    taken = time.process_time() - began
    assert 0.5 * taken < clock.cpu_seconds <= taken and clock.seconds > 0.0
    with compiling() as clock:
        total(x, 10_000)
    assert clock.cpu_seconds == clock.seconds == 0.0
