"""Pictures of stored results, as one would print them."""

import contextlib
import math
import os
from fractions import Fraction
from pathlib import Path

import matplotlib.style
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.markers import CARETUP
from matplotlib.textpath import TextPath
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

#: Marker and colour of each scheme: the paper's markers, the palette of Okabe and Ito without its pale yellow.
SCHEMES = {
    "euler_maruyama": ("x", "#D55E00"),
    "midpoint": ("o", "#0072B2"),
    "splitting": ("D", "#009E73"),
    "splitting_drift_first": ("s", "#CC79A7"),
}
OTHERS = (("^", "#E69F00"), ("v", "#56B4E9"), ("P", "#000000"), ("*", "#D55E00"), ("h", "#0072B2"), ("<", "#009E73"))
UNRESOLVED, SLOPE = "#999999", "#777777"

#: The reference slopes of strong errors: (order, line style, whether the line lies above the data or below).
STRONG_SLOPES = ((1 / 2, "--", True), (1, ":", False))

STYLE = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that a figure looks the same everywhere
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 10,
    "legend.fontsize": 8,
    "lines.linewidth": 1.1,
    "lines.markersize": 6,
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
}
PANEL = (5.0, 4.0)  # inches, without the legend under it and the title above
INTERVAL = 1.96  # half the width of a 95 % interval in standard errors

SYMBOLS = {
    "sigma": r"\sigma",
    "inertia": "I",
    "noise_inertia": r"\hat{I}",
    "epsilon": r"\varepsilon",
    "beta": r"\beta",
    "nu": r"\nu",
}


def figure(results):
    """The matplotlib figure of ``results``, drawn by the plotter of their kind."""
    kind = results.attributes.get("kind")
    if kind not in PLOTTERS:
        raise ValueError(f"there is no figure for results of kind {kind!r}; known kinds: {', '.join(PLOTTERS)}")
    with _style():
        return PLOTTERS[kind](results)


def save(results, folder, stem):
    """Write ``<stem>.pdf`` and ``<stem>.png`` into ``folder``, each aside first and then moved into place."""
    drawn, folder = figure(results), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    # Without a date and the name of the program the same results give the same bytes.
    for form, metadata in (("pdf", {"CreationDate": None}), ("png", {"Software": None})):
        temporary = folder / f".{stem}.{form}.{os.getpid()}.tmp"
        try:
            with _style():
                drawn.savefig(temporary, format=form, metadata=metadata)
            os.replace(temporary, folder / f"{stem}.{form}")
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
    return folder / f"{stem}.pdf", folder / f"{stem}.png"


@contextlib.contextmanager
def _style():
    """Our style on matplotlib's own, whatever the user's settings are."""
    with matplotlib.style.context(["default", STYLE]):
        yield


# ---------------------------------------------------------------------------------------------------------------------
# Strong errors
# ---------------------------------------------------------------------------------------------------------------------


def _strong(results):
    cases = list(dict.fromkeys(group.case for group in results.groups))
    if not cases:
        raise ValueError("the results hold no scheme, so there is nothing to draw")
    panels = [[group for group in results.groups if group.case == case] for case in cases]
    facts = [_facts(groups[0].attributes) for groups in panels]
    shared = {name: text for name, text in facts[0].items() if all(other.get(name) == text for other in facts)}
    styles = _styles(results)

    columns = 2 if len(panels) == 4 else min(len(panels), 3)
    rows = math.ceil(len(panels) / columns)
    fig, axes = _panels(rows, columns, max(map(len, panels)), results.attributes.get("title", ""), shared.values())
    for i, (ax, groups, fact) in enumerate(zip(axes, panels, facts, strict=False)):
        if len(panels) > 1:
            own = [text for name, text in fact.items() if name not in shared]
            title = _plain(groups[0].attributes.get("case_title") or groups[0].case)
            ax.set_title("\n".join([title, *_lines(own, ",  ", 9, PANEL[0] - 0.5)]))
        _strong_panel(ax, groups, styles)
        if i % columns == 0:
            ax.set_ylabel(r"strong error  $\sup_n\,(\mathrm{E}|y_h(t_n)-y_{\mathrm{ref}}(t_n)|^2)^{1/2}$")
    for ax in axes[len(panels) :]:
        ax.remove()
    return fig


