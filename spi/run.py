"""The one path from a spec to results, shared by the command line, Python users, the Makefile and the tests."""

import functools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import __version__, compiling, source_digest, spec, storage
from .ensemble import thread_count
from .kinds import KINDS
from .kinds.plans import KernelCall, Plan
from .records import Results
from .rng import STREAM_VERSION

#: What a run takes before and after its study, once everything is compiled.
STARTING_SECONDS = 2.0
#: A checkpoint is written after this many seconds, and when the run is interrupted.
CHECKPOINT_SECONDS = 10.0


class Stopped(Exception):
    """The run was interrupted; the same command goes on from the checkpoint."""


class Progress(NamedTuple):
    """How far a run is; one is reported before the first and after every batch of paths."""

    case: str
    part: str  #: scheme, and estimator if there are several
    done: float  #: in paths, or in seconds of typical speed
    total: float
    seconds: float  #: wall clock spent on it, including earlier runs
    stderr: float  #: of the error at the largest step and the final time; NaN before there is one
    number: int  #: of this part among all parts of all cases, from 0
    parts: int


@functools.cache
def layers() -> spec.Layers:
    """How spec files of all kinds are read."""
    return spec.Layers.of({name: kind.keys.Case for name, kind in KINDS.items()})


def load(path: str | Path, profile: str = "laptop", overrides: Iterable[str] = ()) -> spec.Experiment:
    """The experiment in a spec file; SpecError if anything is wrong with it, see :func:`spi.spec.load`."""
    return spec.load(path, layers(), profile, overrides)


def plans(experiment: spec.Experiment) -> list[Plan[Any]]:
    """The plans of all parts of all cases, in the order in which they are run."""
    study = KINDS[experiment.kind].study
    return [study.plan(case, part) for case in experiment.cases for part in study.parts(case)]


def results_path(experiment: spec.Experiment, out: str | Path) -> Path:
    """Where the results of an experiment go: ``<out>/<name>.h5``."""
    return Path(out) / f"{experiment.name}.h5"


def checkpoint_path(experiment: spec.Experiment, out: str | Path) -> Path:
    """Where the states of an unfinished run are kept."""
    return Path(out) / f"{experiment.name}.checkpoint.h5"


def run(
    experiment: spec.Experiment,
    out: str | Path = "results",
    fresh: bool = False,
    report: Callable[[Progress], None] = lambda progress: None,
    report_compiling: Callable[[int, int, str], None] = lambda number, total, name: None,
) -> Path:
    """Run an experiment, write its results file and return its path; goes on from a checkpoint if there is one.

    With `fresh` nothing earlier is looked at, and results of another spec are replaced.  Where kernels have to be
    compiled first, `report_compiling` is told which of how many comes next, and for which scheme.  Raises StorageError
    if the results cannot be written or are those of another spec, Stopped if interrupted.
    """
    target, checkpoint = results_path(experiment, out), checkpoint_path(experiment, out)
    storage.check_writable(target)
    if not fresh:
        storage.check_same_spec(target, experiment.hash)
    key_of_states = f"{experiment.hash} {source_digest()}"  # other code might go on with other numbers
    earlier = {} if fresh else storage.read_checkpoint(checkpoint, key_of_states) or {}
    ready = plans(experiment)
    states = {}
    saved = time.monotonic()
    try:
        compiling.compile_missing(_kernel_calls(ready), report_compiling)
        for number, plan in enumerate(ready):
            key = _key(plan)
            states[key] = _resumed(plan.start(), key, earlier)
            report(_progress(plan, states[key], number, len(ready)))
            for state in plan.batches(states[key]):
                states[key] = state
                report(_progress(plan, state, number, len(ready)))
                if time.monotonic() - saved > CHECKPOINT_SECONDS:
                    _write_states(checkpoint, key_of_states, earlier, states)
                    saved = time.monotonic()
        groups = tuple(plan.group(states[_key(plan)]) for plan in ready)
        storage.write(target, Results(_attributes(experiment), groups))
    except KeyboardInterrupt:
        _write_states(checkpoint, key_of_states, earlier, states)
        raise Stopped(f"stopped; what is done is kept in {checkpoint}: the same command goes on from there") from None
    checkpoint.unlink(missing_ok=True)
    return target


