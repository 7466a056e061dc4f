"""Lists of what there is: models, schemes and experiments."""

from collections.abc import Iterable, Mapping
from typing import IO, TYPE_CHECKING, Any

from .text import fraction, new_console, new_table, printable

if TYPE_CHECKING:
    from ..schemes import Scheme  # a compiler comes with it

_WIDTH = 80  # of what goes into a file or a pipe, and the least on a terminal


def print_models(models: Mapping[str, Any], file: IO[str] | None = None) -> None:
    """Print what models there are (name -> class of its record) with their formulas and parameters."""
    rows = []
    for name, record in models.items():
        formula = " ".join((record.__doc__ or "").split("\n\n")[0].split())
        rows.append((name, f"{formula}\nparameters: {', '.join(record._fields)}"))
    _print("models", ["name", "equations and parameters"], rows, file)


def print_schemes(schemes: Mapping[str, "Scheme"], file: IO[str] | None = None) -> None:
    """Print what schemes there are (name -> row of the table of schemes), their orders and what they preserve."""
    rows = []
    for name, row in schemes.items():
        orders = map(fraction, (row.strong_order, row.strong_order_commuting, row.weak_order))
        rows.append((name, *orders, f"{row.label}; preserves {row.preserves}"))
    _print("schemes", ["name", "strong\norder", "with one\nnoise", "weak\norder", ""], rows, file)


def print_experiments(title: str, experiments: Mapping[str, Any], file: IO[str] | None = None) -> None:
    """Print experiments: what to call them on the command line -> their ``spi.specs.Heading``."""
    rows = [(name, str(one.figure or "-"), one.title) for name, one in experiments.items()]
    _print(title, ["name", "figure", "title"], rows, file)


def print_results(results: Iterable[Any], file: IO[str] | None = None) -> None:
    """Print what results there are (``spi.running.finding.Listed``): their names, and under each what it is."""
    console = new_console(file)
    for one in results:
        counts = sorted({count for count in one.samples if count})
        samples = " to ".join(f"{count:,}" for count in dict.fromkeys([*counts[:1], *counts[-1:]]))
        facts = [one.kind, *[f"{samples} samples"] * bool(samples), one.created]
        for line in filter(None, (one.name, f"    {', '.join(facts)}: {one.title}", f"    {one.how}".rstrip())):
            console.print(printable(line), markup=False, soft_wrap=True)


def _print(title: str, headings: Iterable[str], rows: Iterable[Iterable[str]], file: IO[str] | None) -> None:
    """Print a table as wide as the terminal, whose last column wraps."""
    from rich.measure import Measurement
    from rich.text import Text

    console = new_console(file)
    table = new_table(title, headings, left=1)
    last = table.columns[-1]
    last.justify, last.no_wrap = "left", False
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    needed = Measurement.get(console, console.options.update(max_width=10_000), table).minimum
    console.width = max(console.width if console.is_terminal else _WIDTH, needed, _WIDTH)
    console.print(table)
    console.print()
