"""Look of all figures: colours, markers, titles, numbers and words."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.mathtext import MathTextParser

from ..compiler.dispatch import answers
from ..ensemble.protocol import at_temperature, complex_modes, symbols
from ..models import MODELS
from ..schemes import SCHEMES
from ..storage.records import Order
from ..storage.stored import Description, Stored
from . import page

Look = tuple[str, str]  #: marker and colour
Looks = dict[str, Look]  #: by variant

#: Marker and colour of schemes that are not in the table of schemes, which a file from elsewhere may have.
OTHERS = (("v", "#56B4E9"), ("P", "#000000"), ("*", "#D55E00"), ("h", "#0072B2"), ("<", "#009E73"))

#: For each scheme at several eps its markers, from large to small eps, and its sequence of colours, which differ in
#: lightness: curves that share a panel can be told apart without colours.
SEQUENCES = (("o", "s", "^", "v", "p", "h"), ("D", "<", ">", "P", "X", "*"), ("d", "8", "H", "x", "+", "1"))
RAMPS = ("plasma", "viridis", "cividis")

GREEK = (
    *("alpha", "beta", "gamma", "delta", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "xi", "rho", "sigma"),
    *("tau", "phi", "chi", "psi", "omega", "Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma", "Phi", "Psi"),
    "Omega",
)
SYMBOLS = {name: rf"\{name}" for name in GREEK} | {
    "inertia": "I",
    "noise_inertia": r"\hat{I}",
    "epsilon": r"\varepsilon",
    "eps": r"\varepsilon",
}

#: The labels of horizontal axes.
AXES = {"t": "time $t$", "h": "step size $h$", "n": "number of steps $n$", "lag": "lag $s$"}

_LONG = 60  # letters of a formula that is not shown in a title
_MOST_ENTRIES = 9  # of a tuple that is shown whole
_MOST_COMPONENTS = 64  # of a state that is shown


def _looks_of(variants: Sequence[str], number: int, in_one: Look | None) -> Looks:
    """Looks of the variants of one scheme: markers in one colour, beginning with the look of the scheme, or a ramp."""
    markers = SEQUENCES[number]
    if in_one:
        marker, colour = in_one
        return {variant: (markers[i % len(markers)] if i else marker, colour) for i, variant in enumerate(variants)}
    ramp, last = matplotlib.colormaps[RAMPS[number]], len(variants) - 1
    return {
        variant: (markers[i % len(markers)], to_hex(ramp(0.86 * (1 - i / last)))) for i, variant in enumerate(variants)
    }


def looks(cases: Iterable[Iterable[Stored]]) -> Looks:
    """Marker and colour of every variant in the readings of all cases, the same in all panels.

    Of a scheme at several eps, or extrapolated in several ways, each variant has its own, in an order; a single variant
    looks like the scheme.
    """
    members: dict[str, dict[str, tuple[float, int]]] = {}
    for about in (reading.about for readings in cases for reading in readings):
        members.setdefault(about.scheme, {})[about.variant] = (-(about.eps or 0.0), about.extrapolate)
    unknown = [name for name in members if name not in SCHEMES]
    chosen: Looks = {name: row.look for name, row in SCHEMES.items()}
    chosen |= {name: OTHERS[i % len(OTHERS)] for i, name in enumerate(unknown)}
    several = [scheme for scheme, variants in members.items() if len(variants) > 1]
    many = len(several) > len(RAMPS)  # schemes for the sequences of colours
    for scheme, variants in members.items():
        if scheme in several:
            ordered, number = sorted(variants, key=variants.__getitem__), several.index(scheme) % len(RAMPS)
            chosen |= _looks_of(ordered, number, chosen[scheme] if many else None)
        else:
            chosen |= dict.fromkeys(variants, chosen[scheme])
    return _in_colours(chosen, [variant for variants in members.values() for variant in variants])


def _in_colours(looks: Looks, variants: Sequence[str]) -> Looks:
    """Looks in the colours that a person chose for variants, in their order or by name."""
    colours = page.current().chosen.get("colors", ())
    if not isinstance(colours, Mapping):
        colours = dict(zip(variants, colours, strict=False))
    if unknown := next((name for name in colours if name not in (*variants, *looks)), None):
        raise ValueError(f"colors: has '{unknown}'; {page.meant(unknown, variants)}")
    return looks | {name: (looks[name][0], to_hex(colour)) for name, colour in colours.items()}


def shade(colour: str, i: int, count: int) -> str:
    """Number i of ``count`` shades of a colour, from itself to a pale one."""
    white = 0.6 * i / max(count - 1, 1)
    red, green, blue = ((1 - white) * part + white for part in to_rgb(colour))
    return to_hex((red, green, blue))


def order_text(order: Order) -> str:
    """A fitted order with its interval; empty if it is not resolved."""
    if not math.isfinite(order.order):
        return ""
    return f"order {order.order:.2f} [{order.low:.2f}, {order.high:.2f}]".replace("-", "\N{MINUS SIGN}")


def label(about: Description, with_eps: bool = True) -> str:
    """Name of the scheme of a reading in mathtext; `about` is its description."""
    text = plain(about.scheme_label)
    if with_eps and about.eps is not None:
        text = rf"{text}, $\varepsilon={power(about.eps)}$"
    return ", ".join([text, *[about.extrapolation] * (about.extrapolate > 0)])


def in_overlay(about: Description, alone: bool) -> Description:
    """Description of a record in a panel with those of other cases; `alone`: each case has one."""
    title = about.swept.title if about.swept else about.case_title
    own = about.owner if alone else f"{about.owner}/{about.variant}"
    return replace(about, variant=own, scheme_label=title if alone else f"{title}, {about.scheme_label}")


def named(name: str, variables: tuple[str, ...] = ()) -> str:
    """Name of a function or quantity in mathematics: the label that a person chose, or the name set as such."""
    label = page.current().label(name)
    if label is None:
        return maths(name, variables)
    parts = plain(label).split("$")  # every other one is mathematics already
    spaced = [part.replace(" ", r"\ ") for part in parts]
    return "$" + "".join(part if i % 2 else rf"\mathrm{{{part}}}" for i, part in enumerate(spaced) if part) + "$"


def symbol(name: str) -> str:
    """Symbol of a parameter in mathtext, with an index where its name has one; empty if it has none."""
    return SYMBOLS.get(name) or (name if len(name) == 1 else _indexed(name))


def _indexed(name: str) -> str:
    """A letter with its index in mathtext: `w0`, `Jx`, `y_2`, `mu1`, `x(1)` and `h(1,0)`; empty for another name."""
    found = re.fullmatch(rf"([A-Za-z]|{'|'.join(GREEK)})(?:_?(\d+|[xyz])|\(([\d,]+)\))", name)
    return f"{SYMBOLS.get(found[1], found[1])}_{{{found[2] or found[3]}}}" if found else ""


def word(name: str) -> str:
    """Label of a parameter on an axis: one that a person chose, or in mathtext if there is a symbol for it."""
    if label := page.current().label(name):
        return plain(label)
    named = symbol(name)
    return f"${named}$" if named else plain(name.replace("_", " "))


def dress(fig: Figure, width: float, height: float, title: str, parameters: Iterable[str], least: float = 0.0) -> None:
    """Give a figure of ``width`` and ``height`` inches for its panels a title and a line of parameters above them.

    In a paper both belong in the caption, see :func:`caption`, and the figure is as wide as its column.  In a figure of
    a given height the caption has what does not leave its panels ``least`` inches: the parameters, else the title, too.
    """
    page.remember(fig)
    FigureCanvasAgg(fig)  # which remembers the sizes of texts, unlike the canvas that a figure begins with
    parameters = list(parameters)
    fig.set_label(". ".join(filter(None, [plain(title), ", ".join(parameters)])) + ".")
    layout = page.current().layout
    pads: dict[str, Any] = {"w_pad": layout.w_pad, "h_pad": layout.h_pad}
    if page.current().is_paper:
        fig.set_size_inches(width, layout.height or 1.3 * height)  # which is fitted when all is drawn
        fig.set_layout_engine(ConstrainedLayoutEngine(**pads))
        return
    titles = wrapped((word.rstrip() for word in WORD.findall(plain(title))), " ", "figure.titlesize", width)
    lines = wrapped(parameters, ",  ", "legend.fontsize", width)

    def top() -> float:
        return bool(titles) * layout.heading + layout.title_line * len(titles) + layout.facts_line * len(lines)

    is_off = page.current().chosen.get("title") is False
    for part in (lines, titles):
        if is_off or (layout.height is not None and layout.height - top() < least):
            part.clear()
    height = layout.height or height + top()
    fig.set_size_inches(width, height)
    fig.set_layout_engine(ConstrainedLayoutEngine(rect=(0, 0, 1, 1 - top() / height), **pads))
    middle: dict[str, Any] = {"x": 0.5, "ha": "center", "va": "top", "linespacing": layout.heading_spacing}
    if titles:
        fig.text(y=1 - layout.above / height, s="\n".join(titles), fontsize=layout.title, **middle)
    if lines:
        under = layout.facts_above + layout.title_line * len(titles)
        fig.text(y=1 - under / height, s="\n".join(lines), fontsize=layout.facts, color="#444444", **middle)


def has_caption(fig: Figure) -> bool:
    """Whether title or parameters are left to the caption of a figure."""
    return len(fig.texts) < 2


def caption(fig: Figure) -> str:
    """Caption of a figure: its title and parameters; formulas as in LaTeX."""
    return str(fig.get_label())


def wrapped(items: Iterable[str], separator: str, size: str | float, width: float) -> list[str]:
    """``items`` joined in lines that are no wider than ``width`` inches, with a margin.

    ``size`` is that of the letters in points, or the name of a setting of matplotlib such as "axes.titlesize".
    """
    layout, lines = page.current().layout, list[str]()
    for item in items:
        longer = separator.join([*lines[-1:], item])
        if lines and inches(longer, size) < layout.fill * width - layout.side:
            lines[-1] = longer
        else:
            lines.append(item)
    return lines


def inches(text: str, size: str | float) -> float:
    """Width of a text in inches, at a size as in :func:`wrapped`."""
    return page.inches_of(text, FontProperties(size=page.points(size) if isinstance(size, str) else size))


_FINAL = r"\mathrm{final\ time}"


def split_facts(of_cases: list[dict[str, str]]) -> tuple[list[str], list[list[str]]]:
    """Facts that all cases share, and the further ones of each case; `of_cases` are the :func:`facts` of each."""
    # T is the temperature where there is one
    if any("model_temperature" in of_case or "temperature" in of_case.get("initial", "") for of_case in of_cases):
        of_cases = [
            {name: text.replace("$T=", f"${_FINAL}=") for name, text in of_case.items()} for of_case in of_cases
        ]
    shared = {name: text for name, text in of_cases[0].items() if all(other.get(name) == text for other in of_cases)}
    return list(shared.values()), [
        [text for name, text in of_case.items() if name not in shared] for of_case in of_cases
    ]


class Formulas(tuple[str, ...]):
    """Formulas of the numbers of a parameter, in which a swept word stands."""

    def __str__(self) -> str:
        """In mathtext, as it would be a number or a tuple of numbers."""
        each = [formula(text) for text in self]
        return each[0] if len(each) == 1 else "(" + r",\,".join(each) + ")"


def _is_shown(value: Any) -> bool:
    """Whether a parameter is a number or a few numbers."""
    return not isinstance(value, str | bool) and (
        not isinstance(value, tuple) or isinstance(value, Formulas) or isinstance((*value, "")[0], int | float)
    )


def facts(reading: Stored, *names: str, **others: Any) -> dict[str, str]:
    """Parameters that stand above a figure, name -> mathtext.

    Besides those of its description they are the fields of the reading in `names`, and `others`: ``step``,
    ``reference_step``, ``reference_scheme``, ``samples``, ``estimator``, ``functions`` (one alone) and ``path``.
    """
    about, own = reading.about, {name: getattr(reading, name) for name in names} | others
    texts = _of_model(about) | _of_start(about) | _of_reference(own)
    if own.get("samples") is not None:
        texts["samples"] = f"{count(own['samples'])} sample{'s' * (own['samples'] != 1)}"
    texts |= _of_noise(about)
    if own.get("estimator"):
        texts["estimator"] = own["estimator"]
    if len(own.get("functions") or ()) == 1:
        texts["function"] = rf"$\varphi(y)={formula(own['functions'][0], about.variables)}$"
    if own.get("path") is not None:
        texts["path"] = f"path {own['path']} of seed {about.seed}"
    return texts


def _of_model(about: Description) -> dict[str, str]:
    """Parameters of the model that are numbers, and its noise if that is a text."""
    texts = {}
    of_model = symbols(MODELS[about.model]) if about.model in MODELS else {}
    for name, value in about.parameters.items():
        if name == "noise" and isinstance(value, str | tuple):  # as text, or none
            texts["model_noise"] = plain(f"noise: {value}") if value else "no noise"
        elif _is_shown(value) and of_model.get(name) != "":
            named = of_model.get(name) or symbol(name) or r"\mathrm{" + name.replace("_", r"\ ") + "}"
            typeset = f"${named}={value if isinstance(value, Formulas) else number(value)}$"
            if not isinstance(value, Formulas) or _parses(typeset):
                texts[f"model_{name}"] = typeset
    return texts


def _of_start(about: Description) -> dict[str, str]:
    """Where paths start, and their final time."""
    texts = {}
    if about.initial is not None and len(about.initial) <= _MOST_COMPONENTS:
        texts["initial"] = f"${initial_value(about)}$"
    if about.initial_law is not None:
        texts["initial"] = plain(f"initial states: {about.initial_law}")
    if about.final_time is not None:
        # T is the temperature of a model with a bath of its own, be there one or not
        bath = about.model in MODELS and answers(at_temperature, MODELS[about.model])
        texts["final_time"] = f"${_FINAL if bath else 'T'}={number(about.final_time)}$"
    return texts


def _of_reference(own: Mapping[str, Any]) -> dict[str, str]:
    """Steps, and the scheme of the reference."""
    texts = {}
    for name, named in (("step", "h"), ("reference_step", r"h_{\mathrm{ref}}")):
        if own.get(name) is not None:
            texts[name] = f"${named}={number(own[name], steps=True)}$"
    if own.get("reference_scheme"):
        name = own["reference_scheme"]
        texts["reference_scheme"] = plain(f"reference: {SCHEMES[name].label if name in SCHEMES else name}")
    return texts


def _of_noise(about: Description) -> dict[str, str]:
    """What is special about the noise."""
    texts = {}
    if about.truncate_noise:
        texts["truncate_noise"] = "truncated noise"
    if about.driver:
        texts["driver"] = plain(f"driver: {about.driver}")
    if about.areas != "exact":
        texts["areas"] = "Gaussian areas"
    return texts


def modes_of(about: Description) -> Any:
    """(symbol, names of the modes) where the components are parts of complex modes; otherwise ()."""
    return complex_modes(MODELS[about.model]) if about.model in MODELS else ()


def initial_value(about: Description) -> str:
    """y_0 in mathtext, of complex modes as complex numbers."""
    y = about.initial or ()
    if not (named := modes_of(about)):
        return f"y_0={number(y)}"
    modes = [f"{number(re)}{'+' if im >= 0 else '-'}{number(abs(im))}i" for re, im in zip(*[iter(y)] * 2, strict=True)]
    return f"{named[0]}(0)=(" + r",\,".join(modes) + ")"


def component_names(about: Description, count: int) -> list[str]:
    """Names of the components of the state, in mathtext."""
    if about.variables:
        return [f"${symbol(name)}$" if symbol(name) else plain(name) for name in about.variables]
    if not (named := modes_of(about)):
        return [f"$y_{{{i + 1}}}$" for i in range(count)]
    letter, modes = named
    return [rf"${part}\,{letter}_{{{mode}}}$" for mode in modes for part in (r"\mathrm{Re}", r"\mathrm{Im}")][:count]


def number(value: float | tuple[float | None, ...] | list[float | None] | None, steps: bool = False) -> str:
    """A number or a tuple of numbers in mathtext: simple decimals and fractions as such, steps as powers of two."""
    if isinstance(value, tuple | list):
        if len(value) == 1:
            return number(value[0])
        shown = [number(v) for v in value]
        if len(shown) > _MOST_ENTRIES:
            shown = [*shown[:4], r"\ldots", shown[-1]]
        return "(" + r",\,".join(shown) + ")"
    if value is None:  # a noise
        return r"\mathrm{off}"
    if steps and math.frexp(value)[0] == 0.5:
        return f"2^{{{math.frexp(value)[1] - 1}}}"
    few = next((text for text in (f"{value:.3g}", f"{value:.4g}") if math.isclose(float(text), value)), None)
    nearest = Fraction(value).limit_denominator(12)
    if few is None and nearest and math.isclose(nearest, value, rel_tol=1e-12):
        return str(nearest)
    digits, e, exponent = (few or f"{value:.3g}").partition("e")
    factor = digits[:-1] if digits in ("1", "-1") else rf"{digits}\cdot"
    return rf"{factor}10^{{{int(exponent)}}}" if e else digits


def power(value: float) -> str:
    """A number in mathtext, powers of ten as such."""
    exponent = round(math.log10(value)) if value > 0 else 0
    return f"10^{{{exponent}}}" if exponent and math.isclose(value, 10.0**exponent) else number(value)


def count(number: int) -> str:
    """A number of things, with large powers of ten as such."""
    exponent = len(str(number)) - 1
    return (
        f"$10^{{{exponent}}}$"
        if number == 10**exponent and exponent > 3
        else f"{number:,}"
        if exponent > 4
        else f"{number}"
    )


def formula(text: str, variables: tuple[str, ...] = ()) -> str:
    """A test function, the text of an expression, in mathtext; `variables` are the system's names of y1, y2, ..."""
    text = re.sub(r"\d+\.\d+(e-?\d+)?|\d+e-?\d+", lambda match: _constant(float(match.group())), text)
    text = re.sub(r"\by(\d+)", lambda match: _component(int(match.group(1)), variables), text)
    text = re.sub(r"(?<![\\{\w])([A-Za-z])(?:(\d+)\b|\((\d+)\))", r"\1_{\2\3}", text)
    text = re.sub(r"(?<![\\{\w])([A-Za-z]{2,}(_[A-Za-z]+)*)", lambda match: _word(match.group(1)), text)
    text = text.replace("<=", r"\leq ").replace(">=", r"\geq ")
    return re.sub(r"\^(\d+)", r"^{\1}", text).replace("*", r"\,")


