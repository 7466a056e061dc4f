"""How all figures look: colours, markers, titles, numbers and words."""

import contextlib
import math
import re
from fractions import Fraction

import matplotlib
import matplotlib.style
from matplotlib.colors import to_hex
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.textpath import TextPath

from ..records import family, family_label

#: Marker and colour of each scheme: the paper's markers, the palette of Okabe and Ito without its pale yellow.
SCHEMES = {
    "euler_maruyama": ("x", "#D55E00"),
    "euler_maruyama_renormalised": ("v", "#56B4E9"),
    "midpoint": ("o", "#0072B2"),
    "splitting": ("D", "#009E73"),
    "splitting_drift_first": ("s", "#CC79A7"),
    "splitting_order2": ("^", "#E69F00"),
    "ap_splitting": ("h", "#0072B2"),
    "ap_splitting_midpoint": ("p", "#56B4E9"),
    "multiscale_euler": ("X", "#D55E00"),
    "multiscale_euler_semi_implicit": ("P", "#CC79A7"),
}
OTHERS = (("v", "#56B4E9"), ("P", "#000000"), ("*", "#D55E00"), ("h", "#0072B2"), ("<", "#009E73"))

#: The markers of one scheme at several eps, from large to small eps, and for each such scheme its sequence of colours.
SEQUENCE = ("o", "s", "^", "v", "p", "h")
RAMPS = ("plasma", "viridis", "cividis")

#: What estimators of weak errors are called.
ESTIMATORS = {"plain": "plain Monte Carlo", "multilevel": "multilevel", "kolmogorov": "Kolmogorov, no sampling"}

STYLE = {
    "font.family": "DejaVu Sans",  # comes with matplotlib, so that a figure looks the same everywhere
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 10,
    "legend.fontsize": 8,
    "lines.linewidth": 1.1,
    "lines.markersize": 6,
    "agg.path.chunksize": 10_000,  # long paths are drawn in parts
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
}

SYMBOLS = {
    "sigma": r"\sigma",
    "inertia": "I",
    "noise_inertia": r"\hat{I}",
    "epsilon": r"\varepsilon",
    "eps": r"\varepsilon",
    "beta": r"\beta",
    "nu": r"\nu",
}

#: Models whose state is the (Re, Im) of complex modes: symbol and modes.
COMPLEX = {"sine_euler": (r"\omega", ("(1,0)", "(1,1)", "(0,1)", "(-1,1)"))}


@contextlib.contextmanager
def applied():
    """Our style on matplotlib's own, whatever the user's settings are."""
    with matplotlib.style.context(["default", STYLE]):
        yield


def styles(results):
    """Marker and colour of every scheme in ``results``, the same in all panels.

    Of a scheme at several eps each has its own, in an order; at one eps it looks like the scheme.
    """
    members = {}
    for group in results.groups:
        members.setdefault(family(group), {})[group.scheme] = group.attributes.get("eps")
    unknown = [name for name in members if name not in SCHEMES]
    looks = SCHEMES | {name: OTHERS[i % len(OTHERS)] for i, name in enumerate(unknown)}
    ramps = 0
    for name, schemes in members.items():
        if len(schemes) == 1:
            looks |= dict.fromkeys(schemes, looks[name])
            continue
        ramp = matplotlib.colormaps[RAMPS[ramps % len(RAMPS)]]
        ramps += 1
        for i, scheme in enumerate(sorted(schemes, key=lambda scheme: -(schemes[scheme] or 0.0))):
            looks[scheme] = SEQUENCE[i % len(SEQUENCE)], to_hex(ramp(0.86 * (1 - i / (len(schemes) - 1))))
    return looks


def label(group, with_eps=True):
    """What the scheme of a group is called."""
    text, eps = plain(family_label(group)), group.attributes.get("eps")
    return rf"{text}, $\varepsilon={power(eps)}$" if with_eps and eps is not None else text


def cases(results):
    """The groups of each case."""
    names = dict.fromkeys(group.case for group in results.groups)
    if not names:
        raise ValueError("the results hold no scheme, so there is nothing to draw")
    return [[group for group in results.groups if group.case == name] for name in names]


def dress(fig, width, height, title, parameters):
    """Give a figure of ``width`` and ``height`` inches for its panels a title and a line of parameters above them."""
    titles = wrapped(plain(title).split(), " ", 11, width)
    lines = wrapped(parameters, ",  ", 8, width)
    top = 0.1 + 0.22 * len(titles) + 0.18 * len(lines)
    height += top
    fig.set_size_inches(width, height)
    fig.set_layout_engine(ConstrainedLayoutEngine(rect=(0, 0, 1, 1 - top / height), w_pad=0.08, h_pad=0.06))
    middle = {"x": 0.5, "ha": "center", "va": "top", "linespacing": 1.3}
    fig.text(y=1 - 0.1 / height, s="\n".join(titles), fontsize=11, **middle)
    under = 0.12 + 0.22 * len(titles)
    fig.text(y=1 - under / height, s="\n".join(lines), fontsize=8, color="#444444", **middle)


