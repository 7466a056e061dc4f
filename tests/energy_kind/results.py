"""What is stored of mean energies."""

from typing import Annotated

from spi.printing.tables import Column, Table
from spi.storage.stored import Array, Stored, array, axis, fact


class Energies(Stored):
    """Mean energies of one scheme at several step sizes, from large to small."""

    row_axes = ("h",)
    tables = (Table("h", [Column("energy", "mean of H (95 %)")]),)

    h: Annotated[Array, axis("step size", "time")]
    energy: Annotated[Array, array("h", "mean energy", formula="E H(y(T))")]
    energy_stderr: Annotated[Array, array("h", "standard error of the mean energy")]
    samples: Annotated[int, fact("number of paths", column=True)]


Record = Energies
