"""Functions made of texts, and functions chosen by type."""

import traceback
from typing import NamedTuple

import numpy as np
import pytest
from helpers import COMPILED
from numba import TypingError, njit

from spi.compiler.dispatch import OPTIONS, calling, device, function_of
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


@pytest.mark.skipif(not COMPILED, reason="about the compiler")
def test_the_compiler_shows_the_line_of_a_generated_function():
    add = compiled(function_of(["def add(a, b):", "c = b", "return a + c"], {}))
    with pytest.raises(TypingError, match=r"(?s)add made by .*return a \+ c"):
        add(1.0, "text")


@device
def length(value):
    return len(value)


@device(by_type=True)
def size(value):
    """A number for each type, by a bare function or a decorated one."""
    if is_none(value):
        return lambda value: 0
    return length if is_array(value) else (lambda value: 1)


@device(by_type=True)
def clear(value):
    """Nothing is done but to arrays."""
    return clear_array if is_array(value) else None


def clear_array(value):
    value[:] = 0.0


@compiled
def size_compiled(value):
    clear(value)
    return size(value)


@pytest.mark.parametrize(("value", "expected"), [(None, 0), (np.ones(3), 3), (2.0, 1)])
def test_a_function_is_chosen_by_type(value, expected):
    assert size(value) == size_compiled(value) == expected
    assert clear(value) is None and not np.any(value if is_array(value) else 0.0)


class Half(NamedTuple):
    """A record that has no part in what its method does."""

    length = calling(length, "half")


def test_a_method_may_leave_out_its_record():
    assert Half.length(Half(), np.ones(2)) == 2
