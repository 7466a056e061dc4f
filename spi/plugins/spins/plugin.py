"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "spins",
    models={"spins": "spi.plugins.spins.models:Spins"},
    initial={"spins": "spi.plugins.spins.specs.initial:SpinStates"},
    grids={"lattice": "spi.plugins.spins.specs.initial:of_array"},
    formats={
        ".ovf": "spi.plugins.spins.storage.ovf:array_of",
        ".omf": "spi.plugins.spins.storage.ovf:array_of",
    },
    warnings={"negative": "spi.plugins.spins.running.negative:warning"},
    commands={"export": "spi.plugins.spins.command:COMMAND"},
    further={"dynamics.waves": "spi.plugins.spins.kinds.statistics.waves:WAVES"},
    films={"lattice": "spi.plugins.spins.kinds.trajectory.figure:FILM"},
    panels={
        "trajectory.spins": "spi.plugins.spins.kinds.trajectory.words:SPINS",
        "trajectory.loop": "spi.plugins.spins.kinds.trajectory.words:LOOP",
    },
)
