"""Word of ``panels`` for spins."""

from typing import Any

from spi.ensemble.protocol import geometry
from spi.specs.panels import Further


def _fault(case: Any) -> str:
    return "" if geometry(case.model).get("on") == "lattice" else "is for the model spins"


SPINS = Further("spi.plugins.spins.kinds.trajectory.figure:SPINS", _fault)
