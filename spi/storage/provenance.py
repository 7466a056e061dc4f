"""When, with what and on which machine results were computed."""

import contextlib
import datetime
import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any

from .. import __version__


def provenance() -> dict[str, Any]:
    """Root attributes that say when, with what and on which machine results were computed."""
    from ..compiler import rounding  # here, since results are read without the compiler

    return {
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "spi_version": __version__,
        "machine_processor": _processor(),
        "machine_instruction_set": rounding.instruction_set(),
        "machine_vector_bits": rounding.vector_bits(),
        "machine_fused_operations": rounding.is_fused(),
        "machine_cpu_count": os.cpu_count() or 1,
        "machine_platform": platform.platform(),
        "machine_python": platform.python_version(),
        **{f"machine_{name}": _version_of(name) for name in ("numpy", "numba", "h5py")},
    }


def machine() -> str:
    """This machine in a line: what of it the last digits of results could depend on."""
    from ..compiler import rounding

    compiled = f"{rounding.instruction_set()}, vectors of {rounding.vector_bits()} bits"
    versions = ", ".join(f"{name} {_version_of(name)}" for name in ("numba", "numpy"))
    return f"{_processor()}; {compiled}; {versions}"


def _version_of(package: str) -> str:
    """The version of an installed package; results must not be lost because some installation does not tell it."""
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
