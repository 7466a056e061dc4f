"""Stored groups as xarray."""

from typing import Any

import numpy as np
import xarray as xr

from ..storage.records import Description, Group


def dataset_of(group: Group) -> xr.Dataset:
    """The arrays of a group with their coordinates; components of states are called as in expressions."""
    coordinates: dict[str, Any] = {
        name: (name, _labels(group, name, values), group.notes.get(name)) for name, values in group.coordinates.items()
    }
    if "swept_word" in group.attributes:  # so that parts can be put together along the parameter
        coordinates[group.attributes["swept_word"]] = ((), group.attributes["swept_value"])
    if "swept_second_word" in group.attributes:
        coordinates[group.attributes["swept_second_word"]] = ((), group.attributes["swept_second_value"])
    variables = {name: (axes, values, group.notes.get(name)) for name, (axes, values) in group.variables.items()}
    attributes = {name: value for name, value in group.attributes.items() if value is not None}
    return xr.Dataset(variables, coordinates, attributes)


def _labels(group: Group, name: str, values: np.ndarray) -> np.ndarray:
    """The values of a coordinate; of components their names."""
    if name != "component":
        return values
    return np.array(component_names(Description.of(group).variables, len(values)))


def component_names(named: tuple[str, ...], count: int) -> list[str]:
    """What the components of a state are called in expressions: as the system has `named` them, or y1, y2, ..."""
    return list(named) or [f"y{i + 1}" for i in range(count)]
