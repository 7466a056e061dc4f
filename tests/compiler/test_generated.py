"""Functions made of texts, and functions chosen by type."""

import traceback

import numpy as np
import pytest
from helpers import COMPILED
from numba import TypingError, njit

from spi.compiler.dispatch import OPTIONS, device, unrolled
from spi.compiler.generated import function_of
from spi.compiler.records import is_array, is_none

compiled = njit(**OPTIONS)


def raised(function, *arguments):
    """What Python prints of the error of a call."""
    with pytest.raises(ZeroDivisionError) as error:
        function(*arguments)
    return "".join(traceback.format_exception(error.value))


def test_a_traceback_shows_the_line_of_a_generated_function():
    shares = function_of(["def shares(a, b):", "c = a + offset", "return c / b"], {"offset": 1})
    assert shares(1, 2) == 1.0
    assert "return c / b" in raised(shares, 1, 0)
    other = function_of(["def shares(a, b):", "return a / b  # another"], {})
    assert "# another" in raised(other, 1, 0) and "# another" not in raised(shares, 1, 0)


@unrolled(each="a[i] / b")
def quotient(a, b):
    """a / b."""


def test_a_traceback_shows_the_line_of_what_is_unrolled():
    assert quotient((1.0, 2.0), 4.0) == (0.25, 0.5)
    assert "return (a[0] / b, a[1] / b, )" in raised(quotient, (1.0, 2.0), 0.0)


@pytest.mark.skipif(not COMPILED, reason="about the compiler")
def test_the_compiler_shows_the_line_of_a_generated_function():
    add = compiled(function_of(["def add(a, b):", "c = b", "return a + c"], {}))
    with pytest.raises(TypingError, match=r"(?s)add made by .*return a \+ c"):
        add(1.0, "text")


@device(by_type=True)
def size(value):
    """A number for each type."""
    if is_none(value):
        return lambda value: 0
    return (lambda value: len(value)) if is_array(value) else (lambda value: 1)


@compiled
def size_compiled(value):
    return size(value)


@pytest.mark.parametrize(("value", "expected"), [(None, 0), (np.zeros(3), 3), (2.0, 1)])
def test_a_function_is_chosen_by_type(value, expected):
    assert size(value) == size_compiled(value) == expected
