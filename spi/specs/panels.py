"""Words of the key ``panels`` of a kind: its own, and those that plug-ins add."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import MinLen
from pydantic import BeforeValidator

from ..plugins import Registry, imported
from ..storage.records import Variables
from .keys import check_here, wrong


class Further(NamedTuple):
    """A word that a plug-in adds to those of a kind."""

    panels: str  #: "module:attribute" of its panels, see ``spi.drawing.panels``
    fault: Callable[[Any], str] = lambda case: ""  #: why a case cannot have them, such as "is for sine_euler"
    numbers: str = ""  #: "module:attribute" of a function of a record: what they show, see ``Stored.exported``


#: "kind.word" -> :class:`Further`.
FURTHER = Registry("panels")


def words(kind: str, own: Sequence[str]) -> tuple[str, ...]:
    """All words of a kind, whose `own` stand first."""
    names = [name.partition(".") for name in FURTHER]
    return (*own, *(word for first, _, word in names if first == kind))


def panels_of(kind: str, own: Sequence[str], least: int = 1) -> Any:
    """Annotation of the key ``panels`` of a kind, which has `least` words."""

    def check(value: Any) -> Any:
        for i, word in enumerate(value if isinstance(value, list) else ()):
            check_here("panels", f"{kind}.{word}", i, value=word)
        return value

    known: Any = Literal[words(kind, own)]
    return Annotated[tuple[known, ...], MinLen(least), BeforeValidator(check)]


def check_further(kind: str, case: Any) -> None:
    """Raise the error about a panel of a plug-in that is not for a case."""
    for i, word in enumerate(case.panels):
        name = f"{kind}.{word}"
        if name in FURTHER and (fault := FURTHER[name].fault(case)):
            raise wrong(f"is '{word}', which {fault}", "leave it out", "panels", i)


def numbers_of(kind: str, record: Any) -> Variables:
    """What the panels of plug-ins show of a record, beside what is stored."""
    chosen = [FURTHER[name] for name in (f"{kind}.{word}" for word in record.panels) if name in FURTHER]
    return {name: column for one in chosen if one.numbers for name, column in imported(one.numbers)(record).items()}


class Panels(Mapping[str, Sequence[Any]]):
    """Panels of a kind by their words, those of plug-ins imported when they are first asked for."""

    def __init__(self, kind: str, own: Mapping[str, Sequence[Any]]) -> None:
        self.kind, self.own = kind, own

    def __getitem__(self, word: str) -> Sequence[Any]:
        panels: Sequence[Any] = self.own[word] if word in self.own else imported(FURTHER[f"{self.kind}.{word}"].panels)
        return panels

    def __contains__(self, word: object) -> bool:
        return word in self.own or f"{self.kind}.{word}" in FURTHER

    def __iter__(self) -> Iterator[str]:
        return iter(words(self.kind, [*self.own]))

    def __len__(self) -> int:
        return len(words(self.kind, [*self.own]))  # not [*self], which asks for the length
