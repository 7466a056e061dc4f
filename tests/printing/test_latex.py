"""Tables as LaTeX."""

import re

import pytest

from spi.printing import latex
from spi.printing.latex import Titled
from spi.printing.tables import StyledText, TextTable


@pytest.mark.parametrize(
    ("plain", "expected"),
    [
        ("3.42e-3 ± 0.07e-3", r"$(3.42 \pm 0.07)\cdot 10^{-3}$"),
        ("6.612345e-2 ± 2e-13", r"$6.612345\cdot 10^{-2} \pm 2\cdot 10^{-13}$"),
        ("3.42 ± 0.07", r"$3.42 \pm 0.07$"),
        ("(9e-1 ± 4e-1)", r"($(9 \pm 4)\cdot 10^{-1}$)"),
        ("-1.1e-15", r"$-1.1\cdot 10^{-15}$"),
        ("1e-08", r"$1\cdot 10^{-8}$"),
        ("2^-5", "$2^{-5}$"),
        ("h = 2^-4.6, d = 0.1", "h = $2^{-4.6}$, d = 0.1"),
        ("0.504 [-0.489, 0.520]", "0.504 [$-0.489$, 0.520]"),
        ("2.0-3.1", "2.0-3.1"),
        ("12.3 µs", r"12.3 \textmu{}s"),
        ("99.9 %", r"99.9 \%"),
        ("≤ 3.1", r"$\leq$ 3.1"),
        ("y1^2", r"y1\textasciicircum{}2"),
        (r"a_b & {c} $d$ \e ~f #1", r"a\_b \& \{c\} \$d\$ \textbackslash{}e \textasciitilde{}f \#1"),
        ("Lévy, σ", r"Lévy, $\sigma$"),
        ("1 ≈ ₂", "1 ? 2"),
        ("inf", "inf"),
        ("", ""),
    ],
)
def test_text(plain, expected):
    assert latex.text(plain) == expected


def table(rows=2, title="a_b"):
    lines = [[StyledText("[0, 1]"), StyledText(f"{i}e-3 ± 1e-3")] for i in range(rows)]
    return Titled.of(TextTable(title, ("x & y", "error"), [lines], 1))


def test_a_table_is_a_float_with_rules():
    text = latex.document("my_run", "50 %\n\\input{x}", [table()])
    assert text == "\n".join(
        [
            r"% my_run: 50 % \input{x}",
            r"% needs \usepackage{booktabs}",
            "",
            r"\begin{table}",
            r"\centering",
            r"\caption{50 \% \textbackslash{}input\{x\}: a\_b}",
            r"\label{tab:my-run-1}",
            r"\begin{tabular}{lr}",
            r"\toprule",
            r"x \& y & error \\",
            r"\midrule",
            r"{[0, 1]} & $(0 \pm 1)\cdot 10^{-3}$ \\",
            r"{[0, 1]} & $(1 \pm 1)\cdot 10^{-3}$ \\",
            r"\bottomrule",
            r"\end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def test_a_heading_of_one_letter_is_a_symbol():
    grid = TextTable("", ("scheme", "h", "error at h"), [[[StyledText("a"), StyledText("2^-4"), StyledText("1")]]], 2)
    assert r"scheme & $h$ & error at h \\" in latex.document("r", "t", [Titled.of(grid)])


def test_a_long_table_may_break_and_all_braces_are_closed():
    text = latex.document("r", "t", [table(60), table(3)])
    assert text.count(r"\begin{longtable}{lr}") == text.count(r"\end{longtable}") == text.count(r"\endhead") == 1
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == 1
    assert r"\usepackage{booktabs} and \usepackage{longtable}" in text
    plain = re.sub(r"\\[{}]", "", text)
    assert plain.count("{") == plain.count("}") and len(re.findall(r"(?<!\\)\$", text)) % 2 == 0
    for line in text.splitlines():
        if line.endswith(r"\\") and "caption" not in line and "multicolumn" not in line:
            assert len(re.findall(r"(?<!\\)&", line)) == 1


def test_a_table_loses_empty_columns_and_breaks_of_headings():
    row = [StyledText("[b]"), StyledText("0.5 [0.4, 0.6]"), StyledText("3\n4", "bold red"), StyledText("")]
    found = Titled.of(TextTable("title [x]", ["scheme", "non-\nfinite", "Euler-\nMaruyama", ""], [[row]], 1))
    assert found.title == "title [x]" and found.justified == "lrr"
    assert list(found.frame.columns) == ["scheme", "nonfinite", "Euler-Maruyama"]
    assert found.frame.to_numpy().tolist() == [["[b]", "0.5 [0.4, 0.6]", "3 4"]]
