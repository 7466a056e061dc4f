"""YAML as plain data that knows where it stands in the file."""

import difflib
import unicodedata
from collections.abc import Callable, Iterable
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any, NoReturn

import yaml

from ..storage import contents

Location = tuple[str | int, ...]  #: of a value in a document: keys, and indices of lists

_MOST_BYTES = 200_000  # of a file; YAML takes some seconds for so much
_MOST_ENTRIES = 10_000  # aliases of aliases could multiply without bound
_MERGE = "tag:yaml.org,2002:merge"


def about(loc: Location, message: str) -> str:
    """A message about a location, without the file and the line."""
    key = ".".join(name for name in loc if isinstance(name, str))
    item = f"entry {loc[-1] + 1} " if loc and isinstance(loc[-1], int) else ""
    return f"{key}{': ' if key else ''}{item}{message}"


class SpecError(ValueError):
    """An invalid spec: for each mistake a line ``path:line: key: what is wrong; what would be right``.

    An experiment that comes with the program is called by its name, ``name: line 3: key: ...``.
    """

    def __init__(self, *messages: str) -> None:
        self.messages = tuple("".join(c if c.isprintable() else " " for c in message) for message in messages)
        super().__init__("\n".join(self.messages))


class Document:
    """A YAML text as dicts, lists, texts (numbers too), True, False and None.

    `place` says how a line is named in messages; `top` is the
    location at which the text stands, so that an override is a document as well.
    """

    def __init__(self, text: str, place: Callable[[int], str], top: Location = ()) -> None:
        self.place, self.top, self.left = place, top, _MOST_ENTRIES
        self.places = {top[:n]: place(1) for n in range(len(top) + 1)}
        self.data = self._compose(text, top)
        for key in reversed(top):
            self.data = {key: self.data}

    def at(self, loc: Location) -> Any:
        """Value at a location."""
        return reduce(getitem, loc, self.data)

    def depth(self, loc: Location) -> int:
        """Length of the part of a location that exists."""
        return next(n for n in range(len(loc), -1, -1) if loc[:n] in self.places)

    def fail(self, loc: Location, message: str) -> NoReturn:
        """Raise the SpecError about a location."""
        raise SpecError(self.message(loc, message))

    def message(self, loc: Location, message: str) -> str:
        """A message about a location; about a key that is missing at the start of its mapping."""
        return f"{self.places[loc[: self.depth(loc)]]} {about(loc, message)}"

    def _compose(self, text: str, top: Location) -> Any:
        try:
            node = yaml.compose(text, Loader=yaml.SafeLoader)
            return None if node is None else self._value(node, top, ())
        except SpecError:
            raise
        except yaml.MarkedYAMLError as error:
            line = (error.problem_mark or error.context_mark).line + 1
            fault = ", ".join(part for part in (error.context, error.problem) if part)
        except yaml.reader.ReaderError as error:
            line, fault = text.count("\n", 0, error.position) + 1, f"has the character U+{error.character:04X}"
        except RecursionError:
            line, fault = 1, "is too deeply nested"
        except (ValueError, OverflowError):
            line, fault = 1, "has an escape that stands for no character"
        top = top or ("YAML",)
        self.places[top] = self.place(line)
        self.fail(top, f"{fault}; check brackets, quotes, colons and indentation here")

    def _value(self, node: yaml.Node, loc: Location, around: tuple[yaml.Node, ...]) -> Any:
        """Value of a node at a location; `around` are the nodes that contain it."""
        self.left -= 1
        if self.left < 0 or node in around:
            more = "; longer values stand in files, as in initial: {file: y0.npy}" if "initial" in loc else ""
            right = f"a file may have {_MOST_ENTRIES} entries, aliases included{more}"
            self.fail(loc, f"is too long or contains itself; {right}")
        if not node.tag.startswith("tag:yaml.org,2002:"):
            self.fail(loc, f"has the tag {node.tag}; remove the tag")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, loc, (*around, node))
        if isinstance(node, yaml.ScalarNode):
            self._check_text(node.value, loc)
        if isinstance(node, yaml.SequenceNode):
            for n, item in enumerate(node.value):
                self.places[*loc, n] = self.place(item.start_mark.line + 1)
            return [self._value(item, (*loc, n), (*around, node)) for n, item in enumerate(node.value)]
        if node.tag.endswith(":bool"):
            return node.value.lower() in ("true", "yes", "on")
        return None if node.tag.endswith(":null") else node.value

    def _check_text(self, text: str, loc: Location) -> None:
        """Refuse control characters, which a terminal obeys, and surrogates, which no results file can hold."""
        if bad := next((c for c in text if unicodedata.category(c) in ("Cc", "Cs") and c not in "\t\n"), None):
            self.fail(loc, f"has the character U+{ord(bad):04X}; remove it")

    def _mapping(self, node: yaml.MappingNode, loc: Location, around: tuple[yaml.Node, ...]) -> dict[str, Any]:
        """A dict; its own keys override those merged in by ``<<``."""
        merged: dict[str, Any] = {}
        own: dict[str, Any] = {}
        # What is merged in comes first, so that the mapping's own keys have the last word on places too.
        for key, value in sorted(node.value, key=lambda pair: pair[0].tag != _MERGE):
            if not isinstance(key, yaml.ScalarNode):
                self.fail(loc, "has a list or mapping as a key; keys must be words")
            self._check_text(key.value, loc)
            inner = (*loc, key.value)
            self.places[inner] = self.place(key.start_mark.line + 1)
            if key.tag == _MERGE:
                for source in reversed(value.value if isinstance(value, yaml.SequenceNode) else [value]):
                    if not isinstance(source, yaml.MappingNode):
                        self.fail(inner, "is not a mapping; give the alias of one, as in <<: *name")
                    merged |= self._value(source, loc, around)
                continue
            if key.value in own:
                self.fail(inner, "is given twice; remove one")
            own[key.value] = self._value(value, inner, around)
        return {**merged, **own}


