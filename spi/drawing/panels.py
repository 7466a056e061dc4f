"""Panels that a kind declares, drawn from its records: a field, what it is drawn over, and what stands beside it.

    PANELS = {
        "mean": [CurvePanel("mean", over="t", facet="function", label="mean of ${f}$", reference="reference")],
        "error": [ErrorPanel("error", facet="function", label="error of ${f}$")],
    }
    draw = Figures(PANELS, facts=("samples", "step"))

Fields have the names that they have in files.  Axes, texts, units and intervals come from their description
(``spi.storage.stored``).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..storage.records import Order
from ..storage.stored import Estimate, Stored
from . import layout, page, plots, style

_LINES = 4  # shades of one colour that can be told apart
_UNITS = ("s", "ns", "rad")  # that stand on an axis; others, as "state", are those of the system

Records = Sequence[Any]


def names_along(record: Stored, axis: str, count: int) -> list[str]:
    """Name in mathematics of each place along an axis: of functions, Casimir functions, exponents, ..."""
    if axis in ("function", "variable", "quantity"):
        return [style.named(str(name), record.about.variables) for name in np.asarray(record.get(axis)).tolist()]
    symbols = {"casimir": "C", "number": r"\lambda"}
    if axis == "component":
        return style.component_names(record.about, count)
    symbol = symbols.get(axis, axis)
    return [f"${symbol}_{{{i + 1}}}$" if count > 1 else f"${symbol}$" for i in range(count)]


def scheme_look(record: Stored, looks: style.Looks, **more: Any) -> dict[str, Any]:
    """Colour and marker of the scheme of a record."""
    marker, colour = looks[record.about.variant]
    return {"color": colour, "marker": marker, "markersize": 5.5} | more


class Same(NamedTuple):
    """Fact that a quantity is one number everywhere, and the panels that would show it."""

    text: str
    panels: list[plots.Plot]


class CurvePanel(NamedTuple):
    """A field over one of its axes, a line for each scheme."""

    field: str
    over: str
    facet: str = ""  #: an axis with a panel for each place
    lines: str = ""  #: an axis with a line, in a shade of its own, for each of a few places
    label: str = ""  #: of the vertical axis, with {name} or {f}, the name along `facet`; by default the text
    x: str = ""  #: label of the horizontal axis
    scale: str = ""  #: of that axis, if not the one that suits it
    at: Mapping[str, Callable[[Any], int | None]] = {}  #: places along other axes; None leaves a record out
    along: Callable[[Any, int], plots.Array] | None = None  #: the places of the values, instead of those along `over`
    half: Callable[[Any], plots.Array] | None = None  #: half the intervals, instead of those beside the field
    factor: Callable[[Any, int], float] = lambda record, place: 1.0
    reference: str = ""  #: a field with values of theory, over the same axes or fewer
    reference_name: str = "reference"
    reference_by: Callable[[Any, int], Callable[[plots.Array], plots.Array] | None] = lambda record, place: None
    note: Callable[[Any, int, int], str] = lambda record, place, line: ""  #: at the end of each line
    slopes: Sequence[float] | Callable[[Records], Sequence[float]] = ()
    log: bool = False
    zero: bool = False
    top: float = plots.HUGE  #: larger values are only marked
    modulus: bool = False  #: whether the sign does not count
    resolved: str = ""  #: a field with whether values are resolved; else those of intervals above 0 are, on log axes
    nan_diverged: bool = False  #: whether NaN means that paths diverged
    look: dict[str, Any] = {}  # noqa: RUF012
    conserved: bool = False  #: whether there is a fact instead of a panel of what all schemes conserve up to rounding
    same: str = ""  #: a fact instead of a panel where all values of all schemes are one number, with {} for it
    only: Callable[[Any, int], bool] = lambda record, place: True  #: the places along `facet` that are shown
    then: Callable[[plots.Plot, Records, int], Any] = lambda plot, records, place: plot

    def numbers(self, record: Stored) -> Estimate | None:
        """Numbers of a record, the largest along axes that the panel lacks; None if there is nothing to draw."""
        numbers = record.estimate(self.field)
        if numbers is None or not numbers.value.size or any(place(record) is None for place in self.at.values()):
            return None
        for axis in [axis for axis in numbers.axes if axis not in (self.over, self.facet, self.lines, *self.at)]:
            numbers = numbers.without(axis, np.max)
        return numbers if self.nan_diverged or np.isfinite(numbers.value).any() else None

    def _places(self, numbers: Estimate) -> int:
        """Number of places along the facet."""
        return int(numbers.value.shape[numbers.axes.index(self.facet)]) if self.facet else 1

    def expand(self, records: Records, looks: style.Looks) -> Iterator[Any]:
        """Panels of one case."""
        pairs = [(record, numbers) for record in records if (numbers := self.numbers(record))]
        if not pairs:
            return
        if len({self._places(numbers) for _, numbers in pairs}) > 1:
            raise ValueError(f"overlay: each case has another number of places along '{self.facet}'")
        first, numbers = pairs[0]
        everything = np.concatenate([numbers.value.ravel() for _, numbers in pairs])
        count = self._places(numbers)
        names = names_along(first, self.facet, count) if self.facet else [""]
        shown = [record for record, _ in pairs]
        drawn: list[Any] = []
        for place in (place for place in range(count) if any(self.only(record, place) for record in shown)):
            plot = self._plot(pairs, looks, place, names[place])
            finished = self.then(plot, shown, place)
            fact = _conservation(plot) if self.conserved else ""
            drawn.append(Same(fact, [finished]) if fact else finished)
        if self.same and (everything == everything[0]).all():
            drawn = [Same(self.same.format(f"{everything[0]:g}"), drawn)]
        yield from drawn

    def _plot(self, pairs: Sequence[tuple[Any, Estimate]], looks: style.Looks, place: int, name: str) -> plots.Plot:
        first, meaning = pairs[0][0], pairs[0][0].by_name[self.field].meaning
        drawn = [line for record, own in pairs for line in self._lines(record, own, looks, place, len(pairs))]
        scale = self.scale or {"h": "steps", "n": "log"}.get(self.over, "linear")
        own: plots.Draw | None = None
        if self.over == "value":
            at = plots.places(np.concatenate([line.x for line in drawn]))
            drawn, scale = [line._replace(x=at.of(line.x)) for line in drawn], at.scale
            own = at.dress
        across, theory = self._theory(pairs, place)
        text = style.plain(meaning.text) + (f" ({meaning.unit})" if meaning.unit in _UNITS else "")
        return plots.Plot(
            [*drawn, *theory],
            style.long_title(first, self.facet, place),
            self.x or style.axis_label(first, self.over),
            self._label(text, name),
            scale,
            self.log,
            across=across,
            slopes=self.slopes([record for record, _ in pairs]) if callable(self.slopes) else self.slopes,
            zero=self.zero,
            top=self.top,
            own=own,
            entries=list(_shades(first, self.lines)) if self.lines else (),
        )

    def _label(self, text: str, name: str) -> str:
        """Label of the vertical axis: as a person named the field, by its template, or its text and a name."""
        if own := page.current().label(self.field):
            return style.plain(own)
        return (
            self.label.format(f=name.strip("$"), name=name) if self.label else " of ".join(filter(None, (text, name)))
        )

    def _lines(
        self, record: Any, numbers: Estimate, looks: style.Looks, place: int, schemes: int
    ) -> Iterator[plots.Series]:
        """Lines of one scheme."""
        x = record.get(self.over) if self.along is None else self.along(record, place)
        value, ends, poor = self._values(record, numbers, place)
        in_time = self.over in ("t", "lag")
        alone = schemes == 1 and in_time  # a single curve needs no markers, which look like data
        look = scheme_look(record, looks, **{"marker": ""} if alone else {}) | self.look
        text = style.label(record.about)
        rows = plots.spread(len(value), _LINES) if self.lines else [0]
        for i, row in enumerate(rows):
            mine = [part[row] if self.lines else part for part in (value, poor, *ends)]
            more = dict(zip(("low", "high"), mine[2:], strict=False)) | {"note": self.note(record, place, row)}
            own = look | ({"color": style.shade(str(look["color"]), i, len(rows))} if i else {})
            yield plots.series(x, mine[0], own, "" if i else text, poor=mine[1], band=in_time and bool(ends), **more)

    def _values(self, record: Any, numbers: Estimate, place: int) -> tuple[plots.Array, list[plots.Array], plots.Array]:
        """Values at one place along the facet, the ends of their intervals, and whether they are not resolved."""
        if self.half is not None:
            half = self.half(record)
            numbers = numbers._replace(low=numbers.value - half, high=numbers.value + half)
        value, *ends = (
            self.factor(record, place) * self._taken(record, array, numbers.axes, place)
            for array in (numbers.value, *([] if numbers.exact else (numbers.low, numbers.high)))
        )
        if self.modulus and ends:
            half = np.abs(ends[1] - ends[0]) / 2
            ends = [np.abs(value) - half, np.abs(value) + half]
        value = np.abs(value) if self.modulus else value
        poor = ends[0] <= 0 if self.log and ends else np.zeros(value.shape, bool)
        if (resolved := record.get(self.resolved)) is not None:
            poor = ~self._taken(record, resolved, numbers.axes, place)
        if self.nan_diverged:
            value = np.where(np.isnan(value), np.inf, value)
        return value, ends, poor

    def _taken(self, record: Any, array: plots.Array, axes: Sequence[str], place: int) -> plots.Array:
        """Part of an array at one place along the facet: (lines, over), or (over,), or a number."""
        index = tuple(
            slice(None) if axis in (self.lines, self.over) else place if axis == self.facet else self.at[axis](record)
            for axis in axes
        )
        taken = np.asarray(array)[index]
        turned = taken.ndim == 2 and axes.index(self.over) < axes.index(self.lines)
        return taken.T if turned else taken

    def _theory(
        self, pairs: Sequence[tuple[Any, Estimate]], place: int
    ) -> tuple[list[tuple[float, str]], list[plots.Series]]:
        """Values of theory: a number for the whole panel, or a line."""
        for record, _ in pairs if self.reference else ():
            if (theory := record.estimate(self.reference)) is None:
                continue
            values = self.factor(record, place) * self._taken(record, theory.value, theory.axes, place)
            there = np.isfinite(values)
            if values.ndim == 0 and there:
                return [(float(values), self.reference_name)], []
            if values.ndim and there.any():
                x = record.get(self.over)
                if (formula := self.reference_by(record, place)) is not None:
                    fine = np.linspace(x.min(), x.max(), _FINE)
                    return [], [plots.series(fine, formula(fine), plots.THEORY, self.reference_name)]
                is_line = there.all() and (len(x) >= _DENSE or (values == values[0]).all())
                look = plots.THEORY if is_line else _SOMETIMES
                return [], [plots.series(x[there], values[there], look, self.reference_name)]
        return [], []


def _conservation(plot: plots.Plot) -> str:
    """Fact that all lines of a panel are constant up to rounding; empty if they are not."""
    lines = [line.y for line in plot.series if len(line.y) > 1]
    sizes = [float(np.abs(y).max()) for y in lines]
    if not lines or not all(size < plots.HUGE for size in sizes):  # false also for NaN
        return ""
    change = max(float(np.abs(y - y[0]).max()) / (size or 1.0) for y, size in zip(lines, sizes, strict=True))
    if change > _CONSERVED:
        return ""
    return f"{plot.y} conserved" + (f" to ${style.number(float(f'{change:.0e}'))}$" if change else "")


def _shades(record: Any, axis: str) -> Iterator[plots.LegendEntry]:
    """Entries of the legend for the places along an axis whose lines differ in shade; none for a single one."""
    values = record.get(axis)
    rows = plots.spread(len(values), _LINES)
    for i, row in enumerate(rows if len(rows) > 1 else ()):
        shade = plots.Line2D([], [], color=style.shade("#000000", i, len(rows)), linewidth=3)
        yield shade, style.value_of(axis, values[row])


_CONSERVED = 1e-11  # relative changes along a path that are those of rounding
_DENSE, _FINE = 50, 400  # values of theory from which on a line is drawn through them, and those of a formula
_SOMETIMES = {"color": "black", "marker": "+", "markersize": 8, "linestyle": "none", "zorder": 4}


def ErrorPanel(field: str, **options: Any) -> CurvePanel:
    """Moduli of errors against the step size on logarithmic axes, with reference slopes and fitted orders."""
    given: dict[str, Any] = {"over": "h", "log": True, "modulus": True, "nan_diverged": True, "resolved": "resolved"}
    return CurvePanel(field, **given | options)


def order_of(field: str = "order") -> Callable[[Any, int, int], str]:
    """Note of a line: the fitted order in a field, one for all or one for each place along the facet."""

    def note(record: Any, place: int, line: int) -> str:
        owner = record
        for name in field.split("."):
            owner = getattr(owner, name)
        return style.order_text(owner if isinstance(owner, Order) else owner[place])

    return note


def overlaid(cases: Sequence[Records]) -> Records:
    """Records of all cases as those of one, with the title of the case in place of, or before, that of the scheme."""
    for axis in ("function", "quantity"):
        names = {tuple(map(str, values)) for case in cases for one in case if (values := one.get(axis)) is not None}
        if len(names) > 1:
            raise ValueError(f"overlay: each case has other names of {axis}s; give all of them the same ones")
    alone = all(len(case) == 1 for case in cases)
    return [replace(one, about=style.in_overlay(one.about, alone)) for case in cases for one in case]


class OwnPanels(NamedTuple):
    """Panels that a function of the kind makes, of the records of a case and the looks of schemes.

    It yields panels, lists of panels that belong together in a row, and facts in place of panels.
    """

    expand: Callable[[Any, style.Looks], Any]


class Figures(NamedTuple):
    """Figures of a kind: its panels by the words of the key ``panels``."""

    panels: Mapping[str, Sequence[Any]]
    facts: Sequence[str] | Callable[[Any], dict[str, str]] = ()  #: fields of the record that stand above the figure

    @np.errstate(all="ignore")  # records of paths that diverged hold NaN and infinity
    def __call__(self, title: str, cases: Sequence[Records]) -> layout.PanelFigure:
        """Figure of the records of each case, or of all of them in an overlay."""
        facts = [
            self.facts(records) if callable(self.facts) else style.facts(records[0], *self.facts) for records in cases
        ]
        if page.current().overlays_cases() and len(cases) > 1:
            cases = [overlaid(cases)]
            facts = [dict(item for item in facts[0].items() if all(item in other.items() for other in facts))]
        looks = style.looks(cases)
        drawn = [self._groups(records, looks, own) for records, own in zip(cases, facts, strict=True)]
        self._check_shown(cases, looks)
        shared, own = style.split_facts(facts)
        headings = [
            [style.plain(records[0].about.case_title), *texts] for records, texts in zip(cases, own, strict=True)
        ]
        return layout.arranged(title, list(zip(headings, drawn, strict=True)), shared)

    def _groups(self, records: Records, looks: style.Looks, facts: dict[str, str]) -> list[list[plots.Plot]]:
        """Panels of one case, word by word; a quantity that is one number becomes a fact if others are shown."""
        groups: list[list[plots.Plot]] = []
        same: list[list[plots.Plot]] = []
        for word in self._words(records[0]):
            for panel in self.panels[word]:
                drawn = list(panel.expand(records, looks))
                single = [plot for plot in drawn if isinstance(plot, plots.Plot)]
                groups += [*(plot for plot in drawn if isinstance(plot, list)), single]
                equal = [one for one in drawn if isinstance(one, Same)]
                same += [one.panels for one in equal]
                texts = [*(text for text in drawn if isinstance(text, str)), *(one.text for one in equal)]
                facts |= dict(zip(texts, texts, strict=True))
        return [group for group in groups if group] or same

    def _check_shown(self, cases: Sequence[Records], looks: style.Looks) -> None:
        """Raise ValueError about a panel that a person chose now, and of which the results have no numbers."""
        for word in page.current().chosen.get("panels", ()):
            if not any(list(panel.expand(records, looks)) for records in cases for panel in self.panels[word]):
                remedy = "add to the spec what it shows and run it first, or choose another one"
                raise ValueError(f"panels: the results have nothing that '{word}' shows; {remedy}")

    def _words(self, record: Any) -> Sequence[str]:
        """Words of the panels that were chosen, or that a record asks for, by default all; ValueError for no panel."""
        words = page.current().chosen.get("panels") or getattr(record, "panels", None) or tuple(self.panels)
        if unknown := [word for word in words if word not in self.panels]:
            raise ValueError(f"panels: has '{unknown[0]}'; {page.meant(unknown[0], [*self.panels])}")
        return tuple(words)
