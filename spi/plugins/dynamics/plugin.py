"""What this plug-in offers."""

from spi.plugins import Plugin

_KINDS = "spi.plugins.dynamics.kinds"

PLUGIN = Plugin(
    "dynamics",
    kinds={name: f"{_KINDS}.{name}" for name in ("equilibrium", "statistics", "lyapunov")},
    warnings={"uniqueness": "spi.plugins.dynamics.running.uniqueness:warning"},
)
