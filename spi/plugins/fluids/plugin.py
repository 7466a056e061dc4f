"""What this plug-in offers."""

from spi.plugins import Plugin

_INITIAL = "spi.plugins.fluids.specs.initial"

PLUGIN = Plugin(
    "fluids",
    initial=dict.fromkeys(("modes", "vorticity", "random"), f"{_INITIAL}:Vorticity"),
    grids=dict.fromkeys(("sine_euler", "zeitlin"), f"{_INITIAL}:of_grid"),
)
