"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "systems",
    sources={
        "system": "spi.plugins.systems.reading:SOURCE",
        "algebra": "spi.plugins.systems.reading:SOURCE",
        "bracket": "spi.plugins.systems.reading:SOURCE",
    },
    templates={"system": "spi.plugins.systems.template:TEXT"},
    groups={"systems": "systems written in YAML, and lattices"},
)
