"""Blocks of paths: LANES states in one array, component i of lane l at [i * LANES + l].

Loops over lanes that load a tuple, compute and store it become vector instructions.
"""

from numba import types
from numba.core import cgutils
from numba.extending import overload

from ..compiler.dispatch import INLINED, intrinsic
from ..numerics.rng import LANES
from .protocol import dimension, large


def load_lane(model, y, lane):
    """The state of one lane as a tuple of ``dimension(model)`` floats; of a large model a view of the block."""
    if large(model):
        return y[lane : dimension(model) * LANES : LANES]
    return tuple(float(y[i * LANES + lane]) for i in range(dimension(model)))


def store_lane(y, lane, state):
    """Put a tuple of floats into one lane; of a large model an array."""
    for i, value in enumerate(state):
        y[i * LANES + lane] = value


@intrinsic(load_lane)
def _(model, y, lane):
    if large(model):
        return None
    d = dimension(model)

    def code(context, builder, signature, arguments):
        data = cgutils.create_struct_proxy(signature.args[1])(context, builder, arguments[1]).data
        lane = arguments[2]
        values = [
            builder.load(builder.gep(data, [builder.add(lane, lane.type(i * LANES))], inbounds=True)) for i in range(d)
        ]
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(types.float64, d)(model, y, types.int64), code


@overload(load_lane, jit_options=INLINED)
def _(model, y, lane):
    return (lambda model, y, lane: y[lane : dimension(model) * LANES : LANES]) if large(model) else None


@intrinsic(store_lane)
def _(y, lane, state):
    if isinstance(state, types.Array):
        return None

    def code(context, builder, signature, arguments):
        data = cgutils.create_struct_proxy(signature.args[0])(context, builder, arguments[0]).data
        lane = arguments[1]
        for i, value in enumerate(cgutils.unpack_tuple(builder, arguments[2])):
            builder.store(value, builder.gep(data, [builder.add(lane, lane.type(i * LANES))], inbounds=True))
        return context.get_dummy_value()

    return types.void(y, types.int64, state), code


@overload(store_lane, jit_options=INLINED)
def _(y, lane, state):
    def store_array(y, lane, state):
        for i in range(len(state)):
            y[i * LANES + lane] = state[i]

    return store_array if isinstance(state, types.Array) else None
