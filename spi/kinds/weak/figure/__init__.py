"""The figure of weak errors: panels of errors, of sample sizes and of accuracy against processor time."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from matplotlib.figure import Figure

from spi.drawing import page, style
from spi.drawing.axes import ERRORS, LEAST, PANEL, legend_line, panel_title
from spi.drawing.layout import Panel, check_panels

from ..comparisons import sweeps
from ..estimators import label_of
from ..results import WeakErrors
from . import eps, methods
from .series import Series, errors_panel, prefixes_panel, series_of

#: The words of the key ``panels``.
WORDS = ("errors", "samples", "seconds", "eps")

_SIZE = 6.0  # of a marker


def draw(title: str, cases: Sequence[Sequence[WeakErrors]]) -> Figure:
    """The figure of a study of kind weak, the panels of each case and test function as its ``panels`` ask.

    ``errors`` against step sizes, beside it ``samples``, the same by number of paths, and under them ``eps``, errors
    against eps, and ``seconds``, accuracy and estimates against processor time.
    """
    looks = style.looks(cases)
    shared, own = style.split_facts([_facts(readings) for readings in cases])
    lines = []
    for f in range(max(len(readings[0].functions) for readings in cases)):
        for readings, facts in zip(cases, own, strict=True):
            if f < len(readings[0].functions):
                lines += _lines(readings, f, looks, _title(readings[0], f, len(cases) > 1, facts))
    if not lines:
        raise ValueError("the results name no panel that could be drawn")
    if all(len(line) == 1 for line in lines):
        lines = _arranged([panel for (panel,) in lines], len(cases))

    columns, size = page.current().panels(max(map(len, lines)), PANEL, LEAST)
    lines = [line[i : i + columns] for line in lines for i in range(0, len(line), columns)]
    fig = Figure()
    height = len(lines) * (size[1] + legend_line() * (5 + max(map(_entries, cases))))
    style.dress(fig, columns * size[0], height, title, shared)
    grid = fig.add_gridspec(len(lines), columns)
    for i, line in enumerate(lines):
        for j, panel in enumerate(line):
            ax = fig.add_subplot(grid[i, j])
            panel(ax)
            if j and ax.get_ylabel() == ERRORS["weak"]:
                ax.set_ylabel("")
    return fig


def _entries(readings: Sequence[WeakErrors]) -> int:
    """How many lines the schemes of a case take in a legend, with what is said about several eps."""
    found = sweeps(readings)
    others = sum(reading.about.eps is None for reading in readings)
    many = len(readings) + 2 * bool(found) if {"errors", "samples"} & set(readings[0].panels) else 0
    return max(many, len(found) + others + 1)


def _arranged(panels: list[Panel], cases: int) -> list[list[Panel]]:
    """Panels in lines: the cases side by side, a line per function; of one function or many cases as it fits."""
    columns = cases if 1 < cases <= 3 else 2 if len(panels) in (2, 4) else min(len(panels), 3)
    return [panels[i : i + columns] for i in range(0, len(panels), columns)]


def _facts(readings: Sequence[WeakErrors]) -> dict[str, str]:
    """What is told of all of a case: of the estimators and their samples only what they have in common."""
    first, estimators = readings[0], {reading.about.estimator for reading in readings}
    return style.facts(
        first,
        "reference_scheme",
        reference_step=first.reference_step if any(reading.sampled for reading in readings) else None,
        samples=first.paths if len(estimators) == 1 else None,
        estimator=label_of(first.about.estimator) if len(estimators) == 1 else None,
        functions=first.formulas,
    )


def _title(reading: WeakErrors, f: int, several_cases: bool, facts: list[str]) -> str:
    lines = [panel_title(reading.about, facts)] if several_cases else []
    if len(reading.functions) > 1:
        formula = style.formula(reading.formulas[f], reading.about.variables)
        lines.append(rf"{style.plain(reading.functions[f])}: $\varphi(y)={formula}$")
    return "\n".join(lines)


def _lines(readings: Sequence[WeakErrors], f: int, looks: style.Looks, title: str) -> list[list[Panel]]:
    """The lines of panels of one case and test function."""
    panels = readings[0].panels
    check_panels(panels, WORDS)
    staged = [reading for reading in readings if reading.prefixes]
    apart = "samples" in panels and staged  # plain results then have panels of their own
    shown = [reading for reading in readings if not (apart and _is_outdone(reading, readings))]
    sizes = eps.sizes(shown)
    shown.sort(key=lambda one: -sizes.get(one.about.variant, 0.0))  # where errors agree, small discs lie on large ones
    series = _series(shown, readings, f, looks, sizes)
    first: list[Panel] = []
    if "errors" in panels:
        drawn: dict[str, Any] = {
            "series": [*eps.largest(shown, f, looks), *series],
            "notes": eps.reference_note(readings),
        }
        first.append(partial(errors_panel, title=title, **drawn))
    if apart:
        exact = {one.about.variant: line for one, line in zip(shown, series, strict=True) if line.exact}
        for reading in staged:
            schemes = {one.about.variant for one in readings}
            of_paths = [style.label(reading.about)] * (len(schemes) > 1) + ["plain Monte Carlo by number of paths"]
            titles = [title] * (not first) + [": ".join(of_paths)]
            told: dict[str, Any] = {"exact": exact.get(reading.about.variant), "title": "\n".join(filter(None, titles))}
            first.append(partial(prefixes_panel, reading=reading, f=f, **told))
    under = eps.panels(shown, f, looks, "" if first else title) if "eps" in panels else []
    if "seconds" in panels:
        under += methods.panels(readings, f, "" if first or under else title)
    return [line for line in (first, *under) if line]


def _series(
    shown: Sequence[WeakErrors], readings: Sequence[WeakErrors], f: int, looks: style.Looks, sizes: dict[str, float]
) -> list[Series]:
    """The series of each reading that is shown; `sizes` are those of markers of schemes with several eps."""
    several_schemes = len({reading.about.variant for reading in readings}) > 1
    several_estimators = len({reading.about.estimator for reading in readings}) > 1
    joined = all(reading.sampled for reading in readings)
    found = []
    for reading in shown:
        variant = reading.about.variant
        marker, colour = looks[variant]
        size = sizes.get(variant, eps.OTHERS if sizes else _SIZE)
        look = {"marker": "o" if variant in sizes else marker, "color": colour, "markersize": size}
        estimator = label_of(reading.about.estimator)
        if reading.paths is not None:
            estimator += f" ({style.count(reading.paths)})"
        names = [style.label(reading.about)] * (several_schemes or not several_estimators)
        label = ", ".join([*names, *[estimator] * several_estimators])
        found.append(series_of(reading, f, look, label, joined, _is_outdone(reading, shown)))
    return found


def _is_outdone(reading: WeakErrors, readings: Sequence[WeakErrors]) -> bool:
    """Whether a plain estimate stands beside a better one of the same scheme, by levels or points."""
    return reading.about.estimator == "plain" and any(
        other.about.estimator in ("multilevel", "quasi") and other.about.variant == reading.about.variant
        for other in readings
    )
