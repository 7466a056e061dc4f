"""States of all parts of an experiment, and the sums that are stored of them while it runs and afterwards."""

import contextlib
import glob
import hashlib
import json
import math
import re
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from .. import NUMBERS_DIGEST, __version__, specs, storage
from ..kinds.plans import Plan, State
from ..specs.naming import results_in
from ..statistics.tallies import Chunk
from ..storage import StorageError, Store
from ..storage.results import aside, write_bytes
from ..storage.sums import SUMS_VERSION
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

    @property
    def ending(self) -> str:
        """What the names of its files have before their ending."""
        return f"shard-{self.number}-of-{self.count}"


_OF_SHARD = re.compile("[.]shard-([0-9]+)-of-([0-9]+)$")  # the end of the name of a shard's note, without its ending

#: The ending of the notes on unfinished runs.
NOTE = "json"


class _TimeIsUp(Exception):
    """The run has taken as long as it may."""


def note_path(experiment: specs.Experiment, out: str | Path, shard: Shard | None = None) -> Path:
    """Note on an unfinished run: ``<out>/sums/<experiment>-<hash of the spec>-<digest of the sources>.json``.

    Other sources might go on with other numbers, so that they have notes and sums of their own.
    """
    name = f"{experiment.name}-{experiment.hash[:12]}-{NUMBERS_DIGEST[:8]}"
    return Path(out) / "sums" / ".".join(filter(None, (name, shard.ending if shard else "", NOTE)))


