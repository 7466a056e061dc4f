"""Files that a spec names: the modules that become of them, and initial values that stand in them.

    initial: {file: field.npy}
    initial: {file: field.csv}

With the spec they are kept as texts, the bytes of an array in base64.
"""

import base64
import binascii
import difflib
import io
import traceback
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ..compiler import modules, own
from ..plugins import Registry, lacking
from ..storage import contents
from .keys import shown, wrong

_MOST_BYTES = 1_000_000
_BINARY = "data:application/octet-stream;base64,"  # the prefix of a text that encodes bytes


def as_text(data: bytes) -> str:
    """Text by which a file is kept that is no text, see RFC 2397."""
    return _BINARY + base64.b64encode(data).decode()


def content(text: str) -> bytes:
    """Bytes of the file that is kept as this text."""
    if not text.startswith(_BINARY):
        return text.encode()
    try:
        return base64.b64decode(text.removeprefix(_BINARY), validate=True)
    except binascii.Error:
        return text.encode()


class UntrustedCode(Exception):
    """Python code that is not trusted was to be run; its message is the path that the spec gives it."""


class Files:
    """Texts of files that belong to a spec, each read once, by their paths as the spec writes them.

    Paths are seen from the folder of the spec file.  With `given`, those texts stand in the place of what is on disk;
    those that are `added` stand in the place of files of their names only.
    Code is run only where `trusts(path, text)` is true, else UntrustedCode is raised.
    """

    def __init__(
        self,
        spec_path: str | Path,
        given: Iterable[tuple[str, str]] | None = None,
        trusts: Callable[[str, str], bool] = lambda path, text: True,
        added: Iterable[tuple[str, str]] = (),
    ) -> None:
        self.folder, self.trusts = Path(spec_path).parent, trusts
        self.texts = dict(given or ()) | dict(added)
        self.complete = given is not None
        #: Digest of a state in which other runs have ended -> their seeds, whose noise must not come again.
        self.seeds: dict[str, frozenset[int]] = {}

    def text(self, path: str, key: str, most: int = _MOST_BYTES, binary: bool = False) -> str:
        """Text of a file that stands under `key`; raises the error about that key if it cannot be read.

        A file of more than `most` bytes is refused.  One that is `binary` is kept as :func:`as_text` of its bytes.
        """
        if path not in self.texts:
            if self.complete:
                raise wrong(f"is {shown(path)}, whose text is not among the files of this spec", "add it to them", key)
            self.texts[path] = self._from_disk(path, key, most, binary)
        return self.texts[path]

    def made(self, path: str, key: str, make: Callable[[], bytes]) -> bytes:
        """Bytes that are kept as those of a file that there need not be, made once, where they are not given."""
        if path not in self.texts and not self.complete:
            self.texts[path] = as_text(make())
        return content(self.text(path, key))

    def module(self, path: str, key: str) -> ModuleType:
        """Module with the text of a Python file; raises the error about `key` if it cannot be imported."""
        text = self.text(path, key)
        if not self.trusts(path, text):
            raise UntrustedCode(path)
        try:
            return modules.stored(Path(path).stem, text)
        except SyntaxError as error:
            at = f"line {error.lineno}: " if error.lineno else ""
            raise wrong(f"is {shown(path)}, {at}{error.msg}", "correct the Python file", key) from None
        except ImportError as error:
            raise wrong(f"is {shown(path)}{_line(error)}: {error}", self._remedy(error), key) from None
        except (Exception, SystemExit) as error:
            fault = f"is {shown(path)}{_line(error)}: raises {type(error).__name__}: {error}"
            raise wrong(fault, "correct the Python file, which must be importable", key) from None

    def _from_disk(self, path: str, key: str, most: int, binary: bool) -> str:
        file = self.folder / path
        try:
            data = contents(file, most)
            return as_text(data) if binary else data.decode("utf-8-sig").replace("\r\n", "\n")
        except FileNotFoundError:
            there = [other.name for other in file.parent.glob(f"*{file.suffix}")]
            near = difflib.get_close_matches(file.name, there, 1)
            right = "paths begin at the folder of the spec"
            right = f"did you mean '{Path(path).with_name(near[0])}'?" if near else right
            raise wrong(f"is {shown(path)}, and there is no file {file}", right, key) from None
        except UnicodeDecodeError:
            raise wrong(f"is {shown(path)}, which is not UTF-8", "save the file as UTF-8", key) from None
        except (OSError, ValueError) as error:
            reason = (getattr(error, "strerror", None) or "").lower() or str(error)
            right = "give a smaller file, of one array" if binary else "give a file of text"
            raise wrong(f"is {shown(path)}, which cannot be read ({reason})", right, key) from None

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


# ---------------------------------------------------------------------------------------------------------------------
# Arrays
# ---------------------------------------------------------------------------------------------------------------------

