"""Compilation of functions that exist only to be inlined, without machine code of their own.

Numba takes each compiled function to machine code of its own, with a wrapper for Python and one for C, even if only
its copies in the functions that call it are ever used.  For the functions of this program, about a hundred in one
kernel, that took most of the time of compiling.
"""

import contextlib
import dis
import gc

from numba.core import event
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from .private import parts_of, uses

Library = JITCodeLibrary
if uses("rounding"):
    from .rounding import RoundedLibrary as Library  # type: ignore[assignment]

#: Thresholds of the garbage collector while Numba compiles: most of its objects stay, and are searched in vain.
COLLECTIONS = (50_000, 20, 20)


class InlinedLibrary(Library):
    """Code of one function, to be linked into its callers and never run by itself."""

    def __init__(self, codegen, function, *, once):
        super().__init__(codegen, function.__qualname__)
        self._has_loop, self._once = has_loop(function), once

    def _optimize_final_module(self):
        """As Numba's, but only if the function has a loop, which must become vector instructions before it is inlined.

        A function without a loop is optimised as part of its callers; to do both takes a fifth of the time of
        compiling.  With `once` it is the first of Numba's two rounds, since the callers have both of them.
        """
        if self._has_loop and self._once:
            codegen = self._codegen
            vectors = {"loop_vectorize": codegen._loopvect, "slp_vectorize": False}
            passes, builder = codegen._module_pass_manager(opt=codegen._opt_level, cost="cheap", **vectors)
            passes.run(self._final_module, builder)
        elif self._has_loop:
            super()._optimize_final_module()

    def _finalize_final_module(self):
        """As Numba's, without handing the code to the engine that makes machine code of it."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name):
        """0: there is no such pointer."""
        return 0

    @property
    def codegen(self):
        """Where a function that can be run would register its environment with :meth:`set_env`."""
        return self

    def set_env(self, name, environment):
        """Nothing: :class:`KernelCompiler` does this for the copies in a kernel."""


def has_loop(function):
    """Whether a function jumps backwards."""
    return any("JUMP" in i.opname and i.argval <= i.offset for i in dis.get_instructions(function))


class InliningCompiler(Compiler):
    """Compiles a function into an :class:`InlinedLibrary`."""

    def compile_extra(self, function):
        once = self.state.flags.forceinline  # else it is called, and not optimised as part of a caller
        self.state.library = InlinedLibrary(self.state.targetctx.codegen(), function, once=once)
        with unhindered():
            return super().compile_extra(function)


@contextlib.contextmanager
def unhindered():
    """Within the block the garbage collector runs rarely, and Numba's timers of LLVM are off.

    There is a timer for each function that is being compiled, and each is notified of every call of LLVM.
    """
    thresholds, listeners = gc.get_threshold(), event._registered["numba:llvm_lock"]
    timers = [listener for listener in listeners if isinstance(listener, event.TimingListener)]
    listeners[:] = [listener for listener in listeners if listener not in timers]
    gc.set_threshold(*COLLECTIONS)
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
        listeners += timers


class LinkedLibrary(InlinedLibrary):
    """Code of one of the wrappers that Numba puts around a parallel loop; the kernel holds a copy of it."""

    def __init__(self, codegen, name):
        Library.__init__(self, codegen, name)
        self._has_loop = False


class KernelCompiler(Compiler):
    """Compiles a function that Python calls, with all that is inlined into it, so that the disk cache can keep it.

    Of a function with a parallel loop Numba would optimise and turn into machine code the body, two wrappers of it and
    the whole, each of which contains the one before; only the whole is ever used.
    """

    def compile_extra(self, function):
        codegen = self.state.targetctx.codegen()
        self.state.library = Library(codegen, function.__qualname__)
        self.state.library.enable_object_caching()
        with parts_of(codegen, LinkedLibrary), unhindered():
            result = super().compile_extra(function)
        # an error that an inlined function raises looks for the environment of that function
        for environment in result._find_referenced_environments():
            result.library.codegen.set_env(environment.env_name, environment)
        return result
