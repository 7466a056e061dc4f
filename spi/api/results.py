"""Results as a Python user sees them: parts by name, arrays as xarray, tables as pandas."""

import difflib
from collections import Counter
from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray as xr

from .. import views
from ..drawing import style
from ..running import finding
from ..specs.figures import FIGURE_KEYS
from ..statistics import claims
from ..storage import records
from ..storage.stored import AT_MOST, Description, Stored, by_case
from .specs import as_overrides, check_type, in_python

# ---------------------------------------------------------------------------------------------------------------------
# Curves of results in axes of a person's own.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:
    from ..drawing import Axes
    from ..drawing.layout import PanelFigure


def draw_into(ax: "Axes", results: "Results", quantity: str | None, look: dict[str, Any]) -> "Axes":
    """Draw a quantity of every part against the step size or the time; ValueError if a part has none of that name."""
    readings = views.readings(results.stored)
    looks = style.looks(by_case(readings))
    for reading, group in zip(readings, results.stored.groups, strict=True):
        arrays = dataset_of(group, reading)
        able = [str(array) for array, values in arrays.items() if {"h", "t"} & set(values.dims)]
        wanted = quantity or next(filter(able.__contains__, (*reading.headline, *able)), "array")
        if wanted not in able:
            raise ValueError(f"{group.name} has no {wanted} against h or t; give quantity= one of {', '.join(able)}")
        x = "h" if "h" in arrays[wanted].dims else "t"
        marker, colour = looks[reading.about.variant]
        own: dict[str, Any] = {"marker": marker} if x == "h" else {}
        lines = list(_lines(reading, arrays, wanted, x))
        if len(lines) == 1:  # the colours of several lines of one part are left to matplotlib
            own["color"] = colour
        for label, y, half in lines:
            text = ", ".join(filter(None, (style.label(reading.about), label)))
            ax.errorbar(arrays[x].to_numpy(), y, half, **{"label": text, **own, **look})
        if x == "h":
            ax.set_xscale("log", base=2)
            if _is_error(reading, wanted):
                ax.set_yscale("log", nonpositive="clip")
        for axis, values in ((ax.xaxis, arrays[x]), (ax.yaxis, arrays[wanted])):
            if not axis.get_label_text():
                axis.set_label_text(values.attrs.get("long_name", str(values.name).replace("_", " ")))
    return ax


def _lines(
    reading: Stored, arrays: xr.Dataset, quantity: str, x: str
) -> Iterator[tuple[str, np.ndarray, np.ndarray | None]]:
    """(label, y, distances (2, ...) to the ends of the interval) of each line, one for each place along other axes."""
    values = abs(arrays[quantity]) if _is_error(reading, quantity) else arrays[quantity]
    ends = _ends(reading, arrays, quantity)
    others = [dim for dim in values.dims if dim != x]
    for place in np.ndindex(*(values.sizes[dim] for dim in others)):
        at = dict(zip(others, place, strict=True))
        names = [str(arrays[dim].values[i]) if dim in arrays.coords else f"{dim} {i}" for dim, i in at.items()]
        width = None if ends is None else np.array([end.isel(at).to_numpy() for end in ends])
        yield ", ".join(names), values.isel(at).to_numpy(), width


def _is_error(reading: Stored, quantity: str) -> bool:
    """Whether a quantity is one by which schemes are judged and of which only the size counts."""
    claims = reading.by_name[quantity].meaning.claims if quantity in reading.by_name else ()
    return quantity in reading.headline and any(claim.sense == AT_MOST for claim in claims)


def _ends(reading: Stored, arrays: xr.Dataset, quantity: str) -> list[xr.DataArray] | None:
    """Distances from values to the lower and the upper ends of their intervals; None without."""
    numbers = reading.estimate(quantity)
    if numbers is None or numbers.exact:
        return None
    numbers = numbers.absolute if _is_error(reading, quantity) else numbers
    dims, value = arrays[quantity].dims, numbers.value
    return [xr.DataArray(np.nan_to_num(away), dims=dims) for away in (value - numbers.low, numbers.high - value)]


