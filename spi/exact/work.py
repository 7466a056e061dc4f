"""Progress of work without paths: the code that works counts seconds of typical speed, which are reported.

    with reporting_to(report):              # the caller, who wants reports
        with work("solving", seconds):      # the whole work, with its predicted seconds
            counted(seconds)                # in its loops

Without a report, counting costs a look at a variable.
"""

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import NamedTuple

#: Wall-clock seconds from one report to the next.
PAUSE = 0.2
#: The share of the whole that must be counted before the time of the rest is estimated from the speed so far.
_KNOWN = 0.05
#: The share that is done of a prediction that was too small and is raised.
_NEARLY = 0.98


class Work(NamedTuple):
    """State of work in progress."""

    title: str
    done: float  #: seconds of typical speed
    total: float  #: predicted, more than `done`; 0 where there is no prediction
    left: float  #: wall-clock seconds, by the speed so far; NaN before enough is counted

    @property
    def share(self) -> float:
        """Share that is done, from 0 to 1."""
        return self.done / self.total if self.total > 0.0 else 0.0

    @property
    def so_far(self) -> str:
        """``solving 40%``, or the title alone without a prediction."""
        return f"{self.title} {self.share:.0%}" if self.total > 0.0 else self.title


ReportWork = Callable[[Work | None], None]  #: called with the state of the work, and with None at its end

_clock = time.perf_counter


class _Meter:
    """Counter of one piece of work."""

    def __init__(self, title: str, seconds: float, done: float, report: ReportWork) -> None:
        self.title, self.report = title, report
        self.first = self.done = done
        self.total = done + seconds
        self.began = self.last = _clock()
        report(self.work())

    def work(self) -> Work:
        """State of this work."""
        counted, left = self.done - self.first, math.nan
        if counted > _KNOWN * (self.total - self.first):
            left = (_clock() - self.began) * (self.total - self.done) / counted
        return Work(self.title, self.done, self.total, left)

    def count(self, seconds: float) -> None:
        """Count `seconds` as done; a whole that turns out to be more is raised."""
        self.done += seconds
        self.total = max(self.total, self.done / _NEARLY)
        if (now := _clock()) - self.last >= PAUSE:
            self.last = now
            self.report(self.work())


_REPORT: ContextVar[ReportWork | None] = ContextVar("report", default=None)
_METER: ContextVar[_Meter | None] = ContextVar("meter", default=None)


@contextlib.contextmanager
def reporting_to(report: ReportWork) -> Iterator[None]:
    """Within the block call `report` for the work done there, at its beginning and every :data:`PAUSE` seconds."""
    before = _REPORT.set(report)
    try:
        yield
    finally:
        _REPORT.reset(before)


@contextlib.contextmanager
def work(title: str, seconds: float, done: float = 0.0) -> Iterator[None]:
    """The block is work predicted to take `seconds`, after `done` seconds before it; other work may be part of it."""
    if _METER.get() is not None or (report := _REPORT.get()) is None:
        yield
        return
    before = _METER.set(_Meter(title, seconds if math.isfinite(seconds) else 0.0, done, report))
    try:
        yield
    finally:
        _METER.reset(before)
        report(None)


def expected(seconds: float) -> None:
    """Replace the prediction of the remaining work by `seconds`."""
    if (meter := _METER.get()) is not None and math.isfinite(seconds):
        meter.total = max(meter.done + seconds, meter.done / _NEARLY)


def counted(seconds: float) -> None:
    """Count `seconds` of typical speed as done in the work in progress."""
    if (meter := _METER.get()) is not None:
        meter.count(seconds)
