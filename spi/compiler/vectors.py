"""Eight floats in one vector register, and two of them, a tile: arithmetic, and products of a matrix with tiles.

Loops over lanes become vector instructions by themselves where there are many lanes (``lanes.py``).  Models whose
states are arrays have few paths or columns at a time, and Numba makes vectors of so short a loop only sometimes; so
they use vectors explicitly.  In Python a vector is a NumPy array of eight floats.
"""

import operator

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import lower_builtin, models, register_model, type_callable

from .dispatch import intrinsic
from .instructions import check_places
from .private import uses

WIDTH = 8  #: floats in a vector
TILE = 2 * WIDTH  #: columns of a tile

FUSED = ("contract",)  # a product and a sum in one rounding
_ALIGNED, _MASK = ir.Constant(ir.IntType(32), 8), ir.VectorType(ir.IntType(1), WIDTH)
_DOUBLES, _TILE = (ir.VectorType(ir.DoubleType(), count) for count in (WIDTH, TILE))


class VectorType(types.Type):
    """Numba type of a vector."""

    def __init__(self):
        super().__init__("Vector")


VECTOR = VectorType()


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, numba_type):
        super().__init__(manager, numba_type, _DOUBLES)


def without_refcount(array):
    """The same array, or tuple with arrays, whose references are not counted, for use while another reference is held.

    Numba counts references whenever an array is handed on, with atomic instructions, and cannot leave that out where
    there are branches; in small loops it takes longer than the work.
    """
    return array


def load(array, i):
    """array[i : i + WIDTH]."""
    return np.array(array[i : i + WIDTH])


def gather(array, i, places, first):
    """array[i + places[first + k]] for k = 0, ..., WIDTH - 1."""
    return array[i + places[first : first + WIDTH]]


def store(array, i, vector):
    """array[i : i + WIDTH] = vector."""
    array[i : i + WIDTH] = vector


def load_pairs(array, begin, n, first):
    """Eight pairs of a ring of n pairs of floats, those from number `first` >= 0 on, as vectors of their two members.

    The ring is array[begin : begin + 2 * n]; n must be at least WIDTH.
    """
    places = begin + 2 * ((first + np.arange(WIDTH)) % n)
    return array[places], array[places + 1]


def store_pairs(array, begin, n, first, low, high, a, b):
    """Put the pairs number `low` to before `high` of two vectors in their places, see :func:`load_pairs`."""
    places = begin + 2 * ((first + np.arange(WIDTH)) % n)[low:high]
    array[places], array[places + 1] = a[low:high], b[low:high]


def fused(a, x, b):
    """a x + b for a number a and vectors or numbers x and b, in compiled code rounded once."""
    return a * x + b


def flipped(vector):
    """The last float first."""
    return vector[::-1]


def _checked_pointer(context, builder, array_type, array, i, numba_vector=_DOUBLES):
    """Pointer to WIDTH numbers."""
    if context.enable_boundscheck:
        check_places(context, builder, array_type, array, i, builder.add(i, i.type(WIDTH - 1)))
    return _pointer(context, builder, array_type, array, i, numba_vector)


def _pointer(context, builder, array_type, array, i, numba_vector=_DOUBLES):
    data = cgutils.create_struct_proxy(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [i]), numba_vector.as_pointer())


@intrinsic(without_refcount)
def _(array):
    def without_meminfo(context, builder, numba_type, value):
        if isinstance(numba_type, types.BaseTuple):
            for i, inner in enumerate(numba_type.types):
                part = without_meminfo(context, builder, inner, builder.extract_value(value, i))
                value = builder.insert_value(value, part, i)
        elif isinstance(numba_type, types.Array):
            array = cgutils.create_struct_proxy(numba_type)(context, builder, value)
            array.meminfo = ir.Constant(array.meminfo.type, None)
            value = array._getvalue()
        return value

    def code(context, builder, signature, arguments):
        return without_meminfo(context, builder, array, arguments[0])

    def counted(context, builder, signature, arguments):
        return impl_ret_borrowed(context, builder, array, arguments[0])

    return array(array), code if uses("refcounts") else counted


@intrinsic(load)
def _(array, i):
    def code(context, builder, signature, arguments):
        return builder.load(_checked_pointer(context, builder, array, *arguments), align=8)

    return VECTOR(array, types.int64), code


