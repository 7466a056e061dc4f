"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin("lattices", needs=("systems", "spins"), definitions={"lattice": "spi.plugins.lattices.bonds:model_of"})
