"""Time that compiling kernels, and loading compiled ones, takes within a block of code."""

import contextlib
import time

from numba.core import event


class Clock(event.Listener):
    """Seconds, by the clock and of the processor, in which Numba's lock of the compiler was held."""

    def __init__(self):
        self.seconds = self.cpu_seconds = 0.0
        self._depth, self._began = 0, (0.0, 0.0)

    def on_start(self, event):
        if not self._depth:
            self._began = time.perf_counter(), time.process_time()
        self._depth += 1

    def on_end(self, event):
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._began[0]
            self.cpu_seconds += time.process_time() - self._began[1]


@contextlib.contextmanager
def compiling():
    """:class:`Clock` of what is compiled or loaded within the block."""
    clock = Clock()
    with event.install_listener("numba:compiler_lock", clock):
        yield clock
