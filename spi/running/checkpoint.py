"""The states of all parts of an experiment, and the file in which they are kept while it runs and afterwards."""

import contextlib
import glob
import hashlib
import json
import math
import re
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from .. import NUMBERS_DIGEST, __version__, specs, storage
from ..kinds.plans import Plan, State
from ..statistics.tallies import Chunk
from ..storage import StorageError
from ..storage.sums import VERSION
from .load import name_of, plans
from .workers import WorkersLost

#: Of the time of a run, what writing checkpoints may take.
_SHARE = 0.01

#: Into which an experiment may be divided.
MOST_SHARDS = 10_000


class Stopped(Exception):
    """The run was interrupted, or its time was up; the same command resumes from the checkpoint."""


class Limits(NamedTuple):
    """When a run keeps what is done, and when it ends."""

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
        found = cls(int(digits[1]), int(digits[2])) if digits else cls(0, 0)
        if not 1 <= found.number <= found.count <= MOST_SHARDS:
            raise ValueError(text)
        return found

    @property
    def suffix(self) -> str:
        """What its file is called after that of the whole."""
        return f".shard-{self.number}-of-{self.count}"


_OF_SHARD = re.compile("[.]shard-[0-9]+-of-[0-9]+$")  # how the name of the file of one ends, without .npz


class _TimeIsUp(Exception):
    """The run has taken as long as it may."""


def sums_path(experiment: specs.Experiment, out: str | Path, one: Shard | None = None) -> Path:
    """Where sums over paths are kept: ``<out>/sums/<name>-<hash of the spec>-<digest of the sources>-v<layout>.npz``.

    Other sources might go on with other numbers, so that their sums stand in a file of their own and are kept.
    """
    name = f"{experiment.name}-{experiment.hash[:12]}-{NUMBERS_DIGEST[:8]}-v{VERSION}{one.suffix if one else ''}.npz"
    return Path(out) / "sums" / name


class Checkpoint:
    """The states of all parts of an experiment, and their file."""

    def __init__(self, experiment: specs.Experiment, path: Path, limits: Limits, tell: Callable[[str], None]) -> None:
        self.experiment, self.path, self.limits, self.tell = experiment, path, limits, tell
        self.states = [State(plan) for plan in plans(experiment)]
        self.keys = {name: Keys.of(state.plan) for name, state in self.by_name.items()}
        self.began = self.saved = time.monotonic()
        self.pause = limits.checkpoint_seconds
        self.failed = False
        self.begun_with: float | None = None  #: the work that was known before this run
        self.saved_work = 0.0
        self.machines = {storage.machine()}  #: on which anything was computed that is known

    @property
    def by_name(self) -> dict[str, State]:
        """Name of a part -> its state."""
        return {name_of(state.plan): state for state in self.states}

    @property
    def sizes(self) -> dict[str, dict[str, int]]:
        """Name of a part -> how much of its sums is wanted, by what decides them."""
        return {name: sizes(state.plan, self.keys[name]) for name, state in self.by_name.items()}

    def missing(self) -> list[tuple[int, Chunk]]:
        """The chunks that are wanted for now and not done, with the number of their part."""
        return [(number, chunk) for number, state in enumerate(self.states) for chunk in state.missing()]

    def chunks(self) -> tuple[str, ...]:
        """A line for each chunk, as ``Results.chunks``."""
        return tuple(
            f"{name} {number} {chunk.index} {chunk.paths} {state.digests[number][chunk.index, chunk.paths]}"
            for name, state in self.by_name.items()
            for number, path_set in enumerate(state.path_sets)
            for chunk in path_set.chunks(number)
        )

    def shards(self) -> dict[Shard, Path]:
        """The files of those shards of the experiment that have been begun."""
        name, found = re.compile(re.escape(self.path.stem) + r"[.]shard-([0-9]+)-of-([0-9]+)[.]npz"), {}
        for file in self.path.parent.glob("*.npz"):
            if match := name.fullmatch(file.name):
                with contextlib.suppress(ValueError):  # a name that no run gives
                    found[Shard.of(f"{match[1]}/{match[2]}")] = file
        return found

    def resume(self) -> None:
        """Take what is known from the file and from those of shards, of other parts from other specs of the name."""
        known = self.merge(self.path)
        known = known.union(*(self.merge(file, with_extra=False) for file in self.shards().values()))
        self.take_of_others(self.by_name.keys() - known)

    def take_of_others(self, unknown: Collection[str]) -> None:
        """Take what is known of some parts from other specs of the name; say so, and what other sources have."""
        others = self.path.parent.glob(f"{glob.escape(self.experiment.name)}-*.npz") if unknown else ()
        abouts = {file: storage.about_sums(file) for file in others if not _OF_SHARD.search(file.stem)}
        of_these = {file: about for file, about in abouts.items() if about and self._same_sources(about)}
        sizes = {file: about.get("samples") or 0 for file, about in of_these.items()}
        found = {file: self.merge(file, only=unknown) for file in sorted(sizes, key=sizes.__getitem__, reverse=True)}
        for file, parts in found.items():
            if parts:
                self.tell(f"{', '.join(sorted(parts))}: going on with the sums over paths in {file}")
        if unknown == self.by_name.keys() and not any(found.values()):
            self.tell_of_other_sources()

    def tell_of_other_sources(self) -> None:
        """Say which sums over the same paths other sources of spi computed."""
        others = [(file, about) for file, about in self._of_spec(self.experiment.hash) if not self._same_sources(about)]
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
                storage.remove_sums(file)

    def _of_spec(self, spec_hash: str) -> Iterator[tuple[Path, dict]]:
        """The files of sums of a spec of this name, by whichever sources, and what they tell about them."""
        for file in sorted(self.path.parent.glob(f"{glob.escape(self.experiment.name)}-{spec_hash[:12]}*.npz")):
            about = storage.about_sums(file, any_version=True)
            if about is not None and about.get("spec_hash") == spec_hash:
                yield file, about

    def merge(self, path: Path, with_extra: bool = True, only: Collection[str] | None = None) -> set[str]:
        """Add what a file of sums knows of the very same paths, of some parts or of all; of which parts it does."""
        read = storage.read_sums(path)
        if read is None or not self._same_sources(read[0]):
            if read is None and path.exists():
                self.tell(f"warning: {path}: is damaged, or was edited; what it has is computed anew")
            return set()
        known = set()
        for name, state in self.by_name.items():
            if only is None or name in only:
                try:
                    if plain := Kept(*read).of(self.keys[name]):
                        state.merge(plain, with_extra)
                        known.add(name)
                        self.machines.update(read[0].get("machines") or ())
                except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, MemoryError) as error:
                    self.tell(f"warning: {path}: has {error} for {name}, so it was edited; they are computed anew")
        return known

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
    def kept(self) -> Iterator[None]:
        """Within it an interruption, or the end of the time, is turned into Stopped once all that is done is kept."""
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
        """Seconds spent on all that is known."""
        return sum(state.seconds for state in self.states)

    def _same_sources(self, about: dict) -> bool:
        return about["version"] == VERSION and about.get("source_digest") == NUMBERS_DIGEST


