"""Tables of trajectories."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.text import casimirs, joined, new_table, power_of_two, print_whole, sentence, short, whose

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


def told(readings: Sequence[Trajectory]) -> str:
    """What came out of a case, in one sentence: the Casimir functions, diverged paths, and what the figure is about."""
    drifts = (
        (whose(one.about), float(np.max(one.casimir_drift)))
        for one in readings
        if one.casimir_drift and losses(one, one.casimirs) is None
    )
    lost = [f"with {_whose(one)} at t = {one.nonfinite_from:g}" for one in readings if one.nonfinite_from is not None]
    left = f"the path diverged {joined(lost)}" if lost else ""
    undefined = joined([_whose(one) for one in readings if losses(one, one.casimirs)])
    some = f"some Casimir function is not defined all the time with {undefined}" if undefined else ""
    return sentence([casimirs(drifts), some, left, *_populations(readings), *_energy(readings)])


def _whose(reading: Trajectory) -> str:
    return whose(reading.about, with_eps=True)


def _populations(readings: Sequence[Trajectory]) -> Iterator[str]:
    """Clauses on the schemes that keep all components positive, where the figure shows populations."""
    if "populations" not in readings[0].panels:
        return
    lowest = {_whose(reading): float(reading.lowest.min()) for reading in readings}
    positive = [label for label, value in lowest.items() if value > 0]
    others = [f"{value:.3g} with {label}" for label, value in lowest.items() if not value > 0]
    yield f"all populations stay positive with {joined(positive)}" if positive else ""
    yield f"the smallest population is {joined(others)}" if others else ""


def _energy(readings: Sequence[Trajectory]) -> Iterator[str]:
    """A clause on the first and last value of the Hamiltonian, if there is one path whose figure shows it."""
    if len(readings) == 1 and "hamiltonian" in readings[0].panels:
        yield "the Hamiltonian goes from {:.4g} to {:.4g}".format(*readings[0].hamiltonian[[0, -1]])
