"""What is stored of mean energies."""

from spi.printing.tables import Column, Table
from spi.storage.stored import Array, Stored, array, axis, fact


class Energies(Stored):
    """Mean energies of one scheme at several step sizes, from large to small."""

    row_axes = ("h",)
    tables = (Table("h", [Column("energy", "mean of H (95 %)")]),)

    h: Array = axis("step size", "time")
    energy: Array = array("h", "mean energy", formula="E H(y(T))")
    energy_stderr: Array = array("h", "standard error of the mean energy")
    samples: int = fact("number of paths", column=True)


Record = Energies
