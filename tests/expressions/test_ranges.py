"""Between which values an expression lies, and which are constant but for jumps."""

import math

import numpy as np
import pytest

from spi.expressions import as_numpy, is_step, parse_expression, range_of

ALL = -math.inf, math.inf


@pytest.mark.parametrize(
    ("text", "known"),
    [
        ("(1 + (y1 - 3)/abs(y1 - 3))/2", (0, 1)),
        ("abs(y1*y2)/(y1*y2)", (-1, 1)),
        ("abs(y1 - 9)/(9 - y1)", (-1, 1)),
        ("abs(sin(y1))/exp(y1)", ALL),  # as tuples sin(y1) and exp(y1) are equal
        ("1/2 + tanh(10^6*(y1 - 1))/2", (0, 1)),
        ("1/(1 + exp(-100*(y1 - 1)))", (0, 1)),
        ("exp(-y1^2)", (0, 1)),
        ("1/(1 + y1^2)", (0, 1)),
        ("sin(y1)*cos(y2) + 2", (1, 3)),
        ("log(2 + sin(y1))", (0, math.log(3))),
        ("sqrt(1 - y1^2)", (0, 1)),
        ("-(y1^2)^0.3", (-math.inf, 0)),
        ("(sin(y1) - 1)^3", (-8, 0)),
        ("exp(1000*sin(y1))", (0, math.inf)),
        ("y1*y2", ALL),
        ("1/y1^2", ALL),
        ("tan(y1)", ALL),
        ("3", (3, 3)),
    ],
)
def test_values_lie_within_the_range(text, known):
    tree = parse_expression(text, 2)
    low, high = range_of(tree)
    assert (low, high) == pytest.approx(known)
    y = np.random.default_rng(1).standard_cauchy((2, 10_000))
    values = as_numpy(tree)(y)
    values = values[np.isfinite(values)]
    assert values.size and low <= values.min() and values.max() <= high


@pytest.mark.parametrize(
    ("text", "known"),
    [("(1 + (y1 - 3)/abs(y1 - 3))/2", True), ("abs(y1 - 9)/(9 - y1)", True), ("7", True)]
    + [("abs(sin(y1))/exp(y1)", False), ("y1/y1", False), ("sin(y1)", False), ("abs(y1)", False)],
)
def test_steps(text, known):
    assert is_step(parse_expression(text, 2)) == known