_COMMANDS = ("cos", "cosh", "exp", "log", "max", "min", "pi", "sin", "sinh", "tan", "tanh")  # of mathtext


def _word(name: str) -> str:
    return f"\\{name} " if name in (*_COMMANDS, *GREEK) else r"\mathrm{" + name.replace("_", r"\ ") + "}"


@cache
def maths(text: str, variables: tuple[str, ...] = ()) -> str:
    """An expression or a name set as mathematics, as it is written where that is not possible."""
    if passage := re.fullmatch(r"share with (.+) until t", text):  # its indicator function
        condition = maths(passage[1], variables)
        return rf"$\mathbf{{1}}\{{{condition[1:-1]}\ \mathrm{{for\ some}}\ s\leq t\}}$" if condition[0] == "$" else text
    if " " in text and re.search(r"[A-Za-z]{3,}(?![\w(])", text):  # a sentence, in which only expressions are set
        words = text.split()
        return " ".join(maths(word, variables) if re.search(r"\by\d|[<>=^]", word) else plain(word) for word in words)
    typeset = f"${formula(text, variables)}$"
    return typeset if _parses(typeset) else plain(text)


def long_title(record: Any, facet: str, place: int) -> str:
    """Title of the panel of one function: its name and formula, where they are not one."""
    names, texts = record.get("function"), record.get("texts")
    if facet != "function" or texts is None or len(names) == 1:
        return ""
    return definition(names[place], texts[place], record.about.variables)


