"""Eight floats in one vector register, and products of a small matrix with two such vectors per row.

Loops over lanes become vector instructions by themselves where there are many lanes (``lanes.py``).  Models whose
states are arrays have few paths or columns at a time, and Numba makes vectors of so short a loop only sometimes; so
they say what is a vector.  In Python a vector is a NumPy array of eight floats.
"""

import operator

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models, register_default
from numba.extending import lower_builtin, type_callable

from .dispatch import instructions

WIDTH = 8  #: floats in a vector
TILE = 2 * WIDTH  #: columns of a tile

_FUSED = ("contract",)  # a product and a sum in one rounding
_DOUBLES = ir.VectorType(ir.DoubleType(), WIDTH)


class Vector(types.Type):
    """The Numba type of a vector."""

    def __init__(self):
        super().__init__("Vector")


VECTOR = Vector()


@register_default(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _DOUBLES)


def load(array, i):
    """array[i : i + WIDTH]."""
    return np.array(array[i : i + WIDTH])


def store(array, i, vector):
    """array[i : i + WIDTH] = vector."""
    array[i : i + WIDTH] = vector


def largest(vector):
    """The largest of the eight; NaN only if the first is."""
    return max(float(x) for x in vector)


def _pointer(context, builder, array_type, array, i, numba_vector=_DOUBLES):
    data = cgutils.create_struct_proxy(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [i]), numba_vector.as_pointer())


@instructions(load)
def _(array, i):
    def code(context, builder, signature, arguments):
        return builder.load(_pointer(context, builder, array, *arguments), align=8)

    return VECTOR(array, types.int64), code


@instructions(store)
def _(array, i, vector):
    def code(context, builder, signature, arguments):
        builder.store(arguments[2], _pointer(context, builder, array, *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, vector), code


@instructions(largest)
def _(vector):
    def code(context, builder, signature, arguments):
        found = builder.extract_element(arguments[0], ir.Constant(ir.IntType(32), 0))
        for lane in range(1, WIDTH):
            other = builder.extract_element(arguments[0], ir.Constant(ir.IntType(32), lane))
            found = builder.select(builder.fcmp_ordered(">", other, found), other, found)
        return found

    return types.float64(VECTOR), code


def _spread(builder, number, vector):
    """A vector of one number."""
    size, zero = vector.count, ir.Constant(ir.IntType(32), 0)
    lone = builder.insert_element(ir.Constant(vector, ir.Undefined), number, zero)
    mask = ir.Constant(ir.VectorType(ir.IntType(32), size), [0] * size)
    return builder.shuffle_vector(lone, ir.Constant(vector, ir.Undefined), mask)


def _arithmetic(operation, write):
    """Let `operation` take vectors, and vectors and numbers."""

    @type_callable(operation)
    def types_of_call(context):
        def typer(a, b):
            if VECTOR in (a, b) and all(t == VECTOR or isinstance(t, types.Float) for t in (a, b)):
                return VECTOR
            return None

        return typer

    for a, b in ((Vector, Vector), (Vector, types.Float), (types.Float, Vector)):

        @lower_builtin(operation, a, b)
        def code(context, builder, signature, arguments):
            vectors = (
                value if t == VECTOR else _spread(builder, value, _DOUBLES)
                for t, value in zip(signature.args, arguments, strict=True)
            )
            return getattr(builder, write)(*vectors, flags=_FUSED)


_arithmetic(operator.add, "fadd")
_arithmetic(operator.sub, "fsub")
_arithmetic(operator.mul, "fmul")


def multiply_tile(matrix, first, columns, x, x_first, stride, out, out_first, out_stride, rows):
    """out = A x for A (rows, columns) and a tile x of `columns` rows, all in flat arrays of float64.

    A[r, c] is matrix[first + r * columns + c], x[c, j] is x[x_first + c * stride + j] for j < TILE, and out[r, j] goes
    to out[out_first + r * out_stride + j].  Sums are from c = 0 on, each product and sum rounded once.
    """
    for r in range(rows):
        for j in range(TILE):
            total = 0.0
            for c in range(columns):
                total += matrix[first + r * columns + c] * x[x_first + c * stride + j]
            out[out_first + r * out_stride + j] = total


@instructions(multiply_tile)
def _(matrix, first, columns, x, x_first, stride, out, out_first, out_stride, rows):
    number = types.int64
    signature = types.void(matrix, number, number, x, number, number, out, number, number, number)

    def code(context, builder, signature, arguments):
        _, first, columns, _, x_first, stride, _, out_first, out_stride, rows = arguments
        a, b, c = (
            cgutils.create_struct_proxy(signature.args[i])(context, builder, arguments[i]).data for i in (0, 3, 6)
        )
        a, b, c = (builder.gep(data, [i]) for data, i in ((a, first), (b, x_first), (c, out_first)))
        done = cgutils.alloca_once_value(builder, ir.Constant(ir.IntType(64), 0))
        for height in (4, 2, 1):  # rows that go together: more would need more registers than AVX2 has
            _rows_together(builder, height, a, columns, b, stride, c, out_stride, rows, done)
        return context.get_dummy_value()

    return signature, code


def _rows_together(builder, height, matrix, columns, x, stride, out, out_stride, rows, done):
    """The rows from `done` on, `height` at a time while there are so many."""
    integer, vector = ir.IntType(64), ir.VectorType(ir.DoubleType(), TILE)
    together, one = ir.Constant(integer, height), ir.Constant(integer, 1)
    test, body = builder.append_basic_block("rows"), builder.append_basic_block("together")
    inner, store, end = (builder.append_basic_block(name) for name in ("columns", "store", "end"))
    builder.branch(test)

    builder.position_at_end(test)
    row = builder.load(done)
    builder.cbranch(builder.icmp_signed("<=", builder.add(row, together), rows), body, end)

    builder.position_at_end(body)
    starts = [
        builder.gep(matrix, [builder.mul(builder.add(row, ir.Constant(integer, r)), columns)]) for r in range(height)
    ]
    builder.branch(inner)

    builder.position_at_end(inner)
    column = builder.phi(integer)
    sums = [builder.phi(vector) for _ in range(height)]
    tile = builder.load(_as_vector(builder, builder.gep(x, [builder.mul(column, stride)]), vector), align=8)
    new = []
    for start, total in zip(starts, sums, strict=True):
        factor = builder.load(builder.gep(start, [column]))
        product = builder.fmul(_spread(builder, factor, vector), tile, flags=_FUSED)
        new.append(builder.fadd(product, total, flags=_FUSED))
    following = builder.add(column, one)
    column.add_incoming(ir.Constant(integer, 0), body)
    column.add_incoming(following, inner)
    for total, value in zip(sums, new, strict=True):
        total.add_incoming(ir.Constant(vector, [0.0] * TILE), body)
        total.add_incoming(value, inner)
    builder.cbranch(builder.icmp_signed("<", following, columns), inner, store)

    builder.position_at_end(store)
    for r, value in enumerate(new):
        place = builder.mul(builder.add(row, ir.Constant(integer, r)), out_stride)
        builder.store(value, _as_vector(builder, builder.gep(out, [place]), vector), align=8)
    builder.store(builder.add(row, together), done)
    builder.branch(test)
    builder.position_at_end(end)


def _as_vector(builder, pointer, vector):
    return builder.bitcast(pointer, vector.as_pointer())
