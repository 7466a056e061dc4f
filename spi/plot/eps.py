"""Weak errors of schemes for the multiscale system: against eps, and the largest over eps."""

import math
from functools import partial

import numpy as np

from .. import estimators
from . import style
from .errors import HUGE, INTERVAL, legend_under, limits, rules, with_order
from .series import ERROR, Series, draw, frame, remarks

COLUMNS = 3  # panels side by side
APART = 0.01  # of the panel's width, between markers of two schemes at one eps
LIMIT = "#eeeeee"  # where the reference shows a limit
LARGEST, SMALLEST, OTHERS = 13.0, 5.5, 3.5  # discs of several eps, one on the other where the errors agree


def families(groups):
    """(scheme, estimator) -> groups of a scheme for the multiscale system, from large to small eps."""
    found = {}
    for group in sorted(groups, key=lambda group: -(group.attributes.get("eps") or 0.0)):
        if group.attributes.get("eps") is not None:
            found.setdefault((style.family(group), group.estimator), []).append(group)
    return found


def sizes(groups):
    """Size of the marker of each scheme with several eps, smaller as eps is."""
    found = {}
    for members in families(groups).values():
        if len(members) > 1:
            names = [group.scheme for group in members]
            found |= dict(zip(names, np.linspace(LARGEST, SMALLEST, len(names)).tolist(), strict=True))
    return found


def largest(groups, f):
    """Of each scheme with several eps the series of its largest errors, with the order of these."""
    chosen = {key: members for key, members in families(groups).items() if _comparable(members)}
    schemes, methods = ({key[i] for key in chosen} for i in (0, 1))
    series = []  # as broad lines behind the points
    for (scheme, estimator), members in chosen.items():
        h = members[0].coordinates["h"]
        errors, withouts = (
            np.array([group.variables[name][1][..., f, :] for group in members]) for name in ("error", "error_without")
        )
        top = estimators.largest_over(h, errors, withouts)
        told = [style.label(members[0], with_eps=False)] * (len(schemes) > 1)
        told += [style.ESTIMATORS.get(estimator, estimator)] * (len(methods) > 1)
        label = with_order(", ".join([*told, r"largest over $\varepsilon$"]), *top.order[:3])
        colour = style.SCHEMES[scheme][1] if len(schemes) > 1 and scheme in style.SCHEMES else "#000000"
        shown = np.where(top.resolved, top.value, np.nan)
        expected = members[0].attributes.get("expected_order")
        line = {"color": colour, "linewidth": 2.0}
        series.append(Series(h, shown, INTERVAL * top.stderr, top.resolved, True, expected, label, line, True))
    return series


def _comparable(members):
    h = members[0].coordinates["h"]
    alike = all(np.array_equal(group.coordinates["h"], h) and "error_without" in group.variables for group in members)
    return alike and len(members) > 1 and len(h) > 1


def reference_note(groups):
    """What a reference shows that does not resolve the fast processes; nothing if it resolves them all."""
    a = groups[0].attributes
    smallest = min((eps for group in groups if (eps := group.attributes.get("eps"))), default=math.inf)
    if not smallest**2 < a.get("reference_step", 0.0):
        return []
    whose = "the scheme's own limit"
    if a.get("reference_scheme"):
        of = (g for g in groups if style.family(g) == a["reference_scheme"])
        label = next((style.label(g, with_eps=False) for g in of), a["reference_scheme"].replace("_", " "))
        whose = f"the limit of {label}"
    return [rf"$\varepsilon<\sqrt{{h_{{\mathrm{{ref}}}}}}$: the reference shows {whose}"]


