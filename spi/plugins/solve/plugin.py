"""What this plug-in offers."""

from spi.plugins import Plugin

PLUGIN = Plugin(
    "solve",
    estimators={"kolmogorov": "spi.plugins.solve.kinds.weak.kolmogorov:KolmogorovPlan"},
    solvers={
        "axis_inertias": "spi.plugins.solve.exact.sphere",
        "rotation_shear_rates": "spi.plugins.solve.exact.cylinder",
    },
)
