"""Stored groups as xarray."""

from typing import Any

import numpy as np
import xarray as xr

from ..storage.records import Description, Group

#: What variables and coordinates are called in print, those that occur in several kinds first; others by their names.
_LONG_NAMES = {
    "h": "step size",
    "t": "time",
    "y": "state",
    "error": "error",
    "error_final": "error at the final time",
    "casimir_drift": "largest change of a Casimir",
    "nonfinite": "diverged paths (NaN or infinity)",
    "expectation": "expectation of the test function",
    "reference": "expectation at the reference step",
    "hamiltonian": "Hamiltonian",
    "casimirs": "Casimirs",
    "function": "test function",
}
_ERRORS = {
    "strong": ("strong error", "sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2)"),
    "weak": ("weak error", "E phi(y_h(T)) - E phi(y(T))"),
}
_UNITS = {"seconds": "s", "cpu_seconds": "s", "seconds_per_path": "s", "ns_per_step": "ns", "largest_angle": "rad"}


def long_name(name: str, kind: str = "") -> str:
    """What a variable is called in print."""
    base = name.removesuffix("_stderr").removesuffix("_bound")
    if base != name:
        what = "standard error" if name.endswith("_stderr") else "bound of the numerical error"
        return f"{what} of the {long_name(base)}"
    if name == "error" and kind in _ERRORS:
        return _ERRORS[kind][0]
    return _LONG_NAMES.get(name, name.replace("_", " "))


def dataset_of(group: Group, kind: str = "") -> xr.Dataset:
    """The arrays of a group with their coordinates; components of states are called as in expressions."""

    def told(name: str) -> dict[str, str]:
        formula = {"formula": _ERRORS[kind][1]} if name == "error" and kind in _ERRORS else {}
        units = {"units": _UNITS[name]} if name in _UNITS else {}
        return {"long_name": long_name(name, kind), **formula, **units}

    coordinates: dict[str, Any] = {
        name: (name, _labels(group, name, values), told(name)) for name, values in group.coordinates.items()
    }
    variables = {name: (axes, values, told(name)) for name, (axes, values) in group.variables.items()}
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
