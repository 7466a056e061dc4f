"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "clusters",
    commands={"merge": "spi.plugins.clusters.command:MERGE", "verify": "spi.plugins.clusters.command:VERIFY"},
    ways={"shard": "spi.plugins.clusters.command:SHARD", "dask": "spi.plugins.clusters.command:DASK"},
)
