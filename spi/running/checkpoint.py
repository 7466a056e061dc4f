"""The states of all parts of an experiment, and the file in which they are stored while it runs and afterwards."""

import contextlib
import glob
import hashlib
import json
import math
import re
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from .. import NUMBERS_DIGEST, __version__, specs, storage
from ..kinds.plans import Plan, State
from ..statistics.tallies import Chunk
from ..storage import StorageError
from ..storage.results import SUFFIX, SUMS_VERSION
from .load import name_of, plans
from .workers import WorkersLost

#: The share of the time of a run that writing checkpoints may take.
_SHARE = 0.01

#: Into which an experiment may be divided.
MOST_SHARDS = 10_000


class Stopped(Exception):
    """The run was interrupted, or its time was up; the same command resumes from the checkpoint."""


class Limits(NamedTuple):
    """When a run writes checkpoints, and when it ends."""

    checkpoint_seconds: float = 5.0  #: from one checkpoint to the next, or longer where writing one takes long
    max_seconds: float = math.inf  #: after which it stops as if it were interrupted


@dataclass(frozen=True)
class Shard:
    """Number `number` of `count` shares of an experiment that is divided among several runs."""

    number: int  #: from 1 on
    count: int

    @classmethod
    def of(cls, text: str) -> "Shard":
        """Read from "3/8"; ValueError if that is not a shard, or one of more than MOST_SHARDS."""
        digits = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text)
        shard = cls(int(digits[1]), int(digits[2])) if digits else cls(0, 0)
        if not 1 <= shard.number <= shard.count <= MOST_SHARDS:
            raise ValueError(text)
        return shard


_OF_SHARD = re.compile("[.]shard-([0-9]+)-of-([0-9]+)$")  # the end of the name of a shard's file, without its ending


class _TimeIsUp(Exception):
    """The run has taken as long as it may."""


def sums_path(experiment: specs.Experiment, out: str | Path, shard: Shard | None = None) -> Path:
    """The file of sums: ``<out>/sums/<name>-<hash of the spec>-<digest of the sources>-v<layout>.sums``.

    Other sources might go on with other numbers, so that their sums stand in a file of their own, which stays.
    """
    name = f"{experiment.name}-{experiment.hash[:12]}-{NUMBERS_DIGEST[:8]}-v{SUMS_VERSION}"
    suffix = f".shard-{shard.number}-of-{shard.count}" if shard else ""
    return Path(out) / "sums" / f"{name}{suffix}{SUFFIX}"


