"""The grammar of systems written in YAML, and every error as one line with key and remedy."""

import contextlib
import random

import mutations
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from yaml_cases import SYSTEMS, definition

from spi.systems.definition import DefinitionError, define, strengths
from spi.systems.text import NumberError, Symbols, addends, entries, expression, names, whole

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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("p +", "it ends too early"),
        ("p p", "unexpected 'p'"),
        ("(p", "a parenthesis is not closed"),
        ("cos(p", "a parenthesis is not closed"),
        ("x(5)", "there is no x(5); on a ring of n write x(mod(i, n) + 1) for the next"),
        ("x(1/2)", "'1/2' is not an integer"),
        ("x(p)", "unknown word 'p'"),
        ("x", "unknown word 'x'"),
        ("y(1)", "unknown word 'y'"),
        ("coss(p)", "unknown word 'coss', did you mean 'cos'?"),
        ("cos", "'cos' without parentheses"),
        ("sum(p for i = 1.2)", "is not a range such as i = 1..n"),
        ("sum(p for a = 1..2)", "'a' is a variable, a parameter or a function; take another word as index"),
        ("sum(p for x = 1..2)", "'x' is a variable, a parameter or a function"),
        ("sum(p for i = 1..99999)", "the range runs over more than 10000 values"),
        ("sum(p for i = 1..200, j = 1..200)", "the range runs over more than 10000 values"),
        ("max(p)", "max needs two values or more, as in max(a, b)"),
        ("mod(1)", "mod needs two whole numbers"),
        ("mod(1, 0)", "mod needs two whole numbers"),
        ("p/0", "division by zero"),
        ("0^-1", "division by zero"),
        ("p^1000", "too large"),
        ("1e400*p", "too large"),
        ("log(0)*p", "it has no finite real value"),
        ("sqrt(-1)*p", "it has no finite real value"),
        ("(" * 2000, ""),
        ("p" * 30_000, "longer than 20000 characters"),
        ("__import__('os')", "unknown word '__import__'"),
        ("p.real", "unexpected '.'"),
        ("p[0]", "unexpected '['"),
        ("", "it ends too early"),
    ],
)
def test_wrong_formulas(text, message):
    for read in (expression, addends):
        with pytest.raises(NumberError) as error:
            read(text, WORDS)
        assert message in str(error.value)


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

GOOD = {
    "algebra": "so(3)",
    "sizes": {"n": "2"},
    "parameters": {"a": "2"},
    "hamiltonian": "y1^2/a",
    "noises": ["y1", "a*y3"],
}


