"""Functions chosen by record type: the same in Python and compiled."""

from typing import NamedTuple

import numpy as np
import pytest
from helpers import ONE_NOISE, RIGID_BODY, compiled_only
from numba import TypingError, njit

from spi.compiler.dispatch import INDICES, OPTIONS, answers, looped, method, number, only_where, trait, unrolled
from spi.compiler.inlining import uncompiled
from spi.compiler.records import class_of, is_none
from spi.ensemble.protocol import (
    component_indices,
    dimension,
    drift_angle,
    drift_flow,
    hamiltonian,
    noise_indices,
    noises,
    pieces,
    strengths,
)

compiled = njit(**OPTIONS)


@method
def area(shape, scale):
    """The area, scaled."""


@method(default=True)
def corners(shape):
    """The number of corners; most shapes have none."""
    return 0


@method(optional=True)
def diagonal(shape):
    """The diagonal of a shape that has one."""


@trait(bool, default=False)
def straight(shape):
    """Whether no side is curved."""


class Circle(NamedTuple):
    radius: float

    def area(shape, scale):
        return 3.0 * shape.radius * shape.radius * scale


class Square(NamedTuple):
    side: float

    straight = True

    def area(shape, scale):
        return shape.side * shape.side * scale

    def corners(shape):
        return 4

    def diagonal(shape):
        return shape.side * 2.0**0.5


class Line(NamedTuple):
    length: float
    area: float = 0.0  # a field, which is no answer to the word

    def corners(shape):
        return 2

    def straight(shape):
        return True


@compiled
def areas(a, b, scale):
    return area(a, scale), area(b, scale), corners(a), corners(b)


@compiled
def straightness(a, b, c):
    return straight(a), straight(b), straight(c)


@compiled
def area_of(shape, scale):
    return area(shape, scale)


# --- words -----------------------------------------------------------------------------------------------------------


def test_words_mean_what_the_record_says():
    expected = (24.0, 18.0, 0, 4)
    a, b = Circle(2.0), Square(3.0)
    assert (area(a, 2.0), area(b, 2.0), corners(a), corners(b)) == expected
    assert areas(a, b, 2.0) == expected
    assert areas(b, a, 2.0) == (18.0, 24.0, 4, 0)


def test_a_missing_meaning_is_named():
    with pytest.raises(TypeError, match=r"area has no meaning for Line"):
        area(Line(1.0), 1.0)
    with pytest.raises(TypeError, match=r"hamiltonian has no meaning for Circle"):
        hamiltonian(Circle(1.0), (1.0, 2.0, 3.0))
    with pytest.raises(TypeError, match=r"drift_flow has no meaning for float"):
        drift_flow(1.0, 0, 0.1, (1.0,), None)


@compiled_only
def test_a_missing_meaning_is_an_error_while_compiling():
    with pytest.raises(TypingError, match="area"):
        area_of(Line(1.0), 1.0)
    with pytest.raises(TypingError, match="area"):
        area_of(1.0, 1.0)


def test_defaults():
    assert corners(Circle(1.0)) == 0 and corners(Square(1.0)) == 4
    assert drift_angle(Circle(1.0), 0, 1.0, (1.0,)) == 0.0
    assert drift_angle(RIGID_BODY, 0, 3.0, (-2.0, 0.0, 0.0)) == 3.0


def test_capabilities():
    assert answers(diagonal, Square(1.0)) and answers(diagonal, Square)
    assert not answers(diagonal, Circle(1.0)) and not answers(diagonal, Circle)
    assert not answers(area, Line)
    with pytest.raises(TypeError, match="diagonal has no meaning for Circle"):
        diagonal(Circle(1.0))


def test_facts():
    """Of a record, of its class and in compiled code; with a default; and found by a method."""
    expected = (False, True, True)
    assert tuple(map(straight, (Circle, Square, Line))) == expected
    shapes = Circle(1.0), Square(1.0), Line(1.0)
    assert tuple(map(straight, shapes)) == straightness(*shapes) == expected
    with pytest.raises(TypeError, match="dimension has no meaning for Circle"):
        dimension(Circle(1.0))


# --- constants -------------------------------------------------------------------------------------------------------


@trait
def fields_of(record):
    """How many fields a record has."""
    return len(class_of(record)._fields)


@compiled
def sizes(model):
    return fields_of(model), dimension(model), pieces(model), noises(model), component_indices(model)


