"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "fluids",
    initial={
        "modes": "spi.plugins.fluids.specs.initial:Vorticity",
        "vorticity": "spi.plugins.fluids.specs.initial:Vorticity",
        "random": "spi.plugins.fluids.specs.initial:Vorticity",
    },
    grids={
        "sine_euler": "spi.plugins.fluids.specs.initial:of_grid",
        "zeitlin": "spi.plugins.fluids.specs.initial:of_grid",
    },
)
