"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin("report", commands={"report": "spi.plugins.report.command:COMMAND"})
