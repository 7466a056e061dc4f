"""The figure of mean energies."""

from spi.drawing.panels import CurvePanel, Figures

draw = Figures({"energy": [CurvePanel("energy", over="h", label=r"$\mathrm{{E}}\,H(y(T))$")]})
