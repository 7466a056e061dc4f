"""Tables as LaTeX, in the style of the package booktabs."""

import re
import unicodedata
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

from .tables import TextTable, unbroken

if TYPE_CHECKING:  # pandas takes a while
    from pandas import DataFrame


class Titled(NamedTuple):
    """A table of texts with its title."""

    title: str
    frame: "DataFrame"
    justified: str  #: "l" or "r" for each column

    @classmethod
    def of(cls, grid: TextTable) -> "Titled":
        """A table without the columns that are empty, heading and all, and without breaks that make a column narrow."""
        from pandas import DataFrame

        headings = [unbroken(heading) for heading in grid.headings]
        rows = [[" ".join(text.split("\n")) for text in row] for row in grid.rows]
        shown = [i for i, heading in enumerate(headings) if heading or any(row[i] for row in rows)]
        frame = DataFrame(
            [[row[i] for i in shown] for row in rows],
            columns=[headings[i] for i in shown],
            dtype=object,
        )
        return cls(grid.title, frame, "".join("l" if i < grid.left else "r" for i in shown))


#: More rows than that do not fit on a page; longtable breaks them.
_MOST_LATEX_ROWS = 40

_LATEX_HEAD = r"""% {name}: {title}
% needs \usepackage{{booktabs}}{longtable}
"""

_ESCAPED = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "±": r"$\pm$",
    "≤": r"$\leq$",
    "≥": r"$\geq$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "µ": r"\textmu{}",
    "\n": " ",
}

_GREEK = (
    *("alpha", "beta", "gamma", "delta", "varepsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu"),
    *("xi", "pi", "rho", "sigma", "tau", "upsilon", "varphi", "chi", "psi", "omega"),
    *("Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma", "Upsilon", "Phi", "Psi", "Omega"),
)
_ESCAPED |= {letter: rf"$\{name}$" for letter, name in zip("αβγδεζηθικλμνξπρστυφχψωΓΔΘΛΞΠΣΥΦΨΩ", _GREEK, strict=True)}

_DECIMAL = r"\d+(?:\.\d+)?"
_NUMBER = re.compile(
    rf"(?<![\w.^])-?{_DECIMAL}(?:\^-?{_DECIMAL}|(?:e-?\d+)?(?: ± {_DECIMAL}(?:e-?\d+)?)?)(?![\w^])(?!\.\d)"
)


def document(name: str, title: str, tables: Iterable[Titled]) -> str:
    """All tables of an experiment, each a float or, if it is long, a longtable."""
    parts = [_table(f"tab:{name}-{number}", title, table) for number, table in enumerate(tables, 1)]
    longtable = r" and \usepackage{longtable}" if any(r"\begin{longtable}" in part for part in parts) else ""
    words = {"name": " ".join(name.split()), "title": " ".join(title.split()), "longtable": longtable}
    return "\n".join([_LATEX_HEAD.format(**words), *parts])


def _table(label: str, title: str, table: Titled) -> str:
    style = table.frame.style.hide(axis="index").format(_cell).format_index(_heading, axis="columns")
    long = len(table.frame) > _MOST_LATEX_ROWS
    return style.to_latex(
        hrules=True,
        caption=text(": ".join(filter(None, (title, table.title)))),
        label=re.sub(r"[^A-Za-z0-9:-]+", "-", label),
        column_format=table.justified,
        **({"environment": "longtable"} if long else {"position_float": "centering"}),
    )


def _heading(plain: str) -> str:
    """A heading as text; of one letter, such as that of the step size h, a symbol."""
    return f"${plain}$" if len(plain) == 1 and plain.isascii() and plain.isalpha() else text(plain)


def _cell(plain: str) -> str:
    content = text(plain)
    return f"{{{content}}}" if content.startswith("[") else content  # else an option of the line break before it


def text(plain: str) -> str:
    r"""A text as LaTeX: ``3.42e-3 ± 0.07e-3`` as ``$(3.42 \pm 0.07)\cdot 10^{-3}$``, ``2^-5`` as ``$2^{-5}$``.

    What LaTeX would take for commands is escaped.
    """
    parts, end = [], 0
    for match in _NUMBER.finditer(plain):
        parts += [_escaped(plain[end : match.start()]), _number(match.group())]
        end = match.end()
    return "".join([*parts, _escaped(plain[end:])])


def _number(text: str) -> str:
    value, _, half = text.partition(" ± ")
    base, power, exponent = value.partition("^")
    if power:
        return f"${base}^{{{exponent}}}$"
    (digits, times), (half_digits, half_times) = _mantissa(value), _mantissa(half)
    if not half:
        return f"${digits}{times}$" if times or digits.startswith("-") else digits
    if times and half_times == times:
        return rf"$({digits} \pm {half_digits}){times}$"
    return rf"${digits}{times} \pm {half_digits}{half_times}$"


def _mantissa(number: str) -> tuple[str, str]:
    """Digits of a number, and its power of ten as a factor."""
    digits, _, exponent = number.partition("e")
    return digits, rf"\cdot 10^{{{int(exponent)}}}" if exponent else ""


def _escaped(plain: str) -> str:
    return "".join(_ESCAPED.get(character) or _letter(character) for character in plain)


def _letter(character: str) -> str:
    """A character that LaTeX knows: Latin letters as they are, all others without their marks, or ?."""
    if character.isascii() or unicodedata.name(character, "").startswith("LATIN"):
        return character
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return "".join(_ESCAPED.get(one, one) for one in plain) or "?"
