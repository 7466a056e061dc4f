"""Records that lie in memory: compiled functions hand on one pointer in place of all fields.

Numba hands a record on by value: each field is an argument of its own, an array seven of them, so that a record of 20
arrays is 160 arguments of every function, which takes a quarter of the time of compiling.  A record in memory is one.
What is loaded from it is said not to change, so that loads leave loops as arguments would.
"""

from llvmlite import ir
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed

from .dispatch import intrinsic
from .instructions import part_of, store_parts
from .private import uses
from .records import InMemory, record_class

_IS_USED = uses("pointers") and uses("refcounts")


def in_memory(record):
    """Record of an array-state model, of which compiled code hands on a pointer while the caller of this runs.

    References to its arrays are not counted, see ``vectors.without_refcount``; the caller holds one.
    """
    return record


@intrinsic(in_memory)
def _(record):
    if not _IS_USED or isinstance(record, InMemory) or not getattr(record_class(record), "large", False):
        return record(record), lambda context, builder, signature, arguments: impl_ret_borrowed(
            context, builder, record, arguments[0]
        )

    def code(context, builder, signature, arguments):
        place = cgutils.alloca_once(builder, arguments[0].type)
        store_parts(builder, arguments[0], place)
        # the pointer goes through an empty instruction, so that no load goes ahead of the stores
        hidden = ir.InlineAsm(ir.FunctionType(place.type, [place.type]), "", "=r,0,~{memory}", side_effect=True)
        return builder.call(hidden, [place])

    return InMemory(record)(record), code


if _IS_USED:
    from numba.core.imputils import lower_getattr_generic
    from numba.core.typing.templates import AttributeTemplate, infer_getattr
    from numba.extending import models, register_model

    @register_model(InMemory)
    class _InMemoryModel(models.PrimitiveModel):
        def __init__(self, manager, numba_type):
            super().__init__(manager, numba_type, manager.lookup(numba_type.record).get_value_type().as_pointer())

    @infer_getattr
    class _Fields(AttributeTemplate):
        key = InMemory

        def generic_resolve(self, record, name):
            return record.part(name) if name in record.fields else None

    @lower_getattr_generic(InMemory)
    def _field(context, builder, record, pointer, name):
        return part_of(context, builder, record, pointer, name)
