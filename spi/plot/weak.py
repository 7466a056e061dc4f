"""The figure of weak errors: panels of errors, of sample sizes and of accuracy against processor time."""

from functools import partial

from matplotlib.figure import Figure

from . import eps, methods, style
from .errors import LINE, PANEL
from .series import ERROR, errors_panel, prefixes_panel, series_of

#: The words of the attribute ``panels``.
WORDS = ("errors", "samples", "seconds", "eps")


def draw(results):
    """The figure of a study of kind weak, the panels of each case and test function as its attribute ``panels`` asks.

    ``errors`` against step sizes, beside it ``samples``, the same by number of paths, and under them ``eps``, errors
    against eps, and ``seconds``, accuracy and estimates against processor time.
    """
    cases = style.cases(results)
    styles = style.styles(results)
    shared, own = style.split_facts([[_told(groups)] for groups in cases])
    lines = []
    for f in range(max(len(groups[0].coordinates["function"]) for groups in cases)):
        for groups, facts in zip(cases, own, strict=True):
            if f < len(groups[0].coordinates["function"]):
                lines += _lines(groups, f, styles, _title(groups[0], f, len(cases) > 1, facts))
    if not lines:
        raise ValueError("the results name no panel that could be drawn")
    if all(len(line) == 1 for line in lines):
        lines = _arranged([panel for (panel,) in lines], len(cases))

    columns = max(map(len, lines))
    entries = 5 + max(map(_entries, cases))
    fig = Figure()
    height = len(lines) * (PANEL[1] + LINE * entries)
    style.dress(fig, columns * PANEL[0], height, results.attributes.get("title", ""), shared)
    grid = fig.add_gridspec(len(lines), columns)
    for i, line in enumerate(lines):
        for j, panel in enumerate(line):
            ax = fig.add_subplot(grid[i, j])
            panel(ax)
            if j and ax.get_ylabel() == ERROR:
                ax.set_ylabel("")
    return fig


def _entries(groups):
    """How many lines the schemes of a case take in a legend, with what is said about several eps."""
    found, words = eps.families(groups), groups[0].attributes.get("panels", "errors").split()
    others = sum(group.attributes.get("eps") is None for group in groups)
    many = len(groups) + 2 * bool(found) if {"errors", "samples"} & set(words) else 0
    return max(many, len(found) + others + 1)


def _arranged(panels, cases):
    """Panels in lines: the cases side by side, a line per function; of one function or many cases as it fits."""
    columns = cases if 1 < cases <= 3 else 2 if len(panels) in (2, 4) else min(len(panels), 3)
    return [panels[i : i + columns] for i in range(0, len(panels), columns)]


def _told(groups):
    """A group with the attributes that concern all of a case."""
    told = dict(groups[0].attributes)
    sampled = [group for group in groups if group.estimator != "kolmogorov"]
    told["estimator"] = groups[0].estimator if len({group.estimator for group in groups}) == 1 else ""
    if told["estimator"] != "plain":
        told.pop("samples", None)
    if not sampled:
        told.pop("reference_step", None)
    return groups[0]._replace(attributes=told)


def _title(group, f, several_cases, facts):
    lines = []
    if several_cases:
        lines.append(style.plain(group.attributes.get("case_title") or group.case))
    lines += style.wrapped(facts, ",  ", 9, PANEL[0] - 0.5)
    names = group.coordinates["function"].tolist()
    if len(names) > 1:
        texts = group.attributes.get("functions", ())
        formula = rf": $\varphi(y)={style.formula(texts[f])}$" if len(texts) == len(names) else ""
        lines.append(style.plain(names[f]) + formula)
    return "\n".join(lines)


def _lines(groups, f, styles, title):
    """The lines of panels of one case and test function."""
    words = groups[0].attributes.get("panels", "errors").split()
    for word in words:
        if word not in WORDS:
            raise ValueError(f"there is no panel {word!r}; known panels: {', '.join(WORDS)}")
    staged = [group for group in groups if "prefix_error" in group.variables]
    apart = "samples" in words and staged  # plain results then have panels of their own
    shown = [group for group in groups if not (apart and _is_outdone(group, groups))]
    several = len({group.scheme for group in groups}) > 1, len({group.estimator for group in groups}) > 1
    joined = not any(group.estimator == "kolmogorov" for group in groups)
    sizes = eps.sizes(shown)
    shown.sort(key=lambda group: -sizes.get(group.scheme, 0.0))  # where errors agree, small discs lie on large ones
    series = []
    for group in shown:
        size = sizes.get(group.scheme, eps.OTHERS if sizes else 6)
        marker, colour = styles[group.scheme]
        look, beside = ("o" if group.scheme in sizes else marker, colour), _is_outdone(group, shown)
        series.append(series_of(group, f, look, *several, joined, beside, size))
    first = []
    if "errors" in words:
        drawn = {"series": [*eps.largest(shown, f), *series], "notes": eps.reference_note(groups)}
        first.append(partial(errors_panel, title=title, **drawn))
    if apart:
        exact = {g.scheme: one for g, one in zip(shown, series, strict=True) if one.exact}
        for group in staged:
            of_paths = ": ".join([*[style.label(group)] * several[0], "plain Monte Carlo by number of paths"])
            titles = [title] * (not first) + [of_paths]
            told = {"exact": exact.get(group.scheme), "title": "\n".join(filter(None, titles))}
            first.append(partial(prefixes_panel, group=group, f=f, **told))
    under = eps.panels(shown, f, styles, "" if first else title) if "eps" in words else []
    if "seconds" in words:
        under += methods.panels(groups, f, "" if first or under else title)
    return [line for line in (first, *under) if line]


def _is_outdone(group, groups):
    """Whether a plain estimate stands beside a multilevel one of the same scheme."""
    return group.estimator == "plain" and any(
        other.estimator == "multilevel" and other.scheme == group.scheme for other in groups
    )
