"""Progress of a run: in a notebook one display that is updated, in a terminal one line that is written over."""

import math
import sys
from types import TracebackType
from typing import Any

from ..exact.work import Work
from ..printing.text import human_time
from ..running.compiling import Compiling
from ..running.run import NOBODY, Progress, Watch

_WIDTH = 100  # of the line, cut there


class ProgressDisplay:
    """One line, a display in a notebook and on standard error elsewhere; it vanishes at the end.

    Without `wanted` there is none but in a notebook; with False there is none at all.
    """

    def __init__(self, name: str, wanted: bool | None) -> None:
        self.name, self.shown = name, in_notebook() if wanted is None else wanted
        self.in_notebook, self.stream = in_notebook(), sys.stdout if in_notebook() else sys.stderr
        self.length = 0
        self.display: Any = None  #: that of a notebook, once something was written

    def __enter__(self) -> "ProgressDisplay":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._write("", end="" if self.in_notebook else "\r")

    @property
    def watch(self) -> Watch:
        """Callbacks for a run."""
        return Watch(self._report, self._report_compiling, self._tell) if self.shown else NOBODY

    def share(self, unit: str, done: float, total: float, work: Work | None = None) -> None:
        """Show the share of a whole that is done, or that of work without paths that is under way."""
        self._write(f"{self.name}: {_so_far(work) if work else f'{unit} {done / total:.0%}'}")

    def _report(self, progress: Progress) -> None:
        if progress.work:
            news = [_so_far(progress.work)]
        else:
            news = [f"{progress.done / progress.total:.0%}", progress.precision]
        self._write(f"{self.name}: {progress.place} {', '.join(filter(None, news))}")

    def _report_compiling(self, news: Compiling) -> None:
        self._write(f"{self.name}: compiling {news.title}, {news.number} of {news.described}")

    def _tell(self, news: str) -> None:
        self._write(news, end="\n")
        self.length = 0

    def _write(self, text: str, end: str = "") -> None:
        """Write over the line; with an end of line, a text that stays."""
        if self.shown and self.in_notebook:
            self._display(text, end)
        elif self.shown:
            cut = text[:_WIDTH] if end != "\n" else text
            self.stream.write(f"\r{cut:<{self.length}}{end}")
            self.stream.flush()
            self.length = len(cut)

    def _display(self, text: str, end: str) -> None:
        """Write in a notebook, which does not take carriage returns."""
        if end:
            self.stream.write(text + end)
            self.stream.flush()
            return
        plain = {"text/plain": text[:_WIDTH]}
        if self.display is not None:
            self.display.update(plain, raw=True)
        elif text:
            self.display = sys.modules["IPython"].display.display(plain, raw=True, display_id=True)


def _so_far(work: Work) -> str:
    """``solving 40%, about 12 s left``, as far as that is known."""
    return work.so_far + (f", about {human_time(work.left)} left" if math.isfinite(work.left) else "")


def in_notebook() -> bool:
    """Whether this is a kernel of Jupyter."""
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return type(shell).__name__ == "ZMQInteractiveShell"
