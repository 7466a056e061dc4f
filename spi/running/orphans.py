"""Processes that another one started end with it, however that came to its end, or when it has no more use for them."""

import contextlib
import os
import signal
import sys
import threading
from multiprocessing import parent_process
from multiprocessing.connection import wait

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]


def follow_the_parent() -> None:
    """Leave signals to the process that started this one, and end with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()


def end_with_parent() -> None:
    """End this process, one of :mod:`multiprocessing`, with the one that started it."""
    parent = parent_process()
    if parent is not None:
        end_with(parent.sentinel)


def end_with(parent: int) -> None:
    """From now on end this process when `parent` can be read: the end of a pipe whose other end only the parent has.

    A kernel lets no other thread of Python have its turn, which can take long.  On Linux the system therefore says by a
    signal that the pipe is closed; elsewhere it does not, or the signal is ignored.
    """
    threading.Thread(target=_wait_for, args=(parent,), daemon=True).start()
    if sys.platform == "linux" and "F_SETOWN" in dir(fcntl):
        with contextlib.suppress(OSError):  # not every kernel does so
            fcntl.fcntl(parent, fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(parent, fcntl.F_SETFL, fcntl.fcntl(parent, fcntl.F_GETFL) | os.O_ASYNC)


def _wait_for(parent: int) -> None:
    try:
        wait([parent])
    except OSError:  # on Windows a pipe is none of the things for which one can wait
        os.read(parent, 1)
    os._exit(1)
