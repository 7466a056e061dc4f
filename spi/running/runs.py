"""The one path from a spec to results, shared by the command line, Python users, the Makefile and the tests."""

import inspect
import shlex
import sys
from pathlib import Path

from .. import specs, storage, systems
from ..models.damped import undamped
from ..schemes import typical_ns
from . import engine
from .checkpoint import Limits, Stopped, sums_path
from .loading import Source, headings, layers, load, plans
from .session import NOBODY, USUAL, Cost, Progress, Session, Watch, cost_of, identity, results_path
from .workers import Workers

__all__ = [
    "Cost",
    "Limits",
    "Progress",
    "Stopped",
    "Watch",
    "cost",
    "headings",
    "layers",
    "load",
    "plans",
    "reports",
    "results_of",
    "results_path",
    "run",
    "sources",
    "sums_path",
]


def run(
    experiment: specs.Experiment,
    out: str | Path = "results",
    fresh: bool = False,
    watch: Watch = NOBODY,
    limits: Limits = USUAL,
    workers: Workers | None = None,
) -> Path:
    """Run an experiment, write its results file and return its path.

    What is known already is not computed again: of an unfinished run, of a finished one, or of one that differs in the
    number of samples only.  With `fresh` nothing earlier is looked at, and results of another spec are replaced.
    `workers` are processes that compute; without them this one does, on all its threads.

    Raises StorageError if the results cannot be written or are those of another spec, Stopped if interrupted.
    """
    session = Session(experiment, out, fresh, watch, limits, sums_path(experiment, out))
    checkpoint = session.checkpoint
    if not fresh:
        if storage.is_finished(session.target, identity(experiment)):
            watch.tell(f"{session.target} already has the results of this spec; use --fresh to recompute them")
            return session.target
        checkpoint.resume()
    watch.report_beginning(experiment.title, session.cost())
    with checkpoint.kept():
        if checkpoint.missing():
            session.compile()
        if workers is None:
            engine.advance_here(checkpoint.states, session.tick)
        else:
            engine.advance_with(workers, Source.of(experiment), checkpoint.states, session.tick)
        return session.finish()


def results_of(spec_path: str | Path, out: str | Path = "results") -> Path:
    """The results file of a spec file; StorageError if there is none or if it was made from another spec.

    Results of a profile or with overrides count as those of the spec file.
    """
    path = Path(out) / f"{Path(spec_path).stem}.h5"
    attributes = storage.read(path).attributes
    if "model_sources" in attributes or attributes["spec"] != Path(spec_path).read_text(encoding="utf-8"):
        profile = attributes["profile"]
        if load(spec_path, profile).hash != attributes["spec_hash"]:
            raise storage.StorageError(
                f"{path}: holds results of another spec than {spec_path}; "
                f"run `spi run {shlex.quote(str(spec_path))}` first"
            )
    return path


def reports(experiment: specs.Experiment) -> dict[str, list[str]]:
    """What was found of the generated models of an experiment, lines by the name of the system and its cases."""
    found: dict[tuple[str, ...], list[str]] = {}
    for case in experiment.cases:
        if lines := systems.report(undamped(case.model)):
            steps = [f"a step of {s}: about {typical_ns(case.row(s), case.model):.3g} ns" for s in case.schemes]
            found.setdefault((case.model_name, *lines, *steps), []).append(case.name)
    several = len(experiment.cases) > 1
    return {f"{name} ({', '.join(cases)})" if several else name: list(lines) for (name, *lines), cases in found.items()}


def sources(experiment: specs.Experiment) -> list[str]:
    """The Python modules in which the models of an experiment are defined, each once."""
    modules = dict.fromkeys(sys.modules[type(undamped(case.model)).__module__] for case in experiment.cases)
    return [inspect.getsource(module) for module in modules]


def cost(experiment: specs.Experiment) -> Cost:
    """The cost of an experiment from the steps to be taken and typical times of one step."""
    return cost_of(experiment, plans(experiment))
