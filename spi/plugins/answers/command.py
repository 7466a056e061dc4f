"""Command `spi answer`: an expectation to a wanted accuracy."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spi.cli.options import COMPUTE, Command, Fresh, Out, RunOptions, Threads, complete_spec, run_options
from spi.cli.running import CheckpointTime, MaxTime, limits_of, prepare
from spi.cli.terminal import takes_all_characters, tell

if TYPE_CHECKING:
    from spi.specs import Experiment


@run_options("samples")
def answer(
    spec: Annotated[
        Path,
        typer.Argument(
            metavar="SPEC|NAME",
            help="An experiment file (YAML), or a name listed by `spi list`, whose system and initial value count.",
            autocompletion=complete_spec,
        ),
    ],
    function: Annotated[
        list[str] | None, typer.Option(help="Test function, e.g. 'y1^2' (default: those of the experiment).")
    ] = None,
    time: Annotated[str | None, typer.Option(help="Final time (default: that of the experiment).")] = None,
    accuracy: Annotated[str | None, typer.Option(help="Half the width of the 95 % interval, e.g. 1e-5.")] = None,
    seconds: Annotated[str | None, typer.Option(help="Largest work, in seconds of one thread (default: 3600).")] = None,
    dry: Annotated[bool, typer.Option("--dry", help="Run the pilot only, and predict.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the answer as JSON.")] = False,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
    max_time: MaxTime = None,
    checkpoint: CheckpointTime = "5s",
    *,
    options: RunOptions,
) -> None:
    """Find expectations E phi(y(T)) to a wanted accuracy.

    The program chooses scheme, steps, extrapolation and samples, or solves without sampling where it can; it checks
    the bias, and writes <out>/<name>.answer.h5.
    """
    from spi.specs.naming import as_override

    from .running import load_answer

    keys = {"final_time": time, "accuracy": accuracy, "seconds": seconds}
    named = [f"{key}={value}" for key, value in keys.items() if value is not None]
    if function:
        several = {f"phi{i}": text for i, text in enumerate(function, 1)}
        named.append(as_override("functions", several if len(several) > 1 else function[0]))
    experiment = load_answer(spec, options.profile, [*named, *options.assignments], options.trust_code)
    limits = limits_of(max_time, checkpoint)
    prepare(threads)
    if dry:
        _predict(experiment)
        return
    from spi import storage, views
    from spi.cli.progress import ProgressLine
    from spi.printing import as_json
    from spi.running import run as runner

    with ProgressLine(experiment.name) as line:
        path = runner.run(experiment, out, fresh, line.watch, limits)
    results = storage.read(path)
    if json:
        typer.echo(as_json(views.rows(results), takes_all_characters()))
    else:
        views.print_tables(results)
    tell(f"results: {path}")


def _predict(experiment: "Experiment") -> None:
    """Run the pilots, and say what the answers would take."""
    from spi.cli.progress import ProgressLine
    from spi.printing.text import human_time

    from .running import predictions

    with ProgressLine(experiment.name) as line:
        predicted = list(predictions(experiment, line.watch))
    for case, (how, seconds, next_digit) in predicted:
        takes = f": about {human_time(seconds)} of processor time"
        if math.isfinite(next_digit):
            takes += f"; the next digit {human_time(next_digit)}"
        typer.echo(f"{case}: {how}{'' if math.isnan(seconds) else takes}")


COMMAND = Command(
    answer,
    COMPUTE,
    [
        "spi answer rigid_body_strong --function y1^2 --accuracy 1e-4",
        "spi answer my_body.yaml --time 2 --seconds 60 --dry",
    ],
)
