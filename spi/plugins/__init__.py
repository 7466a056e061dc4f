"""Plug-ins: what the program can do beyond its core, each in a folder that can be left out.

A plug-in is a folder here with a file ``plugin.py``, or a package elsewhere with an entry point of the group
``spi.plugins``: a record PLUGIN, a :class:`Plugin` of plain texts, that says by name what it offers.  The record is
read without running the file, and what it offers is imported when it is first asked for by its name.  The core imports
no plug-in and names none; a plug-in imports the core, and the plug-ins that it needs.
"""

import ast
import json
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

GROUP = "spi.plugins"  #: of entry points of other packages
_NOTHING: Mapping[str, str] = MappingProxyType({})


class Plugin(NamedTuple):
    """A plug-in: for each registry of the core what it adds there, name -> "module:attribute"."""

    name: str
    needs: tuple[str, ...] = ()  #: plug-ins without which it is not used
    models: Mapping[str, str] = _NOTHING  #: name in a spec -> class
    #: Key under ``model`` -> ``spi.specs.models.Source``, which reads such a mapping.
    sources: Mapping[str, str] = _NOTHING
    #: Key of a model with a bracket -> what makes the model, not its formulas.
    definitions: Mapping[str, str] = _NOTHING
    initial: Mapping[str, str] = _NOTHING  #: key under ``initial`` -> what reads such a mapping
    laws: Mapping[str, str] = _NOTHING  #: name under ``law`` of an initial state -> class of its keys
    grids: Mapping[str, str] = _NOTHING  #: what a state is on, see ``geometry`` -> what makes one of values on a grid
    formats: Mapping[str, str] = _NOTHING  #: ending of a file, as .npy -> what makes an array of its bytes
    films: Mapping[str, str] = _NOTHING  #: what a state is on -> how films show it, see ``spi.kinds.trajectory.film``
    in_python: Mapping[str, str] = _NOTHING  #: what a state is on -> how a person gets its values there, a text
    panels: Mapping[str, str] = _NOTHING  #: "kind.word" -> a further panel of a kind, see ``spi.specs.panels``
    noises: Mapping[str, str] = _NOTHING  #: kind under ``noise`` -> its keys, a ``spi.specs.noise.Driver``
    kinds: Mapping[str, str] = _NOTHING  #: name in a spec -> folder or file of a kind of experiment
    estimators: Mapping[str, str] = _NOTHING  #: name in a spec -> estimator of weak errors
    solvers: Mapping[str, str] = _NOTHING  #: method that a model answers -> module, see ``spi.exact.expectations``
    warnings: Mapping[str, str] = _NOTHING  #: name -> what says the limits of the results of a case, in a line
    commands: Mapping[str, str] = _NOTHING  #: name on the command line -> ``spi.cli.options.Command``
    ways: Mapping[str, str] = _NOTHING  #: option of `spi run` -> ``spi.cli.options.Way``, how experiments are computed
    offered: Mapping[str, str] = _NOTHING  #: name in ``import spi`` -> function, class or module
    templates: Mapping[str, str] = _NOTHING  #: word of ``spi new --WORD NAME`` -> text of an experiment to begin with
    further: Mapping[str, str] = _NOTHING  #: "plug-in.word" -> what that plug-in asks others for by this word
    groups: Mapping[str, str] = _NOTHING  #: word of ``spi list`` -> which experiments are listed under it, a text


class PluginError(ImportError):
    """A plug-in that cannot be used, in one line with a remedy."""


def _read(file: Path, name: str) -> Plugin:
    """Record that a Python file assigns to a name, whose arguments are literals; the file is not run."""
    for line in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(line, ast.Assign) and isinstance(line.value, ast.Call):
            target, call = line.targets[0], line.value
            if isinstance(target, ast.Name) and target.id == name:
                named = {word.arg or "": ast.literal_eval(word.value) for word in call.keywords}
                return Plugin(*map(ast.literal_eval, call.args), **named)
    raise ValueError(f"{file.name} has no line {name} = Plugin(...)")