def progress_of(states: Sequence[State]) -> str:
    """How far the parts of an experiment are, as in ``splitting 120 of 500 samples, midpoint 0 of 500 samples``."""
    several = len({state.plan.case.name for state in states}) > 1
    told = []
    for state in states:
        plan, one = state.plan, state.plan.progress(state)
        of_paths = one.total > 1 and float(one.total).is_integer()  # else in seconds, or in parts of a path
        known = one.total > 0 and math.isfinite(one.done / one.total)
        share = f"{math.floor(100 * one.done / one.total) if known else 0} %"
        count = f"{int(one.done):,} of {int(one.total):,} samples" if of_paths else share
        told.append(f"{name_of(plan) if several else plan.part.name} {count}")
    return ", ".join(told)


def as_run(experiment: specs.Experiment) -> dict[str, Any]:
    """The spec, and how it is run, by the names that these have among the root attributes of results."""
    return {
        "experiment": experiment.name,
        "kind": experiment.kind,
        "title": experiment.title,
        "profile": experiment.profile,
        "overrides": experiment.overrides,
        "spec": experiment.text,
        "model_sources": json.dumps(dict(experiment.files)),
    }


# ---------------------------------------------------------------------------------------------------------------------
# What earlier runs know of the parts of an experiment: sums are found by the digest of what decides them.
#
# Another scheme, another value of a swept parameter, another case or another claim changes no sum that is there, so
# that
# a spec with more of them computes only what is new.
# ---------------------------------------------------------------------------------------------------------------------


class Keys(NamedTuple):
    """Digests of what decides a part: its sums over the paths of each path set, and all else that is known of it."""

    extra: str
    path_sets: tuple[str, ...]

    @classmethod
    def of(cls, plan: Plan) -> "Keys":
        """Those of a plan."""
        numbers = range(len(plan.path_sets(plan.initial_extra())))
        return cls(_digest(plan.deciding(None)), tuple(_digest(plan.deciding(number)) for number in numbers))


def _digest(deciding: dict[str, Any]) -> str:
    """Of mappings in their order, since sums stand in the order of the functions that they are of."""
    text = json.dumps(deciding, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def sizes(plan: Plan, keys: Keys) -> dict[str, int]:
    """How much of the sums with each key a plan wants, as results tell it."""
    return dict(zip(keys.path_sets, plan.sizes(), strict=True))


class Kept:
    """A file of sums that has been read, by keys."""

    def __init__(self, about: dict[str, Any], parts: dict[str, Any]) -> None:
        self.parts, keys = parts, about["keys"]
        self.extras = {told["extra"]: part for part, told in keys.items()}
        self.places = {
            key: (part, number) for part, told in keys.items() for number, key in enumerate(told["path_sets"])
        }

    def of(self, keys: Keys) -> dict[str, Any]:
        """What is known of a part with these keys, as ``State.plain`` tells it; empty if that is nothing."""
        found: dict[str, Any] = {"path_sets": list(self._path_sets(keys))}
        if keys.extra in self.extras:
            found["extra"] = self.parts[self.extras[keys.extra]]["extra"]
        return found if found["path_sets"] or "extra" in found else {}

    def _path_sets(self, keys: Keys) -> Iterable[dict[str, Any]]:
        for number, key in enumerate(keys.path_sets):
            part, there = self.places.get(key, ("", 0))
            for one in self.parts[part]["path_sets"] if part else ():
                if one["number"] == there:
                    yield {**one, "number": number}