def definition(name: str, text: str, variables: tuple[str, ...] = ()) -> str:
    """Name and the formula of a function, as far as that is not too long; empty where they are one."""
    if name == text:
        return ""
    return plain(name) + (f": {maths(text, variables)}" if len(text) < _LONG else "")


def value_of(axis: str, value: float) -> str:
    """Place along an axis of step sizes or of a parameter, as an equation."""
    return f"${symbol(axis) or axis}={number(float(value), axis == 'h')}$"


def axis_label(record: Any, axis: str) -> str:
    """Label of a horizontal axis."""
    if label := page.current().label(axis):
        return plain(label)
    return word(record.word) if axis == "value" else AXES.get(axis, axis)


def _component(number: int, variables: tuple[str, ...]) -> str:
    """A component of the state by its number, from 1 on, in mathtext."""
    if number > len(variables):
        return f"y_{{{number}}}"
    name = variables[number - 1]
    return symbol(name) or r"\mathrm{" + name.replace("_", r"\_") + "}"


def _constant(value: float) -> str:
    times = value / math.pi
    if times and times % 1 == 0:
        return r"\pi" if times == 1 else rf"{times:g}\pi"
    return number(value)


@cache
def plain(text: str) -> str:
    """A text of the user, with its mathematics between dollars, as in ``at $\\lambda = 4$``; others are dollars.

    Those of mathematics stand close to it, and no digit follows.  U+FEFF is left out, which no PDF can have.
    """
    parts = _MATHEMATICS.split(text.replace("\ufeff", ""))
    return "".join(part if i % 2 and _parses(part) else part.replace("$", r"\$") for i, part in enumerate(parts))


_MATHEMATICS = re.compile(r"(\$(?! )[^$]*(?<! )\$(?!\d))")


def _parses(text: str) -> bool:
    """Whether matplotlib can set a text as mathematics."""
    try:
        MathTextParser("path").parse(text)
    except ValueError:
        return False
    return len(text) > len("$$")


WORD = re.compile(r"(?:\\\$|\$(?:\\\$|[^$])*\$|[^\s$])+\s*")  #: of a text, in which a formula is one


def shades(count: int) -> np.ndarray:
    """(count, 4) colours of curves at several times, from early to late."""
    return np.asarray(matplotlib.colormaps["viridis"](np.linspace(0, 0.88, count)))