def _read_entry(entry: EntryPoint) -> Plugin:
    """Record of another package."""
    try:
        spec = find_spec(entry.module)
        if spec is None or spec.origin is None:
            raise ValueError(f"there is no module {entry.module}")
        return _read(Path(spec.origin), entry.attr)
    except Exception as error:
        right = "must be a spi.plugins.Plugin(...) of plain texts; mend or uninstall it"
        raise PluginError(f"the plug-in {entry.value} cannot be read ({error}), {right}") from error


@cache
def installed() -> dict[str, Plugin]:
    """Plug-ins that are here, by name; PluginError if one of another package cannot be read.

    One that needs a plug-in that is not here is not here, either.
    """
    files = sorted(Path(__file__).parent.glob("*/plugin.py"))
    plugins = {file.parent.name: _read(file, "PLUGIN") for file in files}
    for entry in entry_points(group=GROUP):
        plugin = _read_entry(entry)
        if plugin.name in plugins:
            raise PluginError(f"two plug-ins are called '{plugin.name}'; rename or uninstall that of {entry.value}")
        plugins[plugin.name] = plugin
    while lacking := [name for name, plugin in plugins.items() if not plugins.keys() >= {*plugin.needs}]:
        for name in lacking:
            del plugins[name]
    return plugins


def offers(field: str) -> dict[str, str]:
    """What all plug-ins add to a registry, one of the fields of :class:`Plugin`."""
    whole: dict[str, str] = {}
    for plugin in installed().values():
        for name, place in getattr(plugin, field).items():
            if name in whole:
                raise PluginError(f"two plug-ins have {field} called '{name}'; uninstall one of them, '{plugin.name}'")
            whole[name] = place
    return whole


def imported(place: str) -> Any:
    """What stands at "module:attribute", or the module without an attribute."""
    module, _, attribute = place.partition(":")
    return getattr(import_module(module), attribute) if attribute else import_module(module)


class Registry(MutableMapping[str, Any]):
    """Entries of the core and of all plug-ins, by name; those of plug-ins are imported when first asked for."""

    def __init__(self, field: str, own: Mapping[str, Any] = _NOTHING, made: Callable[[str], Any] = imported) -> None:
        self.field, self._made = field, made
        self._own, self._offered = dict(own), dict[str, Any]()

    def __getitem__(self, name: str) -> Any:
        if name in self._own:
            return self._own[name]
        if name not in self._offered:
            if name not in (places := offers(self.field)):
                raise KeyError("; ".join(filter(None, (str(name), lacking(self.field, name)))))
            self._offered[name] = self._made(places[name])
        return self._offered[name]

    def __setitem__(self, name: str, value: Any) -> None:
        self._own[name] = value

    def __delitem__(self, name: str) -> None:
        del self._own[name]

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in offers(self.field)

    def __iter__(self) -> Iterator[str]:
        return iter({**dict.fromkeys(self._own), **dict.fromkeys(offers(self.field))})

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def name_of(self, value: Any) -> str | None:
        """Name of a class or function that is in the registry; nothing is imported for that."""
        own = next((name for name, other in self._own.items() if other is value), None)
        place = f"{getattr(value, '__module__', '')}:{getattr(value, '__qualname__', '')}"
        return own or next((name for name, other in offers(self.field).items() if other == place), None)


#: Which plug-in of this repository has which name of which registry, also where its folder is left out.
INDEX = "index.json"


def lacking(field: str, name: Any) -> str | None:
    """Which plug-in has a name of a registry that is not here, as advice; None if none of this repository has it."""
    owners = json.loads(Path(__file__).with_name(INDEX).read_text(encoding="utf-8")).get(field, {})
    plugin = owners.get(name) if isinstance(name, str) else None
    return None if plugin is None or plugin in installed() else f"install the plug-in {plugin}, which has it"
