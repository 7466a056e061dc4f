"""Command `spi study`: five experiments about one system, and a report on them."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spi.cli.options import COMPUTE, INVALID, Command, Threads, complete_spec, end
from spi.cli.running import CheckpointTime, MaxTime, limits_of, prepare
from spi.cli.terminal import tell

if TYPE_CHECKING:
    from spi.specs import Experiment

    from .parts import Study


def study(
    system: Annotated[
        Path,
        typer.Argument(
            metavar="SYSTEM",
            help="A file (YAML) with model, initial and final_time, or an experiment with them.",
            autocompletion=complete_spec,
        ),
    ],
    minutes: Annotated[float, typer.Option(help="Time that the study may take.", min=0.1, max=1e5)] = 2.0,
    out: Annotated[Path | None, typer.Option(help="Folder of the study (default: <name>_study).")] = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="Write the experiments anew, and recompute them.")] = False,
    threads: Threads = None,
    max_time: MaxTime = None,
    checkpoint: CheckpointTime = "5s",
) -> None:
    """Study the schemes on one system: orders, what they preserve, work against error, large steps.

    Writes five experiments, their results and a report into a folder.  The experiments can be edited: the same command
    then runs what has changed, and writes the report anew.
    """
    prepare(threads)
    from spi import storage, views
    from spi.cli.progress import ProgressLine
    from spi.plugins.report.command import write_report
    from spi.plugins.report.views.page import Head
    from spi.printing import print_safely
    from spi.running import run as runner
    from spi.running.remarks import reports

    from .advice import advice
    from .parts import Study

    limits = limits_of(max_time, checkpoint)
    studied = Study.of(system)
    folder = out or Path(f"{studied.name}_study")
    for name, lines in reports(studied.source).items():
        print_safely([f"{name}:", *(f"  {line}" for line in lines)])
    paths: dict[str, Path] = {}
    for word, experiment in _experiments(studied, folder, minutes, fresh).items():
        with ProgressLine(experiment.name) as line:
            paths[word] = runner.run(experiment, folder, fresh, line.watch, limits)
    found = tuple(advice(views.readings(storage.read(paths["work"]))))  # type: ignore[arg-type]
    page = folder / "report.html"
    _, problems = write_report([*paths.values()], page, head=Head(studied.title, found))
    print_safely(found)
    for problem in problems:
        tell(f"spi: {problem}")
    again = shlex.join(["spi", "study", str(system)])
    tell(f"wrote {page}; the experiments are beside it, and `{again}` runs those that you edit")
    if problems:
        raise typer.Exit(INVALID)


def _experiments(studied: "Study", folder: Path, minutes: float, fresh: bool) -> "Mapping[str, Experiment]":
    """Experiments of the study: those in the folder, which a person may have edited, or else new ones there."""
    from spi.running.load import load
    from spi.specs.files import content
    from spi.storage import write_all

    mark = f"# Written by `spi study`; of the system {studied.digest}.\n"
    there = {word: path for word in studied.words if (path := studied.path(word, folder)).exists()}
    if there and not fresh:
        if old := [path for path in there.values() if mark not in path.read_text(encoding="utf-8", errors="replace")]:
            end(
                INVALID,
                f"{old[0]}: is of another system or of a former state of its file; give --fresh, or another --out",
            )
        return {word: load(path) for word, path in there.items()}
    texts = studied.specs(minutes)
    specs = {studied.path(word, folder): f"{mark}{text}".encode() for word, text in texts.items()}
    folder.mkdir(parents=True, exist_ok=True)
    write_all(specs | {folder / name: content(text) for name, text in studied.source.files})
    return {word: load(studied.path(word, folder)) for word in texts}


COMMAND = Command(study, COMPUTE, ["spi study my_system.yaml", "spi study my_system.yaml --minutes 20"])