class Checkpoint:
    """States of all parts of an experiment, and their files.

    Each path set, and what a part knows besides, has a file of its own in ``<out>/sums``, called by its key, and an
    unfinished run a note there.
    """

    def __init__(
        self,
        experiment: specs.Experiment,
        out: str | Path,
        limits: Limits,
        tell: Callable[[str], None],
        shard: Shard | None = None,
    ) -> None:
        self.experiment, self.limits, self.tell = experiment, limits, tell
        self.store, self.shard = Store(Path(out) / "sums"), shard
        self.note = note_path(experiment, out, shard)
        self.states = [State(plan) for plan in plans(experiment)]
        self.keys = [sums_keys(state.plan) for state in self.states]
        #: by key the places of what it decides: the number of a part and that of a path set, None for all else
        self.places: dict[str, list[tuple[int, int | None]]] = defaultdict(list)
        for part, keys in enumerate(self.keys):
            for number, key in keys.items():
                if number is not None and self.places[key]:
                    self.states[part].alike[number] = [(self.states[p], n or 0) for p, n in self.places[key]]
                self.places[key].append((part, number))
        #: what the files have, by the number of a part and that of a path set, None for what it knows besides
        self.stored: dict[tuple[int, int | None], Any] = {
            (part, None): _known(state, None) for part, state in enumerate(self.states)
        }
        self.began = self.saved = time.monotonic()
        self.pause = limits.checkpoint_seconds
        self.failed = False
        self.begun_with: float | None = None  #: the work that was done before this run
        self.saved_work = 0.0
        self.machines = {storage.machine()}  #: on which any of the sums were computed

    @property
    def keys_by_part(self) -> dict[str, list[str]]:
        """Name of a part -> the keys of what it knows besides sums, and of its path sets."""
        named = zip(self.states, self.keys, strict=True)
        return {name_of(state.plan): list(keys.values()) for state, keys in named}

    @property
    def all_keys(self) -> set[str]:
        """Keys of all parts."""
        return {key for keys in self.keys for key in keys.values()}

    def missing(self) -> list[tuple[int, Chunk]]:
        """Chunks that are wanted for now and not done, with the number of their part."""
        return [(number, chunk) for number, state in enumerate(self.states) for chunk in state.missing()]

    def chunks(self) -> tuple[str, ...]:
        """A line for each chunk, as ``Results.chunks``."""
        return tuple(f"{label} {digest}" for state in self.states for label, digest in digests_of(state).items())

    def shards(self) -> dict[Shard, Path]:
        """Notes of those shards of the experiment that have been begun."""
        shards = {}
        for file in self.store.folder.glob(f"{glob.escape(self.note.stem)}.shard-*.{NOTE}"):
            if match := _OF_SHARD.fullmatch(file.stem.removeprefix(self.note.stem)):
                with contextlib.suppress(ValueError):  # a name that no run gives
                    shards[Shard.of(f"{match[1]}/{match[2]}")] = file
        return shards

    def resume(self) -> None:
        """Take all sums that are stored, those of shards too; say so unless an unfinished run goes on."""
        taken = self.take()
        for shard in self.shards():
            taken |= self.take(shard.ending)
        if taken and not self.note.exists():
            self.tell(f"{', '.join(sorted(taken))}: going on with the sums over paths in {self.store.folder}")
        if not taken:
            self.tell_of_other_sources()

    def take(self, shard: str = "") -> set[str]:
        """Take the stored sums, of a shard or of the whole; the names of the parts that can use any."""
        taken = set()
        for part, (state, keys) in enumerate(zip(self.states, self.keys, strict=True)):
            for number, key in keys.items():
                try:
                    plain = self.store.read(key, shard)
                    if plain is None:
                        continue
                    machines = plain.pop("machines")
                    useful = state.merge(number, plain)
                except StorageError as error:
                    self.tell(f"warning: {error}")
                    continue
                except ValueError:
                    self.tell(f"warning: {self.store.path(key, shard)}: has sums of other shapes, which begin anew")
                    continue
                if not shard:
                    self.stored[part, number] = _known(state, number)
                if useful:
                    self.machines.update(machines)
                    taken.add(name_of(state.plan))
        return taken

    def tell_of_other_sources(self) -> None:
        """Say which unfinished run of this spec other sources of spi have begun."""
        name = self.note.name.removesuffix(f"-{NUMBERS_DIGEST[:8]}.{NOTE}")
        for file in sorted(self.store.folder.glob(f"{glob.escape(name)}-*.{NOTE}")):
            if (about := read_note(file)) is not None and about["source_digest"] != NUMBERS_DIGEST:
                self.tell(
                    f"{file}: has a run of this spec that {storage.computed_by(about)}; its sums are kept, and those "
                    "sources go on with them; with these the run begins anew"
                )
                return

    def save(self, finished: bool = False) -> None:
        """Write the files of all that is new, and unless it is finished the note.

        What is known besides sums comes first: of more sums than it wants some could not be used.
        """
        began = time.monotonic()
        if not finished:
            self.write_note()
        for besides in (True, False):
            if besides and self.shard:  # each shard has the decisions of the whole
                continue
            for key, places in self.places.items():
                if (places[0][1] is None) == besides:
                    self._write(key, places)
        self.saved, self.saved_work = time.monotonic(), self._work()
        self.pause = max(self.limits.checkpoint_seconds, (self.saved - began) / _SHARE)

    def _write(self, key: str, places: Sequence[tuple[int, int | None]]) -> None:
        """Write the file of a key if any of its places has something new."""
        known = {(part, number): _known(self.states[part], number) for part, number in places}
        if all(_same(one, self.stored.get(place, (None,))) for place, one in known.items()):
            return
        plain = _together([self.states[part].plain(number) for part, number in places])
        machines = {"machines": sorted(self.machines)}
        self.store.write(key, machines | plain, self.shard.ending if self.shard else "")
        self.stored |= known

    def write_note(self) -> None:
        """Write which run is unfinished, how far it is and which sums it needs."""
        about = {
            **{name: value for name, value in as_run(self.experiment).items() if name in _NOTED},
            "spec_hash": self.experiment.hash,
            "source_digest": NUMBERS_DIGEST,
            "spi_version": __version__,
            "progress": progress_of(self.states),
            "keys": sorted(self.all_keys),
        }
        with aside(self.note) as temporary:
            write_bytes(temporary, json.dumps(about).encode())

    def remove_shards(self) -> None:
        """Remove the files of all shards."""
        shards = self.shards()
        if shards:
            self.store.remove_shards(self.all_keys)
        for note in shards.values():
            note.unlink(missing_ok=True)

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
            saved = f"progress is saved in {self.store.folder}"
            raise Stopped(f"{why}; {saved}: run the same command again to resume") from None
        except Exception as error:  # whatever it is, what is done is not lost with it
            with contextlib.suppress(StorageError):
                if self._work() > self.saved_work:
                    self.save()
                if isinstance(error, WorkersLost) and self._work():
                    raise WorkersLost(f"{error}; progress is saved in {self.store.folder}") from None
            raise

    def _work(self) -> float:
        """Seconds spent on all sums that are there."""
        return sum(state.seconds for state in self.states)