def dataset_of(group: records.Group, reading: Stored) -> xr.Dataset:
    """Arrays of a group with their coordinates and with the 95 % interval of each, from ``x_low`` to ``x_high``.

    Components of states are called as in expressions.
    """
    about = reading.about
    values = dict(group.coordinates)
    if "component" in values:
        values["component"] = np.array(component_names(about.variables, len(values["component"])))
    coordinates: dict[str, Any] = {name: (name, along, group.notes.get(name)) for name, along in values.items()}
    if about.swept:  # so that parts can be put together along the parameter
        coordinates |= {word: ((), value) for word, value in about.swept.places.items()}
    variables = {
        name: (axes, array, group.notes.get(name) or notes_of(reading, name))
        for name, (axes, array) in reading.exported().items()
        if name not in group.attributes
    }
    return xr.Dataset(variables, coordinates, netcdf_attributes(group.attributes))


def notes_of(reading: Stored, name: str) -> dict[str, str]:
    """Attributes of an array that is not in the file."""
    if name in reading.by_name:
        return reading.by_name[name].meaning.notes
    base, _, end = name.rpartition("_")
    if base not in reading.by_name:
        return {}
    meaning = reading.by_name[base].meaning
    text = f"{'lower' if end == 'low' else 'upper'} end of the 95 % interval of {base}"
    return meaning._replace(text=text, formula="").notes


_SCIPY = ("dimensions", "variables")  # attributes of this name would replace what its files are made of


