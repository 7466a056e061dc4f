"""Plain tables as LaTeX, in the style of the package booktabs."""

import re
import unicodedata
from collections.abc import Iterable

from .tables import Cell, PlainTable

#: More rows than that do not fit on a page; longtable breaks them.
_MOST_ROWS = 40

_HEAD = r"""% {name}: {title}
% needs \usepackage{{booktabs}} and \usepackage{{longtable}}
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


def document(name: str, title: str, tables: Iterable[PlainTable]) -> str:
    """All tables of an experiment, each a float or, if it is long, a longtable."""
    parts = [_table(f"tab:{name}-{number}", title, table) for number, table in enumerate(tables, 1)]
    return "\n".join([_HEAD.format(name=_comment(name), title=_comment(title)), *parts])


def _comment(text: str) -> str:
    return " ".join(text.split())


def _table(label: str, title: str, table: PlainTable) -> str:
    long = len(table.rows) > _MOST_ROWS
    columns = "".join("l" if left else "r" for left in table.left)
    caption = rf"\caption{{{text(': '.join(filter(None, (title, table.title))))}}}\label{{{_label(label)}}}"
    headings = " & ".join(map(text, table.headings)) + r" \\"
    body = [line for number, row in enumerate(table.rows) for line in _row(row.cells, _rule(table, number))]
    rows = [r"\toprule", headings, r"\midrule", *[r"\endhead"] * long, *body, r"\bottomrule"]
    if long:
        return "\n".join([rf"\begin{{longtable}}{{{columns}}}", caption + r"\\", *rows, r"\end{longtable}", ""])
    tabular = [rf"\begin{{tabular}}{{{columns}}}", *rows, r"\end{tabular}"]
    return "\n".join([r"\begin{table}", r"\centering", caption, *tabular, r"\end{table}", ""])


def _rule(table: PlainTable, number: int) -> bool:
    return table.rows[number].ends_section and number + 1 < len(table.rows)


def _row(cells: Iterable[Cell], rule: bool) -> list[str]:
    return [" & ".join(_cell(cell) for cell in cells) + r" \\", *[r"\midrule"] * rule]


def _cell(cell: Cell) -> str:
    content = text(cell.text)
    if cell.mark in ("bad", "bold"):
        return rf"\textbf{{{content}}}"
    return f"{{{content}}}" if content.startswith("[") else content  # else an option of the line break before it


def _label(label: str) -> str:
    return re.sub(r"[^A-Za-z0-9:-]+", "-", label)


def text(plain: str) -> str:
    r"""A text as LaTeX: ``3.42e-3 ± 0.07e-3`` as ``$(3.42 \pm 0.07)\cdot 10^{-3}$``, ``2^-5`` as ``$2^{-5}$``.

    What LaTeX would take for commands is escaped.
    """
    parts, end = [], 0
    for match in _NUMBER.finditer(plain):
        parts += [_escaped(plain[end : match.start()]), _number(match.group())]
        end = match.end()
    return "".join([*parts, _escaped(plain[end:])])


def _number(found: str) -> str:
    value, _, half = found.partition(" ± ")
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
    """The digits of a number, and its power of ten as a factor."""
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
