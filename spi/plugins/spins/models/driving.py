"""Fields of spins that depend on time, frozen over each step: H is linear in them, so that a step has their means.

A component of a field that is a text is a course c(t).  Kernels evaluate it as a row of operations on a stack: numbers
and courses of another lattice need no compilation anew.
"""

import functools
from typing import Annotated, Any, NamedTuple

import numpy as np
import pydantic
from pydantic_core import PydanticCustomError

from spi.compiler.dispatch import FieldOf, device
from spi.ensemble import protocol
from spi.expressions import Component, Constant, WholePower, canonical, is_constant, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.models.delegation import answering_as_inner
from spi.numerics.averages import NODES, mean
from spi.numerics.elementary import exp, log, sin_cos_huge

from .kernels import Form, SpinTables

#: Operations by their names in ``spi.expressions``; a number and t come first.
_OF_ONE = ("Negative", "Sine", "Cosine", "Exponential", "Logarithm", "SquareRoot", "Absolute", "HyperbolicTangent")
_OF_TWO = ("Sum", "Difference", "Product", "Quotient", "Power", "Maximum", "Minimum", "Less", "Greater")
NUMBER, TIME, FIRST = 0, 1, 2
_CODES = {name: FIRST + n for n, name in enumerate((*_OF_ONE, *_OF_TWO))}
_NEGATIVE, _SINE, _COSINE, _EXP, _LOG, _ROOT, _ABSOLUTE, _TANH = (_CODES[name] for name in _OF_ONE)
_SUM, _DIFFERENCE, _PRODUCT, _QUOTIENT, _POWER, _MAXIMUM, _MINIMUM, _LESS, _GREATER = (_CODES[n] for n in _OF_TWO)
_MOST = 64  # numbers on the stack


def _tree(text: str) -> Any:
    return parse_expression(text, 1, ("t",))


def course(given: Any) -> float | str:
    """Number that is given, or course in its least text; the error about what is neither."""
    try:
        tree = _tree(str(given))
        _operations(tree)
    except NumberError as error:
        said = {
            "fault": f"is '{given}' ({error})",
            "right": "must be a number, or a function of t such as 2*cos(0.1*t)",
        }
        raise PydanticCustomError("spec", "{fault}; {right}", {**said, "keys": ()}) from None
    return float(tree.value) if is_constant(tree) else canonical(tree).replace("y1", "t")


#: A component of a field: a number, or a course.
Course = Annotated[float | str, pydantic.PlainValidator(course, json_schema_input_type=float | str)]


def _operations(tree: Any) -> list[tuple[int, float]]:
    """(operation, number) one after the other, operands before what is done with them."""
    if isinstance(tree, Constant):
        return [(NUMBER, tree.value)]
    if isinstance(tree, Component):
        return [(TIME, 0.0)]
    if isinstance(tree, WholePower):
        return [*_operations(tree.a), (NUMBER, float(tree.exponent)), (_POWER, 0.0)]
    name = type(tree).__name__
    if name not in _CODES:
        raise NumberError(f"{name} is not known here")
    return [*(entry for operand in tree for entry in _operations(operand)), (_CODES[name], 0.0)]


def is_driven(model: Any) -> bool:
    """Whether a component of the field of a model is a course."""
    return any(isinstance(entry, str) for entry in np.ravel(np.array(model.field, object)))


@functools.lru_cache(8)
def courses_of(field: Any) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """(rows, 3) numbers, 0 for courses; (rows, 3) the course of a component, -1 for a number; the courses."""
    given = np.reshape(np.array(field, object), (-1, 3))
    texts = tuple(dict.fromkeys(entry for entry in given.ravel() if isinstance(entry, str)))
    which = np.array([texts.index(e) if isinstance(e, str) else -1 for e in given.ravel()]).reshape(-1, 3)
    return np.where(which < 0, np.where(which < 0, given, 0.0).astype(float), 0.0), which, texts


def value_at(text: str, t: float) -> float:
    """A course at a time."""
    operations, numbers, _ = _rows((text,))
    return float(course_at(operations, numbers, 0, len(operations), t, np.empty(_MOST)))


