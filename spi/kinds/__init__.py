"""The kinds of experiment, one folder each: the only place that lists them.

A kind consists of the modules of its folder that :class:`Kind` names, which are imported when they are first
needed, with the contents that the protocols below describe.  Any stands there for types of the kind itself: the class
of its keys and the record of its results.

A new kind is such a folder and a line in KINDS.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from spi.storage.records import Part

if TYPE_CHECKING:  # what takes a while to import
    from spi.drawing import Figure
    from spi.specs import BaseCase
    from spi.storage.stored import Stored

    from .plans import Plan


class KeysModule(Protocol):
    """``keys``: what may stand in a spec file."""

    @property
    def Case(self) -> "type[BaseCase]":
        """The keys of a case."""


class StudyModule(Protocol):
    """``study``: what is computed."""

    def parts(self, case: Any) -> list[Part]:
        """The parts of a case in the order in which they are computed."""

    def plan(self, case: Any, part: Part) -> "Plan":
        """One part, ready to run."""

    # remarks(case) -> Iterator[str] may be added: warnings about parts of a case that are left out or changed


class ResultsModule(Protocol):
    """``results``: the one description of what a study gives, and a file holds, of a part."""

    @property
    def Record(self) -> "type[Stored]":
        """The record: of each field axes, text, unit and claim; its tables, rows and remarks; properties."""

    # rows(readings) -> Iterator[dict[str, Any]] may be added: rows of CSV and JSON beside those of each record


class FigureModule(Protocol):
    """``figure``: ``draw = Figures(PANELS, FACTS)``, see ``spi.drawing.panels``, and perhaps a function ``film``."""

    def draw(self, title: str, cases: Sequence[Sequence[Any]]) -> "Figure":
        """The matplotlib figure of the results of each case."""


class Folder:
    """The modules of a folder, imported when they are first needed; `package` is its dotted name."""

    MODULES: tuple[str, ...]

    def __init__(self, package: str):
        self.package = package

    def __getattr__(self, name: str) -> Any:
        if name not in self.MODULES:
            raise AttributeError(f"{self.package} has no module {name!r}, only {', '.join(self.MODULES)}")
        whole = import_module(self.package)
        return import_module(f"{self.package}.{name}") if hasattr(whole, "__path__") else whole


class Kind(Folder):
    """The modules of a kind of experiment, ``kind.keys`` and so on."""

    keys: KeysModule
    study: StudyModule
    results: ResultsModule
    figure: FigureModule

    MODULES = ("keys", "study", "results", "figure")


#: name in a spec file -> kind
KINDS = {
    "strong": Kind("spi.kinds.strong"),
    "trajectory": Kind("spi.kinds.trajectory"),
    "weak": Kind("spi.kinds.weak"),
    "work_precision": Kind("spi.kinds.work_precision"),
    "stability": Kind("spi.kinds.stability"),
    "equilibrium": Kind("spi.kinds.equilibrium"),
    "statistics": Kind("spi.kinds.statistics"),
    "lyapunov": Kind("spi.kinds.lyapunov"),
    "answer": Kind("spi.kinds.answer"),
}
