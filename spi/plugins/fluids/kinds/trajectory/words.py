"""Words of ``panels`` for vorticity."""

from typing import Any

from spi.ensemble.protocol import geometry
from spi.specs.panels import Further

_FIGURE, _NUMBERS = (f"spi.plugins.fluids.kinds.trajectory.{name}" for name in ("figure", "numbers"))


def _fault(case: Any) -> str:
    return "" if geometry(case.model).get("on") == "torus" else "is for sine_euler and zeitlin"


VORTICITY = Further(f"{_FIGURE}:VORTICITY", _fault)
SPECTRUM = Further(f"{_FIGURE}:SPECTRUM", _fault, f"{_NUMBERS}:spectra")
ENSTROPHY = Further(f"{_FIGURE}:ENSTROPHY", _fault, f"{_NUMBERS}:enstrophies")


def _tracer_fault(case: Any) -> str:
    return "" if geometry(case.model).get("tracers") else "is for zeitlin with tracers"


TRACER = Further(f"{_FIGURE}:TRACER", _tracer_fault)


def _particles_fault(case: Any) -> str:
    return "" if geometry(case.model).get("particles") else "is for zeitlin with particles"


PARTICLES = Further(f"{_FIGURE}:PARTICLES", _particles_fault, f"{_NUMBERS}:particles")
