"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "systems",
    sources={
        "system": "spi.plugins.systems.reading:SOURCE",
        "algebra": "spi.plugins.systems.reading:SOURCE",
        "bracket": "spi.plugins.systems.reading:SOURCE",
    },
)
