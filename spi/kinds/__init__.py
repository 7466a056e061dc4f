"""Kinds of experiment, one folder each: those of the core, and those that plug-ins offer.

A kind is a folder, or one file, with four modules, which are imported when they are first needed:

* ``keys``: ``Case``, the keys of a case in a spec file, a subclass of ``spi.specs.BaseCase``;
* ``study``: ``parts(case)``, the parts of a case in the order in which they are computed; ``plan(case, part)``, a
  ``spi.kinds.plans.Plan`` that is ready to run; and perhaps ``remarks(case)``, warnings about what is left out or
  changed;
* ``results``: ``Record``, a subclass of ``spi.storage.stored.Stored``, the one description of what a study gives, and a
  file holds, of a part;
* ``figure``: ``draw = Figures(PANELS, FACTS)``, see ``spi.drawing.panels``, and perhaps a function ``film``.

A new kind is such a folder or file in a plug-in, see ``spi.plugins``.
"""

from importlib import import_module
from typing import Any

from ..plugins import Registry


class Folder:
    """Modules of a folder, imported when they are first needed; `package` is its dotted name."""

    MODULES: tuple[str, ...]

    def __init__(self, package: str):
        self.package = package

    def __getattr__(self, name: str) -> Any:
        if name not in self.MODULES:
            raise AttributeError(f"{self.package} has no module {name!r}, only {', '.join(self.MODULES)}")
        whole = import_module(self.package)
        return import_module(f"{self.package}.{name}") if hasattr(whole, "__path__") else whole


class Kind(Folder):
    """Modules of a kind of experiment, ``kind.keys`` and so on."""

    MODULES = ("keys", "study", "results", "figure")


#: name in a spec file -> kind
_OWN = {
    "strong": Kind("spi.kinds.strong"),
    "trajectory": Kind("spi.kinds.trajectory"),
    "weak": Kind("spi.kinds.weak"),
}
KINDS = Registry("kinds", _OWN, Kind)
