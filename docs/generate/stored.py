"""The page docs/reference/results.md: what a results file holds, from the records of the kinds."""

from words import in_symbols, plain, table

from spi.kinds import KINDS
from spi.storage.stored import NUMBERED, Entry, Stored, layout


def page() -> str:
    """What a results file holds, kind by kind."""
    text = PAGE.format(kinds=", ".join(f"[`{kind}`](#{kind})" for kind in KINDS))
    text += table(("axis", "what it is"), ((f"`{name}`", told) for name, told in NUMBERED.items()))
    for kind, module in KINDS.items():
        record = module.results.Record
        entries = list(layout(record))
        text += f"\n## {kind}\n\n{plain(record.__doc__ or '')}\n\n"
        arrays = (_held(one) for one in entries if not one.is_fact)
        text += table(("array", "axes", "what it is", "formula", "unit"), arrays)
        text += "\n" + _tables(record, entries) + "\n"
        text += table(("attribute", "what it is", "unit"), (_fact(one) for one in entries if one.is_fact))
    return text


PAGE = """# What a results file holds

A results file is HDF5: a group `/<case>/<scheme>`, or `/<case>/<scheme>/<estimator>`, for each scheme of each case,
with arrays that have dimension scales, so that xarray and MATLAB open it. Each array has its `long_name`,
and its `formula` and `units` if it has any. The columns of
[tables of numbers](../results.md#tables-of-numbers) have the same names.

Kinds: {kinds}.

Units: *time* is the unit of t in the equation, *state* that of the components of y, *value* that of a test function.
What is not always there is in brackets: it is stored where the spec or the scheme has it. The attributes of each group
also say what was integrated: `scheme`, `scheme_label`, `eps`, `extrapolate`, `estimator`, `case_title`, `seed`,
`model`, its parameters as `model_sigma` and so on, `variables`, `initial`, `final_time` and `truncate_noise`.

"""


def _tables(record: type[Stored], entries: list[Entry]) -> str:
    """Tables of numbers: the main one, and the first array over each other set of axes."""
    first: dict[tuple[str, ...], str] = {}
    for entry in (one for one in entries if one.is_exported):
        first.setdefault(tuple(axis for axis in entry.axes if axis not in record.row_columns), entry.name)
    main = first.pop(record.row_axes)
    others = [f"`{name}` ({', '.join(axes)})" for axes, name in first.items() if not {*axes} <= {*record.row_axes}]
    rest = f"; further ones, where there are such numbers: {', '.join(others)}" if others else ""
    return f"Tables: the main one `{main}` ({', '.join(record.row_axes)}){rest}.\n"


def _held(entry: Entry) -> tuple[str, ...]:
    name = f"`{entry.name}`" if entry.always else f"(`{entry.name}`)"
    told = entry.meaning
    formula = f"`{told.formula}`" if told.formula else ""
    return name, ", ".join(f"`{axis}`" for axis in entry.axes), in_symbols(plain(told.text)), formula, told.unit


def _fact(entry: Entry) -> tuple[str, ...]:
    return (f"`{entry.name}`" if entry.always else f"(`{entry.name}`)"), plain(entry.meaning.text), entry.meaning.unit
