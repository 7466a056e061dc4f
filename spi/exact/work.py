"""How far work without paths is: who does it counts in seconds of typical speed, and who runs it is told.

    with told(report):                      # around whatever may work
        with work("solving", seconds):      # which is predicted to take so long
            with part(seconds):             # of known size
                counted(seconds)            # in its loops

Where nobody is told, counting costs a look at a variable.
"""

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import NamedTuple

#: Wall-clock seconds from one report to the next.
PAUSE = 0.2
#: So much of the whole must be counted before its speed says how long the rest takes.
_KNOWN = 0.05
#: Of what a prediction that proves too small is raised to, what is done.
_NEARLY = 0.98


class Work(NamedTuple):
    """Work that goes on."""

    title: str
    done: float  #: seconds of typical speed
    total: float  #: predicted, more than what is done; 0 where it is not known
    left: float  #: wall-clock seconds, by the speed so far; NaN before enough is counted

    @property
    def share(self) -> float:
        """How much is done, from 0 to 1."""
        return self.done / self.total if self.total > 0.0 else 0.0

    @property
    def so_far(self) -> str:
        """``solving 40%``, as far as that is known."""
        return f"{self.title} {self.share:.0%}" if self.total > 0.0 else self.title


Report = Callable[[Work | None], None]  #: told how far work is, and None at its end

_clock = time.perf_counter


class _Meter:
    """What is counted of one piece of work."""

    def __init__(self, title: str, seconds: float, done: float, report: Report) -> None:
        self.title, self.report = title, report
        self.first = self.done = done
        self.ends = [done + seconds]  #: that of the whole, and of each part within the other that is being done
        self.began = self.last = _clock()
        report(self.work())

    def work(self) -> Work:
        """How far it is."""
        counted, left = self.done - self.first, math.nan
        if counted > _KNOWN * (self.ends[0] - self.first):
            left = (_clock() - self.began) * (self.ends[0] - self.done) / counted
        return Work(self.title, self.done, self.ends[0], left)

    def count(self, seconds: float) -> None:
        """So much more is done; no part of the whole takes more than was predicted of it."""
        self.done += seconds
        if len(self.ends) > 1:
            self.done = min(self.done, self.ends[-1])
        self.ends[0] = max(self.ends[0], self.done / _NEARLY)
        if (now := _clock()) - self.last >= PAUSE:
            self.last = now
            self.report(self.work())


_REPORT: ContextVar[Report | None] = ContextVar("report", default=None)
_METER: ContextVar[_Meter | None] = ContextVar("meter", default=None)


@contextlib.contextmanager
def told(report: Report) -> Iterator[None]:
    """Have `report` told of what is worked within the block, at its beginning and every :data:`PAUSE` seconds."""
    before = _REPORT.set(report)
    try:
        yield
    finally:
        _REPORT.reset(before)


@contextlib.contextmanager
def work(title: str, seconds: float, done: float = 0.0) -> Iterator[None]:
    """Work that is predicted to take `seconds`, after some that are `done`; within other work it is a part of that."""
    if _METER.get() is not None or (report := _REPORT.get()) is None:
        with part(seconds):
            yield
        return
    before = _METER.set(_Meter(title, seconds if math.isfinite(seconds) else 0.0, done, report))
    try:
        yield
    finally:
        _METER.reset(before)
        report(None)


@contextlib.contextmanager
def part(seconds: float) -> Iterator[None]:
    """A part of the work that goes on, predicted to take `seconds`; at its end all of them count as done."""
    if (meter := _METER.get()) is None:
        yield
        return
    end, before = meter.done + (seconds if math.isfinite(seconds) else 0.0), meter.ends
    meter.ends = [*(max(end, outer) for outer in before), end]
    try:
        yield
    finally:
        meter.ends = meter.ends[: len(before)]
        meter.count(max(end - meter.done, 0.0))


def expected(seconds: float) -> None:
    """So many seconds are left of the work that goes on, as is known by now; of a part that stays as it was."""
    if (meter := _METER.get()) is not None and len(meter.ends) == 1 and math.isfinite(seconds):
        meter.ends[0] = meter.done + seconds


def counted(seconds: float) -> None:
    """So many seconds of typical speed are done, of the work that goes on."""
    if (meter := _METER.get()) is not None:
        meter.count(seconds)