class Checkpoint:
    """The states of all parts of an experiment, and their file."""

    def __init__(self, experiment: specs.Experiment, path: Path, limits: Limits, tell: Callable[[str], None]) -> None:
        self.experiment, self.path, self.limits, self.tell = experiment, path, limits, tell
        self.states = [State(plan) for plan in plans(experiment)]
        self.by_name = {name_of(state.plan): state for state in self.states}
        self.keys = {name: Keys.of(state.plan) for name, state in self.by_name.items()}
        self.began = self.saved = time.monotonic()
        self.pause = limits.checkpoint_seconds
        self.failed = False
        self.begun_with: float | None = None  #: the work that was done before this run
        self.saved_work = 0.0
        self.machines = {storage.machine()}  #: on which any of the sums were computed

    @property
    def sizes(self) -> dict[str, dict[str, int]]:
        """Name of a part -> the wanted size of its sums, by their keys."""
        return {
            name: dict(zip(self.keys[name].path_sets, state.plan.sizes(), strict=True))
            for name, state in self.by_name.items()
        }

    def missing(self) -> list[tuple[int, Chunk]]:
        """The chunks that are wanted for now and not done, with the number of their part."""
        return [(number, chunk) for number, state in enumerate(self.states) for chunk in state.missing()]

    def chunks(self) -> tuple[str, ...]:
        """A line for each chunk, as ``Results.chunks``."""
        return tuple(f"{label} {digest}" for state in self.states for label, digest in digests_of(state).items())

    def shards(self) -> dict[Shard, Path]:
        """The files of those shards of the experiment that have been begun."""
        shards = {}
        for file in self.path.parent.glob(f"{glob.escape(self.path.stem)}.shard-*{SUFFIX}"):
            if match := _OF_SHARD.fullmatch(file.stem.removeprefix(self.path.stem)):
                with contextlib.suppress(ValueError):  # a name that no run gives
                    shards[Shard.of(f"{match[1]}/{match[2]}")] = file
        return shards

    def resume(self) -> None:
        """Take the sums in the file and in those of shards, and of other parts those of other specs of the name."""
        merged = self.merge(self.path)
        merged = merged.union(*(self.merge(file, with_extra=False) for file in self.shards().values()))
        self.take_of_others(self.by_name.keys() - merged)

    def take_of_others(self, lacking: Collection[str]) -> None:
        """Take the sums of some parts from other specs of the name; say so, and which sums other sources have."""
        samples = {}
        for file in self._files() if lacking else ():
            about = None if _OF_SHARD.search(file.stem) else storage.about_sums(file)
            if about and _same_sources(about):
                samples[file] = about.get("samples") or 0
        any_merged = False
        for file in sorted(samples, key=samples.__getitem__, reverse=True):
            if merged := self.merge(file, only=lacking):
                any_merged = True
                self.tell(f"{', '.join(sorted(merged))}: going on with the sums over paths in {file}")
        if lacking == self.by_name.keys() and not any_merged:
            self.tell_of_other_sources()

    def tell_of_other_sources(self) -> None:
        """Say which sums over the same paths other sources of spi computed."""
        others = [(file, about) for file, about in self._of_spec(self.experiment.hash) if not _same_sources(about)]
        for file, about in others[:1]:
            more = f" (and {len(others) - 1} more)" if others[1:] else ""
            self.tell(
                f"{file}{more} has sums over these paths that {storage.computed_by(about)}; they are kept, and those "
                "sources go on with them; with these the run begins anew"
            )

    def remove_finished(self, spec_hash: str, source_digest: str) -> None:
        """Remove the sums of a finished run of another spec, or by other sources, whose results are replaced."""
        for file, about in self._of_spec(spec_hash):
            if about.get("finished") and about.get("source_digest") == source_digest:
                file.unlink(missing_ok=True)

    def _files(self, spec_hash: str = "") -> list[Path]:
        """The files of sums of all specs of this name, or of one."""
        return sorted(self.path.parent.glob(f"{glob.escape(self.experiment.name)}-{spec_hash[:12]}*{SUFFIX}"))

    def _of_spec(self, spec_hash: str) -> Iterator[tuple[Path, dict]]:
        """The files of sums of a spec of this name, by whichever sources, with their attributes."""
        for file in self._files(spec_hash):
            about = storage.about_sums(file, any_version=True)
            if about is not None and about.get("spec_hash") == spec_hash:
                yield file, about

    def merge(self, path: Path, with_extra: bool = True, only: Collection[str] | None = None) -> set[str]:
        """Add the sums over the very same paths in a file, of some parts or of all; the names of the parts it has."""
        read = storage.read_sums(path)
        if read is None or not _same_sources(read[0]):
            if read is None and path.exists():
                self.tell(f"warning: {path}: is damaged; what it has is computed anew")
            return set()
        merged = set()
        for name in self.by_name if only is None else only:
            if plain := stored_of(*read, self.keys[name]):
                if not self.by_name[name].fits(plain):
                    self.tell(f"warning: {path}: has sums of other shapes than those of {name}, which begins anew")
                    continue
                if not self.by_name[name].merge(plain, with_extra):
                    continue
                merged.add(name)
                self.machines.update(read[0]["machines"])
        return merged

    def save(self, finished: bool = False) -> None:
        """Write the file."""
        began = time.monotonic()
        about = {
            "keys": {name: keys._asdict() for name, keys in self.keys.items()},
            "spec_hash": self.experiment.hash,
            "source_digest": NUMBERS_DIGEST,  # other code might go on with other numbers
            "spi_version": __version__,
            "samples": sum(self.experiment.samples),
            "finished": finished,
            "machines": sorted(self.machines),
            "progress": progress_of(self.states),
            "run": as_run(self.experiment),
        }
        storage.write_sums(self.path, about, {name: state.plain() for name, state in self.by_name.items()})
        self.saved, self.saved_work = time.monotonic(), self._work()
        self.pause = max(self.limits.checkpoint_seconds, (self.saved - began) / _SHARE)

    def tick(self) -> None:
        """Save if it is time to; a checkpoint that cannot be written is no reason to stop."""
        now, work = time.monotonic(), self._work()
        if self.begun_with is None:
            self.begun_with = work
        elif now - self.began > self.limits.max_seconds and work > self.begun_with:
            raise _TimeIsUp  # not before anything is done: a limit shorter than the start would mean no end
        if now - self.saved > self.pause:
            try:
                self.save()
            except StorageError as error:
                self.saved = time.monotonic()
                if not self.failed:
                    self.tell(f"warning: no checkpoint could be written: {error}; the run continues")
                self.failed = True

    @contextlib.contextmanager
    def saved_at_the_end(self) -> Iterator[None]:
        """Within it an interruption, or the end of the time, is turned into Stopped once all that is done is saved."""
        try:
            yield
        except (KeyboardInterrupt, _TimeIsUp) as reason:
            why = "stopped" if isinstance(reason, KeyboardInterrupt) else "stopped, the time limit is reached"
            try:
                self.save()
            except StorageError as error:
                raise Stopped(f"{why}; progress could not be saved: {error}") from None
            raise Stopped(f"{why}; progress is saved in {self.path}: run the same command again to resume") from None
        except Exception as error:  # whatever it is, what is done is not lost with it
            with contextlib.suppress(StorageError):
                if self._work() > self.saved_work:
                    self.save()
                if isinstance(error, WorkersLost) and self._work():
                    raise WorkersLost(f"{error}; progress is saved in {self.path}") from None
            raise

    def _work(self) -> float:
        """Seconds spent on all sums that are there."""
        return sum(state.seconds for state in self.states)