_MOST_OF_ARRAYS = 9_000_000  # bytes: 1024 x 1024 numbers
_MOST_OF_TEXTS = 30_000_000  # of the same as text
_MOST_UNPACKED = 90_000_000  # of an array of increments
_RIGHT = "give a file that numpy.save wrote, of real or complex numbers"


def array_text(values: Any) -> str:
    """Text that stands for the file that ``numpy.save`` would write."""
    data = io.BytesIO()
    np.save(data, values, allow_pickle=False)
    return as_text(data.getvalue())


def array_in(files: Files, path: str) -> np.ndarray:
    """Array in a file, real; raises the error about the key ``file``."""
    ending = Path(path).suffix.lower()
    if advice := lacking("formats", ending):
        raise wrong(f"is {shown(path)}, a format that is not here", advice, "file")
    if ending not in FORMATS:
        data = content(files.text(path, "file", _MOST_OF_ARRAYS, binary=True))
        try:
            values = array_of(data)
        except ValueError:
            raise wrong(f"is {shown(path)}, which is no array", _RIGHT, "file") from None
    else:
        data = content(files.text(path, "file", _MOST_OF_TEXTS, binary=True))
        try:
            values = FORMATS[ending](data)
        except ValueError as error:
            right = f"correct the file, or {_RIGHT}"
            raise wrong(f"is {shown(path)}, which cannot be read ({error})", right, "file") from None
    check_finite(values, shown(path), "file")
    return values


def arrays_in(files: Files, path: str, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Arrays of a file that ``numpy.savez`` wrote, by their names; raises the error about the key ``file``."""
    data = content(files.text(path, "file", _MOST_OF_ARRAYS, binary=True))
    try:
        arrays = unpacked(data, (0, 1, 2, 3), names)
    except ValueError:
        right = f"give a file of numpy.savez with {' and '.join(names)}, of at most {_MOST_UNPACKED // 10**6} MB"
        raise wrong(f"is {shown(path)}, which holds no such arrays", right, "file") from None
    for name in names:
        check_finite(arrays[name], f"{shown(path)}, in which {name}", "file")
    return arrays


def unpacked(data: bytes, dimensions: tuple[int, ...], names: tuple[str, ...] = ()) -> dict[str, np.ndarray]:
    """Arrays in a file of ``numpy.savez``, these or all, by their names; ValueError if there are none such."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            if sum(member.file_size for member in archive.zip.infolist()) > _MOST_UNPACKED:
                raise ValueError("too large")
            return {name: _real(archive[name], dimensions) for name in names or archive.files}
    except Exception as error:  # damaged bytes make zipfile, zlib and NumPy raise errors of a dozen types
        raise ValueError(f"no such arrays: {error}") from None


def array_of(data: bytes) -> np.ndarray:
    """Array in a file of ``numpy.save``, real, of one to five dimensions; ValueError if it is damaged."""
    try:
        return _real(np.lib.format.read_array(io.BytesIO(data), allow_pickle=False), range(1, 6))
    except Exception as error:
        raise ValueError(f"no such array: {error}") from None


def table_of(data: bytes) -> tuple[list[str], np.ndarray]:
    """(names in the first line, if it has no numbers; (rows, columns)) of a CSV file; ValueError if it is none."""
    lines = [line for line in data.decode("utf-8-sig").splitlines() if line.strip()]
    head = [name.strip() for name in lines[0].split(",")] if lines else []
    head, rows = ([], lines) if any(map(_is_number, head)) else (head, lines[1:])
    return head, np.loadtxt(rows, delimiter=",", comments=None, ndmin=2) if rows else np.empty((0, 0))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _of_table(data: bytes) -> np.ndarray:
    """Array in a CSV file, of one dimension if it has one row or one column."""
    _, values = table_of(data)
    if not values.size:
        raise ValueError("no numbers")
    return values.ravel() if 1 in values.shape else values


#: Ending of a file -> function (bytes) that returns the array in it, or raises ValueError; the others are NumPy's.
FORMATS = Registry("formats", {".csv": _of_table})


def _real(values: np.ndarray, dimensions: Collection[int]) -> np.ndarray:
    """An array of numbers, each complex one in a list as its real and its imaginary part; ValueError about others."""
    if values.dtype.kind not in "iufc" or values.ndim not in dimensions or not values.size:
        raise ValueError("not such an array")
    if values.dtype.kind == "c":
        if values.ndim > 1:
            raise ValueError("a complex field")
        values = np.stack([values.real, values.imag], axis=-1).ravel()
    return values.astype(float)


def check_finite(values: np.ndarray, text: str, key: str) -> None:
    if not np.isfinite(values).all():
        place = ", ".join(str(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise wrong(f"is {text}, which is not finite at [{place}]", "all numbers must be finite", key)
