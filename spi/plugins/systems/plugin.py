"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "systems",
    sources=dict.fromkeys(("system", "algebra", "bracket"), "spi.plugins.systems.reading:SOURCE"),
)
