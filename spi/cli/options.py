"""What several commands have in common: options, exit codes, and how a command ends."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from .names import assignments, complete_kind, complete_profile, complete_results, complete_spec
from .signals import STOP
from .streams import tell

if TYPE_CHECKING:
    from ..specs import Experiment

DONE, FAILED, INVALID, STOPPED, CLAIM_FAILED = 0, 1, 2, 3, 4

Specs = Annotated[
    list[Path],
    typer.Argument(
        metavar="SPEC",
        help="Experiment files (YAML), names listed by `spi list`, or files of results, whose spec and options count.",
        autocompletion=complete_spec,
    ),
]
Stored = Annotated[
    Path,
    typer.Argument(
        metavar="FILE|SPEC|NAME",
        help="A file of results, or an experiment that was run, with the options of the run.",
        autocompletion=complete_results,
    ),
]
Several = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="FILE|SPEC|NAME",
        help="Files of results, or experiments that were run, with the options of the runs (default: all results).",
        autocompletion=complete_results,
    ),
]
Profile = Annotated[
    str | None,
    typer.Option(help="laptop (the file itself, the default), paper or quick.", autocompletion=complete_profile),
]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Override a key of the spec.")]
Samples = Annotated[str | None, typer.Option(help="Number of paths; short for --set samples=N.")]
Seed = Annotated[str | None, typer.Option(help="Seed; short for --set seed=S.")]
As = Annotated[
    str | None,
    typer.Option(
        "--as",
        metavar="KIND",
        help="Convert the experiment to another kind, e.g. strong.",
        autocompletion=complete_kind,
    ),
]
Out = Annotated[Path, typer.Option(help="Folder of results.")]
ResultsFolder = Annotated[Path, typer.Option("--results", help="Folder of results.")]
Threads = Annotated[int | None, typer.Option(help="Threads (default: all).", min=1)]
Fresh = Annotated[bool, typer.Option("--fresh", help="Recompute from scratch and overwrite existing results.")]

TrustCode = Annotated[
    bool,
    typer.Option(
        "--trust-code",
        help="Run Python code that a file of results holds, though no file here equals it; only if you trust it.",
    ),
]


def load(
    specs: list[Path],
    profile: str | None,
    overrides: list[str] | None,
    samples: str | None,
    seed: str | None,
    kind: str | None = None,
    trust_code: bool = False,
) -> list["Experiment"]:
    """All experiments, before anything runs; converted to another kind if that is given.

    Raises SpecError with the mistakes of all of them; StorageError if results cannot be read, or may not be run.
    """
    from ..running.load import load_any, means_another
    from ..specs import SpecError

    overrides = assignments(overrides, samples, seed)
    experiments: list[Experiment] = []
    problems: list[str] = []
    for path in specs:
        try:
            experiments.append(load_any(path, profile, overrides, kind, trust_code=trust_code))
            if not (profile or overrides or kind) and means_another(path, experiments[-1]):
                tell(f"spi: {path}: its spec means something else to this version of spi, so numbers will differ")
        except SpecError as error:
            problems += error.messages
    if problems:
        raise SpecError(*dict.fromkeys(problems))  # what is wrong with an option is so for each of them
    return experiments


def end(code: int, message: str) -> NoReturn:
    """End a command with a line; whoever asked it to stop is not told of what only seems wrong because of that."""
    STOP.check()
    tell(f"spi: {message}")
    raise typer.Exit(code)
