"""What a report says of each experiment."""

import io
import json
import math
import re
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from markupsafe import Markup
from rich.console import Console
from rich.table import Table
from rich.text import Text

from ..kinds import KINDS
from ..printing import claims as printed_claims
from ..printing import sweeps
from ..printing.text import duration, fraction, short
from ..report import views
from ..running import shipped
from ..specs import text_of
from ..statistics.claims import VERDICTS
from ..statistics.curves import curves
from ..storage.records import Results
from ..storage.stored import Stored, by_case

# ---------------------------------------------------------------------------------------------------------------------
# What a kind of experiment prints, as tables of pandas and lines of text, from which HTML and LaTeX are made.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:  # pandas takes a while
    from pandas import DataFrame


class Titled(NamedTuple):
    """A table of texts with its title."""

    title: str
    frame: "DataFrame"
    justified: str  #: "l" or "r" for each column

    @classmethod
    def of(cls, title: str, justified: str, headings: Iterable[str], rows: Iterable[Iterable[str]]) -> "Titled":
        """The table with these rows."""
        from pandas import DataFrame

        return cls(title, DataFrame(map(list, rows), columns=list(headings), dtype=object), justified)

    @property
    def html(self) -> Markup:
        """The table as HTML."""
        from pandas import option_context

        with option_context("display.max_colwidth", None):
            return Markup(self.frame.to_html(index=False, border=0))


class Recorder(Console):
    """A console that keeps what is printed to it: tables, and all else as lines."""

    def __init__(self) -> None:
        super().__init__(file=io.StringIO(), width=10_000, color_system=None, highlight=False)
        self.items: list[Titled | str] = []

    def print(self, *objects: Any, **options: Any) -> None:
        """Keep what would be printed, but for empty lines."""
        self.items += [_titled(one) if isinstance(one, Table) else str(one) for one in objects]


def _titled(table: Table) -> Titled:
    """A table without the columns that are empty, heading and all, and without breaks that make a column narrow."""
    every = [(str(column.header), [_plain(cell) for cell in column.cells], column.justify) for column in table.columns]
    headings, cells, justified = zip(*(one for one in every if one[0] or any(one[1])), strict=True)
    unbroken = (re.sub(r"-\n(?=[a-z])", "", one).replace("-\n", "-").replace("\n", " ") for one in headings)
    return Titled.of(str(table.title or ""), "".join(one[0] for one in justified), unbroken, zip(*cells, strict=True))


def _plain(cell: Any) -> str:
    return (cell if isinstance(cell, Text) else Text.from_markup(str(cell))).plain.replace("\n", " ")


Facts = list[tuple[str, str]]  #: name and value

_LONGEST = 2000  # characters of a line that is shown: longer ones stand for arrays

#: The names of attributes of a results file, and what they are called in a report.
_PROVENANCE = {
    "seed": "seed",
    "profile": "profile",
    "created": "computed",
    "spi_version": "spi",
    "stream_version": "version of the random streams",
    "source_digest": "digest of the sources that compute",
    "spec_hash": "digest of the spec (SHA-256)",
    "machine_processor": "processor",
    "machine_instruction_set": "instruction set",
    "machine_vector_bits": "bits of vectors",
    "machine_cpu_count": "processors",
    "machine_platform": "platform",
    "machine_python": "Python",
    "machine_numpy": "NumPy",
    "machine_numba": "Numba",
    "machine_h5py": "h5py",
}


class Section(NamedTuple):
    """One experiment in a report, but for its figure."""

    name: str  #: of the results file, without its ending
    anchor: str  #: by which the page refers to it, unlike those of the others
    title: str
    kind: str
    paper_figure: int | None
    asks: str  #: what the experiment asks; empty if its spec does not say
    headlines: Facts  #: the title of a case and what came out of it; one without a title if there is one case
    verdicts: dict[str, int]  #: how many claims passed, are inconclusive and failed; empty if there are none
    complaints: list[tuple[str, str]]  #: of each claim that did not pass: the verdict and its details
    orders: Titled | None
    items: list[Titled | str]  #: what `spi show` prints
    cost: Facts
    provenance: Facts
    command: str  #: that repeats it from the results file
    from_spec: str  #: that repeats it from the spec
    files: Facts  #: the spec and the files that belong to it: name and text

    @property
    def tables(self) -> list[Titled]:
        """The tables among the items, that of the orders before them."""
        printed = [item for item in self.items if isinstance(item, Titled)]
        return [self.orders, *printed] if self.orders else printed


