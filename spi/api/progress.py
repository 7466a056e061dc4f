"""How far a run is, in a notebook or a terminal: one line that is written over."""

import math
import sys
from types import TracebackType
from typing import Any

from ..running.compiling import Compiling
from ..running.run import NOBODY, Progress, Watch

_WIDTH = 100  # of the line, cut there


class Line:
    """One line, on standard output in a notebook and on standard error elsewhere; it vanishes at the end.

    Without `wanted` there is none but in a notebook; with False there is none at all.
    """

    def __init__(self, name: str, wanted: bool | None) -> None:
        self.name, self.shown = name, in_notebook() if wanted is None else wanted
        self.stream = sys.stdout if in_notebook() else sys.stderr
        self.length = 0

    def __enter__(self) -> "Line":
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._write("", end="\r")

    @property
    def watch(self) -> Watch:
        """What a run is given to tell how far it is."""
        return Watch(self._report, self._report_compiling, self._tell) if self.shown else NOBODY

    def share(self, what: str, done: float, total: float) -> None:
        """Say how much of a whole is done."""
        self._write(f"{self.name}: {what} {done / total:.0%}")

    def _report(self, progress: Progress) -> None:
        where = f"{progress.number + 1}/{progress.parts} {progress.case} {progress.part}"
        known = "" if math.isnan(progress.stderr) else f", standard error {progress.stderr:.1e}"
        self._write(f"{self.name}: {where} {progress.done / progress.total:.0%}{known}")

    def _report_compiling(self, news: Compiling) -> None:
        self._write(f"{self.name}: compiling {news.title}, {news.number} of {news.told}")

    def _tell(self, news: str) -> None:
        self._write(news, end="\n")
        self.length = 0

    def _write(self, text: str, end: str = "") -> None:
        """Write over what stands in the line."""
        if self.shown:
            cut = text[:_WIDTH] if end != "\n" else text
            self.stream.write(f"\r{cut:<{self.length}}{end}")
            self.stream.flush()
            self.length = len(cut)


def in_notebook() -> bool:
    """Whether this is a kernel of Jupyter."""
    ipython: Any = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return type(shell).__name__ == "ZMQInteractiveShell"
