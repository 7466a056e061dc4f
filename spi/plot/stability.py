"""The figure of stability: maps of regimes, and single quantities over the swept parameter."""

import math
from functools import partial

import numpy as np
from matplotlib.lines import Line2D

from . import layout, style
from .errors import HUGE, error_axes, limits, rules
from .quantities import CAP, QUANTITIES, is_zero, read
from .regimes import SIZE as MAP
from .regimes import lines as maps
from .regimes import sweep_label, value_places

SIZE = (3.3, 2.75)  # inches of a panel
ALONE = (4.4, 3.3)  # the same where a case has only one
COLUMNS = 4  # panels side by side
STEPS = 4  # step sizes shown at most
WIDE = 20.0  # ratio of swept values above which their axis is logarithmic
MARKERS = 6.5, 4.5  # sizes of the first scheme's and of the last one's, so that both are seen where they agree

#: The words of the attribute ``panels``.
WORDS = ("regimes", *QUANTITIES)


def draw(results):
    """The figure of a study of kind stability.

    Of the word ``regimes`` a line of maps per case, a map per scheme; of all other words a panel each, again lines of
    their own for each case, below the maps.
    """
    cases = style.cases(results)
    words = [_words(groups) for groups in cases]
    shared, own = style.split_facts(cases)
    swept = [_single_value(groups[0]) for groups in cases]
    if len(set(map(tuple, swept))) == 1:
        shared = [*swept[0], *shared]
    else:
        own = [[*one, *facts] for one, facts in zip(swept, own, strict=True)]
    looks = _looks(results)
    mapped = [i for i, asked in enumerate(words) if "regimes" in asked]
    names = {group.scheme for i in mapped for group in cases[i]}
    several = len(cases) > 1
    lines = []
    if mapped:
        titles = [_title(cases[i], own[i], several, MAP[0] * len(names)) for i in mapped]
        lines += maps([cases[i] for i in mapped], titles)
    for groups, facts, asked in zip(cases, own, words, strict=True):
        chosen = [word for word in asked if word != "regimes"]
        lines += _lines(groups, chosen, looks, partial(_title, groups, facts, several)) if chosen else []
    return layout.arranged(results.attributes.get("title", ""), _without_repetition(lines), shared)


def _words(groups):
    words = groups[0].attributes["panels"].split()
    for word in words:
        if word not in WORDS:
            raise ValueError(f"there is no panel {word!r}; known panels: {', '.join(WORDS)}")
    return words


def _single_value(group):
    """The swept value as a fact if it is only one."""
    values = group.coordinates["value"]
    return [f"{sweep_label(group)}$\\,={style.number(float(values[0]))}$"] if len(values) == 1 else []


def _looks(results):
    """How each scheme is drawn; markers differ in size, the last lies on top."""
    styles = style.styles(results)
    sizes = np.linspace(*MARKERS, len(styles)) if len(styles) > 1 else [5.5]
    names = dict.fromkeys(group.scheme for group in results.groups)
    return {
        name: {"marker": styles[name][0], "color": styles[name][1], "markersize": float(size)}
        for name, size in zip(names, sizes, strict=False)
    }


def _title(groups, facts, several, width):
    return layout.case_title(groups[0], facts, width) if several else ""


def _lines(groups, words, looks, title):
    """The line panels of a case in lines of about the same length."""
    size = SIZE if len(words) > 1 else ALONE
    columns = math.ceil(len(words) / math.ceil(len(words) / COLUMNS))
    found = []
    for i in range(0, len(words), columns):
        panels = [partial(_panel, groups=groups, word=word, looks=looks) for word in words[i : i + columns]]
        found.append(layout.Line(panels, size, "" if i else title(size[0] * columns)))
    return [*found[:-1], found[-1]._replace(legend=_legend(groups, words, looks))]


def _without_repetition(lines):
    """The lines without a legend that is repeated further down."""
    texts = [[text for row in line.legend for _, text in row] for line in lines]
    return [line._replace(legend=()) if texts[i] in texts[i + 1 :] else line for i, line in enumerate(lines)]


def _shown(group):
    """Numbers of the step sizes that are lines; none where the step size is the horizontal axis."""
    return layout.spread(len(group.coordinates["h"]), STEPS) if len(group.coordinates["value"]) > 1 else [None]


