"""The files that a spec names, and the modules that become of them."""

import difflib
import traceback
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

from ..compiler import modules, own
from ..storage import contents
from .keys import shown, wrong

_MOST_BYTES = 1_000_000


class Files:
    """The texts of files that belong to a spec, each read once, by their paths as the spec writes them.

    Paths are seen from the folder of the spec file.  With `given`, those texts stand in the place of what is on disk.
    """

    def __init__(self, spec_path: str | Path, given: Iterable[tuple[str, str]] | None = None) -> None:
        self.folder = Path(spec_path).parent
        self.texts = dict(given or ())
        self.complete = given is not None

    def text(self, path: str, key: str) -> str:
        """The text of a file that stands under `key`; raises the error about that key if it cannot be read."""
        if path not in self.texts:
            if self.complete:
                raise wrong(f"is {shown(path)}, whose text is not among the files of this spec", "add it to them", key)
            self.texts[path] = self._from_disk(path, key)
        return self.texts[path]

    def module(self, path: str, key: str) -> ModuleType:
        """The module with the text of a Python file; raises the error about `key` if it cannot be imported."""
        text = self.text(path, key)
        try:
            return modules.stored(Path(path).stem, text)
        except SyntaxError as error:
            at = f"line {error.lineno}: " if error.lineno else ""
            raise wrong(f"is {shown(path)}, {at}{error.msg}", "correct the Python file", key) from None
        except ImportError as error:
            raise wrong(f"is {shown(path)}{_line(error)}: {error}", self._remedy(error), key) from None
        except (Exception, SystemExit) as error:
            what = f"is {shown(path)}{_line(error)}: raises {type(error).__name__}: {error}"
            raise wrong(what, "correct the Python file, which must be importable", key) from None

    def _from_disk(self, path: str, key: str) -> str:
        file = self.folder / path
        try:
            return contents(file, _MOST_BYTES).decode("utf-8-sig").replace("\r\n", "\n")
        except FileNotFoundError:
            there = [other.name for other in file.parent.glob(f"*{file.suffix}")]
            near = difflib.get_close_matches(file.name, there, 1)
            right = (
                f"did you mean '{Path(path).with_name(near[0])}'?" if near else "paths begin at the folder of the spec"
            )
            raise wrong(f"is {shown(path)}, and there is no file {file}", right, key) from None
        except UnicodeDecodeError:
            raise wrong(f"is {shown(path)}, which is not UTF-8", "save the file as UTF-8", key) from None
        except (OSError, ValueError) as error:
            reason = (getattr(error, "strerror", None) or "").lower() or str(error)
            raise wrong(f"is {shown(path)}, which cannot be read ({reason})", "give a file of text", key) from None

    def _remedy(self, error: ImportError) -> str:
        name = (error.name or "").partition(".")[0]
        beside = any((self.folder / file).exists() for file in (f"{name}.py", name)) if name else False
        if beside or (error.name or "").startswith(own.__name__):  # the latter for a relative import
            return "the file must stand alone; make an installed package of both, see docs/own_models.md"
        return "install what it imports, or correct the Python file"


def _line(error: BaseException) -> str:
    """Where in a stored module an error was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).parent == modules.folder()]
    return f", line {lines[-1]}" if lines else ""
