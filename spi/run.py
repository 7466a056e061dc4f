"""The one path from a spec to results and figures, shared by the command line, the Makefile and the tests."""

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from . import __version__, source_digest, store
from .ensemble import thread_count
from .records import Results
from .rng import LANES, STREAM_VERSION
from .schemes import SCHEMES
from .spec import load
from .studies import STUDIES

#: A checkpoint is written after this many seconds, and when the run is interrupted.
CHECKPOINT_SECONDS = 10.0


class Stopped(Exception):
    """The run was interrupted; the same command goes on from the checkpoint."""


class Progress(NamedTuple):
    """How far a run is; one is reported before the first and after every batch of paths."""

    case: str
    scheme: str
    done: int  #: paths
    samples: int
    seconds: float  #: wall clock spent on these paths, including earlier runs
    stderr: float  #: of the error at the largest step and the final time; NaN before there is one
    part: int  #: number of this scheme among all schemes of all cases, from 0
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
    states = {} if fresh else _read_states(study, checkpoint, key_of_states)
    parts = [(case, scheme) for case in experiment.cases for scheme in case.schemes]
    saved = time.monotonic()
    try:
        for part, (case, scheme) in enumerate(parts):
            key = f"{case.name}/{scheme}"
            plan = study.plan(case, scheme)
            new = study.start(plan)
            states[key] = _fitting(states.get(key), new) or new
            report(_progress(study, plan, states[key], case, scheme, part, len(parts)))
            for state in study.batches(plan, states[key]):
                states[key] = state
                report(_progress(study, plan, state, case, scheme, part, len(parts)))
                if time.monotonic() - saved > CHECKPOINT_SECONDS:
                    _write_states(checkpoint, key_of_states, states)
                    saved = time.monotonic()
        groups = [study.group(case, scheme, states[f"{case.name}/{scheme}"]) for case, scheme in parts]
        store.write(target, Results(_attributes(experiment), tuple(groups)))
    except KeyboardInterrupt:
        _write_states(checkpoint, key_of_states, states)
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

    path_steps: int  #: steps of all paths, step sizes, schemes and cases together
    seconds: float  #: a rough estimate
    megabytes: float


def cost(experiment):
    """The cost of an experiment from the steps to be taken and typical times of one step."""
    study = STUDIES[experiment.kind]
    steps, seconds, memory = 0, 0.0, 0.0
    for case in experiment.cases:
        per_path, needed = study.cost(case)
        memory = max(memory, needed)
        for scheme in case.schemes:
            steps += per_path * case.samples
            seconds += per_path * case.samples * 1e-9 * SCHEMES[scheme].typical_ns / thread_count()
    return Cost(steps, seconds, memory / 1e6)


def _progress(study, plan, state, case, scheme, part, parts):
    done = min(state.blocks * LANES, plan.samples)
    stderr = study.current_stderr(plan, state) if done else float("nan")
    return Progress(case.name, scheme, done, plan.samples, state.seconds, stderr, part, parts)


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


def _write_states(path, spec_hash, states):
    flat = {f"{key}/{name}": value for key, state in states.items() for name, value in state._asdict().items()}
    store.write_checkpoint(path, spec_hash, flat)


def _read_states(study, path, spec_hash):
    flat = store.read_checkpoint(path, spec_hash) or {}
    grouped = {}
    for name, value in flat.items():
        key, field = name.rsplit("/", 1)
        grouped.setdefault(key, {})[field] = value
    return {key: study.State(**f) for key, f in grouped.items() if set(f) == set(study.State._fields)}


def _fitting(state, new):
    """The state of a checkpoint, or None if there is none or if it is not shaped like a new one."""
    if state is not None and [np.shape(x) for x in state] == [np.shape(x) for x in new]:
        return state
    return None
