"""Standard output and error, whatever they can take."""

import codecs
import io
import math
import os
import signal
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import typer

from .. import CACHE_PROBLEM
from ..printing.text import human_time, printable

# ---------------------------------------------------------------------------------------------------------------------
# Standard output and error, whatever they can take.
# ---------------------------------------------------------------------------------------------------------------------

#: What stands for characters that an output cannot take; of letters with marks the letter, of all others "?".
_INSTEAD = {"±": "+-", "µ": "u", "–": "-", "—": "-", "…": "...", "×": "x", "σ": "sigma", "β": "beta", "→": "->"}


def tell(message: str) -> None:
    """A line on standard error, without what a terminal would take for a command."""
    typer.echo("".join(c if c.isprintable() or c == "\n" else "?" for c in message), err=True)


def takes_all_characters() -> bool:
    """Whether standard output is in an encoding of Unicode."""
    return (sys.stdout.encoding or "").lower().startswith("utf")


def write_what_the_terminal_can() -> None:
    """Let nothing that is written fail because of the encoding of the output, or because an output is closed."""
    codecs.register_error("spi", _instead)
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # this takes the number of the file, so that no other file gets it
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="spi")


def _instead(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)  # nothing is read from these streams
    text = "".join(map(_ascii, error.object[error.start : error.end]))
    return text, error.end


def _ascii(character: str) -> str:
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return _INSTEAD.get(character) or plain or "?"


@contextmanager
def for_whoever_reads() -> Iterator[None]:
    """Within it a reader of standard output that has seen enough, such as `head`, does not end the program."""
    try:
        yield
        sys.stdout.flush()
    except (BrokenPipeError, SystemExit):  # which rich makes of it
        drop_unwritable_output()


def drop_unwritable_output() -> None:
    """Let the rest of standard output go nowhere if it cannot be written; Python would try that again at the end."""
    try:
        sys.stdout.flush()
    except OSError:
        sys.stdout = io.StringIO()


# ---------------------------------------------------------------------------------------------------------------------
# How a run is asked to stop.
# ---------------------------------------------------------------------------------------------------------------------


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


# ---------------------------------------------------------------------------------------------------------------------
# How far a run is, on a terminal.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

    from ..running.compiling import Compiling
    from ..running.run import Cost, Progress, Watch


class ProgressLine:
    """One line on a terminal: paths done, rate, time left, current standard error."""

    def __init__(self, name: str) -> None:
        self.name = printable(name)
        self.bar: Bar | None = None
        self.task: TaskID | None = None
        self.told: tuple = ()  #: which kernels are compiled

    def __enter__(self) -> "ProgressLine":
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
            from rich.table import Column

            # The count and the time left are never cut, however narrow the terminal is; the text is.
            whole, cut = Column(no_wrap=True), Column(no_wrap=True, ratio=1, overflow="ellipsis")
            columns = [
                MofNCompleteColumn(table_column=whole),
                TimeRemainingColumn(compact=True, table_column=whole.copy()),
                BarColumn(10, table_column=whole.copy()),
                TextColumn("{task.description}", markup=False, table_column=cut),
            ]
            self.bar = Progress(*columns, console=Console(stderr=True), transient=True, expand=True)
            self.bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    @property
    def watch(self) -> "Watch":
        """What a run is given to tell how far it is."""
        from ..running.run import Watch

        return Watch(self.report, self.report_compiling, self.tell, self.report_beginning)

    def tell(self, news: str) -> None:
        """Say something that stays, above the line if there is one."""
        if self.bar:
            self.bar.console.print(f"spi: {news}", markup=False, soft_wrap=True)
        else:
            tell(f"spi: {news}")

    def report_beginning(self, title: str, cost: "Cost") -> None:
        """Say what runs and how long it will take; where that is open, what runs."""
        STOP.check()
        long = f"; {'at most ' * cost.at_most}about {human_time(cost.seconds)} once compiled"
        self.tell(f"{self.name}: {printable(title)}{long * math.isfinite(cost.seconds)}")

    def report_compiling(self, news: "Compiling") -> None:
        STOP.check()
        total, before = len(news.jobs), news.number - 1
        if self.told is not news.jobs:
            self.told = news.jobs
            kept = "" if CACHE_PROBLEM else "; saved for later runs"
            self.tell(f"{self.name}: compiling {printable(news.told)}{kept}")
        elif not self.bar:
            tell(f"spi: {self.name}: compiling {printable(news.title)}, {total - before} of {total} kernels left")
        if self.bar:
            self._show(self.bar, None, f"{self.name}: compiling {printable(news.title)}", total, before)

    def report_work(self, number: int, total: int, work: str) -> None:
        """Say which of how many comes next of some work, such as "drawing NAME"."""
        STOP.check()
        if self.bar:
            self._show(self.bar, None, f"{self.name}: {work}", total, number - 1)

    def report(self, progress: "Progress") -> None:
        STOP.check()
        if not self.bar:
            return
        part = f"{self.name} {progress.number + 1}/{progress.parts} {progress.case} {progress.part}"
        if progress.work is not None:
            work = progress.work  # in per cent, as what it takes in all becomes known on the way
            total = 100.0 if work.total else None
            self._show(self.bar, work.title, f"{part}: {work.so_far}", total, 100.0 * work.share)
            return
        news = "starting"
        if progress.done:
            rate = f"{progress.done / progress.seconds:.3g} paths/s, " if isinstance(progress.done, int) else ""
            known = "" if math.isnan(progress.stderr) else f"standard error {progress.stderr:.1e}"
            news = f"{rate}{known}".removesuffix(", ")
        self._show(self.bar, progress.number, f"{part}: {news}", progress.total, progress.done)

    def _show(
        self, bar: "Bar", part: int | str | None, description: str, total: float | None, completed: float
    ) -> None:
        """Show how far a part, or work that has a title, is; None for what is neither."""
        if self.task is None or bar.tasks[-1].fields["part"] != part:
            if self.task is not None:
                bar.remove_task(self.task)
            self.task = bar.add_task(description, part=part, total=total, completed=int(completed))
        bar.update(self.task, description=description, total=total, completed=completed)