def section(path: Path, results: Results, anchor: str) -> Section:
    """What is to be said of the results in the file `path`.

    ValueError if they are of an unknown kind or hold nothing, StorageError if they cannot be read as such.
    """
    kind = results.attributes.get("kind", "")
    if kind not in KINDS:
        raise ValueError(f"there is no report of results of kind {kind!r}; known kinds: {', '.join(KINDS)}")
    read = views.readings(results)
    if not read:
        raise ValueError("the results hold no scheme, so there is nothing to report")
    judged, attributes = views.verdicts(results), results.attributes
    counts, recorder = Counter(one.verdict for one in judged), Recorder()
    views.show(results, recorder, with_title=False)
    return Section(
        name=path.stem,
        anchor=anchor,
        title=attributes.get("title") or path.stem,
        kind=kind.replace("_", " "),
        paper_figure=attributes.get("figure"),
        asks=attributes.get("asks", ""),
        headlines=_headlines(kind, read),
        verdicts={verdict: counts[verdict] for verdict in VERDICTS} if judged else {},
        complaints=printed_claims.complaints(judged),
        orders=_orders(kind, by_case(read)),
        items=recorder.items,
        cost=list(_cost(results)),
        provenance=list(_provenance(attributes)),
        command=shlex.join(["spi", "run", path.name]),
        from_spec=_from_spec(attributes.get("experiment", path.stem), attributes),
        files=list(_files(attributes.get("experiment", path.stem), attributes)),
    )


def _headlines(kind: str, read: Sequence[Stored]) -> Facts:
    """The quantities of each case that the record names as its headline, or of a sweep those that it shows."""
    cases, names = by_case(read), KINDS[kind].results.Record.headline
    found = [(whole.title, whole.curves) for whole in views.wholes(kind, read)]
    if names and not found:
        each = [curves(KINDS[kind].results.quantities(case), names) for case in cases]
        found = list(zip(views.titles(cases), each, strict=True))
    return [(title if len(found) > 1 else "", sweeps.headline(of_case)) for title, of_case in found if of_case]


def _orders(kind: str, cases: Sequence[Sequence[Any]]) -> Titled | None:
    """All fitted orders with their intervals; None if there are none."""
    if not KINDS[kind].keys.Case.quantities:
        return None
    several = len(cases) > 1
    headings = (*["case"] * several, "scheme", "order", "95 % interval", "expected")
    found = [
        (*[title] * several, *texts)
        for title, case in zip(views.titles(cases), cases, strict=True)
        for texts in _orders_of(kind, case)
    ]
    return Titled.of("orders", several * "l" + "lrrr", headings, found) if found else None


def _orders_of(kind: str, case: Sequence[Any]) -> Iterator[tuple[str, str, str, str]]:
    """Of each fitted order of a case whose it is, the number, its interval and what theory says."""
    expected = {one.about.scheme: getattr(one, "expected_order", None) for one in case if not one.about.extrapolate}
    expected |= {one.about.variant: getattr(one, "expected_order", None) for one in case}
    for one in KINDS[kind].results.quantities(case):
        if one.name not in ("order", "uniform_order"):
            continue
        subject = f"{one.subject}, largest over eps" if one.name == "uniform_order" else one.subject
        theory = expected.get(one.about.variant)
        told = "" if theory is None else fraction(theory)
        if math.isfinite(one.value):
            yield subject, f"{one.value:.3f}", f"[{one.low:.3f}, {one.high:.3f}]", told
        else:
            yield subject, "not resolved", "", told


def _cost(results: Results) -> Iterator[tuple[str, str]]:
    """What the results cost, as far as all kinds store it."""
    groups = results.groups
    seconds = math.fsum(group.attributes.get("wall_seconds", 0.0) for group in groups)
    threads = max((group.attributes.get("threads", 0) for group in groups), default=0)
    yield "time", f"{duration(seconds)} of wall-clock time" + (f" on {threads} threads" if threads else "")
    paths = sorted({group.attributes["samples"] for group in groups if group.attributes.get("samples")})
    if paths:
        yield "paths", " to ".join(dict.fromkeys(f"{count:,}" for count in (paths[0], paths[-1])))
    measured = [group.arrays.get("ns_per_step", group.attributes.get("ns_per_step", math.nan)) for group in groups]
    known = np.concatenate([np.ravel(values) for values in measured])
    known = known[np.isfinite(known)]
    if known.size:
        ends = dict.fromkeys(short(float(end), ".3g") for end in (known.min(), known.max()))
        yield "time per step and path", f"{' to '.join(ends)} ns"


def _provenance(attributes: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield from ((label, str(attributes[key])) for key, label in _PROVENANCE.items() if key in attributes)
    if len(attributes.get("machines", ())) > 1:
        yield "machines", "; and ".join(attributes["machines"])
    if attributes.get("overrides"):
        yield "overrides", "; ".join(attributes["overrides"])


def _from_spec(name: str, attributes: dict[str, Any]) -> str:
    """The command that repeats results from their spec, by its name if it came with the program as it stands there."""
    if name in shipped.names() and text_of(shipped.path_of(name)) == attributes.get("spec"):
        words = ["spi", "run", name]
    else:
        words = ["spi", "run", f"{name}.yaml"]
    if (profile := attributes.get("profile", "laptop")) != "laptop":
        words += ["--profile", profile]
    for override in attributes.get("overrides", ()):
        words += [override] if override.startswith("--") else ["--set", override]
    return shlex.join(words)


def _files(name: str, attributes: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if "spec" in attributes:
        yield f"{name}.yaml", attributes["spec"]
    for file, text in json.loads(attributes.get("model_sources") or "{}").items():
        numbers = len(text) > _LONGEST and "\n" not in text
        yield file, f"numbers, {len(text):,} characters in the results file" if numbers else text