def _known(state: State, number: int | None) -> tuple[Any, ...]:
    """What a state has of a path set, or for None besides sums: other objects when it grows."""
    return (state.extra, state.answers) if number is None else (state.tallies.get(number),)


def _same(one: tuple[Any, ...], other: tuple[Any, ...]) -> bool:
    return all(a is b for a, b in zip(one, other, strict=True))


def _together(plain: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What several states know of the same, in the form of :meth:`State.plain`, as one of them could tell it."""
    if "answers" in plain[0]:
        return max(plain, key=lambda one: (len(one["answers"]), one["extra"]["seconds"]))
    tallies: dict[str, dict[str, Any]] = {}
    for tally in (tally for one in plain for tally in one["tallies"]):
        nodes, short = [node[:2] for node in tally["nodes"]], [(index, sums["paths"]) for index, sums in tally["short"]]
        tallies.setdefault(repr((nodes, short)), tally)
    return {"tallies": list(tallies.values()), "digests": [digest for one in plain for digest in one["digests"]]}


#: The names of what stands in a note of a run.
_NOTED = ("experiment", "kind", "title", "profile", "overrides")

_MOST_OF_NOTE = 10**8  # bytes


def read_note(path: Path) -> dict[str, Any] | None:
    """Note on an unfinished run; None if it is none."""
    with contextlib.suppress(OSError, ValueError):
        about = json.loads(storage.contents(path, _MOST_OF_NOTE))
        needed = {*_NOTED, "source_digest", "progress", "keys"}
        if isinstance(about, dict) and needed <= about.keys() and isinstance(about["keys"], list):
            return about
    return None


def label_of(plan: Plan, chunk: Chunk) -> str:
    """Name of a chunk among those of all parts: that of its part, and its path set, number and paths."""
    return f"{name_of(plan)} {chunk.path_set} {chunk.index} {chunk.paths}"


def digests_of(state: State) -> dict[str, str]:
    """Digests of the chunks of a state that is complete, by their names."""
    return {
        label_of(state.plan, chunk): state.digests[number][chunk.index, chunk.paths]
        for number, path_set in enumerate(state.path_sets)
        for chunk in path_set.chunks(number)
    }


def progress_of(states: Sequence[State]) -> str:
    """Progress of an experiment, as in ``splitting 120 of 500 samples, midpoint 0 of 500 samples``."""
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
    """Spec, and how it is run, by the names that these have among the root attributes of results."""
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
# Sums go by the hash of all that decides them.
#
# Another scheme, another value of a swept parameter, another case or another claim changes no sum that is there, so
# that a spec with more of them, or fewer, computes only what is new.
# ---------------------------------------------------------------------------------------------------------------------


def sums_keys(plan: Plan) -> dict[int | None, str]:
    """By the number of a path set the key of its sums, and by None that of what the part knows besides sums."""
    keys: dict[int | None, str] = {None: _key(plan.deciding(None))}
    for number, path_set in enumerate(plan.path_sets(plan.initial_extra())):
        keys[number] = _key({**plan.deciding(number), "chunk_blocks": path_set.chunk_blocks})
    return keys


def _key(deciding: dict[str, Any]) -> str:
    """A hash of mappings in their order, since sums stand in the order of the functions that they are of."""
    text = json.dumps([SUMS_VERSION, NUMBERS_DIGEST, deciding], separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def remove_unneeded(results: Path, replaced: set[str]) -> None:
    """Remove sums once the results that are made of them are replaced for the second time.

    That are the `replaced` ones of `results`, and those of unfinished runs, with these sources, of this file that were
    there before the former results, but for all that other results in the folder or other unfinished runs need.
    """
    store, before = Store(results.parent / "sums"), storage.former(results).stat().st_mtime
    notes = [(file, about) for file in store.folder.glob(f"*.{NOTE}") if (about := read_note(file))]
    needed = [set[str]()]
    for file, about in notes:
        whose = results_in(results.parent, about["experiment"], about["profile"], about["overrides"])
        if whose == results and about["source_digest"] == NUMBERS_DIGEST and file.stat().st_mtime < before:
            store.remove_shards(about["keys"])
            file.unlink(missing_ok=True)
            replaced = replaced.union(about["keys"])
        else:
            needed.append(set(about["keys"]))
    if replaced:  # else the other results need not be read
        needed += [storage.keys_needed(file) for file in results.parent.glob("*.h5")]
        store.remove(replaced.difference(*needed))
