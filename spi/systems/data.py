"""The keys of a definition as texts, lists and mappings of texts; errors about the place where one stands."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from ..ensemble.inexact import INNER_METHODS
from .keys import KEYS, DefinitionError
from .symbolics import shortened
from .text import NumberError, Symbols, entries, expression

T = TypeVar("T")


class Data:
    """A definition, read key by key."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data

    def at(self, keys: Sequence[Any], read: Callable[..., T], *arguments: Any) -> T:
        """What `read` makes of the arguments; its NumberError becomes one about the place to which `keys` lead."""
        try:
            return read(*arguments)
        except NumberError as error:
            cut = "not closed" in str(error) and isinstance(keys[-1], int)
            right = "put an entry with commas in quotes" if cut else "correct it here"
            raise DefinitionError(f"is '{shortened(self.value(keys))}' ({error}); {right}", *keys) from None

    def value(self, keys: Sequence[Any]) -> Any:
        found: Any = self.data
        for key in keys:
            found = found[key]
        return found

    def mapping(self, key: str) -> Mapping[str, str]:
        found = self.data.get(key, {})
        if not isinstance(found, dict) or not all(isinstance(value, str) for value in found.values()):
            _refuse_truth_values(found.items() if isinstance(found, dict) else (), key)
            raise DefinitionError(f"must be a mapping such as {KEYS[key].partition('as in ')[2] or '{a: 1}'}", key)
        return found

    def texts(self, key: str) -> list[tuple[str, tuple[Any, ...]]]:
        """The texts of a list, or the one text, each with its place."""
        found = self.data.get(key, [])
        if isinstance(found, str):
            return [(found, (key,))]
        if not isinstance(found, list) or not all(isinstance(text, str) for text in found):
            _refuse_truth_values(enumerate(found) if isinstance(found, list) else [(None, found)], key)
            raise DefinitionError("must be a list of texts", key)
        return [(text, (key, n)) for n, text in enumerate(found)]

    def expressions(self, key: str, formulas: Symbols) -> Iterator[tuple[tuple[Any, ...], str, Any]]:
        """(place, text, expression) of each formula of a list, ranges written out."""
        for text, keys in self.texts(key):
            for one, inner in self.at(keys, entries, text, formulas):
                yield keys, one.strip(), self.at(keys, expression, one, inner)

    def inner(self) -> str:
        """How compositions move by terms that have no exact flow."""
        given = self.data.get("inner", "")
        if given not in ("", *INNER_METHODS):
            raise DefinitionError(f"is '{given}'; must be {' or '.join(INNER_METHODS)}", "inner")
        return str(given)


def _refuse_truth_values(found: Iterable[tuple[Any, Any]], key: str) -> None:
    """DefinitionError about the first of some (place, value) that YAML takes for true or false."""
    for place, value in found:
        if isinstance(value, bool):
            words = "yes, on and true" if value else "no, off and false"
            what = f"has a word that YAML reads as {str(value).lower()}, one of {words}"
            raise DefinitionError(f"{what}; put it in quotes", key, *([] if place is None else [place]))
