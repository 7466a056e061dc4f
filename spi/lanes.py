"""Blocks of paths: LANES states in one array, component i of lane l at [i * LANES + l].

Loops over lanes that load a tuple, compute and store it become vector instructions.
"""

from numba import types
from numba.core import cgutils

from .dispatch import instructions
from .protocol import dimension
from .rng import LANES


def load_lane(model, y, lane):
    """The state of one lane as a tuple of ``dimension(model)`` floats."""
    return tuple(float(y[i * LANES + lane]) for i in range(dimension(model)))


def store_lane(y, lane, state):
    """Put a tuple of floats into one lane."""
    for i, value in enumerate(state):
        y[i * LANES + lane] = value


@instructions(load_lane)
def _(model, y, lane):
    d = dimension(model)

    def code(context, builder, signature, arguments):
        data = cgutils.create_struct_proxy(signature.args[1])(context, builder, arguments[1]).data
        lane = arguments[2]
        values = [
            builder.load(builder.gep(data, [builder.add(lane, lane.type(i * LANES))], inbounds=True)) for i in range(d)
        ]
        return context.make_tuple(builder, signature.return_type, values)

    return types.UniTuple(types.float64, d)(model, y, types.int64), code


@instructions(store_lane)
def _(y, lane, state):
    def code(context, builder, signature, arguments):
        data = cgutils.create_struct_proxy(signature.args[0])(context, builder, arguments[0]).data
        lane = arguments[1]
        for i, value in enumerate(cgutils.unpack_tuple(builder, arguments[2])):
            builder.store(value, builder.gep(data, [builder.add(lane, lane.type(i * LANES))], inbounds=True))
        return context.get_dummy_value()

    return types.void(y, types.int64, state), code