def wrapped(items, separator, size, width):
    """``items`` joined in lines that are no wider than ``width`` inches, with a margin, at font size ``size``."""
    lines = []
    for item in items:
        longer = separator.join([*lines[-1:], item])
        if lines and TextPath((0, 0), longer, size=size).get_extents().width < 72 * (width - 0.4):
            lines[-1] = longer
        else:
            lines.append(item)
    return lines


def split_facts(panels):
    """The parameters that all cases share, and those of each case that are its own."""
    told = [facts(groups[0].attributes) for groups in panels]
    shared = {name: text for name, text in told[0].items() if all(other.get(name) == text for other in told)}
    return list(shared.values()), [[text for name, text in one.items() if name not in shared] for one in told]


def facts(attributes):
    """The parameters that the attributes of a group tell, as mathtext."""
    told = {}
    for name, value in attributes.items():
        if name.startswith("model_") and not isinstance(value, str | bool):
            key = name.removeprefix("model_")
            told[name] = f"${SYMBOLS.get(key) or upright(key)}={number(value)}$"
    if "initial" in attributes:
        told["initial"] = f"${initial_value(attributes)}$"
    if "final_time" in attributes:
        told["final_time"] = f"$T={number(attributes['final_time'])}$"
    for name, symbol in (("step", "h"), ("reference_step", r"h_{\mathrm{ref}}")):
        if name in attributes:
            told[name] = f"${symbol}={number(attributes[name], steps=True)}$"
    if attributes.get("reference_scheme"):
        told["reference_scheme"] = plain(f"reference: {attributes['reference_scheme'].replace('_', ' ')}")
    if "samples" in attributes:
        told["samples"] = f"{count(attributes['samples'])} samples"
    if attributes.get("truncate_noise"):
        told["truncate_noise"] = "truncated noise"
    if attributes.get("estimator"):
        told["estimator"] = ESTIMATORS.get(attributes["estimator"], attributes["estimator"])
    if len(attributes.get("functions", ())) == 1:
        told["function"] = rf"$\varphi(y)={formula(attributes['functions'][0])}$"
    if "path" in attributes and "seed" in attributes:
        told["path"] = f"path {attributes['path']} of seed {attributes['seed']}"
    return told


def initial_value(attributes):
    """y_0 in mathtext, of complex modes as complex numbers."""
    y = attributes["initial"]
    if attributes.get("model") not in COMPLEX:
        return f"y_0={number(y)}"
    modes = [f"{number(re)}{'+' if im >= 0 else '-'}{number(abs(im))}i" for re, im in zip(*[iter(y)] * 2, strict=True)]
    return f"{COMPLEX[attributes['model']][0]}(0)=(" + r",\,".join(modes) + ")"


def component_names(attributes, count):
    """What the components of the state are called, in mathtext."""
    if attributes.get("model") not in COMPLEX:
        return [f"$y_{{{i + 1}}}$" for i in range(count)]
    symbol, modes = COMPLEX[attributes["model"]]
    return [rf"${part}\,{symbol}_{{{mode}}}$" for mode in modes for part in (r"\mathrm{Re}", r"\mathrm{Im}")][:count]


def number(value, steps=False):
    """A number or a tuple of numbers in mathtext: simple decimals and fractions as such, steps as powers of two."""
    if isinstance(value, tuple | list):
        return number(value[0]) if len(value) == 1 else "(" + r",\,".join(number(v) for v in value) + ")"
    if value is None or math.isnan(value):
        return r"\mathrm{off}"
    if steps and math.frexp(value)[0] == 0.5:
        return f"2^{{{math.frexp(value)[1] - 1}}}"
    digits, e, exponent = f"{value:.3g}".partition("e")
    nearest = Fraction(value).limit_denominator(12)
    if float(f"{value:.3g}") != value and nearest and abs(nearest - value) < 1e-12 * abs(value):
        return str(nearest)
    return rf"{digits}\cdot10^{{{int(exponent)}}}" if e else digits


def power(value):
    """A number in mathtext, powers of ten as such."""
    exponent = round(math.log10(value)) if value > 0 else 0
    return f"10^{{{exponent}}}" if exponent and math.isclose(value, 10.0**exponent) else number(value)


def count(number):
    """How many, with large powers of ten as such."""
    exponent = len(str(number)) - 1
    return f"$10^{{{exponent}}}$" if number == 10**exponent and exponent > 3 else f"{number}"


def formula(text):
    """A test function, as the text of an expression, in mathtext."""
    text = re.sub(r"\d+\.\d+(e-?\d+)?|\d+e-?\d+", lambda match: _constant(float(match.group())), text)
    text = re.sub(r"\by(\d+)", r"y_{\1}", text)
    text = re.sub(r"\b([a-z]{2,})\(", lambda match: rf"\mathrm{{{match.group(1)}}}(", text)
    return re.sub(r"\^(\d+)", r"^{\1}", text).replace("*", r"\,")


def _constant(value):
    times = value / math.pi
    if times and times % 1 == 0:
        return r"\pi" if times == 1 else rf"{times:g}\pi"
    return number(value)


def upright(name):
    return r"\mathrm{" + name.replace("_", r"\ ") + "}"


def plain(text):
    """Text of the user's, in which a dollar is a dollar."""
    return text.replace("$", r"\$")
