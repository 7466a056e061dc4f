"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "fluids",
    models={"zeitlin": "spi.plugins.fluids.models:Zeitlin"},
    initial={
        "modes": "spi.plugins.fluids.specs.initial:Vorticity",
        "vorticity": "spi.plugins.fluids.specs.initial:Vorticity",
        "random": "spi.plugins.fluids.specs.initial:Vorticity",
    },
    offered={"fluid": "spi.plugins.fluids.api"},
    grids={"torus": "spi.plugins.fluids.specs.initial:of_grid"},
    films={"torus": "spi.plugins.fluids.kinds.trajectory.figure:FILM"},
    in_python={"torus": "`spi.fluid.field(spi.load(FILE).y, 64)` in Python is the vorticity on 64 x 64 points"},
    groups={"fluids": "the sine-Euler equations and their limit"},
    panels={
        "trajectory.vorticity": "spi.plugins.fluids.kinds.trajectory.words:VORTICITY",
        "trajectory.spectrum": "spi.plugins.fluids.kinds.trajectory.words:SPECTRUM",
        "trajectory.tracer": "spi.plugins.fluids.kinds.trajectory.words:TRACER",
        "trajectory.particles": "spi.plugins.fluids.kinds.trajectory.words:PARTICLES",
        "statistics.energy_spectrum": "spi.plugins.fluids.kinds.statistics.words:SPECTRUM",
        "trajectory.enstrophy": "spi.plugins.fluids.kinds.trajectory.words:ENSTROPHY",
    },
)
