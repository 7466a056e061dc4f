"""Test functions of weak errors: the grammar, and values in kernels against Python, NumPy and mpmath."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from spi import expressions
from spi.expressions import as_numpy, canonical, is_step, parse_expression, range_of
from spi.expressions.arithmetic import NumberError
from spi.expressions.ranges import numbered, written_out
from spi.numerics.rng import LANES

PAPER = "sin(2*pi*y1) + sin(2*pi*y2) + sin(2*pi*y3)"


def values_of(texts, y):
    """Values [function, state] of expressions at the states y [component, state]."""
    return np.array([as_numpy(parse_expression(text, 3))(y) for text in texts])


def states(seed=0, scale=1.0):
    return scale * np.random.default_rng(seed).standard_normal((3, LANES))


def close(a, b, tolerance=1e-14):
    """Equal, both NaN, or equal up to an error relative to max(1, |b|)."""
    with np.errstate(all="ignore"):
        same = (a == b) | (np.isnan(a) & np.isnan(b))
        return np.all(same | (np.abs(a - b) <= tolerance * np.maximum(1.0, np.abs(b))))


# --- the grammar -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2*pi*y1", "6.283185307179586*y1"),
        ("-y1^2", "-y1^2"),
        ("(-y1)^2", "(-y1)^2"),
        ("- -y1", "y1"),
        ("y1-(y2-y3)", "y1 - (y2 - y3)"),
        ("(y1-y2)-y3", "y1 - y2 - y3"),
        ("y1/(y2*y3)", "y1/(y2*y3)"),
        ("y1**2**3", "y1^8"),
        ("(y1^2)^3", "(y1^2)^3"),
        ("y1^y2^y3", "y1^y2^y3"),
        ("y1^(1/2)", "sqrt(y1)"),
        ("y1^-2", "1/y1^2"),
        ("y1^1.5", "y1^1.5"),
        ("y1^16", "y1^16"),
        ("y1^-20", "y1^-20"),
        ("2^y1", "2^y1"),
        ("(-2)^y1", "(-2)^y1"),
        ("-2*y1", "-2*y1"),
        ("y1*-0.0", "y1*-0.0"),
        ("y1^1", "y1"),
        ("abs(3+4i)*y1", "5*y1"),
        ("tanh(1)+tanh(y1)", f"{math.tanh(1.0)!r} + tanh(y1)"),
    ],
)
def test_canonical_text(text, expected):
    expression = parse_expression(text, 3)
    assert canonical(expression) == expected
    assert parse_expression(expected, 3) == expression


@pytest.mark.parametrize(
    ("text", "dimension", "reason"),
    [
        ("y4", 3, "unknown word 'y4', the state has y1 .. y3"),
        ("y0", 3, "unknown word 'y0', the state has y1 .. y3"),
        ("y2", 1, "unknown word 'y2', the state has only y1"),
        ("Y1", 3, "unknown word 'Y1', the state has y1 .. y3"),
        ("sine(y1)", 3, "unknown word 'sine', did you mean 'sin'?"),
        ("__import__", 3, "unknown word '__import__'"),
        ("sin y1", 3, "'sin' without parentheses"),
        ("2y1", 3, "unexpected 'y1'"),
        ("y1(2)", 3, "unexpected '('"),
        ("sin(y1", 3, "a parenthesis is not closed"),
        ("y1+", 3, "it ends too early"),
        ("y1/0", 3, "division by zero"),
        ("y1*log(0)", 3, "log(0) has no value"),
        ("y1*10^10^10", 3, "too large"),
        ("y1+2i", 3, "complex"),
        ("y1^(2*i^2)", 3, "complex"),
        ("+".join(["y1"] * 302), 3, "more than 300 operations within each other; sum(a, b, c) has many terms"),
        (
            "+".join(["sum(i*y1 + i^2*y2*y3 + y1 for i = 1..10000)"] * 4),
            3,
            "more than 200000 operations and terms of sums",
        ),
        ("sum(y1 for i = 1..10001)", 3, "the range runs over more than 10000 values"),
        ("y(4)", 3, "there is no y(4); on a ring of n write y(mod(i, n) + 1) for the next"),
        ("max(y1)", 3, "max needs two values or more, as in max(a, b)"),
        ("y1 < 2i", 3, "complex"),
        ("(" * 199 + "y1" + ")" * 199, 3, "too deeply nested"),
    ],
)
def test_bad_expressions(text, dimension, reason):
    with pytest.raises(NumberError) as caught:
        parse_expression(text, dimension)
    assert str(caught.value) == reason


@given(st.text("0123456789.e+-*/^() sincoqrtplgabxy", max_size=30) | st.text(max_size=10))
@settings(deadline=None)
def test_parsing_never_fails_otherwise(text):
    try:
        expression = parse_expression(text, 3)
    except NumberError as error:
        assert str(error)
    else:
        assert parse_expression(canonical(expression), 3) == expression


# --- values ----------------------------------------------------------------------------------------------------------


def grown(inner):
    """(text, function of y in mpmath) made from such pairs."""
    two = st.tuples(inner, inner)

    def binary(sign, function):
        return two.map(lambda t: (f"({t[0][0]}){sign}({t[1][0]})", lambda y: function(t[0][1](y), t[1][1](y))))

    def unary(name, function):
        return inner.map(lambda t: (f"{name}({t[0]})", lambda y: function(t[1](y))))

    return st.one_of(
        binary("+", lambda a, b: a + b),
        binary(" - ", lambda a, b: a - b),
        binary("*", lambda a, b: a * b),
        binary("/ ", lambda a, b: a / b),
        unary("-", lambda a: -a),
        unary("abs", abs),
        *(unary(name, bounded(getattr(mpmath, name))) for name in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt")),
        st.tuples(inner, st.integers(2, 20)).map(lambda t: (f"({t[0][0]})^{t[1]}", lambda y: t[0][1](y) ** t[1])),
    )


def bounded(function):
    """The function of numbers below 1e9: the sine of exp(1e20) would need pi to as many digits, for hours."""

    def f(x):
        if abs(x) > 1e9:
            raise OverflowError
        return function(x)

    return f


LEAVES = st.integers(0, 2).map(lambda k: (f"y{k + 1}", lambda y: y[k])) | st.floats(0.1, 9.0).map(
    lambda x: (repr(x), lambda y: mpmath.mpf(x))
)


@given(st.recursive(LEAVES, grown, max_leaves=6), st.tuples(*[st.floats(-3.0, 3.0, allow_subnormal=False)] * 3))
@settings(deadline=None, max_examples=300)
def test_values_are_those_of_mpmath(pair, y):
    text, function = pair
    try:
        expression = parse_expression(text, 3)
        exact, *coarse = (in_mpmath(function, y, bits) for bits in (200, 39, 40, 41))
    except (ArithmeticError, ValueError):
        assume(False)
    assert parse_expression(canonical(expression), 3) == expression
    assume(all(isinstance(value, mpmath.mpf) and abs(value) < 1e50 for value in (exact, *coarse)))
    # How much rounding matters is seen where it is 2^13 times as large; elsewhere functions have errors of a few ulp.
    # Where it decides everything, as in sin(exp(49)), it may look small by chance, and there is nothing to compare.
    size, rounding = max(1.0, abs(exact)), max(abs(value - exact) for value in coarse)
    assume(rounding < 1e-3 * size)
    tolerance = 1e-13 * size + rounding
    value = float(as_numpy(expression)(np.array(y).reshape(3, 1))[0])
    assume(math.isfinite(value))  # overflow within, or a logarithm of 0 or so by rounding
    assert abs(value - exact) <= tolerance


def in_mpmath(function, y, bits):
    with mpmath.workprec(bits):
        return function([mpmath.mpf(component) for component in y])


EACH = [
    PAPER,
    "exp(-y1^2)*cos(y2) - 3",
    "log(abs(y1)) + sqrt(abs(y2))/y3",
    "-y1^15 + y2^7*y3^-3",
    "abs(y1)^1.5 + y2^20 + 2^y3",
    "tan(y1) + tanh(y2)",
    "sin(cos(y1*y2) + exp(sin(y3)))",
    "sinh(y1) + cosh(y2) + atan(y3)",
    "max(y1, y2, 0) - min(y1, y3)",
    "(y1 < y2) + (y1 > 0.5) + (y2 <= y3) + (y3 >= 0)",
    "sum(i*y(i)^2 + y(mod(i, 3) + 1) for i = 1..3)",
]


def test_every_record_occurs_here():
    text = str([parse_expression(text, 3) for text in EACH])
    assert all(cls.__name__ + "(" in text for cls in vars(expressions).values() if hasattr(cls, "meaning"))


def test_a_sum_over_a_lattice():
    """Against NumPy on a ring of 1,000 spins, one record of the loop; two ranges; comparisons; names of components."""
    n = 1000
    names = [f"{x}({i})" for i in range(1, n + 1) for x in "xyz"]
    s = np.random.default_rng(1).standard_normal((n, 3, 5))
    words = {"n": n, "J": 0.5}
    text = "J*sum(x(i)*x(mod(i+1,n)+1) + y(i)*y(mod(i+1,n)+1) + z(i)*z(mod(i+1,n)+1) for i = 1..n)/n"
    tree = parse_expression(text, 3 * n, names, words)
    expected = 0.5 * (s * np.roll(s, -2, axis=0)).sum(axis=1).mean(axis=0)
    np.testing.assert_allclose(as_numpy(tree)(s.reshape(3 * n, 5)), expected, rtol=1e-12)
    assert expressions.has_sum(tree) and len(str(tree)) < 200_000 and not is_step(tree)
    share = parse_expression("sum(z(i) > 1/2 for i = 1..n)/n", 3 * n, names, words)
    np.testing.assert_allclose(as_numpy(share)(s.reshape(3 * n, 5)), (s[:, 2] > 0.5).mean(axis=0))
    assert is_step(share) and range_of(share) == (0.0, 1.0)
    pairs = parse_expression("sum(y(i)*y(j)/(i + j) for i = 1..3, j = 1..i-1)", 3)
    y = states()
    expected = y[1] * y[0] / 3 + y[2] * y[0] / 4 + y[2] * y[1] / 5
    np.testing.assert_allclose(as_numpy(pairs)(y), expected, rtol=1e-14)
    whole, alone = as_numpy(tree)(s.reshape(3 * n, 5)), as_numpy(tree)(s[:, :, 2:3].reshape(3 * n, 1))
    assert whole[2] == alone[0]  # the order of a sum does not depend on what is evaluated beside


def test_singular_parts_of_new_words():
    assert [part.power for part in as_numpy(parse_expression("max(y1, y2) + (y3 > 0)", 3)).singular] == [1.0, 0.0]
    assert range_of(parse_expression("atan(y1) + max(0, min(y2, 1))", 3)) == (-math.pi / 2, math.pi / 2 + 1)


@pytest.mark.parametrize("scale", [0.1, 1.0, 1e7])
def test_values_of_a_block_do_not_depend_on_what_is_evaluated_beside_it(scale):
    """To the last bit, as results must not depend on how many blocks are computed together."""
    y = np.random.default_rng(3).standard_normal((5, 2, 3, LANES)) * scale  # blocks, paths, components, lanes
    for text in EACH:
        phi = as_numpy(parse_expression(text, 3))
        together = phi(np.moveaxis(y, 2, 0))
        for block in range(5):
            alone = phi(np.moveaxis(y[block : block + 1], 2, 0))
            assert np.array_equal(alone[0], together[block], equal_nan=True), text


def test_what_has_no_value_is_nan_or_infinite():
    y = states()
    y[:, :6] = [math.nan, math.inf, -math.inf, 0.0, 1e300, -0.0]
    texts = ["exp(1000*y1)", "1/y1", "y1^2.5", "y1^-3", "log(y1)", "sqrt(y1)", "y1^y2", "cos(y1*y1)", "2^(1e4*y1)"]
    texts += ["sin(y1)", "tan(y1)", "tanh(y1)", "y1 - y1", "y1^15", "y1^0.5/0.1"]
    assert np.isnan(values_of(texts, y)[:, 0]).all()
    assert values_of(["y1^2.5"], -1.0 - np.abs(y))[0, 10:].tolist() != [0.0]
    assert np.isnan(values_of(["y1^2.5"], -1.0 - np.abs(y))[0, 10:]).all()
    assert (values_of(["exp(1000*y1)"], 1.0 + np.abs(y))[0, 10:] == math.inf).all()


def test_formulas_that_name_others():
    functions = {"m": "y1 + y2", "k": "m^2", "s": "sum(y(k) for k = 1..3)", "most": {"maximum": "k - m"}, "y1": "y1"}
    written = written_out(functions, {"y1", "y2"})
    assert written["k"] == "(y1 + y2)^2" and written["s"] == functions["s"] and written["y1"] == "y1"
    assert written["most"] == {"maximum": "((y1 + y2)^2) - (y1 + y2)"}
    with pytest.raises(NumberError, match="a names b names a"):
        written_out({"a": "b + 1", "b": "2*a"}, ())
    with pytest.raises(NumberError, match="more than 100000 characters"):
        written_out({f"f{i}": f"f{i + 1} + f{i + 1}" for i in range(20)} | {"f20": "y1"}, {"y1"})


def test_an_imaginary_number_is_none_where_i_is_a_component():
    """`2i` is refused beside a component or an index called i, in which it would mean twice that; 2*i is that."""
    assert canonical(parse_expression("2*i*q", 2, ("q", "i"))) == "2*y2*y1"
    for text in ("2i", "2i*q", "sum(2i*y(i) for i = 1..2)"):
        with pytest.raises(NumberError, match=r"unexpected '2i', write 2\*i"):
            parse_expression(text, 2, ("q", "i"))
    with pytest.raises(NumberError, match="complex"):
        parse_expression("2i*q", 2, ("q", "p"))


def test_a_range_stands_for_functions_of_their_own():
    """Each with its index in the name; sums over ranges, functionals and other formulas stay as they are"""
    given = {"E": "E(k)/k for k = 1..n-1", "sum": "sum(y(k) for k = 1..2)", "top": {"maximum": "y1"}, "H": "H"}
    known = {"E1": "E(1)/1", "E2": "E(2)/2"} | {name: given[name] for name in ("sum", "top", "H")}
    assert numbered(given, {"n": 3, "size": 2.5}) == known
    pairs = numbered({"w": "omega_re(i,j) for i = -1..0, j = 1..2"}, {})
    assert pairs == {
        f"w{name}": f"omega_re({i},{j})"
        for name, i, j in (("m1_1", -1, 1), ("m1_2", -1, 2), ("0_1", 0, 1), ("0_2", 0, 2))
    }
    for functions, message in (
        ({"E1": "y1", "E": "E(k) for k = 1..2"}, "there are two functions E1"),
        ({"E": "E(k) for k = 1"}, "is not a range"),
        ({"E": "E(k) for k = 1..m"}, "unknown word 'm'"),
    ):
        with pytest.raises(NumberError, match=message):
            numbered(functions, {})
