"""Provenance of results: when, with which versions and on which machine, and from which spec and code."""

import contextlib
import datetime
import importlib.metadata
import json
import os
import platform
from pathlib import Path
from typing import Any

from .. import __version__
from .results import StorageError, read_root


def provenance() -> dict[str, Any]:
    """Root attributes with the time, the versions and the machine of a computation."""
    from ..compiler import private, processor  # here, since results are read without the compiler

    left_out = private.left_out()
    return {
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "spi_version": __version__,
        "machine_processor": _processor(),
        "machine_instruction_set": processor.instruction_set(),
        "machine_vector_bits": processor.vector_bits(),
        "machine_fused_operations": processor.is_fused(),
        "machine_cpu_count": os.cpu_count() or 1,
        "machine_platform": platform.platform(),
        "machine_python": platform.python_version(),
        **{f"machine_{name}": _version_of(name) for name in ("numpy", "numba", "h5py")},
        **({"machine_without": ", ".join(left_out)} if left_out else {}),
    }


def machine() -> str:
    """This machine in a line: all that the last digits of results could depend on."""
    from ..compiler import private, processor

    compiled = f"{processor.instruction_set()}, {processor.vectors()}"
    versions = ", ".join(f"{name} {_version_of(name)}" for name in ("numba", "numpy"))
    without = "".join(f"; without {part}" for part in private.left_out())
    return f"{_processor()}; {compiled}; {versions}{without}"


def _version_of(package: str) -> str:
    """Version of an installed package; results must not be lost because some installation does not state it."""
    with contextlib.suppress(ImportError, OSError):  # none installed; or one whose description cannot be read
        return importlib.metadata.version(package) or "unknown"
    return "unknown"


def _processor() -> str:
    """Name of the processor."""
    facts: dict[str, str] = {}
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            facts.setdefault(key.strip(), value.strip())
    return facts.get("model name") or platform.processor() or platform.machine() or "unknown"


def finished(path: str | Path, identity: dict[str, Any]) -> dict[str, Any] | None:
    """Root attributes of complete results of this very spec, its text included, whatever sources computed them.

    None if the file does not hold such results.
    """
    if not Path(path).exists():
        return None
    stored = _existing(path)
    same = all(stored.get(name) == value for name, value in identity.items() if name != "source_digest")
    return stored if same and stored.get("complete") else None


FORMER = ".previous"  #: what the names of files with former results end with


def former(path: Path) -> Path:
    """File in which those results are kept that were in a file before its spec, or the sources, changed."""
    return path.with_suffix(f"{FORMER}{path.suffix}")


def make_room(path: Path, identity: dict[str, Any], fresh: bool = False) -> set[str] | None:
    """Move results of another spec, or by other sources, to :func:`former`; None if there are none.

    The keys of the sums of those that were there before, which are replaced, are returned.  StorageError about a file
    that holds no results, unless it may go with `fresh`.
    """
    if not path.exists():
        return None
    try:
        stored = _existing(path)
    except StorageError:
        if fresh:
            return None
        raise
    if all(stored.get(name) == identity[name] for name in ("spec_hash", "source_digest")):
        return None
    replaced = keys_needed(former(path))
    os.replace(path, former(path))
    return replaced


def keys_needed(path: Path) -> set[str]:
    """Keys of the sums that results are made of; none if there are no such results."""
    with contextlib.suppress(StorageError, KeyError, TypeError, ValueError, AttributeError):
        return {key for keys in json.loads(read_root(path)["sums"]).values() for key in keys}
    return set()


def _existing(path: str | Path) -> dict[str, Any]:
    """Root attributes of a file to be written; the StorageError about a foreign file says what a run can do."""
    try:
        return read_root(path)
    except StorageError as error:
        problem, mark, _ = str(error).partition("; give a results file")
        if not mark:
            raise
        right = "move it away or use" if Path(path).is_dir() else "use --fresh to replace it or"
        raise StorageError(f"{problem}; {right} --out for another folder") from error


def computed_by(about: dict[str, Any]) -> str:
    """A clause that says by which sources of spi results or sums, with these attributes, were computed."""
    version = f"spi {about['spi_version']}, " if about.get("spi_version") else ""
    return f"other sources of spi computed ({version}digest {str(about.get('source_digest'))[:8]})"