def panels(groups, f, styles, title):
    """Lines of panels of errors against eps, a panel for each step size."""
    if not any(group.attributes.get("eps") for group in groups):
        raise ValueError("the panel 'eps' needs a scheme with eps > 0")
    steps = sorted({h for group in groups for h in group.coordinates["h"].tolist()}, reverse=True)
    found = []
    for i, h in enumerate(steps):
        lines = [*[title] * (i == 0 and bool(title)), f"$h={style.number(h, steps=True)}$"]
        found.append(partial(eps_panel, groups=groups, f=f, styles=styles, h=h, title="\n".join(lines)))
    return [found[i : i + COLUMNS] for i in range(0, len(found), COLUMNS)]


def eps_panel(ax, groups, f, styles, h, title):
    """Errors at one step size against eps; of schemes that know no eps, or for eps = 0, a level."""
    ax.set(xscale="log", yscale="log", xlabel=r"$\varepsilon$", ylabel=ERROR, title=title)
    rules(ax)
    groups = [group for group in groups if h in group.coordinates["h"]]
    several = len({group.estimator for group in groups}) > 1
    ends = limits(np.array([eps for group in groups if (eps := group.attributes.get("eps"))]))
    ax.set_xlim(ends)
    curves = []
    for (scheme, _), members in families(groups).items():
        fast = [group for group in members if group.attributes["eps"] > 0]
        if fast:
            curves.append(_series(fast, f, h, styles[scheme], style.label(fast[0], with_eps=False), several))
    levels = [
        _series([group], f, h, styles[style.family(group)], style.label(group), several)
        for group in groups
        if not group.attributes.get("eps")
    ]
    found = frame([*curves, *levels])
    if found:
        ax.set_ylim(found)
    shift = (ends[1] / ends[0]) ** APART
    for i, one in enumerate(curves):
        beside = one._replace(h=one.h * shift ** (i - (len(curves) - 1) / 2))
        inside = (one.error > 0) & (one.error <= ax.get_ylim()[1])
        joined = np.where(inside, one.error, np.nan)
        ax.plot(beside.h, joined, color=one.look["color"], linewidth=0.9, alpha=0.6, zorder=2)
        draw(ax, beside)
    for one in levels:
        _level(ax, one)
    remarks(ax, curves, consequence="")
    _marks(ax, groups, h, ends)
    legend_under(ax)


def _series(members, f, h, look, label, several_estimators):
    """Errors of one scheme at one step size, over eps."""
    values = []
    for group in members:
        v = group.arrays
        half = v["error_bound"] if "error_bound" in v else INTERVAL * v["error_stderr"]
        at = int(np.flatnonzero(group.coordinates["h"] == h)[0])
        point = abs(v["error"][f, at]), half[f, at], v["resolved"][f, at]
        values.append((group.attributes.get("eps") or math.nan, *point))
    eps, error, half, resolved = np.array(values, float).T
    estimator = members[0].estimator
    told = ", ".join([label, *[style.ESTIMATORS.get(estimator, estimator)] * several_estimators])
    appearance = {"marker": look[0], "color": look[1], "markersize": 5.5}
    return Series(eps, error, half, resolved.astype(bool), False, None, told, appearance, False)


def _level(ax, one):
    (error,), (half,), colour = one.error, one.half, one.look["color"]
    if 0 < error < HUGE:
        ax.axhline(error, color=colour, linestyle="-" if one.resolved[0] else "--", linewidth=1.1, label=one.label)
        if math.isfinite(half):
            low = max(error - half, ax.get_ylim()[0])
            ax.axhspan(low, error + half, color=colour, alpha=0.12, linewidth=0, zorder=0.5)


def _marks(ax, groups, h, ends):
    """Where the explicit scheme becomes unstable, and where the reference shows a limit."""
    stable = math.sqrt(h / 2)
    if ends[0] < stable < ends[1]:
        ax.axvline(stable, color="#777777", linestyle="--", linewidth=0.9, zorder=1, label=r"$h=2\,\varepsilon^2$")
    for note in reference_note(groups):
        edge = math.sqrt(groups[0].attributes["reference_step"])
        ax.axvspan(ends[0], min(edge, ends[1]), color=LIMIT, linewidth=0, zorder=0.2, label=note)