def text_of(path: str | Path, names: Iterable[str] = ()) -> str:
    """Text of a file; `names` might have been given in the place of a path."""
    try:
        data = contents(path, _MOST_BYTES)
    except FileNotFoundError:
        raise SpecError(f"{path}: no such file; {_meant(Path(path), names)}") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or "").lower() or str(error)
        raise SpecError(f"{path}: cannot be read ({reason}); give the path of a YAML file") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SpecError(f"{path}:{line}: encoding: is not UTF-8; save the file as UTF-8") from None


def _meant(path: Path, names: Iterable[str]) -> str:
    """Advice about the path of a file that does not exist."""
    folders = (path.parent, path.parent / "experiments")
    for folder in folders:
        if (same := folder / f"{path.name}.yaml").is_file() or (same := folder / path.name).is_file():
            return f"did you mean {same}?"
    there = {file.stem: file for folder in folders[::-1] for file in folder.glob("*.yaml")}
    if near := difflib.get_close_matches(path.stem, there, 1):
        return f"did you mean {there[near[0]]}?"
    if meant := nearest(path.stem, names):
        return f"did you mean {meant}, which comes with spi? `spi list` shows all that do"
    return "give the path of a YAML file" + ("" if path.suffix else " or a name that `spi list` shows")


_MOST_MEANT = 3


def nearest(name: str, names: Iterable[str]) -> str:
    """Names that a person may mean: the one that is nearly `name`, or a few that begin with it; empty without."""
    names = sorted(names)
    near = difflib.get_close_matches(name, names, 1) or [one for one in names if name and one.startswith(name)]
    return " or ".join([", ".join(near[: _MOST_MEANT - 1]), *near[_MOST_MEANT - 1 : _MOST_MEANT]]) if near else ""


def override(called: str, text: str) -> Document:
    """Document that "a.b=value" stands for, or "--key=value" if the key is an option of its own.

    Messages begin with the spec that it overrides, which is `called` so.
    """
    key, equals, value = text.partition("=")
    if not key.strip() or not equals:
        raise SpecError(f"{called}: --set {text}: is not an assignment; write --set key=value")
    word = key.strip().removeprefix("--")
    option = "--set" if word == key.strip() else f"--{word}:"
    return Document(value, lambda line: f"{called}: {option}", tuple(word.split(".")))
