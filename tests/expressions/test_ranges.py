"""Ranges of formulas: by hand, and against values at random states."""

import math

import numpy as np
import pytest

from spi.expressions import as_numpy, parse_expression
from spi.expressions.ranges import range_of


@pytest.mark.parametrize(
    ("text", "low", "high", "jumps"),
    [
        ("y1", -math.inf, math.inf, False),
        ("sin(2*pi*y1)", -1, 1, False),
        ("(1 + (y1 - 0.9)/abs(y1 - 0.9))/2", 0, 1, True),
        ("abs(y1 - 0.9)/(y1 - 0.9)", -1, 1, True),
        ("abs(y1 - 9)/(9 - y1)", -1, 1, True),
        ("3*sin(y1)^2 - cos(y2)", -1, 4, False),
        ("exp(sin(y1))", 0, math.inf, False),
        ("1/(2 + tanh(y1))", 1 / 3, 1, False),
        ("abs(cos(y1) - 3)", 2, 4, False),
        ("y1/y1", -math.inf, math.inf, False),
        ("sin(y1)^3*y2", -math.inf, math.inf, False),
        ("7", 7, 7, True),
    ],
)
def test_ranges(text, low, high, jumps):
    tree = parse_expression(text, 2)
    found = range_of(tree)
    assert found == pytest.approx((low, high, jumps))
    values = as_numpy(tree)(np.random.default_rng(1).standard_normal((2, 1000)) * 3)
    assert low - 1e-12 <= values.min() and values.max() <= high + 1e-12
