"""Checkpoints: the states of an unfinished run in an HDF5 file."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .files import DAMAGE, aside, create
from .results import read_array

MARK, VERSION = "spi_checkpoint", 2


def write_checkpoint(path: Path, spec_hash: str, state: dict[str, Any]) -> None:
    """Keep ``state``, a flat dict of arrays, numbers and strings; a key "a/b" lies in the group "a"."""
    with aside(path) as temporary, create(temporary) as file:
        file.attrs[MARK] = VERSION
        file.attrs["spec_hash"] = spec_hash
        for key, value in state.items():
            values = np.asarray(value)
            text = values.dtype.kind == "U"
            file.create_dataset(
                key, data=values.astype(object) if text else values, dtype=h5py.string_dtype() if text else None
            ).attrs["scalar"] = not isinstance(value, np.ndarray)


def read_checkpoint(path: Path, spec_hash: str) -> dict[str, Any] | None:
    """The state kept in ``path``, or None if there is none for this spec that can be read."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs[MARK] != VERSION or file.attrs["spec_hash"] != spec_hash:
                return None
            state = {}

            def collect(key: str, item: h5py.Dataset | h5py.Group) -> None:
                if isinstance(item, h5py.Dataset):
                    values = read_array(item)
                    state[key] = values.item() if item.attrs["scalar"] else values

            file.visititems(collect)
            return state
    except DAMAGE:
        return None
