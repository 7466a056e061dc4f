"""Sums over paths, stored by what decides them: a file for each key, beside the results that are made of them.

A key is a hash of all that decides a sum and of the code that computes it, so that nothing else is asked when it is
used again, whichever spec asks for it.  The files are HDF5 with the checksum of results files: the text ``sums``, JSON
in which arrays stand as numbers, and the group ``arrays`` with each of them by its number.
"""

import json
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from .results import DAMAGE, StorageError, aside, checked, create, opened, read_array, size_of

#: Increased where the layout changes, or the division into chunks: runs continue with chunks of the same size only.
SUMS_VERSION = 8

#: The errors that reading a damaged file, or one of another layout, may raise.
_DAMAGE = (*DAMAGE, ArithmeticError, MemoryError)


class Store(NamedTuple):
    """Sums in a folder, by their keys; those of a `shard` of an experiment stand in files of their own."""

    folder: Path

    def path(self, key: str, shard: str = "") -> Path:
        """File of the sums with a key: ``<key>.h5``, or ``<key>.<shard>.h5``."""
        return self.folder / ".".join(filter(None, (key, shard, "h5")))

    def write(self, key: str, plain: Mapping[str, Any], shard: str = "") -> None:
        """Write dicts, lists, arrays, numbers and texts under a key."""
        arrays: list[Any] = []

        def reference(value: Any) -> Any:
            """JSON for what JSON has not: the number of an array, or of NumPy a number."""
            if isinstance(value, np.generic):
                return value.item()
            arrays.append(value)
            return {"array": str(len(arrays) - 1)}

        text = json.dumps({"version": SUMS_VERSION, **plain}, default=reference)
        path = self.path(key, shard)
        with aside(path) as temporary, create(temporary, size_of(arrays)) as file:
            group = file.create_group("arrays")
            for number, values in enumerate(arrays):
                group[str(number)] = values
            file["sums"] = text

    def read(self, key: str, shard: str = "") -> dict[str, Any] | None:
        """What was written under a key; None if there is nothing, StorageError if the file is damaged."""
        path = self.path(key, shard)
        if not path.exists():
            return None
        try:
            data, sound = checked(path)
            if not sound:
                raise ValueError("damaged")
            with opened(path, data) as file:
                plain = _read(file)
            if plain.pop("version") != SUMS_VERSION:
                raise ValueError("of another layout")
        except _DAMAGE:
            raise StorageError(f"{path}: is damaged; what it has is computed anew") from None
        return plain

    def remove(self, keys: Iterable[str]) -> None:
        """Remove the sums with these keys."""
        for key in keys:
            self.path(key).unlink(missing_ok=True)

    def remove_shards(self, keys: Collection[str]) -> None:
        """Remove the files of all shards with these keys."""
        for file in self.folder.glob("*.shard-*.h5"):
            if file.name.partition(".")[0] in keys:
                file.unlink(missing_ok=True)


def _read(file: h5py.File) -> dict[str, Any]:
    """All that a file of sums has."""

    def value(entry: dict[str, Any]) -> Any:
        return read_array(file["arrays"][entry["array"]]) if set(entry) == {"array"} else entry

    plain: dict[str, Any] = json.loads(file["sums"].asstr()[()], object_hook=value)
    return plain
