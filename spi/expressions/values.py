"""Values of expressions: of arrays of states, of one state, and in kernels, of the lanes of a block."""

from functools import lru_cache

import numpy as np
from numba import types
from numba.extending import overload

from ..compiler.dispatch import INDICES, INLINED, device, kernel, number
from ..compiler.records import record_class
from ..ensemble.lanes import load_lane
from ..numerics.angles import ANY_ANGLES, REDUCED_ANGLES, sin_versine
from ..numerics.elementary import REDUCIBLE, bits, exp, log
from ..numerics.rng import LANES
from .trees import Component, Constant, Cosine, Sine, WholePower, parse_expression

_REDUCIBLE_BITS = int(bits(REDUCIBLE))


def as_numpy(expression):
    """The function phi(y) of arrays y of shape (d, ...) with values of shape (...)."""

    def value(e, y):
        if isinstance(e, Constant):
            return np.full(y.shape[1:], e.value)
        if isinstance(e, Component):
            return y[number(e.index)]
        if isinstance(e, WholePower):
            return np.power(value(e.a, y), number(e.exponent))
        return e.meaning.array(*(value(operand, y) for operand in e))

    def phi(y):
        with np.errstate(all="ignore"):
            return np.array(value(expression, np.asarray(y, float)))  # never a view of y

    return phi


def functions_of(texts, dimension):
    """:func:`as_numpy` of each of some texts.

    What is kept by its arguments (``lru_cache``) takes texts: as trees sin(y1) and exp(y1) are equal tuples.
    """
    return [as_numpy(parse_expression(text, dimension)) for text in texts]


def divided(a, b):
    """a / b, also for b = 0."""
    return np.divide(a, b)


overload(divided, jit_options=INLINED)(lambda a, b: lambda a, b: a / b)

#: What generated code may call.
_NAMES = {"np": np, "bits": bits, "divided": divided, "exp": exp, "log": log, "sin_versine": sin_versine}


def evaluate(expression, y, angles):
    """phi(y) for a state, a tuple of floats; `angles` says how large arguments of sines and cosines may be."""
    return value_and_angle(expression, y, angles)[0]


def value_and_angle(expression, y, angles):
    """phi(y), and the bits of the largest |argument| of a sine or cosine in it (0 if there is none).

    If that is more than `angles` allows, both may be wrong, but the second is still too large: bits are ordered as the
    numbers, and those of a NaN exceed those of every number.
    """
    with np.errstate(all="ignore"):
        return _function(_shape(expression))(expression, y, angles)


@overload(evaluate, jit_options=INLINED)
def _(expression, y, angles):
    return lambda expression, y, angles: value_and_angle(expression, y, angles)[0]


@overload(value_and_angle, jit_options=INLINED, strict=False)
def _(expression, y, angles):
    return _function(_shape(expression))


def _shape(expression):
    """The classes of a tree, or of the Numba type of one, as nested tuples: all that decides the code."""
    cls = record_class(expression) if isinstance(expression, types.Type) else type(expression)
    if cls is Constant:
        return (Constant,)
    fields = expression.types if isinstance(expression, types.Type) else expression
    return (cls, *map(_shape, fields))


@lru_cache
def _function(shape):
    """The Python function ``value_and_angle`` for trees of one shape, one line for each record."""
    lines, angles = [], []

    def name(code):
        """Write a line that gives a name to some code."""
        lines.append(f"v{len(lines)} = {code}")
        return f"v{len(lines) - 1}"

    def write(shape, record):
        """Write the lines for the tree in the variable `record`; returns the name of its value."""
        cls, *parts = shape
        if cls is Constant:
            return name(f"{record}.value")
        if cls is Component:
            return f"y[{INDICES.index(parts[0][0])}]"
        parts = parts[:1] if cls is WholePower else parts
        # Long paths into a record cost much compile time, so each part has a name, unless it has no run-time values.
        values = [
            write(part, name(f"{record}.{field}") if Constant in _classes(part) else None)
            for part, field in zip(parts, cls._fields, strict=False)
        ]
        if cls in (Sine, Cosine):
            angles.append(values[0])
        if cls is not WholePower:
            return name(cls.meaning.code.format(*values))
        power = values[0]
        for digit in bin(INDICES.index(shape[2][0]))[3:]:  # the binary digits of the exponent after the first
            power = name(f"{power} * {power}")
            power = name(f"{power} * {values[0]}") if digit == "1" else power
        return power

    value = write(shape, "expression")
    largest = "0"
    for angle in angles:
        largest = name(f"max({largest}, bits(abs({angle})))")
    source = "\n    ".join(["def phi(expression, y, angles):", *lines, f"return {value}, {largest}"])
    exec(source, names := dict(_NAMES))
    return names["phi"]


@lru_cache
def _classes(shape):
    """The classes that occur in a shape."""
    return frozenset().union(shape[:1], *map(_classes, shape[1:]))


# ---------------------------------------------------------------------------------------------------------------------
# Values on the lanes of a block
# ---------------------------------------------------------------------------------------------------------------------


@kernel
def evaluate_lanes(functions, model, y, values):
    """values[f, lane] = phi_f(y) for a tuple of expressions and the states of one block, d * LANES floats."""
    fill(functions, model, y, values)


def fill(functions, model, y, values):
    """The same, one function after the other."""
    for expression, row in zip(functions, values, strict=True):
        fill_row(expression, model, y, row)


@overload(fill, jit_options=INLINED)
def _(functions, model, y, values):
    if len(functions) == 0:
        return lambda functions, model, y, values: None

    def first_then_rest(functions, model, y, values):
        fill_row(functions[0], model, y, values[0])
        fill(functions[1:], model, y, values[1:])

    return first_then_rest


@device
def fill_row(expression, model, y, row):
    """row[lane] = phi(y), with sines in vector instructions unless a lane has an angle too large for them."""
    largest = 0
    for lane in range(LANES):
        row[lane], angle = value_and_angle(expression, load_lane(model, y, lane), REDUCED_ANGLES)
        largest = max(largest, angle)
    if largest > _REDUCIBLE_BITS:
        for lane in range(LANES):
            row[lane] = evaluate(expression, load_lane(model, y, lane), ANY_ANGLES)
