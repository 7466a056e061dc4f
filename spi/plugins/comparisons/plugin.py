"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "comparisons",
    kinds={
        "work_precision": "spi.plugins.comparisons.kinds.work_precision",
        "stability": "spi.plugins.comparisons.kinds.stability",
    },
    groups={"stability": "large steps, strong noise, fast processes"},
)
