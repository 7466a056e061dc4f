"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin("study", ("comparisons", "report"), commands={"study": "spi.plugins.study.command:COMMAND"})
"""Command `spi study`."""
