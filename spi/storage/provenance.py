"""When, with what and on which machine results were computed."""

import contextlib
import datetime
import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Any

from .. import __version__

#: From wide to narrow, as the kernel of Linux names them and as we do.
INSTRUCTION_SETS = {"avx512f": "avx512f", "avx2": "avx2", "avx": "avx", "sse2": "sse2", "sve": "sve", "asimd": "neon"}


def provenance() -> dict[str, Any]:
    """Root attributes that say when, with what and on which machine results were computed."""
    processor, instruction_set = _processor()
    return {
        "created": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "spi_version": __version__,
        "machine_processor": processor,
        "machine_instruction_set": instruction_set,
        "machine_cpu_count": os.cpu_count() or 1,
        "machine_platform": platform.platform(),
        "machine_python": platform.python_version(),
        **{f"machine_{name}": _version_of(name) for name in ("numpy", "numba", "h5py")},
    }


def _version_of(package: str) -> str:
    """The version of an installed package; results must not be lost because some installation does not tell it."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "unknown"


def _processor() -> tuple[str, str]:
    """The name of the processor and its widest vector instructions."""
    facts: dict[str, str] = {}
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(errors="replace").splitlines():
            key, _, value = line.partition(":")
            facts.setdefault(key.strip(), value.strip())
    flags = (facts.get("flags") or facts.get("Features") or "").split()
    name = facts.get("model name") or platform.processor() or platform.machine() or "unknown"
    # Without a list of features (macOS, Windows) 64-bit ARM still means NEON.
    default = "neon" if platform.machine().lower() in ("arm64", "aarch64") else "unknown"
    return name, next((ours for flag, ours in INSTRUCTION_SETS.items() if flag in flags), default)