@compiled
def strengths_of(model):
    return strengths(model)


def test_constants():
    assert sizes(RIGID_BODY) == sizes(ONE_NOISE) == (3, 3, 3, 3, (0, 1, 2))
    assert (fields_of(RIGID_BODY), dimension(RIGID_BODY), component_indices(RIGID_BODY)) == (3, 3, (0, 1, 2))
    for k, index in enumerate(INDICES):
        assert number(index()) == k


@pytest.mark.parametrize("sigma", [(1.0, 2.0, 3.0), (None, 2.0, None), (0.5, None, None), (None, None, None)])
def test_strengths_of_noises_on_and_off(sigma):
    model = RIGID_BODY._replace(sigma=sigma)
    expected = tuple(0.0 if s is None else s for s in sigma)
    assert strengths(model) == strengths_of(model) == expected
    assert noise_indices(model) == tuple(k for k in range(3) if sigma[k] is not None)


# --- unrolled -------------------------------------------------------------------------------------------------------


@unrolled(noise_indices)
def digits(index, model, value, base, shift):
    """Not commutative, so that the order of the indices is seen."""
    return value * base + (number(index) + 1) * strengths(model)[number(index)] + shift


@compiled
def digits_compiled(model, value, base, shift):
    return digits(model, value, base, shift)


@pytest.mark.parametrize(
    ("model", "expected"),
    [
        (RIGID_BODY, 7123.0),
        (ONE_NOISE, 71.0),
        (RIGID_BODY._replace(sigma=(1.0, None, 2.0)), 716.0),
        (RIGID_BODY._replace(sigma=(None, None, None)), 7.0),
    ],
)
def test_unrolled_is_a_fold_in_order(model, expected):
    assert digits(model, 7.0, 10.0, 0.0) == expected
    assert digits_compiled(model, 7.0, 10.0, 0.0) == expected


@unrolled(each="a[i] - c * b[i]")
def difference(a, c, b):
    """a - c b."""


@unrolled(total="c - a[i] * a[i]")
def total(c, a):
    """sum_i (c - a_i^2); the tuple is not the first argument."""


@compiled
def tuplewise_compiled(a, c, b):
    return difference(a, c, b), total(c, a)


@pytest.mark.parametrize("n", [1, 2, 3, 8])
def test_tuplewise(n):
    # Small integers, so that fused operations round as separate ones do: not at all.
    a, b = tuple(float(i + 1) for i in range(n)), tuple(float(i * i - 3) for i in range(n))
    expected = tuple(x - 2.0 * y for x, y in zip(a, b, strict=True)), sum(2.0 - x * x for x in a)
    assert (difference(a, 2.0, b), total(2.0, a)) == expected
    assert tuplewise_compiled(a, 2.0, b) == expected


# --- looped and only_where --------------------------------------------------------------------------------------------

BLOCKS, SHIFT = (0, 20), 7.0


@looped(("for k in places", "for n in range(k, k + 3)"), "a[n] = c * b[n] + SHIFT", "b[n] = 0.0", places=BLOCKS)
def moved(a, c, b): ...
@only_where(lambda wish: not is_none(wish))
@looped(("for n in range(len(a))",), "a[n] += 1.0")
def raised(wish, a):
    """Add 1."""


@compiled
def looped_compiled(a, c, b):
    moved(a, c, b)
    raised(None, a)
    raised(1, b)


def looped_in_python(a, c, b):
    with uncompiled():
        moved(a, c, b)
        raised(None, a)
        raised(1, b)


@pytest.mark.parametrize("run", [looped_compiled, looped_in_python])
def test_looped_writes_loops_and_only_where_leaves_out(run):
    a, b = np.zeros(24), np.arange(24.0)
    run(a, 2.0, b)
    on = [0, 1, 2, 20, 21, 22]
    assert np.flatnonzero(a).tolist() == on
    assert a[on].tolist() == [7.0, 9.0, 11.0, 47.0, 49.0, 51.0]  # 2 n + 7, not raised
    assert np.delete(b, on).tolist() == np.delete(np.arange(1.0, 25.0), on).tolist()
    assert b[on].tolist() == [1.0] * 6


def test_looped_functions_have_a_formula_for_a_docstring():
    assert (moved.__doc__, raised.__doc__) == ("a[n] = c * b[n] + SHIFT; b[n] = 0.0", "Add 1.")
    assert moved.__module__ == __name__
