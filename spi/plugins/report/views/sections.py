"""Sections of a report, one for each experiment."""

import json
import math
import re
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from latex2mathml.converter import convert
from markupsafe import Markup, escape

from spi import views
from spi.ensemble import protocol
from spi.kinds import KINDS
from spi.models import MODELS
from spi.printing import sweeps, tables
from spi.printing.latex import Titled
from spi.printing.tables import StyledText, TextTable
from spi.printing.text import fraction, human_time, short
from spi.running import shipped
from spi.specs import text_of
from spi.specs.document import Document
from spi.statistics.claims import VERDICTS, orders_of, quantities
from spi.statistics.curves import curves
from spi.storage.records import StoredResults
from spi.storage.stored import Stored, by_case

# ---------------------------------------------------------------------------------------------------------------------
# The equation of an experiment with its parameters as MathML, which browsers draw without anything else.
# ---------------------------------------------------------------------------------------------------------------------


_DRIFT = r"\mathrm{d}y = B(y) \nabla H(y)\,\mathrm{d}t"
_DAMPING = r" - \gamma y\,\mathrm{d}t"
_FRICTION = r" - \sum_k \frac{\sigma_k^2}{2T} (X_k H)\, X_k\,\mathrm{d}t"
_FIELDS = r", \quad X_k = B \nabla \widehat H_k"
_NOISE = r" + \sum_k \sigma_k B(y) \nabla \widehat H_k(y) \circ \mathrm{d}W_k"
_FAST = r" + \frac{1}{\varepsilon} \sum_k \sigma_k B(y) \nabla \widehat H_k(y)\, \xi_k\,\mathrm{d}t"
_OF_FAST = r", \quad \mathrm{d}\xi_k = -\frac{\xi_k}{\varepsilon^2}\,\mathrm{d}t + \frac{\mathrm{d}W_k}{\varepsilon}"

_LONG = 100  # letters of a formula that is not typeset


def typeset(text: str, block: bool = False) -> Markup:
    """A text as HTML, its parts between dollars, which are LaTeX, as MathML."""
    parts = [part.replace(r"\$", "$") for part in re.split(r"(?<!\\)\$", text)]
    return Markup("").join(_formula(part, block) if i % 2 else escape(part) for i, part in enumerate(parts))


def powers(text: str) -> Markup:
    """A text as HTML, powers as `2^-5` with an exponent that stands high."""
    parts = re.split(r"(?<=[\d.])\^(-?\d+(?:\.\d+)?)", text)
    minus = "\N{MINUS SIGN}"
    return Markup("").join(
        Markup("<sup>{}</sup>").format(part.replace("-", minus)) if i % 2 else escape(part)
        for i, part in enumerate(parts)
    )


def _formula(latex: str, block: bool) -> Markup:
    try:
        return Markup(convert(latex, display="block" if block else "inline"))
    except Exception:  # of whatever kind: a formula that cannot be set is shown as it is written
        return Markup("<code>{}</code>").format(latex)


def equation(read: Sequence[Stored], attributes: Mapping[str, Any]) -> Iterator[Markup]:
    """Equation that results are of, with its structure and Hamiltonians as far as the cases have one model."""
    about = read[0].about
    damping = _DAMPING if "damping" in about.parameters else ""
    friction, fields = (_FRICTION, _FIELDS) if "temperature" in about.parameters else ("", "")
    noise, of_noise = (_NOISE, "") if about.eps is None else (_FAST, _OF_FAST)
    yield typeset(f"${_DRIFT}{damping}{friction}{noise}{of_noise}{fields}$", block=True)
    if {one.about.model for one in read} == {about.model}:
        yield from _system(about.model, about.variables, attributes)


def _system(model: str, variables: tuple[str, ...], attributes: Mapping[str, Any]) -> Iterator[Markup]:
    """Structure and Hamiltonians of a built-in model, or those that its definition has."""
    if model in MODELS and (latex := protocol.equation(MODELS[model])):
        yield typeset(f"${latex}$", block=True)
        return
    definition = _definition(attributes)
    noises = definition.get("noises") or []
    hats = noises if isinstance(noises, list) else [noises]
    named = {"H": definition.get("hamiltonian"), **{rf"\widehat H_{{{k}}}": one for k, one in enumerate(hats, 1)}}
    texts = [_equal(name, one, variables) for name, one in named.items() if isinstance(one, str)]
    if texts:
        yield Markup(", &ensp;").join(texts)


