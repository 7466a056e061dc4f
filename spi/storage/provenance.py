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
    """The version of an installed package; results must not be lost because some installation does not state it."""
    with contextlib.suppress(ImportError, OSError):  # none installed; or one whose description cannot be read
        return importlib.metadata.version(package) or "unknown"
    return "unknown"


def _processor() -> str:
    """The name of the processor."""
    facts: dict[str, str] = {}
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            key, _, value = line.partition(":")
            facts.setdefault(key.strip(), value.strip())
    return facts.get("model name") or platform.processor() or platform.machine() or "unknown"


def finished(path: str | Path, identity: dict[str, Any]) -> dict[str, Any] | None:
    """The root attributes of complete results of this very spec, its text included, whatever sources computed them.

    None if the file does not hold such results.
    """
    if not Path(path).exists():
        return None
    stored = _existing(path)
    same = all(stored.get(name) == value for name, value in identity.items() if name != "source_digest")
    return stored if same and stored.get("complete") else None


def check_replaceable(path: str | Path, identity: dict[str, Any], parts: dict[str, dict[str, int]]) -> None:
    """Raise StorageError instead of replacing results of another spec or by other sources.

    A missing file is fine, and so are results whose parts are all among the new ones, with as many samples or more;
    `parts` maps the name of a part to {key that determines its numbers: its size}.
    """
    if not Path(path).exists():
        return
    stored = _existing(path)
    sizes = _sizes(parts)
    try:
        old = _sizes(json.loads(stored["parts"]))
    except (KeyError, TypeError, ValueError, AttributeError):  # where the file does not state them, a key of no part
        old = {"": 0}
    among_them = old.keys() <= sizes.keys()
    if stored.get("source_digest") != identity["source_digest"] and (
        among_them or stored.get("paths_hash") == identity["paths_hash"]
    ):
        raise StorageError(
            f"{path}: holds results that {computed_by(stored)}; they are kept: use --fresh to compute all anew and "
            "replace them, or --out for another folder"
        )
    if stored.get("spec_hash") == identity["spec_hash"]:
        return
    if not among_them:
        raise StorageError(
            f"{path}: holds results of another spec, or of this one before it was edited; use --fresh to replace it or "
            "--out for another folder, or delete it: then what both have alike is not computed again"
        )
    if any(size > sizes[key] for key, size in old.items()):
        raise StorageError(
            f"{path}: holds results of more samples or of a longer time; "
            "use --fresh to replace it or --out for another folder"
        )


def _existing(path: str | Path) -> dict[str, Any]:
    """The root attributes of a file to be written; the StorageError about a foreign file says what a run can do."""
    try:
        return read_root(path)
    except StorageError as error:
        problem, mark, _ = str(error).partition("; give a results file")
        if not mark:
            raise
        right = "move it away or use" if Path(path).is_dir() else "use --fresh to replace it or"
        raise StorageError(f"{problem}; {right} --out for another folder") from error


def _sizes(parts: dict[str, dict[str, int]]) -> dict[str, int]:
    """The largest size of all parts with the same key, by key."""
    largest: dict[str, int] = {}
    for part in parts.values():
        largest |= {key: max(size, largest.get(key, 0)) for key, size in part.items()}
    return largest


def computed_by(about: dict[str, Any]) -> str:
    """A clause that says by which sources of spi results or sums, with these attributes, were computed."""
    version = f"spi {about['spi_version']}, " if about.get("spi_version") else ""
    return f"other sources of spi computed ({version}digest {str(about.get('source_digest'))[:8]})"


def spec_and_sources(path: str | Path) -> tuple[str, str] | None:
    """The digests of the spec and of the sources of the results in a file; None if there is no such file."""
    try:
        stored = read_root(path)
        return str(stored.get("spec_hash")), str(stored.get("source_digest"))
    except StorageError:
        return None