def _strong_panel(ax, groups, styles):
    ax.set_xscale("log", base=2)
    ax.set_yscale("log", nonpositive="clip")
    h = np.concatenate([group.coordinates["h"] for group in groups])
    if h.size:
        ax.set_xlim(h.min() / 1.5, h.max() * 1.5)
        _power_ticks(ax, h)
    ax.set_xlabel("step size $h$")
    drawn = np.concatenate([_strong_scheme(ax, group, *styles[group.scheme]) for group in groups])
    if len(drawn):
        _slopes(ax, drawn)
        _limits(ax, drawn)
    ax.grid(True, which="major", color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    _remarks(ax, groups)
    # Under the panel, where it never covers data; the schemes first, their markers without bars.
    entries = sorted(zip(*ax.get_legend_handles_labels(), strict=True), key=lambda e: not isinstance(e[0], tuple))
    handles = [handle[0] if isinstance(handle, tuple) else handle for handle, _ in entries]
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14), "handlelength": 2.4}
    ax.legend(handles, [label for _, label in entries], frameon=False, **place)


def _strong_scheme(ax, group, marker, colour):
    """Draw one scheme and return its points (h, error) that are drawn."""
    h = group.coordinates["h"]
    error, stderr = group.variables["error"][1], group.variables["error_stderr"][1]
    resolved = group.variables["resolved"][1].astype(bool)
    finite = np.isfinite(error) & (error > 0)
    bars = INTERVAL * np.where(np.isfinite(stderr), stderr, 0.0)
    style = {"marker": marker, "markerfacecolor": "none", "elinewidth": 0.7, "capsize": 0, "markeredgewidth": 1.2}
    good, poor = finite & resolved, finite & ~resolved
    ax.errorbar(h[good], error[good], bars[good], color=colour, label=_label(group), zorder=3, **style)
    if poor.any():
        ax.errorbar(h[poor], error[poor], bars[poor], color=UNRESOLVED, linestyle="none", zorder=2, **style)
    lost = ~np.isfinite(error)
    if lost.any():
        top = {"transform": ax.get_xaxis_transform(), "clip_on": False}
        ax.plot(h[lost], np.ones(lost.sum()), marker=CARETUP, color=colour, linestyle="none", zorder=4, **top)
    return np.column_stack([h[finite], error[finite]])


def _slopes(ax, points):
    """Reference lines that touch the cloud of points from above or below, at a distance, so that they cover none."""
    ends = np.array(ax.get_xlim())
    for order, line, above in STRONG_SLOPES:
        ratio = points[:, 1] / points[:, 0] ** order
        factor = ratio.max() * 1.7 if above else ratio.min() / 1.7
        label = f"slope {Fraction(order)}"
        ax.plot(ends, factor * ends**order, line, color=SLOPE, linewidth=1, zorder=1, label=label)


def _limits(ax, points):
    """The data with some room, and at least two whole decades' labels."""
    low, high = np.log10(points[:, 1].min() / 3), np.log10(points[:, 1].max() * 3)
    while math.floor(high) - math.ceil(low) < 1:
        low, high = low - 0.05, high + 0.05
    ax.set_ylim(10**low, 10**high)


def _power_ticks(ax, h):
    exponents = np.arange(round(math.log2(h.min())), round(math.log2(h.max())) + 1)
    step = 1 if len(exponents) <= 5 else 2 if len(exponents) <= 13 else 4
    ax.xaxis.set_major_locator(FixedLocator(2.0 ** exponents[::-1][::step]))
    ax.xaxis.set_minor_locator(FixedLocator(2.0**exponents) if step > 1 else NullLocator())
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"${_number(x, steps=True)}$"))
    ax.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))


def _label(group):
    a = group.attributes
    label = _plain(a.get("scheme_label", group.scheme))
    if not math.isfinite(a.get("order", math.nan)):
        return f"{label}: order not resolved"
    return f"{label}: order {a['order']:.2f} [{a['order_ci'][0]:.2f}, {a['order_ci'][1]:.2f}]"


