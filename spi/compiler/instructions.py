"""Instructions of LLVM for intrinsics: constants, fields of records, and tuples of floats that lie in arrays.

Each function returns (signature, function that writes the instructions), as :func:`~.dispatch.intrinsic` requires.
"""

from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.np.arrayobj import populate_array

from .records import InMemory, is_array, record_class


def constant(record, value):
    """Code for f(record): a constant."""
    return typeof(value)(record), lambda context, builder, signature, arguments: context.get_constant_generic(
        builder, signature.return_type, value
    )


def field(record, name):
    """Code for f(record): a field of it."""
    if isinstance(record, InMemory):
        return record.part(name)(record), lambda context, builder, signature, arguments: part_of(
            context, builder, record, arguments[0], name
        )
    place = record.fields.index(name)

    def code(context, builder, signature, arguments):
        value = builder.extract_value(arguments[0], place)
        return impl_ret_borrowed(context, builder, signature.return_type, value)

    return record.types[place](record), code


def part_of(context, builder, record, pointer, name):
    """Field `name` of a record in memory, or the pointer to a record within it."""
    place = record.fields.index(name)
    pointer = _inside(builder, pointer, place)
    if record_class(record.types[place]):
        return pointer
    without = ()
    if isinstance(record.types[place], types.Array):  # the counter and the object in Python
        model = context.data_model_manager.lookup(record.types[place])
        without = tuple(map(model.get_field_position, ("meminfo", "parent")))
    return _loaded(builder, pointer, without)


def _inside(builder, pointer, place):
    zero = ir.IntType(32)(0)
    return builder.gep(pointer, [zero, ir.IntType(32)(place)], inbounds=True)


def _loaded(builder, pointer, without=()):
    """What lies at a pointer, number by number, those numbered `without` left out."""
    kind = pointer.type.pointee
    if not isinstance(kind, ir.types.Aggregate):
        value = builder.load(pointer)
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        return value
    whole = ir.Constant(kind, ir.Undefined)
    for i, part in enumerate(kind.elements if hasattr(kind, "elements") else [kind.element] * kind.count):
        inner = ir.Constant(part, None) if i in without else _loaded(builder, _inside(builder, pointer, i))
        whole = builder.insert_value(whole, inner, i)
    return whole


def store_parts(builder, value, pointer):
    """Store a value at a pointer, number by number."""
    kind = value.type
    if not isinstance(kind, ir.types.Aggregate):
        builder.store(value, pointer)
        return
    for i in range(len(kind.elements) if hasattr(kind, "elements") else kind.count):
        store_parts(builder, builder.extract_value(value, i), _inside(builder, pointer, i))


def floats(record, name):
    """Code for f(record): a field of it, an array, or a tuple as floats, with 0 for None."""
    place = record.fields.index(name)
    if is_array(record.types[place]):
        return field(record, name)
    inner = record.types[place].types

    def code(context, builder, signature, arguments):
        values = cgutils.unpack_tuple(builder, builder.extract_value(arguments[0], place))
        zero = context.get_constant(types.float64, 0.0)
        numbers = [
            zero if t == types.none else context.cast(builder, value, t, types.float64)
            for value, t in zip(values, inner, strict=True)
        ]
        return context.make_tuple(builder, signature.return_type, numbers)

    return types.UniTuple(types.float64, len(inner))(record), code


def check_places(context, builder, array_type, array, *places):
    """Raise IndexError where a place lies outside of an array of one dimension, if NUMBA_BOUNDSCHECK asks for it.

    Numba checks the places of its own instructions only.
    """
    if context.enable_boundscheck:
        size = cgutils.create_struct_proxy(array_type)(context, builder, array).nitems
        for place in places:
            cgutils.do_boundscheck(context, builder, place, size, 0)


def load_strided(count, stride, *arguments):
    """Code for f(..., array, i): the tuple (array[i], array[i + stride], ...) of `count` floats."""

    def code(context, builder, signature, values):
        pointers = _pointers(context, builder, signature.args[-2], *values[-2:], count, stride)
        return context.make_tuple(builder, signature.return_type, [builder.load(pointer) for pointer in pointers])

    return types.UniTuple(types.float64, count)(*arguments[:-1], types.int64), code


def store_strided(stride, array, i, numbers):
    """Code for f(array, i, numbers): store the tuple of floats `numbers` at array[i], array[i + stride], ..."""

    def code(context, builder, signature, values):
        pointers = _pointers(context, builder, array, *values[:2], len(numbers), stride)
        for value, pointer in zip(cgutils.unpack_tuple(builder, values[2]), pointers, strict=True):
            builder.store(value, pointer)
        return context.get_dummy_value()

    return types.void(array, types.int64, numbers), code


def load_each(count, model, places, array):
    """Code for f(model, places, array, i): the tuple (array[places[0] + i], ...) of `count` floats.

    Where there are fewer places, the rest is 0.
    """

    def code(context, builder, signature, values):
        data = cgutils.create_struct_proxy(array)(context, builder, values[2]).data
        indices = [builder.add(place, values[3]) for place in cgutils.unpack_tuple(builder, values[1])]
        check_places(context, builder, array, values[2], *indices)
        loaded = [builder.load(builder.gep(data, [index], inbounds=True)) for index in indices]
        loaded += [context.get_constant(types.float64, 0.0)] * (count - len(loaded))
        return context.make_tuple(builder, signature.return_type, loaded)

    return types.UniTuple(types.float64, count)(model, places, array, types.int64), code


def floats_on_stack(count, *arguments):
    """Code for f(*arguments): an empty array of `count` floats on the stack of the function into which f is inlined."""
    kind = types.Array(types.float64, 1, "C")

    def code(context, builder, signature, values):
        block = cgutils.alloca_once(builder, ir.ArrayType(ir.DoubleType(), count))
        block.align = 64
        array = context.make_array(kind)(context, builder)
        data = builder.bitcast(block, ir.DoubleType().as_pointer())
        length, stride = (context.get_constant(types.intp, number) for number in (count, 8))
        populate_array(array, data=data, shape=(length,), strides=(stride,), itemsize=stride, meminfo=None)
        return array._getvalue()

    return kind(*arguments), code


def xor_strips(count, target, t, a, i, b, j):
    """Code for f(target, t, a, i, b, j): target[t + k] = a[i + k] ^ b[j + k] for `count` words at once.

    A loop over so few would be tested for overlapping arrays, which takes longer than the loop.
    """

    def code(context, builder, signature, values):
        strip = ir.VectorType(ir.IntType(64), count).as_pointer()
        places = zip((target, a, b), values[::2], values[1::2], strict=True)
        first = [_pointers(context, builder, kind, array, place, count, 1)[0] for kind, array, place in places]
        to, left, right = (builder.bitcast(pointer, strip) for pointer in first)
        builder.store(builder.xor(builder.load(left, align=8), builder.load(right, align=8)), to, align=8)
        return context.get_dummy_value()

    return types.void(target, types.int64, a, types.int64, b, types.int64), code


def _pointers(context, builder, array_type, array, i, count, stride):
    data = cgutils.create_struct_proxy(array_type)(context, builder, array).data
    places = [builder.add(i, i.type(j * stride)) for j in range(count)]
    check_places(context, builder, array_type, array, *places)
    return [builder.gep(data, [place], inbounds=True) for place in places]
