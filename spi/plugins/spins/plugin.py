"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "spins",
    models={"spins": "spi.plugins.spins.models:Spins"},
    initial={"spins": "spi.plugins.spins.specs.initial:SpinStates"},
    further={"dynamics.waves": "spi.plugins.spins.kinds.statistics.waves:WAVES"},
    films={"lattice": "spi.plugins.spins.kinds.trajectory.figure:FILM"},
    panels={"trajectory.spins": "spi.plugins.spins.kinds.trajectory.words:SPINS"},
)
