"""Tables of trajectories."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from spi.printing.rows import rows_of
from spi.printing.text import new_table, power_of_two, print_whole, short

from .results import Trajectory, losses

if TYPE_CHECKING:
    from rich.console import Console


def rows(readings: Iterable[Trajectory]) -> Iterator[dict[str, Any]]:
    """A record per time."""
    for reading in readings:
        yield from rows_of(reading, ["t"], spread=["component", "casimir"])


def show(console: "Console", heading: str, readings: Sequence[Trajectory]) -> None:
    """Print the table of a case."""
    from rich.text import Text

    count = len(readings[0].casimir_drift)
    drifts = [f"drift\nof C{c + 1 if count > 1 else ''}" for c in range(count)]
    headings = ["scheme", "step", "steps", "H at the\nend", *drifts, "smallest\ncomponent", "diverged\nat t ="]
    implicit = any(reading.solver for reading in readings)
    table = new_table(heading, headings + ["solver\nfailures", "iterations\na step"] * implicit, left=1)
    for reading in readings:
        lost, solver = reading.nonfinite_from, reading.solver
        cells = [str(solver.failures), short(solver.iterations_mean, ".1f")] if solver else ["", ""]
        table.add_row(
            Text(reading.about.label),
            power_of_two(reading.step),
            str((len(reading.y) - 1) * reading.every),
            short(float(reading.hamiltonian[-1]), ".6g"),
            *map(short, reading.casimir_drift),
            short(float(reading.lowest.min()), ".3g"),
            Text("" if lost is None else f"{lost:g}", style="bold red"),
            *map(Text, cells * implicit),
        )
    print_whole(console, table)
    for line in _undefined(readings):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print()


def _undefined(readings: Sequence[Trajectory]) -> Iterator[str]:
    """Sentences on quantities that are not defined along paths which did not diverge."""
    for reading in readings:
        count = reading.casimirs.shape[1]
        named = {f"C{c + 1 if count > 1 else ''}": reading.casimirs[:, c] for c in range(count)}
        for name, values in {"H": reading.hamiltonian, **named}.items():
            if lost := losses(reading, values):
                yield f"{reading.about.label}: {name} is {lost}"
