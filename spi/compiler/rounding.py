"""Explicit choice of the products that are rounded and of the width of vectors, so that bits do not depend on LLVM's.

A processor with fused operations computes a b + c with one rounding.  LLVM may use them where the flag ``contract``
allows it, and in a b + c d it may fuse either product; which one it takes changes with the width of vectors.  So the
choice is made here, in the code as Numba writes it and before anything is optimised:

* a sum or difference with a product that is used nowhere else, in the same function, becomes one fused operation;
* where both operands are such products, the first one is fused;
* all other operations are rounded one by one.

The flag is taken away, so that nothing is left to choose.  Vectors of 128, 256 and 512 bits, of x86 and of ARM, then
give equal bits.  Only a processor without fused operations gives others: there each operation is rounded.

LLVM prefers vectors of 256 bits on several Intel processors that have 512, which makes kernels up to 1.4 times slower,
and so each function carries the width that we want; SPI_VECTOR_BITS=128, 256 or 512 asks for another.
"""

import collections

from llvmlite import ir
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from .private import parts_of
from .processor import is_fused, vector_bits

ALLOWED = "contract"  # the flag of LLVM by which a product and a sum may become one operation


def round_explicitly(module):
    """Replace sums with products by fused operations, see above; `module` is one of ``llvmlite.ir``."""
    width = vector_bits()
    for function in module.functions:
        if function.blocks:
            if is_fused():
                _fuse(function)
            for block in function.blocks:
                for instruction in block.instructions:
                    _forbid(instruction)
            # `set.add` circumvents a list of names that lacks those which only some processors have
            set.add(function.attributes, f'"prefer-vector-width"="{width}"')


def _forbid(instruction):
    for flags in (instruction.flags, getattr(instruction, "fastmath", ())):
        if ALLOWED in flags:
            flags.remove(ALLOWED)


def _fuse(function):
    """Replace sums and differences that are allowed to be fused, in order."""
    instructions = [instruction for block in function.blocks for instruction in block.instructions]
    uses = collections.Counter(id(operand) for instruction in instructions for operand in _operands(instruction))

    def is_product(value):
        return _allows(value, "fmul") and uses[id(value)] == 1

    for block in function.blocks:
        written = []
        for instruction in block.instructions:
            if _allows(instruction, "fadd", "fsub") and any(map(is_product, instruction.operands)):
                written += _fused(block, instruction, 0 if is_product(instruction.operands[0]) else 1)
            else:
                written.append(instruction)
        block.instructions[:] = written


def _operands(instruction):
    if isinstance(instruction, ir.PhiInstr):
        return [value for value, _ in instruction.incomings]
    return instruction.operands


def _allows(value, *operations):
    """Whether a value is the result of one of these operations, and may be part of a fused one."""
    is_one = isinstance(value, ir.Instruction) and value.opname in operations and ALLOWED in value.flags
    return is_one and getattr(value.type, "element", value.type) == ir.DoubleType()


def _fused(block, instruction, place):
    """Instructions that replace a sum or difference whose operand number `place` is a product."""
    kind = instruction.type
    (a, b), c = instruction.operands[place].operands, instruction.operands[1 - place]
    written = []
    if instruction.opname == "fsub":  # a b - c or c - a b
        written = [ir.Instruction(block, kind, "fneg", [a if place else c])]
        a, c = (written[0], c) if place else (a, written[0])
    name = f"llvm.fma.v{kind.count}f64" if isinstance(kind, ir.VectorType) else "llvm.fma.f64"
    fma = cgutils.get_or_insert_function(block.parent.module, ir.FunctionType(kind, [kind] * 3), name)
    written.append(ir.CallInstr(block, fma, [a, b, c]))
    # other instructions use the sum by its name, which stays; llvmlite cannot replace it in all of them
    written[-1]._name = instruction.name
    return written


class RoundedLibrary(JITCodeLibrary):
    """Code of one function, with explicit rounding and a width of vectors."""

    def add_ir_module(self, module):
        round_explicitly(module)
        super().add_ir_module(module)


class RoundedCompiler(Compiler):
    """Compiles a function, and the other code that Numba writes for it, into such libraries."""

    def compile_extra(self, function):
        codegen = self.state.targetctx.codegen()
        self.state.library = RoundedLibrary(codegen, function.__qualname__)
        self.state.library.enable_object_caching()
        with parts_of(codegen, RoundedLibrary):
            return super().compile_extra(function)