def netcdf_attributes(values: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as netCDF 3 can hold them.

    It has no booleans, no None, no whole numbers of more than 32 bits, and no lists of texts: those are 1 or 0, none,
    numbers of 64 bits where these are exact or else texts, and the lines of one text.  A name that scipy's files have
    for their own is followed by an underscore.
    """

    def plain(value: Any) -> Any:
        if isinstance(value, bool | np.bool_):
            return int(value)
        if isinstance(value, int | np.integer) and not -(2**31) <= value < 2**31:
            return float(value) if int(float(value)) == value else str(value)
        return value

    def plain_list(values: Any) -> Any:
        each = tuple(map(plain, values))
        return "\n".join(map(str, each)) if any(isinstance(value, str) for value in each) or not each else each

    return {
        name + "_" * (name in _SCIPY): plain_list(value) if isinstance(value, tuple | list) else plain(value)
        for name, value in values.items()
        if value is not None
    }


def component_names(named: tuple[str, ...], count: int) -> list[str]:
    """Names of the components of a state in expressions: those in the system, `named`, or y1, y2, ..."""
    return list(named) or [f"y{i + 1}" for i in range(count)]


class Results:
    """Results of an experiment, or of some of its parts.

    A part is what was computed at a time: a scheme in a case, at one eps and by one estimator where there are several.
    Its name has these in this order, as in "main/splitting" or "weak_noise/splitting/plain"; :attr:`parts` lists them.

    Indexing narrows: ``results["splitting"]`` has the parts in whose name "splitting" stands, ``results["weak_noise"]``
    those of that case, at all values where it is swept, and ``results["weak_noise/splitting"]`` and
    ``results["weak_noise"]["splitting"]`` those of both.  Where one part is left its arrays are attributes:
    ``results["splitting"].error``.
    """

    def __init__(self, stored: records.StoredResults, path: Path | None = None) -> None:
        self.stored = stored  #: what is in the file, as :mod:`spi.storage.records` describes it
        self.path = path  #: of the file; None if there is none

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the parts."""
        return tuple(group.name for group in self.stored.groups)

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the whole experiment: kind, title, profile, seed, versions, ..."""
        return self.stored.attributes

    @property
    def kind(self) -> str:
        """Kind of the experiment, as in its spec."""
        return str(self.attributes["kind"])

    @property
    def spec(self) -> str:
        """Text of the spec, YAML; overrides are among the :attr:`attributes`."""
        return str(self.attributes["spec"])

    def __getitem__(self, name: str) -> "Results":
        """Parts whose names have all words of `name`, divided by slashes; KeyError if there are none.

        TypeError if `name` is not text.
        """
        if not isinstance(name, str):
            raise TypeError(f"results are indexed by the name of a part, not by {name!r}; parts: {self._listed()}")
        groups = self._named(name)
        if not groups:
            words = dict.fromkeys(word for group in self.stored.groups for word in _words(group))
            near = difflib.get_close_matches(name, [*words, *self.parts], 1)
            raise KeyError(f"no part {name}; " + (f"did you mean {near[0]}?" if near else f"parts: {self._listed()}"))
        owners = {(Description.of(group).owner, group.attributes["scheme"]) for group in groups}
        stated = claims.of_text(self.attributes.get("expect"))
        expect = claims.as_text(claim for claim in stated if (claim.case, claim.scheme) in owners)
        stored = records.StoredResults(self.attributes | {"expect": expect}, groups, self.stored.chunks)
        return Results(stored, self.path)

    def __contains__(self, name: object) -> bool:
        """Whether there are parts of that name, as in :meth:`__getitem__`."""
        return isinstance(name, str) and bool(self._named(name))

    def _named(self, name: str) -> tuple[records.Group, ...]:
        """Parts that have all words of `name`."""
        words = set(name.split("/"))
        return tuple(group for group in self.stored.groups if words <= {*_words(group)})

    def __iter__(self) -> Iterator[str]:
        return iter(self.parts)

    def __len__(self) -> int:
        return len(self.parts)

    def __getattr__(self, name: str) -> xr.DataArray:
        if name.startswith("_") or name == "stored":
            raise AttributeError(name)
        groups = self.stored.groups
        arrays = dict.fromkeys(array for group in groups for array in (*group.variables, *group.coordinates))
        if len(self) == 1 and not hasattr(type(self), name):
            arrays |= dict.fromkeys(map(str, self.dataset.variables))
        if name not in arrays and not hasattr(type(self), name):  # a property asks here once more after its own error
            offered = [word for word in dir(type(self)) if not word.startswith("_")]
            near = difflib.get_close_matches(name, [*offered, *arrays], 1)
            meant = f"; did you mean {near[0]}?" if near else ""
            whose = f"{self.parts[0]} has no" if len(self) == 1 else "no part has"
            raise AttributeError(f"{whose} {name}; arrays: {', '.join(arrays)}{meant}")
        return self._only(name)[name]

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(map(str, self.dataset.variables) if len(self) == 1 else ())]

    @property
    def dataset(self) -> xr.Dataset:
        """Arrays of the one part that this is narrowed to, with their coordinates; AttributeError if several."""
        return self._only("dataset")

    def _only(self, wanted: str) -> xr.Dataset:
        """Arrays of the only part."""
        if len(self) != 1:
            raise AttributeError(f"{wanted} is of one part; choose one by its name: {self._listed()}")
        return dataset_of(self.stored.groups[0], views.readings(self.stored)[0])

    def _listed(self) -> str:
        return ", ".join(self.parts)

    def to_xarray(self) -> xr.DataTree:
        """Arrays of all parts with their 95 % intervals, a node for each, as :attr:`parts` names and orders them."""
        both = zip(self.stored.groups, views.readings(self.stored), strict=True)
        groups = {group.name: dataset_of(group, reading) for group, reading in both}
        return xr.DataTree.from_dict({"/": xr.Dataset(attrs=netcdf_attributes(self.attributes)), **groups})

    @property
    def orders(self) -> pd.DataFrame:
        """Fitted orders of convergence, their 95 % intervals and those of theory; empty where none is fitted."""
        rows = views.order_rows(views.readings(self.stored))
        return pd.DataFrame(rows).rename(columns={"order_low": "low", "order_high": "high"})

    @property
    def claims(self) -> pd.DataFrame:
        """Claims of the spec about these parts, the results and the verdicts; empty where nothing is expected."""
        rows = [
            {
                **{"case": judged.claim.case, "subject": judged.subject, "claim": judged.text},
                **{name: getattr(judged.found, name, float("nan")) for name in ("value", "low", "high")},
                "verdict": judged.verdict,
            }
            for judged in views.verdicts(self.stored)
        ]
        return pd.DataFrame(rows)

    def table(self, name: str = "") -> pd.DataFrame:
        """Table of this name, or that with a column of this name, as ``spi show --format csv --table NAME`` prints it.

        A row for each case, scheme and place along the axes.  By default the main table, the first of :attr:`tables`.

        ValueError if there is none.
        """
        return pd.DataFrame(views.data_table(self.stored, name).rows)

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """All numbers with their 95 % intervals: a table for each set of axes, by its name, the main one first."""
        return {name: pd.DataFrame(table.rows) for name, table in views.data_tables(self.stored).items()}

    def plot(self, ax: "Axes | None" = None, quantity: str | None = None, **look: Any) -> "PanelFigure | Axes":
        """Figure of these parts as ``spi plot`` draws it; in given axes the curve of each of them.

        `look` are the words of the figure, as in :func:`views.figure`: `panels`, `log`, `xlim`, `legend`, `size`, ...
        The figure is one of matplotlib, to be changed and saved as any other: ``figure.panels`` are the axes of its
        panels, from left to right and from above.

        A curve shows `quantity`, by default the error with its 95 % interval against the step size, or the state
        against time; `look` is then handed on to matplotlib.  Returns the figure, or the axes.

        ValueError if there is nothing to draw, or if a quantity or a look are given without axes.
        """
        if ax is not None:
            return draw_into(ax, self, quantity, look)
        ignored = [*([] if quantity is None else ["quantity"]), *(name for name in look if name not in FIGURE_KEYS)]
        if ignored:
            near = difflib.get_close_matches(ignored[0], FIGURE_KEYS, 1)
            remedy = "give ax as well" + (f", or did you mean '{near[0]}'?" if near else "")
            raise ValueError(f"{', '.join(ignored)}: only for curves in given axes; {remedy}")
        return views.figure(self.stored, **look)

    def __repr__(self) -> str:
        where = f", {self.path}" if self.path else ""
        return f"<spi.Results: {self.attributes.get('title', '')} ({self.kind}{where}): {self._listed()}>"

    def _repr_html_(self) -> str:
        """Title, parts, orders, claims and file, in a notebook."""
        orders, claims = self.orders, self.claims
        lines = [f"<p><b>{escape(str(self.attributes.get('title', '')))}</b>, {escape(self.kind)}</p>"]
        if len(orders):
            lines.append(orders.to_html(index=False, border=0, float_format="{:.3f}".format, na_rep=""))
        else:
            lines.append(f"<p>parts: {escape(', '.join(self.parts))}</p>")
        if len(claims):
            counts = Counter(claims.verdict)
            lines.append(f"<p>claims: {', '.join(f'{count} {verdict}' for verdict, count in counts.items())}</p>")
        if self.path:
            lines.append(f"<p>file: {escape(str(self.path))}</p>")
        return "<div>" + "\n".join(lines) + "</div>"


def _words(group: records.Group) -> list[str]:
    """Words by which a part is found: those of its name, and the case of the spec where a parameter is swept."""
    return [*group.name.split("/"), Description.of(group).owner]


def load(
    path: str | Path,
    *,
    profile: str = "laptop",
    results: str | Path = "results",
    **overrides: Any,
) -> Results:
    """Results in a file that a run wrote, or those of an experiment by its name, in the folder `results`.

    `profile` and overrides are those of the run, as ``spi.run`` takes them, and choose among the results of the
    name, ``<results>/<name>.h5``, ``<results>/<name>.quick.h5`` and so on.

    StorageError if there is no such file, or if it cannot be read; SpecError if `path` can be neither.
    """
    check_type("results", path, (str, Path), "must be a results file, or the name of an experiment that was run")
    with in_python():
        wanted = finding.Wanted(profile, tuple(as_overrides(overrides, {})))
        found = finding.found(Path(path), Path(results), wanted)
        return Results(found.read(), found.path)
