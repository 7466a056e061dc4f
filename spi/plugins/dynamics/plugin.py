"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "dynamics",
    kinds={
        "equilibrium": "spi.plugins.dynamics.kinds.equilibrium",
        "statistics": "spi.plugins.dynamics.kinds.statistics",
        "lyapunov": "spi.plugins.dynamics.kinds.lyapunov",
    },
    warnings={"uniqueness": "spi.plugins.dynamics.running.uniqueness:warning"},
)
