"""Curves of results in axes of a person's own."""

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ..drawing import as_bytes, style
from ..report import views
from ..storage.records import INTERVAL
from ..storage.stored import by_case

if TYPE_CHECKING:
    from ..drawing import Figure
    from ..drawing.axes import Axes
    from .results import Results


def draw_into(ax: "Axes", results: "Results", quantity: str | None, look: dict[str, Any]) -> "Axes":
    """Draw a quantity of every part against the step size or the time; ValueError if a part has none of that name."""
    readings = views.readings(results.stored)
    looks = style.looks(by_case(readings))
    for reading, name in zip(readings, results.parts, strict=True):
        arrays = results[name].dataset
        wanted = quantity or ("error" if "error" in arrays else "y")
        if wanted not in arrays or not {"h", "t"} & set(arrays[wanted].dims):
            able = [str(one) for one, array in arrays.items() if {"h", "t"} & set(array.dims)]
            raise ValueError(f"{name} has no {wanted} against h or t; give quantity= one of {', '.join(able)}")
        marker, colour = looks[reading.about.variant]
        own: dict[str, Any] = {"marker": marker} if "h" in arrays[wanted].dims else {}
        lines = list(_lines(arrays, wanted))
        if len(lines) == 1:  # the colours of several lines of one part are left to matplotlib
            own["color"] = colour
        for label, x, y, half in lines:
            text = ", ".join(filter(None, (style.label(reading.about), label)))
            ax.errorbar(x, y, half, **{"label": text, **own, **look})
        _dress(ax, arrays[wanted])
    return ax


def _lines(arrays: xr.Dataset, quantity: str) -> Iterator[tuple[str, np.ndarray, np.ndarray, np.ndarray | None]]:
    """(what tells it from others, x, y, half the interval) of each line, one for each place along other axes than x."""
    values = arrays[quantity]
    x = "h" if "h" in values.dims else "t"
    if quantity == "error":
        values = abs(values)
    stderr = arrays.get(f"{quantity}_stderr")
    half = arrays.get(f"{quantity}_bound") if stderr is None else INTERVAL * stderr
    others = [dim for dim in values.dims if dim != x]
    for place in np.ndindex(*(values.sizes[dim] for dim in others)):
        at = dict(zip(others, place, strict=True))
        names = [str(arrays[dim].values[i]) if dim in arrays.coords else f"{dim} {i}" for dim, i in at.items()]
        width = None if half is None else half.isel(at).to_numpy()
        yield ", ".join(names), values[x].to_numpy(), values.isel(at).to_numpy(), width


def _dress(ax: "Axes", values: xr.DataArray) -> None:
    """Scales and labels, where the axes have none yet."""
    if "h" in values.dims:
        ax.set_xscale("log", base=2)
        if values.name == "error":
            ax.set_yscale("log", nonpositive="clip")
    if not ax.get_xlabel():
        ax.set_xlabel(_long_name(values["h" if "h" in values.dims else "t"]))
    if not ax.get_ylabel():
        ax.set_ylabel(_long_name(values))


def _long_name(values: xr.DataArray) -> str:
    """What an array is called in print."""
    return str(values.attrs.get("long_name", str(values.name).replace("_", " ")))


def shown_in_notebooks(figure: "Figure") -> "Figure":
    """The figure, which a notebook shows even where nothing has told it how to show figures of matplotlib."""

    setattr(figure, "_repr_png_", partial(as_bytes, figure, "png"))  # noqa: B010 (which mypy would ask for)
    return figure
