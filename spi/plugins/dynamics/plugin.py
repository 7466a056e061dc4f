"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "dynamics",
    offered={"rank_histogram": "spi.plugins.dynamics.api:rank_histogram"},
    kinds={
        "equilibrium": "spi.plugins.dynamics.kinds.equilibrium",
        "growth": "spi.plugins.dynamics.kinds.growth",
        "statistics": "spi.plugins.dynamics.kinds.statistics",
        "lyapunov": "spi.plugins.dynamics.kinds.lyapunov",
    },
    initial={"results": "spi.plugins.dynamics.specs.restart:Restart"},
    laws={
        "uniform_on_surface": "spi.plugins.dynamics.specs.laws:OnSurface",
        "gibbs": "spi.plugins.dynamics.specs.laws:OfGibbs",
    },
    warnings={"uniqueness": "spi.plugins.dynamics.running.uniqueness:warning"},
)