def results_of(spec_path: str | Path, out: str | Path = "results") -> Path:
    """The results file of a spec file; StorageError if there is none or if it was made from another spec.

    Results of a profile or with overrides count as those of the spec file.
    """
    path = Path(out) / f"{Path(spec_path).stem}.h5"
    attributes = storage.read(path).attributes
    if attributes["spec"] != Path(spec_path).read_text(encoding="utf-8"):
        profile = attributes["profile"]
        if load(spec_path, profile).hash != attributes["spec_hash"]:
            raise storage.StorageError(
                f"{path}: holds results of another spec than {spec_path}; run `spi run {spec_path}` first"
            )
    return path


class Cost(NamedTuple):
    """What an experiment would cost."""

    path_steps: float  #: steps of all paths, step sizes, schemes and cases together
    seconds: float  #: an estimate; NaN where nothing bounds the work
    megabytes: float
    at_most: bool  #: whether a target may be reached before


def cost(experiment: spec.Experiment) -> Cost:
    """The cost of an experiment from the steps to be taken and typical times of one step."""
    each = [plan.cost() for plan in plans(experiment)]
    at_most = any(getattr(case, "standard_error", None) is not None for case in experiment.cases)
    return Cost(
        path_steps=math.fsum(one.path_steps for one in each),
        seconds=STARTING_SECONDS + sum(one.seconds for one in each) / thread_count(),
        megabytes=max(one.bytes for one in each) / 1e6,
        at_most=at_most,
    )


def _kernel_calls(ready: Sequence[Plan[Any]]) -> list[tuple[str, KernelCall]]:
    """(name of a scheme, call) for all kernels; schemes first whose steps take long, as they do to compile as well."""

    def of_a_step(plan: Plan[Any]) -> float:
        cost = plan.cost()
        return float(np.nan_to_num(cost.seconds / max(cost.path_steps, 1)))

    dearest_first = sorted(ready, key=of_a_step, reverse=True)
    return [(plan.part.scheme, call) for plan in dearest_first for call in plan.kernel_calls()]


def _key(plan: Plan[Any]) -> str:
    """What the state of a plan is called in a checkpoint."""
    return f"{plan.case.name}/{plan.part.name}"


def _progress(plan: Plan[Any], state: Any, number: int, parts: int) -> Progress:
    done = plan.progress(state)
    return Progress(
        case=plan.case.name,
        part=plan.part.name,
        done=done.done,
        total=done.total,
        seconds=state.seconds,
        stderr=done.stderr,
        number=number,
        parts=parts,
    )


def _attributes(experiment: spec.Experiment) -> dict[str, Any]:
    return {
        "kind": experiment.kind,
        "title": experiment.title,
        "figure": experiment.figure,
        "spec": experiment.text,
        "spec_hash": experiment.hash,
        "expect": experiment.expect,
        "profile": experiment.profile,
        "seed": experiment.cases[0].seed,
        "stream_version": STREAM_VERSION,
        "spi_version": __version__,
        "source_digest": source_digest(),
        "complete": True,
        **storage.provenance(),
    }


def _write_states(path: Path, key: str, earlier: dict[str, Any], states: dict[str, Any]) -> None:
    """Keep all states, those of an earlier run that have not been reached again included."""
    flat = {key: value for name, state in states.items() for key, value in _flat(state, name).items()}
    storage.write_checkpoint(path, key, earlier | flat)


def _flat(state: Any, name: str) -> dict[str, Any]:
    """What a state and the states within it hold, by name."""
    flat: dict[str, Any] = {}
    for field, value in state._asdict().items():
        key = f"{name}/{field}"
        flat |= _flat(value, key) if hasattr(value, "_asdict") else {key: value}
    return flat


def _resumed(new: Any, name: str, earlier: dict[str, Any]) -> Any:
    """The state of a checkpoint, or the new one if there is none or if it is not shaped like that."""
    fits = all(
        key in earlier and np.shape(earlier[key]) == np.shape(new_value) for key, new_value in _flat(new, name).items()
    )
    return _with_values(new, name, earlier) if fits else new


def _with_values(state: Any, name: str, flat: dict[str, Any]) -> Any:
    """A state like this one that holds what `flat` says, the inverse of :func:`_flat`."""
    fields = {}
    for field, value in state._asdict().items():
        key = f"{name}/{field}"
        fields[field] = _with_values(value, key, flat) if hasattr(value, "_asdict") else flat[key]
    return type(state)(**fields)