def _equal(name: str, formula: str, variables: tuple[str, ...]) -> Markup:
    """A Hamiltonian as an equation; long ones, and sums over ranges, as they are written."""
    from spi.drawing import style

    if len(formula) < _LONG and " for " not in formula and (maths := style.maths(formula, variables)).startswith("$"):
        return typeset(f"${name} = {maths[1:]}")
    return typeset(f"${name} =$ ") + Markup("<code>{}</code>").format(formula)


def _definition(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Definition of the system in a spec, or in the file that it names; empty if there is none for all cases."""
    model = Document(attributes.get("spec") or "{}", str).data.get("model")
    if not isinstance(model, dict):
        return {}
    text = json.loads(attributes.get("model_sources") or "{}").get(model.get("system"))
    return Document(text, str).data if text else model


def html(table: Titled) -> Markup:
    """Table as HTML."""
    sides = [" class=l" if side == "l" else "" for side in table.justified]
    head = Markup("").join(
        Markup(f"<th{side}>{{}}</th>").format(text) for side, text in zip(sides, table.frame.columns, strict=True)
    )
    rows = [
        Markup("").join(
            Markup(f"<td{side}>{{}}</td>").format(powers(text)) for side, text in zip(sides, row, strict=True)
        )
        for row in table.frame.itertuples(index=False, name=None)
    ]
    body = Markup("\n").join(Markup("<tr>{}</tr>").format(row) for row in rows)
    return Markup("<table><thead><tr>{}</tr></thead>\n<tbody>{}</tbody></table>").format(head, body)


Facts = list[tuple[str, str]]  #: name and value

_LINE = 80  # characters of a command in one line
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
    "machine_without": "parts of Numba that are left out",
}


class ReportSection(NamedTuple):
    """One experiment in a report, but for its figure."""

    name: str  #: of the results file, without its ending
    anchor: str  #: by which the page refers to it, unlike those of the others
    title: str
    kind: str
    paper_figure: int | None
    draft: str  #: the profile, if its results are no more than a trial
    machine: str
    equation: list[Markup]
    parameters: Markup
    measures: Markup  #: the definition of what is measured
    asks: str  #: what the experiment asks; empty if its spec does not say
    answers: Facts  #: the title of a case and what came out of it; one without a title if there is one case
    verdicts: dict[str, int]  #: the number of claims with each verdict; empty if there are none
    complaints: list[tuple[str, str]]  #: of claims neither confirmed nor consistent: verdict and details
    orders: Titled | None
    items: list[Titled | str]  #: what `spi show` prints
    cost: Facts
    provenance: Facts
    command: str  #: that repeats it from the results file
    from_spec: str  #: that repeats it from the spec
    files: Facts  #: the spec and the files that belong to it: name and text

    @property
    def result(self) -> str:
        """The first sentence of the answer, with the title of the case if there are several."""
        if not self.answers:
            return ""
        case, text = self.answers[0]
        first = re.split(r"(?<=\.) (?=[A-Z])", text)[0]
        more = f" ({len(self.answers) - 1} more below)" if len(self.answers) > 1 else ""
        return f"{case}: {first}{more}" if case else first

    @property
    def tables(self) -> list[Titled]:
        """Tables among the items, that of the orders before them."""
        printed = [item for item in self.items if isinstance(item, Titled)]
        return [self.orders, *printed] if self.orders else printed


def section(path: Path, results: StoredResults, anchor: str) -> ReportSection:
    """Section on the results in the file `path`.

    ValueError if they are of an unknown kind or hold nothing, StorageError if they cannot be read as such.
    """
    kind = results.attributes.get("kind", "")
    if kind not in KINDS:
        raise ValueError(f"there is no report of results of kind {kind!r}; known kinds: {', '.join(KINDS)}")
    read = views.readings(results)
    if not read:
        raise ValueError("the results hold no scheme, so there is nothing to report")
    judged, attributes = views.verdicts(results), results.attributes
    counts = Counter(one.verdict for one in judged)
    return ReportSection(
        name=path.stem,
        anchor=anchor,
        title=views.title(results, read) or path.stem,
        kind=kind.replace("_", " "),
        paper_figure=attributes.get("figure"),
        draft="quick" if attributes.get("profile") == "quick" else "",
        machine=str(attributes.get("machine_processor", "unknown machine")),
        equation=list(equation(read, attributes)),
        parameters=Markup(", &ensp;").join(map(typeset, views.facts(read))),
        measures=typeset(read[0].measures),
        asks=attributes.get("asks", ""),
        answers=_answers(results, read),
        verdicts={verdict: counts[verdict] for verdict in VERDICTS} if judged else {},
        complaints=tables.complaints(judged),
        orders=_orders(by_case(read)),
        items=list(_items(results)),
        cost=list(_cost(read)),
        provenance=list(_provenance(attributes)),
        command=command(["spi", "run", path.name]),
        from_spec=_from_spec(attributes.get("experiment", path.stem), attributes),
        files=list(_files(attributes.get("experiment", path.stem), attributes)),
    )


def _items(results: StoredResults) -> Iterator[Titled | str]:
    """Tables and lines of `spi show`, those of claims among them."""
    for items, judged in views.by_cases(results, everything=True):
        for item in [*items, *[tables.grid(judged)] * bool(judged)]:
            yield Titled.of(item) if isinstance(item, TextTable) else item.text


def _answers(results: StoredResults, read: Sequence[Stored]) -> Facts:
    """Sentences that answer the question in each case, or its main quantities; of a sweep those that it shows."""
    texts = [(whole.title, sweeps.headline(whole.curves)) for whole in views.wholes(read)]
    texts += [("", f"{line}.") for line in sweeps.crossing_lines(views.crossings_of(results, read))]
    if not texts:
        cases = by_case(read)
        each = [" ".join(case[0].answers(case)) or _headline(case) for case in cases]
        texts = list(zip(views.titles(cases), each, strict=True))
    return [(title if len(texts) > 1 else "", text) for title, text in texts if text]


def _headline(case: Sequence[Stored]) -> str:
    return sweeps.headline(curves(quantities(case), case[0].headline))


def _orders(cases: Sequence[Sequence[Stored]]) -> Titled | None:
    """All fitted orders with their intervals, and what theory says; None if there are none."""
    several, rows = len(cases) > 1, []
    for title, case in zip(views.titles(cases), cases, strict=True):
        for one in orders_of(case):
            subject = ", ".join(filter(None, (one.subject, one.claim.further)))
            theory = "" if math.isnan(one.expected) else fraction(one.expected)
            rows.append([StyledText(text) for text in (*[title] * several, subject, sweeps.quantity_text(one), theory)])
    headings = (*["case"] * several, "scheme", "order (95 %)", "expected")
    return Titled.of(TextTable("orders", headings, [rows], several + 1)) if rows else None


def _cost(read: Sequence[Stored]) -> Iterator[tuple[str, str]]:
    """Time and paths of results."""
    seconds = math.fsum(one.wall_seconds for one in read)
    yield "time", f"{human_time(seconds)} of wall-clock time on {max(one.threads for one in read)} threads"
    shown = ("paths", "samples", ",.0f", ""), ("time per step and path", "ns_per_step", ".3g", " ns")
    for label, name, form, unit in shown:
        numbers = np.concatenate([np.ravel(one.get(name)).astype(float) for one in read])
        if (numbers := numbers[np.isfinite(numbers)]).size:
            ends = dict.fromkeys(short(float(end), form) for end in (numbers.min(), numbers.max()))
            yield label, " to ".join(ends) + unit


def _provenance(attributes: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield from ((label, str(attributes[key])) for key, label in _PROVENANCE.items() if key in attributes)
    if len(attributes.get("machines", ())) > 1:
        yield "machines", "; and ".join(attributes["machines"])
    if attributes.get("overrides"):
        yield "overrides", "; ".join(attributes["overrides"])


def _from_spec(name: str, attributes: dict[str, Any]) -> str:
    """Command that repeats results from their spec, by its name if it came with the program as it stands there."""
    if name in shipped.names() and text_of(shipped.path_of(name)) == attributes.get("spec"):
        words = ["spi", "run", name]
    else:
        words = ["spi", "run", f"{name}.yaml"]
    if (profile := attributes.get("profile", "laptop")) != "laptop":
        words += ["--profile", profile]
    for override in attributes.get("overrides", ()):
        words += [override] if override.startswith("--") else ["--set", override]
    return command(words)


def command(words: Sequence[str]) -> str:
    """Words as a person would type them: in quotes where needed, an option a line where they are long."""
    quoted = [f'"{word}"' if "'" in word and not re.search(r'["$`\\!]', word) else shlex.quote(word) for word in words]
    line = " ".join(quoted)
    return line if len(line) <= _LINE else line.replace(" --", " \\\n    --")


def _files(name: str, attributes: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if "spec" in attributes:
        yield f"{name}.yaml", attributes["spec"]
    for file, text in json.loads(attributes.get("model_sources") or "{}").items():
        numbers = len(text) > _LONGEST and "\n" not in text
        yield file, f"numbers, {len(text):,} characters in the results file" if numbers else text
