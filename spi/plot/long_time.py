"""The figure of long times: how errors of the Casimirs grow, and how far the law of long paths is from its limit."""

from functools import partial

from . import layout, style
from .errors import LINE
from .growth import growth_panel, marks, steps_shown
from .laws import chosen, distance_limits, distance_panel, law_limits, law_panel, moments_panel, scheme_row

LARGE = (4.6, 3.2)  # inches of a panel of growth or moments, without its legend
SMALL = (2.6, 2.5)  # the same of a panel of one variable

#: The words of the attribute ``panels``.
WORDS = ("growth", "law", "distance", "moments")


def draw(results):
    """The figure of a study of kind long_time.

    For each case a line with ``growth``, a panel per Casimir, and ``moments``, and under it lines of ``law`` and of
    ``distance``, a panel per variable.
    """
    cases = style.cases(results)
    styles = style.styles(results)
    shared, own = style.split_facts([[_told(groups[0])] for groups in cases])
    runs = [_run(groups) for groups in cases]
    if len(set(runs)) == 1:
        shared = [*shared, *runs[0]]
    else:
        own = [[*facts, *run] for facts, run in zip(own, runs, strict=True)]
    lines = []
    for groups, facts in zip(cases, own, strict=True):
        found = _lines(groups, styles)
        if found and len(cases) > 1:
            width = len(found[0].panels) * found[0].size[0]
            found[0] = found[0]._replace(title=layout.case_title(groups[0], facts, width))
        lines += found
    return layout.arranged(results.attributes.get("title", ""), lines, shared)


def _told(group):
    """A group without what a figure of long times does not tell as all figures do."""
    left_out = ("final_time", "samples")
    return group._replace(attributes={key: value for key, value in group.attributes.items() if key not in left_out})


def _run(groups):
    """How many paths of how many steps there are, as facts; nothing where the schemes differ in that."""
    a = groups[0].attributes
    pairs = {(group.attributes.get("samples"), group.attributes.get("steps_each")) for group in groups}
    if len(pairs) > 1 or None in next(iter(pairs)):
        return ()
    return (f"{style.count(a['samples'])} paths of ${style.number(a['steps_each'], steps=True)}$ steps",)


def _lines(groups, styles):
    words = groups[0].attributes["panels"].split()
    for word in words:
        if word not in WORDS:
            raise ValueError(f"there is no panel {word!r}; known panels: {', '.join(WORDS)}")
    known = [group for group in groups if "law_distance" in group.variables]
    asked = {word for word in words if known or word == "growth"}
    lines, large = [], []
    if "growth" in asked:
        count = max(len(group.coordinates["casimir"]) for group in groups)
        large += [partial(growth_panel, groups=groups, c=c, styles=styles) for c in range(max(count, 1))]
    if "moments" in asked:
        large.append(partial(moments_panel, groups=known, styles=styles))
    if large:
        entries = max(len(groups) + 2, "growth" in asked and sum(len(steps_shown(group)) for group in groups))
        size = LARGE[0], LARGE[1] + LINE * entries
        lines.append(layout.Line(large, size, legend=[marks(groups)] if "growth" in asked else ()))
    for word, panel, limits in (("law", law_panel, law_limits), ("distance", distance_panel, distance_limits)):
        if word in asked:
            names = chosen(known)
            told = {"groups": known, "limits": limits(known, names), "styles": styles}
            panels = [partial(panel, name=name, first=i == 0, **told) for i, name in enumerate(names)]
            lines.append(layout.Line(panels, SMALL, legend=[scheme_row(known, styles, word)]))
    return lines
