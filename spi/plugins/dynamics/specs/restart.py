"""Last states of stored trajectories as initial states, under the key ``initial``: a restart.

    initial: {results: quench}
    initial: {results: results/quench.h5, case: cold, scheme: splitting_symmetric, path: 3}

The state is kept with the spec, and with it the seeds of the run that ended there and of those that went before: the
new run has another seed, so that it does not repeat their noise.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spi import storage
from spi.ensemble.long_states import LongState, state_of
from spi.ensemble.protocol import dimension
from spi.specs.files import Files, content, unpacked
from spi.specs.keys import ABSENT, Keys, entries_in, key_of, listed, shown, wrong
from spi.storage.records import Group, StoredResults

_ENDING = ".last.npz"  # of the state as it is kept
_NAMES = ("y", "seeds")
_HALF = 2**32


class Restart(Keys):
    """The last state of a trajectory in a file of results."""

    results: key_of(str, "a name that `spi list results` shows, or a file of results of kind trajectory")
    case: key_of(str, "the case, where there are several") = ABSENT
    scheme: key_of(str, "the scheme, where there are several") = ABSENT
    path: key_of(int, "the number of the path, where there are several") = ABSENT

    def state(self, model: Any, files: Files) -> Any:
        """Numbers of the state."""
        wanted = {key: value for key, value in self if key != "results" and value is not None}
        digest = hashlib.sha256(json.dumps([self.results, wanted]).encode()).hexdigest()[:8]
        name = f"{Path(self.results).stem}.{digest}{_ENDING}"
        arrays = unpacked(files.made(name, "results", lambda: self._last(wanted, files.folder)), (1, 2), _NAMES)
        y = arrays["y"]
        if len(y) != dimension(model):
            right = f"must have {dimension(model)}, the dimension of the model"
            raise wrong(f"is {shown(self.results)}, whose states have {entries_in(len(y))}", right, "results")
        state = state_of(y)
        files.seeds[LongState(state).digest] = _numbers(arrays["seeds"])
        return state

    def _last(self, wanted: Mapping[str, Any], folder: Path) -> bytes:
        """The state and the seeds in an ``.npz``."""
        results = self._read(folder)
        group = self._chosen(wanted, results)
        y = group.variables["y"][1][-1]
        if not np.isfinite(y).all():
            raise wrong(f"is {shown(self.results)}, whose path has diverged", "give another run", "results")
        kept, seeds = io.BytesIO(), _seeds(results) | {int(group.attributes["seed"])}
        np.savez(kept, y=y, seeds=[divmod(seed, _HALF) for seed in sorted(seeds)])
        return kept.getvalue()

    def _read(self, folder: Path) -> StoredResults:
        """The file of results: of a name that in ./results or beside the spec, of a file seen from the spec."""
        named = Path(self.results).suffix != ".h5"
        places = [Path("results"), folder / "results"] if named else [folder]
        paths = [place / (f"{self.results}.h5" if named else self.results) for place in places]
        path = next((path for path in paths if path.is_file()), None)
        if path is None:
            right = "run that experiment first, or give the path of a file seen from the folder of the spec"
            raise wrong(f"is {shown(self.results)}, and there is no file {paths[0]}", right, "results")
        try:
            return storage.read(path)
        except storage.StorageError as error:
            raise wrong(f"is {shown(self.results)}, which cannot be read", str(error), "results") from None

    def _chosen(self, wanted: Mapping[str, Any], results: StoredResults) -> Group:
        """The only group of a trajectory that is meant."""
        stored = [group for group in results.groups if group.variables.get("y", ((),))[0] == ("t", "component")]
        if not stored:
            raise wrong(f"is {shown(self.results)}, which has no trajectory", "give one, kind: trajectory", "results")
        for key, of in (("case", lambda group: group.case), ("scheme", lambda group: group.variant), ("path", _path)):
            there = list(dict.fromkeys(map(of, stored)))
            if key in wanted and wanted[key] not in there:
                raise wrong(f"is '{wanted[key]}'", f"must be one of {listed(list(map(str, there)))}", key)
            if key not in wanted and len(there) > 1:
                right = f"add {key}: one of {listed(list(map(str, there)))}"
                raise wrong(f"is {shown(self.results)}, which has several", right, "results")
            stored = [group for group in stored if wanted.get(key, of(group)) == of(group)]
        return stored[0]


def _path(group: Group) -> int:
    return int(group.attributes["path"])


def _seeds(results: StoredResults) -> set[int]:
    """Seeds of the runs that went before, which the spec of a run keeps with the state where they ended."""
    kept = json.loads(results.attributes.get("model_sources") or "{}")
    former = [unpacked(content(text), (1, 2), _NAMES) for name, text in kept.items() if name.endswith(_ENDING)]
    return {seed for arrays in former for seed in _numbers(arrays["seeds"])}


def _numbers(halves: np.ndarray) -> frozenset[int]:
    """Seeds of 64 bits from arrays of numbers, which are exact up to 53."""
    return frozenset(int(high) * _HALF + int(low) for high, low in halves)
