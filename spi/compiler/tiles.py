"""Products of a small matrix with two vectors per row."""

from llvmlite import ir
from numba import types
from numba.core import cgutils

from .dispatch import intrinsic
from .vectors import FUSED, TILE, spread


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


@intrinsic(multiply_tile)
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
    """The rows from `done` on, `height` at a time while there are that many."""
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
        product = builder.fmul(spread(builder, factor, vector), tile, flags=FUSED)
        new.append(builder.fadd(product, total, flags=FUSED))
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