@functools.lru_cache(8)
def _rows(texts: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Operations and numbers of courses, and where each begins."""
    each = [_operations(_tree(text)) for text in texts]
    operations, numbers = np.array([entry for rows in each for entry in rows], float).reshape(-1, 2).T
    return operations.astype(np.int64), np.ascontiguousarray(numbers), np.cumsum([0, *map(len, each)])


@device(inline=False)
def course_at(operations, numbers, first, last, t, stack):
    """Value of the operations from `first` to before `last` at the time t."""
    top = -1
    for n in range(first, last):
        operation = operations[n]
        if operation < FIRST:
            top += 1
            stack[top] = t if operation == TIME else numbers[n]
            continue
        if operation >= _SUM:
            top -= 1
            stack[top] = _of_two(operation, stack[top], stack[top + 1])
        else:
            stack[top] = _of_one(operation, stack[top])
    return stack[0]


@device
def _of_one(operation, a):
    s, c = sin_cos_huge(a)
    if operation == _NEGATIVE:
        return -a
    if operation == _SINE:
        return s
    if operation == _COSINE:
        return c
    if operation == _EXP:
        return exp(a)
    if operation == _LOG:
        return log(a)
    if operation == _ROOT:
        return np.sqrt(a)
    if operation == _TANH:
        small = exp(-2.0 * abs(a))
        return np.copysign((1.0 - small) / (1.0 + small), a)
    return abs(a)


@device
def _of_two(operation, a, b):
    if operation == _SUM:
        return a + b
    if operation == _DIFFERENCE:
        return a - b
    if operation == _PRODUCT:
        return a * b
    if operation == _QUOTIENT:
        return a / b
    if operation == _MAXIMUM:
        return max(a, b)
    if operation == _MINIMUM:
        return min(a, b)
    if operation == _LESS:
        return 1.0 if a < b else 0.0
    if operation == _GREATER:
        return 1.0 if a > b else 0.0
    if b == 0.0:
        return 1.0
    size = exp(b * log(abs(a)))  # a power: of a negative number only where the exponent is whole
    if a >= 0.0:
        return size
    if b != np.floor(b):
        return np.nan
    return size if b == 2.0 * np.floor(0.5 * b) else -size


@answering_as_inner(*(name for name in vars(protocol) if name not in vars(SpinTables)))
class DrivenTables(NamedTuple):
    """A lattice of spins whose field depends on time; in a step it is the ``SpinTables`` of that step."""

    model: SpinTables  #: with the parts of the field that do not
    which: np.ndarray  #: (sites, 3) the course of a component, -1 if there is none
    operations: np.ndarray
    numbers: np.ndarray
    begins: np.ndarray  #: (courses + 1,) where those of a course begin
    sigma: np.ndarray
    d: int
    p: int
    q: int
    m: int
    start: float  #: t at the beginning of the experiment

    large, in_place = True, True
    conserved, sphere_size = 1, 3
    dimension, pieces, frictions, noises = FieldOf("d"), FieldOf("p"), FieldOf("q"), FieldOf("m")

    @classmethod
    def of(cls, tables: SpinTables, which: np.ndarray, texts: tuple[str, ...], start: float) -> "DrivenTables":
        """Record of a lattice at rest, of which the sites have these courses."""
        return cls(tables, which, *_rows(texts), tables.sigma, tables.d, tables.p, tables.q, tables.m, start)

    def frozen(model, begin, h):
        courses = model.which, model.operations, model.numbers, model.begins
        return tables_of_step(model.model, *courses, model.start + begin, h)


@device(inline=False)
def tables_of_step(rest, which, operations, numbers, begins, begin, h):
    """Record of a step from `begin` on with the means of the courses over it, and axes and bounds of their fields."""
    values, stack, at = np.empty(len(begins) - 1), np.empty(_MOST), np.empty(5)
    for k in range(len(values)):
        for n in range(5):
            at[n] = course_at(operations, numbers, begins[k], begins[k + 1], begin + NODES[n] * h, stack)
        values[k] = mean(at[0], at[1], at[2], at[3], at[4])
    field, rate, frames, fastest = rest.field.copy(), rest.rate.copy(), rest.frames.copy(), rest.fastest.copy()
    largest = 0.0
    for i in range(len(which)):
        size = 0.0
        for a in range(3):
            if which[i, a] >= 0:
                field[i, a] += rest.moment[i] * values[which[i, a]]
                size += values[which[i, a]] * values[which[i, a]]
        largest = max(largest, np.sqrt(size))
    for k in range(len(rest.form)):
        form = rest.form[k]
        if form == Form.FIELDS or form == Form.SITES or form == Form.DAMPED_SITES:
            fastest[k] += largest
        if form == Form.FIELDS:
            for e in range(rest.first[k], rest.first[k + 1]):
                i, row = rest.member[e, 0], rest.frame[e]
                x, y, z = field[i, 0], field[i, 1], field[i, 2]
                rate[e] = np.sqrt(x * x + y * y + z * z)
                frames[row, 0] = x / rate[e] if rate[e] > 0.0 else 1.0
                frames[row, 1] = y / rate[e] if rate[e] > 0.0 else 0.0
                frames[row, 2] = z / rate[e] if rate[e] > 0.0 else 0.0
    return SpinTables(
        rest.form,
        rest.first,
        rest.member,
        rate,
        rest.frame,
        rest.member_lanes,
        frames,
        fastest,
        rest.neighbours,
        rest.other,
        rest.coupling,
        rest.other_lanes,
        rest.lane_table,
        rest.couplings,
        rest.isotropic,
        field,
        rest.axes,
        rest.uniaxial,
        rest.cubic,
        rest.moment,
        rest.strength,
        rest.noise_axis,
        rest.noise_rows,
        rest.alpha,
        rest.temperature,
        rest.sigma,
        rest.d,
        rest.p,
        rest.q,
        rest.m,
    )
