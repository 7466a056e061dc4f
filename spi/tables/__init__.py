"""Results as records, JSON, CSV and tables to read."""

import csv
import io
import json

from . import anything, long_time, stability, strong, trajectory, weak, work_precision
from .strong import STRONG as STRONG
from .text import fraction, is_odd, new_console, new_table, print_whole
from .text import power_of_two as power_of_two
from .text import with_interval as with_interval
from .weak import WEAK as WEAK
from .work_precision import WORK_PRECISION as WORK_PRECISION

#: What each kind of study has: ``rows(groups)``, records of all groups, and ``show(console, heading, groups)``, the
#: tables of a case.
KINDS = {
    "strong": strong,
    "trajectory": trajectory,
    "weak": weak,
    "work_precision": work_precision,
    "stability": stability,
    "long_time": long_time,
}


def rows(results):
    """One flat record per case, scheme and point of the first axis (of errors step sizes, else times)."""
    kind = KINDS.get(results.attributes.get("kind"), anything)
    return list(kind.rows(results.groups))


def as_json(records):
    """A JSON list of records; as JSON has neither, infinities and nan become null (``nonfinite`` tells why)."""
    plain = [{key: None if is_odd(value) else value for key, value in record.items()} for record in records]
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False)


def as_csv(records):
    """CSV with a header; infinities and nan are written ``inf`` and ``nan``, what a record lacks stays empty."""
    columns = list(dict.fromkeys(key for record in records for key in record))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


def print_table(results, file=None):
    """Print one table per case to ``file`` (standard output if None), in colour if that is a terminal."""
    console = new_console(file)
    title = results.attributes.get("title")
    if title:
        console.print(title, style="bold", markup=False)
    kind = KINDS.get(results.attributes.get("kind"), anything)
    for case in dict.fromkeys(group.case for group in results.groups):
        groups = [group for group in results.groups if group.case == case]
        heading = groups[0].attributes.get("case_title") or case
        kind.show(console, "" if heading == title else heading, groups)


def print_catalogue(models, schemes, experiments, file=None):
    """Print what there is: models (name -> record), schemes (name -> row of the table of orders), experiments."""
    console = new_console(file)
    table = new_table("models", ["name", "parameters", ""], left=3)
    for name, record in models.items():
        table.add_row(name, ", ".join(record._fields), (record.__doc__ or "").splitlines()[0])
    print_whole(console, table)
    console.print()
    orders = ["strong\norder", "with one\nnoise", "weak\norder"]
    table = new_table("schemes", ["name", "", "preserves", *orders], left=3)
    for name, row in schemes.items():
        numbers = (row.strong_order, row.strong_order_commuting, row.weak_order)
        table.add_row(name, row.label, row.preserves, *map(fraction, numbers))
    print_whole(console, table)
    console.print()
    table = new_table("experiments", ["file", "title", "kind", "figure"], left=3)
    for e in experiments:
        table.add_row(str(e.path), e.title, e.kind, str(e.figure or "-"))
    print_whole(console, table)


def print_cost(experiment, cost, file=None):
    """Print that an experiment is valid and what it would cost (a ``spi.run.Cost``)."""
    cases = [f"{case.name} ({', '.join(case.schemes)})" for case in experiment.cases]
    new_console(file).print(
        f"{experiment.path}: valid, profile {experiment.profile}: {'; '.join(cases)}; "
        f"{cost.path_steps:.2g} steps of paths, {'at most ' * cost.at_most}about {cost.seconds:.2g} s once compiled, "
        f"{cost.megabytes:.0f} MB",
        markup=False,
        soft_wrap=True,
    )
