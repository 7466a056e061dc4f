"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin("spins", initial={"spins": "spi.plugins.spins.specs.initial:SpinStates"})
