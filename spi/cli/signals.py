"""How a run is asked to stop."""

import signal
import sys


class Stop:
    """Ctrl-C, or SIGTERM, a batch system's way to say it.

    While Numba compiles, the exception that Python raises then can get lost; so it is also remembered.
    """

    def __init__(self) -> None:
        self.wanted = False
        self.usual_hook = sys.unraisablehook

    def listen(self) -> None:
        """From now on either signal stops the program."""
        self.wanted = False
        if sys.unraisablehook != self._unraisable:
            self.usual_hook, sys.unraisablehook = sys.unraisablehook, self._unraisable
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._wanted)

    def _unraisable(self, lost: "sys.UnraisableHookArgs") -> None:
        """Say nothing once a stop is wanted.

        The exception that got lost is remembered; objects whose making it broke off raise others when they are deleted.
        """
        if not self.wanted:
            self.usual_hook(lost)

    def ignore(self) -> None:
        """From now on there is nothing left to stop."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)

    def _wanted(self, *_: object) -> None:
        self.wanted = True
        raise KeyboardInterrupt

    def check(self) -> None:
        if self.wanted:
            raise KeyboardInterrupt


#: There is one set of signals in a program.
STOP = Stop()
