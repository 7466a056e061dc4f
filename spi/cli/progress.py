"""Progress of a run, on a terminal."""

import math
import sys
from typing import TYPE_CHECKING

from .. import CACHE_PROBLEM
from ..printing.text import human_time, print_lines, printable
from .terminal import STOP, tell

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
        self.jobs: tuple = ()  #: the kernels that are compiled

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
        """Callbacks for a run."""
        from ..running.run import Watch

        return Watch(self.report, self.report_compiling, self.tell, self.report_beginning)

    def tell(self, news: str) -> None:
        """Print a line that stays, above that of the progress if there is one."""
        if self.bar:
            print_lines(self.bar.console, [f"spi: {news}"])
        else:
            tell(f"spi: {news}")

    def report_beginning(self, title: str, cost: "Cost") -> None:
        """Show the title of the run and its time, where that is not open."""
        STOP.check()
        long = f"; {'at most ' if cost.at_most else ''}about {human_time(cost.seconds)} once compiled"
        self.tell(f"{self.name}: {printable(title)}{long if math.isfinite(cost.seconds) else ''}")

    def report_compiling(self, news: "Compiling") -> None:
        STOP.check()
        total, before = len(news.jobs), news.number - 1
        if self.jobs is not news.jobs:
            self.jobs = news.jobs
            saved = "" if CACHE_PROBLEM else "; saved for later runs"
            self.tell(f"{self.name}: compiling {printable(news.described)}{saved}")
        elif not self.bar:
            tell(f"spi: {self.name}: compiling {printable(news.title)}, {total - before} of {total} kernels left")
        if self.bar:
            self._show(self.bar, None, f"{self.name}: compiling {printable(news.title)}", total, before)

    def report_work(self, number: int, total: int, work: str) -> None:
        """Show the number that comes next of some work, such as "drawing NAME"."""
        STOP.check()
        if self.bar:
            self._show(self.bar, None, f"{self.name}: {work}", total, number - 1)

    def report(self, progress: "Progress") -> None:
        STOP.check()
        if not self.bar:
            return
        part = f"{self.name} {progress.place}"
        if progress.work is not None:
            work = progress.work  # in per cent, as what it takes in all becomes known on the way
            total = 100.0 if work.total else None
            self._show(self.bar, work.title, f"{part}: {work.so_far}", total, 100.0 * work.share)
            return
        news = "starting"
        if progress.done:
            rate = f"{progress.done / progress.seconds:.3g} paths/s, " if isinstance(progress.done, int) else ""
            news = f"{rate}{progress.precision}".removesuffix(", ")
        self._show(self.bar, progress.number, f"{part}: {news}", progress.total, progress.done)

    def _show(
        self, bar: "Bar", part: int | str | None, description: str, total: float | None, completed: float
    ) -> None:
        """Show the progress of a part by its number, or of work by its title; None for all else."""
        if self.task is None or bar.tasks[-1].fields["part"] != part:
            if self.task is not None:
                bar.remove_task(self.task)
            self.task = bar.add_task(description, part=part, total=total, completed=int(completed))
        bar.update(self.task, description=description, total=total, completed=completed)