@intrinsic(gather)
def _(array, i, places, first):
    def code(context, builder, signature, arguments):
        base = builder.gep(cgutils.create_struct_proxy(array)(context, builder, arguments[0]).data, [arguments[1]])
        integers = ir.VectorType(ir.IntType(64), WIDTH)
        numbers = builder.load(_checked_pointer(context, builder, places, *arguments[2:], integers), align=8)
        if context.enable_boundscheck:
            each = [builder.extract_element(numbers, ir.Constant(ir.IntType(32), k)) for k in range(WIDTH)]
            check_places(context, builder, array, arguments[0], *(builder.add(arguments[1], number) for number in each))
        whole = spread(builder, builder.ptrtoint(base, ir.IntType(64)), integers)
        addresses = builder.add(whole, builder.mul(numbers, ir.Constant(integers, [8] * WIDTH)))
        addresses = builder.inttoptr(addresses, ir.VectorType(ir.DoubleType().as_pointer(), WIDTH))
        kind = ir.FunctionType(_DOUBLES, [addresses.type, ir.IntType(32), _MASK, _DOUBLES])
        function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.masked.gather.v{WIDTH}f64.v{WIDTH}p0")
        return builder.call(
            function, [addresses, _ALIGNED, ir.Constant(_MASK, [1] * WIDTH), ir.Constant(_DOUBLES, [0.0] * WIDTH)]
        )

    return VECTOR(array, types.int64, places, types.int64), code


@intrinsic(store)
def _(array, i, vector):
    def code(context, builder, signature, arguments):
        builder.store(arguments[2], _checked_pointer(context, builder, array, *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.int64, vector), code


def _shuffled(builder, a, b, places):
    mask = ir.Constant(ir.VectorType(ir.IntType(32), len(places)), places)
    return builder.shuffle_vector(a, b, mask)


def _ring(context, builder, array_type, array, begin, n, first):
    """(begin of a window on a ring, begin for its part that goes around), and a mask of the floats that do not."""
    two = ir.Constant(begin.type, 2)
    if context.enable_boundscheck:
        last = builder.sub(builder.add(begin, builder.mul(two, n)), begin.type(1))
        check_places(context, builder, array_type, array, begin, last)
    starts = [builder.add(begin, builder.mul(two, place)) for place in (first, builder.sub(first, n))]
    ahead = builder.icmp_signed("<", _numbers(builder, first), _splat(builder, n))
    return [_pointer(context, builder, array_type, array, start, _TILE) for start in starts], ahead


def _at_once(builder, n, first):
    """Whether a window does not go around: then no masks are needed, which take longer."""
    return builder.icmp_signed("<=", builder.add(first, first.type(WIDTH)), n)


def _numbers(builder, first):
    """Number of the pair to which each float of a window belongs."""
    lanes = ir.Constant(ir.VectorType(ir.IntType(64), TILE), [place // 2 for place in range(TILE)])
    return builder.add(lanes, _splat(builder, first))


def _splat(builder, number):
    return spread(builder, number, ir.VectorType(ir.IntType(64), TILE))


def _masked(builder, operation, result, *arguments):
    """Call LLVM's masked load or store, which leaves memory alone where the mask is 0."""
    kind = ir.FunctionType(result, [argument.type for argument in arguments])
    name = f"llvm.masked.{operation}.v{TILE}f64.p0"
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), arguments)


@intrinsic(load_pairs)
def _(array, begin, n, first):
    def code(context, builder, signature, arguments):
        (here, around), ahead = _ring(context, builder, array, *arguments)
        with builder.if_else(_at_once(builder, *arguments[2:])) as (at_once, in_two):
            with at_once:
                whole, whole_from = builder.load(here, align=8), builder.basic_block
            with in_two:
                part = _masked(builder, "load", _TILE, here, _ALIGNED, ahead, ir.Constant(_TILE, [0.0] * TILE))
                part = _masked(builder, "load", _TILE, around, _ALIGNED, builder.not_(ahead), part)
                part_from = builder.basic_block
        both = builder.phi(_TILE)
        both.add_incoming(whole, whole_from)
        both.add_incoming(part, part_from)
        nothing = ir.Constant(_TILE, ir.Undefined)
        parts = [_shuffled(builder, both, nothing, list(range(part, TILE, 2))) for part in (0, 1)]
        return context.make_tuple(builder, signature.return_type, parts)

    integer = types.int64
    return types.UniTuple(VECTOR, 2)(array, integer, integer, integer), code


@intrinsic(store_pairs)
def _(array, begin, n, first, low, high, a, b):
    def code(context, builder, signature, arguments):
        (here, around), ahead = _ring(context, builder, array, *arguments[:4])
        lanes = _numbers(builder, ir.Constant(ir.IntType(64), 0))
        wanted = builder.and_(
            builder.icmp_signed(">=", lanes, _splat(builder, arguments[4])),
            builder.icmp_signed("<", lanes, _splat(builder, arguments[5])),
        )
        places = [place for lane in range(WIDTH) for place in (lane, WIDTH + lane)]
        both = _shuffled(builder, *arguments[6:], places)
        all_wanted = builder.icmp_signed("==", builder.sub(arguments[5], arguments[4]), arguments[4].type(WIDTH))
        with builder.if_else(builder.and_(_at_once(builder, *arguments[2:4]), all_wanted)) as (at_once, in_two):
            with at_once:
                builder.store(both, here, align=8)
            with in_two:
                _masked(builder, "store", ir.VoidType(), both, here, _ALIGNED, builder.and_(ahead, wanted))
                behind = builder.and_(builder.not_(ahead), wanted)
                _masked(builder, "store", ir.VoidType(), both, around, _ALIGNED, behind)
        return context.get_dummy_value()

    integer = types.int64
    return types.void(array, integer, integer, integer, integer, integer, a, b), code


@intrinsic(fused)
def _(a, x, b):
    def code(context, builder, signature, arguments):
        kind = _DOUBLES if x == VECTOR else ir.DoubleType()
        factor = spread(builder, arguments[0], _DOUBLES) if x == VECTOR else arguments[0]
        name = f"llvm.fma.v{WIDTH}f64" if x == VECTOR else "llvm.fma.f64"
        function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(kind, [kind] * 3), name)
        return builder.call(function, [factor, *arguments[1:]])

    return x(types.float64, x, x), code


