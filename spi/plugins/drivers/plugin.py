"""What this plug-in offers."""

from spi.plugins import Plugin

LAWS = "spi.plugins.drivers.specs.laws"

PLUGIN = Plugin(
    "drivers",
    noises={
        "ornstein_uhlenbeck": f"{LAWS}:OrnsteinUhlenbeckKeys",
        "fractional": f"{LAWS}:FractionalKeys",
        "file": f"{LAWS}:FileKeys",
    },
)
