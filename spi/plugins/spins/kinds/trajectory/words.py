"""Words of ``panels`` for spins."""

from typing import Any

from spi.ensemble.protocol import geometry
from spi.models.delegation import undamped
from spi.plugins.spins.models import Spins
from spi.plugins.spins.models.driving import is_driven
from spi.specs.panels import Further


def _fault(case: Any) -> str:
    return "" if geometry(case.model).get("on") == "lattice" else "is for the model spins"


SPINS = Further("spi.plugins.spins.kinds.trajectory.figure:SPINS", _fault)


def _without_loop(case: Any) -> str:
    model = undamped(case.model)
    return "" if isinstance(model, Spins) and is_driven(model) else "is for spins in a field that depends on time"


LOOP = Further("spi.plugins.spins.kinds.trajectory.figure:LOOP", _without_loop)