def _legend(groups, words, looks):
    """What markers, shades and edge marks mean, of all panels of a case."""
    rows = [[(Line2D([], [], **looks[group.scheme]), style.label(group)) for group in groups]]
    shown, h = _shown(groups[0]), groups[0].coordinates["h"]
    if len(shown) > 1:
        handles = [Line2D([], [], color=layout.shade("#000000", i, len(shown)), linewidth=2) for i in range(len(shown))]
        names = [f"$h={style.number(float(h[j]), steps=True)}$" for j in shown]
        rows.append(list(zip(handles, names, strict=True)))
    marks = []
    if "casimir" in words and read(groups, "casimir"):
        lines = (("-", "worst path"), (":", "median path"))
        marks += [(Line2D([], [], color="black", linestyle=line), text) for line, text in lines]
    marks += _marks(groups, words)
    return [*rows, marks] if marks else rows


def _marks(groups, words):
    """Entries for what is no ordinary point in some panel."""
    found = []
    logs = [one for word in words if QUANTITIES[word].is_log for one in read(groups, word)]
    if any((one.values == 0).any() for one in logs):
        text = r"0, or an angle $\leq\pi/4$" if "angle" in words else "0"
        found.append(layout.mark("v", text, markerfacecolor="none"))
    if any((~(one.values <= CAP)).any() for one in logs):
        found.append(layout.mark("^", f"not finite, or above ${style.power(CAP)}$"))
    if "law" in words and any(is_zero(one).any() for one in read(groups, "law")):
        found.append(layout.mark("o", "hollow: zero within 2 standard errors", markerfacecolor="none", alpha=0.6))
    return found


def _panel(ax, groups, word, looks):
    """One quantity over the swept value, a line per scheme and step size; over the step size if it is the only one."""
    quantity, found = QUANTITIES[word], read(groups, word)
    if not found:
        layout.empty(ax, quantity.lacking)
        return
    x = _x_axis(ax, found[0].group)
    ax.set_ylabel(quantity.label)
    ax.set_yscale("log" if quantity.is_log else "linear")
    _y_limits(ax, word, np.concatenate([one.values.ravel() for one in found]))
    for one in found:
        look, shown = looks[one.group.scheme], _shown(one.group)
        for i, j in reversed(list(enumerate(shown))):
            at = (0, slice(None)) if j is None else (slice(None), j)
            colour = layout.shade(look["color"], i, len(shown))
            poor = is_zero(one) if word == "law" else np.zeros(one.values.shape, bool)
            _line(ax, x, one.values[at], one.half[at], poor[at], look | {"color": colour})
            if one.dotted is not None:
                _joined(ax, x, one.dotted[at], {"color": colour, "linestyle": ":"})


def _x_axis(ax, group):
    """Scale, ticks and label of the horizontal axis; returns where its points are."""
    values = group.coordinates["value"]
    if len(values) == 1:
        error_axes(ax, group.coordinates["h"])
        return group.coordinates["h"]
    rules(ax)
    ax.set_xlabel(sweep_label(group))
    positive = values[values > 0]
    if positive.size and positive.max() <= WIDE * positive.min() and (values >= 0).all():
        return values
    places, is_log = value_places(values)
    if is_log:
        ax.set_xscale("log")
    else:
        ax.set_xticks(places, [f"${style.number(float(value))}$" for value in values])
    return places


def _y_limits(ax, word, values):
    known = values[np.isfinite(values)]
    if not QUANTITIES[word].is_log:
        top = 1.0 if word in ("finite", "positive") else known.max(initial=1.0)
        ax.set_ylim(-0.05 * top, 1.05 * top)
        return
    known = known[(known > 0) & (known <= (HUGE if word == "angle" else CAP))]
    ax.set_ylim(limits(known if known.size else np.array([1.0])))


def _line(ax, x, values, half, poor, look):
    """A line with its bars, hollow where it is poor; marks at the edges for what lies outside, nothing for NaN."""
    bottom, top = ax.get_ylim()
    known = ~np.isnan(values)
    inside = (values >= bottom) & (values <= top)
    _joined(ax, x, values, {"color": look["color"]})
    bars = {"linestyle": "none", "elinewidth": 0.8, "capsize": 0, "zorder": 3}
    for chosen, fill in ((inside & ~poor, {}), (inside & poor, {"markerfacecolor": "none", "alpha": 0.6})):
        if chosen.any():
            up = np.where(np.isfinite(half), half, 0.0)[chosen]
            down = np.minimum(up, values[chosen] - bottom)
            ax.errorbar(x[chosen], values[chosen], np.array([down, up]), **look | bars | fill)
    layout.edge_marks(ax, x[known], values[known], look["color"])


def _joined(ax, x, values, look):
    bottom, top = ax.get_ylim()
    order = np.argsort(x)
    shown = np.where((values >= bottom) & (values <= top), values, np.nan)
    ax.plot(x[order], shown[order], linewidth=1.0, zorder=2.5, **look)