@intrinsic(flipped)
def _(vector):
    def code(context, builder, signature, arguments):
        return _shuffled(builder, arguments[0], arguments[0], list(range(WIDTH - 1, -1, -1)))

    return VECTOR(vector), code


def spread(builder, number, vector):
    """A vector of one number."""
    nothing = ir.Constant(vector, ir.Undefined)
    lone = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
    return _shuffled(builder, lone, nothing, [0] * vector.count)


def _arithmetic(operation, write):
    """Let `operation` take vectors, and vectors and numbers."""

    @type_callable(operation)
    def types_of_call(context):
        def typer(a, b):
            if VECTOR in (a, b) and all(t == VECTOR or isinstance(t, types.Float) for t in (a, b)):
                return VECTOR
            return None

        return typer

    for a, b in ((VectorType, VectorType), (VectorType, types.Float), (types.Float, VectorType)):

        @lower_builtin(operation, a, b)
        def code(context, builder, signature, arguments):
            vectors = (
                value if t == VECTOR else spread(builder, value, _DOUBLES)
                for t, value in zip(signature.args, arguments, strict=True)
            )
            return getattr(builder, write)(*vectors, flags=FUSED)


_arithmetic(operator.add, "fadd")
_arithmetic(operator.sub, "fsub")
_arithmetic(operator.mul, "fmul")


# ---------------------------------------------------------------------------------------------------------------------
# Products of a small matrix with two vectors per row.
# ---------------------------------------------------------------------------------------------------------------------


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
        if context.enable_boundscheck:
            _check_tiles(context, builder, signature.args, arguments)
        a, b, c = (
            cgutils.create_struct_proxy(signature.args[i])(context, builder, arguments[i]).data for i in (0, 3, 6)
        )
        a, b, c = (builder.gep(data, [i]) for data, i in ((a, first), (b, x_first), (c, out_first)))
        done = cgutils.alloca_once_value(builder, ir.Constant(ir.IntType(64), 0))
        for height in (4, 2, 1):  # rows that go together: more would need more registers than AVX2 has
            _rows_together(builder, height, a, columns, b, stride, c, out_stride, rows, done)
        return context.get_dummy_value()

    return signature, code


def _check_tiles(context, builder, types_of_arguments, arguments):
    """Check all places that :func:`multiply_tile` reads and writes."""
    _, first, columns, _, x_first, stride, _, out_first, out_stride, rows = arguments
    one, size = first.type(1), builder.mul(rows, columns)
    below, across = (builder.sub(count, one) for count in (rows, columns))
    with builder.if_then(builder.icmp_signed(">", size, first.type(0))):
        lasts = (
            (0, first, builder.sub(size, one)),
            (3, x_first, builder.add(builder.mul(across, stride), first.type(TILE - 1))),
            (6, out_first, builder.add(builder.mul(below, out_stride), first.type(TILE - 1))),
        )
        for i, begin, last in lasts:
            places = begin, builder.add(begin, last)
            check_places(context, builder, types_of_arguments[i], arguments[i], *places)


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
