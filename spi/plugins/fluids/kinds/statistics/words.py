"""Word ``energy_spectrum`` of ``panels`` for means of E(k)."""

import re
from collections.abc import Sequence
from typing import Any

from spi.specs.panels import Further

_SHELL = re.compile(r"E\((\d+)\)")


def shells_in(texts: Sequence[str]) -> dict[int, int]:
    """{k: number of the function} of the functions that are E(k), from small k to large."""
    found = {int(match[1]): f for f, text in enumerate(texts) if (match := _SHELL.fullmatch(text))}
    return dict(sorted(found.items()))


def _fault(case: Any) -> str:
    few = len(shells_in([function.text for function in case.path_functions])) < 2
    return "is of functions E(k), as in functions: {E: E(k) for k = 1..5}" if few else ""


SPECTRUM = Further("spi.plugins.fluids.kinds.statistics.figure:SPECTRUM", _fault)