def _remarks(ax, groups):
    """Legend entries for what is not an ordinary point."""
    errors = np.concatenate([group.variables["error"][1] for group in groups])
    resolved = np.concatenate([group.variables["resolved"][1].astype(bool) for group in groups])
    if (np.isfinite(errors) & ~resolved).any():
        ax.plot([], [], "o", color=UNRESOLVED, markerfacecolor="none", label="not resolved, left out of the fit")
    if not np.isfinite(errors).all():
        ax.plot([], [], marker=CARETUP, linestyle="none", color="black", label="paths left the finite numbers")


# ---------------------------------------------------------------------------------------------------------------------
# Frames and words
# ---------------------------------------------------------------------------------------------------------------------


def _panels(rows, columns, entries, title, facts):
    """A figure with room for title, parameters and the legends under the panels."""
    width = columns * PANEL[0]
    titles = _lines(_plain(title).split(), " ", 11, width)
    lines = _lines(facts, ",  ", 8, width)
    top = 0.1 + 0.22 * len(titles) + 0.18 * len(lines)
    height = top + rows * (PANEL[1] + 0.17 * (entries + len(STRONG_SLOPES)))
    fig = Figure(figsize=(width, height))
    fig.set_layout_engine(ConstrainedLayoutEngine(rect=(0, 0, 1, 1 - top / height), w_pad=0.08, h_pad=0.06))
    middle = {"x": 0.5, "ha": "center", "va": "top", "linespacing": 1.3}
    fig.text(y=1 - 0.1 / height, s="\n".join(titles), fontsize=11, **middle)
    under = 0.12 + 0.22 * len(titles)
    fig.text(y=1 - under / height, s="\n".join(lines), fontsize=8, color="#444444", **middle)
    return fig, list(fig.subplots(rows, columns, squeeze=False).flat)


def _lines(items, separator, size, width):
    """``items`` joined in lines that are no wider than ``width`` inches, with a margin, at font size ``size``."""
    lines = []
    for item in items:
        longer = separator.join([*lines[-1:], item])
        if lines and TextPath((0, 0), longer, size=size).get_extents().width < 72 * (width - 0.4):
            lines[-1] = longer
        else:
            lines.append(item)
    return lines


def _facts(attributes):
    """The parameters that the attributes of a group tell, as mathtext."""
    facts = {}
    for name, value in attributes.items():
        if name.startswith("model_") and not isinstance(value, str | bool):
            key = name.removeprefix("model_")
            facts[name] = f"${SYMBOLS.get(key) or _upright(key)}={_number(value)}$"
    for name, symbol in (("initial", "y_0"), ("final_time", "T")):
        if name in attributes:
            facts[name] = f"${symbol}={_number(attributes[name])}$"
    if "reference_step" in attributes:
        facts["reference_step"] = rf"$h_{{\mathrm{{ref}}}}={_number(attributes['reference_step'], steps=True)}$"
    if "samples" in attributes:
        facts["samples"] = f"{attributes['samples']} samples"
    if attributes.get("truncate_noise"):
        facts["truncate_noise"] = "truncated noise"
    return facts


def _number(value, steps=False):
    """A number or a tuple of numbers in mathtext: simple fractions as such, steps as powers of two."""
    if isinstance(value, tuple | list):
        return "(" + r",\,".join(_number(v) for v in value) + ")"
    if math.isnan(value):
        return r"\mathrm{off}"
    if steps and math.frexp(value)[0] == 0.5:
        return f"2^{{{math.frexp(value)[1] - 1}}}"
    nearest = Fraction(value).limit_denominator(12)
    if nearest and abs(nearest - value) < 1e-12 * abs(value):
        return str(nearest)
    digits, e, exponent = f"{value:.3g}".partition("e")
    return rf"{digits}\cdot10^{{{int(exponent)}}}" if e else digits


def _upright(name):
    return r"\mathrm{" + name.replace("_", r"\ ") + "}"


def _plain(text):
    """Text of the user's, in which a dollar is a dollar."""
    return text.replace("$", r"\$")


def _styles(results):
    """Marker and colour of every scheme in ``results``, the same in all panels."""
    names = dict.fromkeys(group.scheme for group in results.groups)
    unknown = [name for name in names if name not in SCHEMES]
    return SCHEMES | {name: OTHERS[i % len(OTHERS)] for i, name in enumerate(unknown)}


#: The kinds of study that have a figure, by ``results.attributes["kind"]``.
PLOTTERS = {"strong": _strong}