def _same_sources(about: dict) -> bool:
    return about["version"] == SUMS_VERSION and about.get("source_digest") == NUMBERS_DIGEST


def label_of(plan: Plan, chunk: Chunk) -> str:
    """The name of a chunk among those of all parts: that of its part, and its path set, number and paths."""
    return f"{name_of(plan)} {chunk.path_set} {chunk.index} {chunk.paths}"


def digests_of(state: State) -> dict[str, str]:
    """The digests of the chunks of a state that is complete, by their names."""
    return {
        label_of(state.plan, chunk): state.digests[number][chunk.index, chunk.paths]
        for number, path_set in enumerate(state.path_sets)
        for chunk in path_set.chunks(number)
    }


def progress_of(states: Sequence[State]) -> str:
    """The progress of an experiment, as in ``splitting 120 of 500 samples, midpoint 0 of 500 samples``."""
    several = len({state.plan.case.name for state in states}) > 1
    parts = []
    for state in states:
        plan, (done, total, _) = state.plan, state.plan.progress(state)
        if total > 1 and float(total).is_integer():  # else in seconds, or in parts of a path
            count = f"{int(done):,} of {int(total):,} samples"
        else:
            count = f"{math.floor(100 * done / total) if total > 0 and math.isfinite(done / total) else 0} %"
        parts.append(f"{name_of(plan) if several else plan.part.name} {count}")
    return ", ".join(parts)


def as_run(experiment: specs.Experiment) -> dict[str, Any]:
    """The spec, and how it is run, by the names that these have among the root attributes of results."""
    return {
        "experiment": experiment.name,
        "kind": experiment.kind,
        "title": experiment.title,
        "profile": experiment.profile,
        "overrides": experiment.overrides,
        "spec": experiment.text,
        "model_sources": json.dumps(dict(experiment.files)) if experiment.files else None,
    }


# ---------------------------------------------------------------------------------------------------------------------
# Sums of earlier runs go by the digest of all that determines them.
#
# Another scheme, another value of a swept parameter, another case or another claim changes no sum that is there, so
# that a spec with more of them computes only what is new.
# ---------------------------------------------------------------------------------------------------------------------


class Keys(NamedTuple):
    """Digests of all that determines a part: its sums over the paths of each path set, and its other results."""

    extra: str
    path_sets: tuple[str, ...]

    @classmethod
    def of(cls, plan: Plan) -> "Keys":
        """The keys of a plan."""
        numbers = range(len(plan.path_sets(plan.initial_extra())))
        return cls(_digest(plan.deciding(None)), tuple(_digest(plan.deciding(number)) for number in numbers))


def _digest(deciding: dict[str, Any]) -> str:
    """A digest of mappings in their order, since sums stand in the order of the functions that they are of."""
    text = json.dumps(deciding, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def stored_of(about: dict[str, Any], parts: dict[str, Any], keys: Keys) -> dict[str, Any]:
    """The state of a part with these keys in a file of sums, as ``State.plain`` makes it; empty if it has nothing."""
    extras = [part for part, its in about["keys"].items() if its["extra"] == keys.extra]
    path_sets = {key: (part, i) for part, its in about["keys"].items() for i, key in enumerate(its["path_sets"])}
    places = [(number, *path_sets[key]) for number, key in enumerate(keys.path_sets) if key in path_sets]
    sums = [
        {**stored, "number": number}
        for number, part, there in places
        for stored in parts[part]["path_sets"]
        if stored["number"] == there
    ]
    if not (extras or sums):
        return {}
    return {"path_sets": sums} | ({"extra": parts[extras[-1]]["extra"]} if extras else {})
