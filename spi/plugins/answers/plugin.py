"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "answers",
    needs=("solve",),
    kinds={"answer": "spi.plugins.answers.kinds.answer"},
    commands={"answer": "spi.plugins.answers.command:COMMAND"},
    offered={"answer": "spi.plugins.answers.api:answer"},
)