@pytest.mark.parametrize(
    ("key", "value", "keys", "message"),
    [
        ("algebras", "so(3)", ("algebras",), "is not a known key"),
        ("algebra", ["so(3)"], ("algebra",), "must be the name of an algebra such as so(3)"),
        ("algebra", "so(33)", ("algebra",), "is 'so(33)' (the size in 'so(33)' must be from 2 to 11); correct it here"),
        ("algebra", None, ("algebra",), "missing key 'algebra'; add algebra: or bracket:"),
        ("variables", ["x", "y"], ("variables",), "has 2 names; so(3) has 3 components"),
        ("variables", ["x", "y", "x"], ("variables",), "has 'x' twice; remove one"),
        ("variables", ["x", "y", "cos"], ("variables",), "has 'cos', a function, parameter or size; take another name"),
        ("variables", ["x", "y", "a"], ("variables",), "has 'a', a function, parameter or size"),
        ("variables", ["x", "y", "n"], ("variables",), "has 'n', a function, parameter or size"),
        ("variables", ["x", "y", "2z"], ("variables", 2), "is '2z' ('2z' is not a name; names have letters from a to"),
        (
            "variables",
            ["x", "y", "ω1"],
            ("variables", 2),
            "is 'ω1' ('ω1' is not a name; names have letters from a to z",
        ),
        (
            "variables",
            ["x", "y", "aω"],
            ("variables", 2),
            "is 'aω' ('aω' is not a name; names have letters from a to z",
        ),
        ("variables", [False, "y", "z"], ("variables", 0), "has a word that YAML reads as false, one of no, off and"),
        ("variables", True, ("variables",), "has a word that YAML reads as true, one of yes, on and true; put it in"),
        ("parameters", {"a": False}, ("parameters", "a"), "has a word that YAML reads as false"),
        ("variables", ["x", "y", "z(i"], ("variables", 2), "is 'z(i' ("),
        ("variables", {"x": "y"}, ("variables",), "must be a list of texts"),
        ("sizes", ["n"], ("sizes",), "must be a mapping such as {n: 4}"),
        ("sizes", {"n": "1/2"}, ("sizes", "n"), "is '1/2' ('1/2' is not an integer)"),
        ("sizes", {"n": "m"}, ("sizes", "n"), "is 'm' (unknown word 'm')"),
        (
            "sizes",
            {"n": "2", "pi": "3"},
            ("sizes", "pi"),
            "is not a valid name; use letters from a to z and digits",
        ),
        ("sizes", {"n": "2", "1x": "3"}, ("sizes", "1x"), "is not a valid name"),
        ("parameters", {"a": "x"}, ("parameters", "a"), "is 'x' (unknown word 'x'"),
        ("parameters", {"a": "b", "b": "1"}, ("parameters", "a"), "is 'b' (unknown word 'b'"),
        ("parameters", {"a": "1/0"}, ("parameters", "a"), "is '1/0' (division by zero)"),
        ("parameters", {"a": "sqrt(-1)"}, ("parameters", "a"), "is 'sqrt(-1)' (it has no finite real value)"),
        ("parameters", {"a": "1e999"}, ("parameters", "a"), "is '1e999' (too large)"),
        ("parameters", {"a": ["1"]}, ("parameters",), "must be a mapping such as {I1: 2}"),
        ("parameters", {"a": "1", "_b": "1"}, ("parameters", "_b"), "is not a valid name"),
        (
            "parameters",
            {"a": "1", "λ": "1"},
            ("parameters", "λ"),
            "is not a valid name; use letters from a to z",
        ),
        ("parameters", {"a": "1", "sum": "1"}, ("parameters", "sum"), "is not a valid name"),
        ("parameters", {"a": "1", "n": "1"}, ("parameters", "n"), "is a size as well; take another name"),
        ("hamiltonian", "y1^2/b", ("hamiltonian",), "is 'y1^2/b' (unknown word 'b'); correct it here"),
        ("hamiltonian", "y4", ("hamiltonian",), "is 'y4' (unknown word 'y4'); correct it here"),
        ("noises", ["y1", "b"], ("noises", 1), "is 'b' (unknown word 'b')"),
        ("noises", {"y1": "1"}, ("noises",), "must be a list of texts"),
        ("noises", [["y1"]], ("noises",), "must be a list of texts"),
        ("noises", ["x(1", "2)"], ("noises", 0), "put an entry with commas in quotes"),
        ("casimirs", ["y1"], ("casimirs", 0), "is 'y1', no Casimir function; its brackets must all be 0"),
    ],
)
def test_errors_name_the_key_and_the_remedy(key, value, keys, message):
    changed = {k: v for k, v in {**GOOD, key: value}.items() if v is not None}
    define(GOOD)
    with pytest.raises(DefinitionError) as error:
        define(changed)
    assert error.value.keys == keys and message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("sigma", "keys", "message"),
    [
        (["1"], ("sigma",), "has 1 entries; must have 2, one for each noise"),
        (["1", "-1"], ("sigma", 1), "is '-1'; must be a number, at least 0"),
        (["1", "y1"], ("sigma", 1), "is 'y1' (unknown word 'y1')"),
        ({"a": "1"}, ("sigma",), "must be a list of texts"),
    ],
)
def test_strengths(sigma, keys, message):
    assert strengths(GOOD, ["a/4", "0"]) == [0.5, 0.0]
    assert strengths(GOOD, "1/i for i = 1..n") == [1.0, 0.5]
    assert strengths(GOOD, None) == [1.0, 1.0]
    with pytest.raises(DefinitionError) as error:
        strengths(GOOD, sigma)
    assert error.value.keys == keys and message in str(error.value)


# --- mutated definitions ---------------------------------------------------------------------------------------------

SMALL = [
    SYSTEMS[name][0]
    for name in ("rigid body", "heavy top", "e(2)", "Toda", "bracket with parameters", "ring of 4 spins")
]
PARTS = (
    "",
    "y1",
    "(",
    ")",
    "^",
    "*",
    "/0",
    "for i = 1..2",
    "..",
    ",",
    "sum(",
    "e",
    "-",
    "0",
    "9" * 30,
    "\0",
    "σ",
    "=",
    "so(3)",
)


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
