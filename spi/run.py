"""The one path from a spec to results and figures, shared by the command line, the Makefile and the tests."""

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from . import __version__, source_digest, store
from .ensemble import thread_count
from .records import Results
from .rng import STREAM_VERSION
from .spec import load
from .studies import STUDIES

#: What a run takes before and after its study, once everything is compiled.
STARTING_SECONDS = 2.0
#: A checkpoint is written after this many seconds, and when the run is interrupted.
CHECKPOINT_SECONDS = 10.0


class Stopped(Exception):
    """The run was interrupted; the same command goes on from the checkpoint."""


class Progress(NamedTuple):
    """How far a run is; one is reported before the first and after every batch of paths."""

    case: str
    scheme: str  #: and estimator, if there are several
    done: float  #: in paths, or in seconds of typical speed
    total: float
    seconds: float  #: wall clock spent on it, including earlier runs
    stderr: float  #: of the error at the largest step and the final time; NaN before there is one
    part: int  #: number of this part among all parts of all cases, from 0
    parts: int


def results_path(experiment, out):
    """Where the results of an experiment go: ``<out>/<name>.h5``."""
    return Path(out) / f"{experiment.name}.h5"


def checkpoint_path(experiment, out):
    return Path(out) / f"{experiment.name}.checkpoint.h5"


def run(experiment, out="results", fresh=False, report=lambda progress: None):
    """Run an experiment, write its results file and return its path; goes on from a checkpoint if there is one.

    With `fresh` nothing earlier is looked at, and results of another spec are replaced.  Raises StoreError if the
    results cannot be written or are those of another spec, Stopped if interrupted.
    """
    target, checkpoint = results_path(experiment, out), checkpoint_path(experiment, out)
    store.check_writable(target)
    if not fresh:
        store.check_same_spec(target, experiment.hash)
    study = STUDIES[experiment.kind]
    key_of_states = f"{experiment.hash} {source_digest()}"  # other code might go on with other numbers
    earlier = {} if fresh else store.read_checkpoint(checkpoint, key_of_states) or {}
    parts = [(case, part) for case in experiment.cases for part in study.parts(case)]
    states = {}
    saved = time.monotonic()
    try:
        for number, (case, part) in enumerate(parts):
            key = f"{case.name}/{part.name}"
            plan = study.plan(case, part)
            states[key] = _resumed(study.start(plan), key, earlier)
            place = (case.name, part.name), (number, len(parts))
            report(_progress(study, plan, states[key], *place))
            for state in study.batches(plan, states[key]):
                states[key] = state
                report(_progress(study, plan, state, *place))
                if time.monotonic() - saved > CHECKPOINT_SECONDS:
                    _write_states(checkpoint, key_of_states, earlier, states)
                    saved = time.monotonic()
        groups = [study.group(case, part, states[f"{case.name}/{part.name}"]) for case, part in parts]
        store.write(target, Results(_attributes(experiment), tuple(groups)))
    except KeyboardInterrupt:
        _write_states(checkpoint, key_of_states, earlier, states)
        raise Stopped(f"stopped; what is done is kept in {checkpoint}: the same command goes on from there") from None
    checkpoint.unlink(missing_ok=True)
    return target


def results_of(spec, out="results"):
    """The results file of a spec file; StoreError if there is none or if it was made from another spec.

    Results of a profile or with overrides count as those of the spec file.
    """
    path = Path(out) / f"{Path(spec).stem}.h5"
    attributes = store.read(path).attributes
    if attributes["spec"] != Path(spec).read_text(encoding="utf-8"):
        profile = attributes["profile"]
        if load(spec, profile).hash != attributes["spec_hash"]:
            raise store.StoreError(f"{path}: holds results of another spec than {spec}; run `spi run {spec}` first")
    return path


class Cost(NamedTuple):
    """What an experiment would cost."""

    path_steps: float  #: steps of all paths, step sizes, schemes and cases together
    seconds: float  #: an estimate; NaN where nothing bounds the work
    megabytes: float
    at_most: bool  #: whether a target may be reached before


def cost(experiment):
    """The cost of an experiment from the steps to be taken and typical times of one step."""
    study = STUDIES[experiment.kind]
    costs = [study.cost(case, part) for case in experiment.cases for part in study.parts(case)]
    steps, seconds, memory = zip(*costs, strict=True)
    at_most = any(getattr(case, "standard_error", None) is not None for case in experiment.cases)
    return Cost(sum(steps), STARTING_SECONDS + sum(seconds) / thread_count(), max(memory) / 1e6, at_most)


def _progress(study, plan, state, names, numbers):
    done, total, stderr = study.progress(plan, state)
    return Progress(*names, done, total, state.seconds, stderr, *numbers)


def _attributes(experiment):
    return {
        "kind": experiment.kind,
        "title": experiment.title,
        "figure": experiment.figure,
        "spec": experiment.text,
        "spec_hash": experiment.hash,
        "profile": experiment.profile,
        "seed": experiment.cases[0].seed,
        "stream_version": STREAM_VERSION,
        "spi_version": __version__,
        "complete": True,
        **store.provenance(),
    }


def _write_states(path, key, earlier, states):
    """Keep all states, those of an earlier run that have not been reached again included."""
    flat = {f"{name}/{field}": value for name, state in states.items() for field, value in state._asdict().items()}
    store.write_checkpoint(path, key, earlier | flat)


def _resumed(new, name, earlier):
    """The state of a checkpoint, or the new one if there is none or if it is not shaped like that."""
    fields = {field: earlier.get(f"{name}/{field}") for field in new._fields}
    fits = all(
        value is not None and np.shape(value) == np.shape(new_value)
        for value, new_value in zip(fields.values(), new, strict=True)
    )
    return type(new)(**fields) if fits else new
