"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "drivers",
    noises={
        "ornstein_uhlenbeck": "spi.plugins.drivers.specs.laws:OrnsteinUhlenbeckKeys",
        "fractional": "spi.plugins.drivers.specs.laws:FractionalKeys",
        "file": "spi.plugins.drivers.specs.laws:FileKeys",
    },
)
