"""The grammar of systems written in YAML, and every error as one line with key and remedy."""

import contextlib
import random

import mutations
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from yaml_cases import SYSTEMS, definition

from spi.expressions.arithmetic import NumberError
from spi.expressions.ranges import entries, whole
from spi.plugins.systems.definition import define, strengths
from spi.plugins.systems.keys import DefinitionError
from spi.plugins.systems.text import Symbols, addends, expression, names

X = {f"x({i})": sympy.Symbol(f"x{i}", real=True) for i in range(1, 5)}
WORDS = Symbols({**X, "p": sympy.Symbol("p", real=True)}, {"a": sympy.Symbol("a", real=True)}, {"n": 4})


# --- the grammar -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("x(1)^2/2", "x(1)*x(1)*(1/2)"),
        ("-p^2", "-(p^2)"),
        ("2^3^2*p", "512*p"),
        ("1e-3*p - 1E+2", "p/1000 - 100"),
        ("0.1*p", "p/10"),  # exact
        ("sum(x(i) for i = 1..n)", "x(1) + x(2) + x(3) + x(4)"),
        ("sum(x(i)*x(i+1) for i = 1..n-1)", "x(1)*x(2) + x(2)*x(3) + x(3)*x(4)"),
        ("sum(x(i)*x(mod(i, n) + 1) for i = n-1..n)", "x(3)*x(4) + x(4)*x(1)"),
        ("sum(i*j*p for i = 1..3, j = 1..i)", "25*p"),
        ("sum(sum(x(j) for j = i..i+1) for i = 1..2)", "x(1) + 2*x(2) + x(3)"),
        ("sum(p for i = 3..2)", "0*p"),
        ("-sum(x(i) for i = 1..2)*a", "-a*x(1) - a*x(2)"),
        ("x(2*2 - 1)", "x(3)"),
        ("mod(-1, 4)*p + mod(7, 4)*p", "6*p"),
        ("x( n )", "x(4)"),
        ("cos(pi)*p", "-p"),
        ("max(2, 3, 1)*p + min(1/2, 4)", "3*p + 1/2"),
        ("atan(1)*p", "pi/4*p"),
        ("sqrt(4)*p**2", "2*p^2"),
        ("i*p", None),
        ("sum(i*p for i = 1..2) + i", None),
    ],
)
def test_formulas(text, same):
    if same is None:
        with pytest.raises(NumberError, match="unknown word 'i'"):
            expression(text, WORDS)
    else:
        assert sympy.expand(expression(text, WORDS) - expression(same, WORDS)) == 0


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("p + x(1) - x(2)", 3),
        ("-p - -x(1)", 2),
        ("1e-3*p + 2e+1", 2),
        ("p*-x(1) + x(2)^-1", 2),
        ("p * - -x(1) - -x(2)", 2),
        ("p^- -2 / + -x(1)", 1),
        ("(p + a) - sum(x(i) - a for i = 1..n)", 9),
        ("sum(p for i = 1..2)*2", 1),
        ("cos(p + x(1))", 1),
    ],
)
def test_terms_of_a_sum(text, count):
    """In the order of the text, with their signs: they add up to the whole."""
    found = addends(text, WORDS)
    assert len(found) == count
    assert sympy.expand(sum(found) - expression(text, WORDS)) == 0


def test_names_and_entries():
    sizes = Symbols(indices={"n": 3})
    assert names("P1", sizes) == ["P1"]
    assert names("x(i), y(i, 2) for i = 1..2", sizes) == ["x(1)", "y(1,2)", "x(2)", "y(2,2)"]
    assert names("z(i,j) for i = 1..n, j = i+1..n", sizes) == ["z(1,2)", "z(1,3)", "z(2,3)"]
    assert [text.strip() for text, _ in entries("a(i), 2 for i = 1..2", sizes)] == ["a(i)", "2"] * 2
    assert whole("2*n - 1", sizes) == 5
    for wrong in ("1x", "x y", "x(1", "x-1", "", "x(i)"):
        with pytest.raises(NumberError):
            names(wrong, sizes)


# --- errors of a definition ------------------------------------------------------------------------------------------

GOOD = {"algebra": "so(3)", "sizes": {"n": "2"}, "parameters": {"a": "2"}, "hamiltonian": "y1", "noises": ["y1", "y3"]}


def test_strengths():
    assert strengths(GOOD, ["a/4", "0"]) == [0.5, 0.0]
    assert strengths(GOOD, "1/i for i = 1..n") == [1.0, 0.5]
    assert strengths(GOOD, None) == [1.0, 1.0]


# --- mutated definitions ---------------------------------------------------------------------------------------------

SMALL = [
    SYSTEMS[name][0]
    for name in ("rigid body", "heavy top", "e(2)", "Toda", "bracket with parameters", "ring of 4 spins")
]
PARTS = ["", "9" * 30, "for i = 1..2", "y1", "..", ",", "sum(", "e", "\0", "σ", "=", "so(3)", "/0", *"()^*-0"]


@given(st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_changed_definition_is_taken_or_refused_in_one_line(draw: random.Random):
    """By a value from mutations.py, a key that is gone or renamed, or characters within a text."""
    data = definition(draw.choice(SMALL))
    *above, key = draw.choice(list(mutations.places(data)))
    owner = data
    for step in above:
        owner = owner[step]
    what = draw.choice(("value", "drop", "text", "text", "text"))
    if what == "text" and isinstance(owner[key], str):
        at = draw.randrange(len(owner[key]) + 1)
        owner[key] = owner[key][:at] + draw.choice(PARTS) + owner[key][at + draw.choice((0, 1, 3)) :]
    elif what == "drop":
        del owner[key]
    else:
        value = draw.choice(mutations.VALUES)
        owner[key] = value if isinstance(value, str | list | dict) else str(value)
    with contextlib.suppress(DefinitionError):
        define(data)
        strengths(data, None)
