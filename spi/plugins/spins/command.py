"""Command `spi export`: states of spins that a trajectory stored, in formats of other programs."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from spi.cli.options import INVALID, LOOK, RESULTS, Command, ResultsFile, ResultsFolder, RunOptions, run_options, stored
from spi.cli.options import end as end_with
from spi.cli.terminal import tell
from spi.plugins import offers

if TYPE_CHECKING:
    from spi.kinds.trajectory.results import Trajectory


@run_options("trust_code")
def export(
    source: ResultsFile,
    format: Annotated[Literal["ovf", "npy", "vtk"], typer.Option(help="Format of the files.")] = "ovf",
    time: Annotated[
        list[float] | None, typer.Option(help="Times of states, the nearest that are stored (default: the last).")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="All states that are stored.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder of the files (default: that of the results).")] = None,
    results: ResultsFolder = RESULTS,
    *,
    options: RunOptions,
) -> None:
    """Write states of spins that a trajectory stored to files: OVF 2.0, NumPy, or VTK.

    A file is <out>/<name>.<case>.<scheme>.<number of the state>.<format>.  The key `initial: {file: ...}` reads OVF and
    NumPy.
    """
    from spi import storage, views
    from spi.kinds.trajectory.results import Trajectory

    (path,) = stored([source], results, options)
    found = [one for one in views.readings(storage.read(path)) if isinstance(one, Trajectory)]
    readings = [one for one in found if one.place.get("on") == "lattice"]
    if not readings:
        others = {offers("in_python").get(one.place.get("on", "")) for one in found} - {None}
        right = next(iter(others), "give results of kind trajectory of the model spins")
        end_with(INVALID, f"{path}: has no states of spins; {right}")
    folder, files = out or path.parent, dict[Path, bytes]()
    for one in readings:
        for number in range(len(one.t)) if every else _numbers(one, time):
            name = f"{path.stem}.{one.about.case}.{one.about.variant}.{number}.{format}"
            files[folder / name] = _bytes(one, number, format)
    storage.write_all(files)
    for file in files:
        tell(f"wrote {file}")


def _numbers(one: "Trajectory", times: list[float] | None) -> list[int]:
    """Numbers of the stored states that are next to some times; of the last one without any."""
    return sorted({int(abs(one.t - t).argmin()) for t in times}) if times else [len(one.t) - 1]


def _bytes(one: "Trajectory", number: int, format: str) -> bytes:
    """File of one state."""
    import numpy as np

    from spi.plugins.spins.storage import ovf, vtk
    from spi.plugins.spins.storage.order import along_first, places_of

    lattice, spins = one.place, one.y[number].reshape(-1, 3)
    per_cell = len(lattice["sites"])
    if format == "npy":
        file = io.BytesIO()
        np.save(file, spins.reshape(*lattice["size"], *([per_cell] if per_cell > 1 else []), 3))
        return file.getvalue()
    size, places = (*lattice["size"], 1, 1)[:3], places_of(lattice)
    vectors = np.array(lattice["vectors"])
    on_axes = np.array_equal(vectors, abs(vectors) * np.eye(len(vectors), 3))
    nodes = size if per_cell == 1 and (on_axes or format == "vtk") else None
    title = f"{one.about.case_title}, {one.about.scheme}, t = {one.t[number]:.17g}"
    written = {"ovf": ovf.bytes_of, "vtk": vtk.bytes_of}[format]
    return written(along_first(spins, size, per_cell), places, nodes, title.replace("\n", " "))


COMMAND = Command(export, LOOK, ["spi export skyrmion", "spi export skyrmion --format vtk --all"])
