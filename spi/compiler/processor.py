"""Vectors of the processor for which kernels are compiled."""

import functools
import os

from llvmlite import binding
from numba import config

from .private import uses

VARIABLE = "SPI_VECTOR_BITS"
WIDTHS = (128, 256, 512)

USUAL = "512"
WISH = os.environ.get(VARIABLE) or USUAL
if WISH not in map(str, WIDTHS):
    raise SystemExit(f"spi: {VARIABLE} is {WISH!r}, which is not 128, 256 or 512")


@functools.cache
def _features():
    """Features of the processor that Numba passes to LLVM: {"avx2", "fma", ...}."""
    always = {"neon"} if binding.get_process_triple().startswith(("aarch64", "arm64")) else set()
    if config.CPU_FEATURES is not None:
        named = {name.removeprefix("+") for name in config.CPU_FEATURES.split(",") if name.startswith("+")}
    else:
        try:
            named = {name for name, has in binding.get_host_cpu_features().items() if has}
        except RuntimeError:  # LLVM does not know this system
            named = set()
        named = named if config.ENABLE_AVX else {name for name in named if not name.startswith("avx")}
    return always | named


def instruction_set():
    """Vector instructions for which kernels are compiled: the processor's, or those of Numba's settings."""
    return next((name for name in ("avx512f", "avx2", "avx", "sse2", "sve", "neon") if name in _features()), "unknown")


def is_fused():
    """Whether there are fused operations, without which results differ from those of other processors."""
    return not _features().isdisjoint(("fma", "neon"))


def vector_bits():
    """Width of vectors: the largest of the processor, or less by SPI_VECTOR_BITS; 0 where LLVM chooses it."""
    if not uses("rounding"):
        return 0
    return min(int(WISH), {"avx512f": 512, "avx2": 256, "avx": 256}.get(instruction_set(), 128))


def vectors():
    """Their width in words."""
    return f"vectors of {vector_bits()} bits" if vector_bits() else "vectors as LLVM chooses"
