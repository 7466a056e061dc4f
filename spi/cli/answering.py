"""The command that answers: an expectation to a wanted accuracy."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Fresh, Out, Overrides, Profile, Seed, Threads, TrustCode, complete_spec, load
from .running import Checkpoint, MaxTime, limits_of, prepare
from .streams import takes_all_characters, tell

if TYPE_CHECKING:
    from ..specs import Experiment

Asked = Annotated[
    Path,
    typer.Argument(
        metavar="SPEC|NAME",
        help="An experiment file (YAML), or a name listed by `spi list`, whose system and initial value count.",
        autocompletion=complete_spec,
    ),
]


def answer(
    spec: Asked,
    function: Annotated[
        list[str] | None, typer.Option(help="Test function, e.g. 'y1^2' (default: those of the experiment).")
    ] = None,
    time: Annotated[str | None, typer.Option(help="Final time (default: that of the experiment).")] = None,
    accuracy: Annotated[str | None, typer.Option(help="Half the width of the 95 % interval, e.g. 1e-5.")] = None,
    seconds: Annotated[str | None, typer.Option(help="At most so many seconds of one thread (default: 3600).")] = None,
    dry: Annotated[bool, typer.Option("--dry", help="Run the pilot only, and predict.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print the answer as JSON.")] = False,
    profile: Profile = None,
    overrides: Overrides = None,
    seed: Seed = None,
    threads: Threads = None,
    out: Out = Path("results"),
    fresh: Fresh = False,
    max_time: MaxTime = None,
    checkpoint: Checkpoint = "5s",
    trust_code: TrustCode = False,
) -> None:
    """Find expectations E phi(y(T)) to a wanted accuracy.

    The program chooses scheme, steps, extrapolation and samples, or solves without sampling where it can; it checks
    the bias, and writes <out>/<name>.answer.h5.
    """
    asked = {"final_time": time, "accuracy": accuracy, "seconds": seconds, "functions": _functions(function)}
    named = [f"{key}={value}" for key, value in asked.items() if value is not None]
    (experiment,) = load([spec], profile, [*named, *(overrides or ())], None, seed, "answer", trust_code)
    limits = limits_of(max_time, checkpoint)
    prepare(threads)
    if dry:
        _predict(experiment)
        return
    from .. import storage
    from ..printing import as_json
    from ..report import views
    from ..running import run as runner
    from .progress import ProgressLine

    with ProgressLine(experiment.name) as line:
        path = runner.run(experiment, out, fresh, line.watch, limits)
    results = storage.read(path)
    if json:
        typer.echo(as_json(views.rows(results), takes_all_characters()))
    else:
        views.print_tables(results)
    tell(f"results: {path}")


def _functions(texts: list[str] | None) -> str | None:
    """The value of the key ``functions``: one function by its text, several as a mapping."""
    if not texts:
        return None
    quoted = ["'" + text.replace("'", "''") + "'" for text in texts]
    if len(quoted) == 1:
        return quoted[0]
    return "{" + ", ".join(f"phi{i}: {text}" for i, text in enumerate(quoted, 1)) + "}"


def _predict(experiment: "Experiment") -> None:
    """Run the pilots, and say what the answers would take."""
    from ..printing.text import human_time
    from ..running.predicting import predictions
    from .progress import ProgressLine

    with ProgressLine(experiment.name) as line:
        found = list(predictions(experiment, line.watch))
    for one in found:
        takes = f": about {human_time(one.seconds)} of processor time"
        takes += f"; the next digit {human_time(one.next_digit)}" * math.isfinite(one.next_digit)
        typer.echo(f"{one.case}: {one.how}{'' if math.isnan(one.seconds) else takes}")
