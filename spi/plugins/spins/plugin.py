"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "spins",
    initial={"spins": "spi.plugins.spins.specs.initial:SpinStates"},
    films={"lattice": "spi.plugins.spins.kinds.trajectory.figure:FILM"},
    panels={"trajectory.spins": "spi.plugins.spins.kinds.trajectory.words:SPINS"},
)
