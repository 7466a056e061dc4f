"""How Numba compiles the functions of this program, most of which exist only to be inlined.

Numba takes each compiled function to machine code of its own, with a wrapper for Python and one for C, even if all that
is ever used of it is its copy in the functions that call it.  For the functions of this program, about a hundred in one
kernel, that took most of the time of compiling.  This is the only file that depends on how Numba works inside: without
it (with no ``pipeline_class`` in ``spi.compiler.dispatch``) everything gives the same results, only starts later.
"""

import contextlib
import copy
import dis
import hashlib
from contextvars import ContextVar
from pathlib import Path

from numba import njit, typeof
from numba.core import config
from numba.core import types as numba_types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target

from . import modules

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]

#: Whether functions that exist to be inlined run as plain Python where Python calls them, see :func:`uncompiled`.
UNCOMPILED = ContextVar("UNCOMPILED", default=False)


class InlinedLibrary(JITCodeLibrary):
    """The code of one function, to be linked into its callers and never run by itself."""

    def __init__(self, codegen, function):
        super().__init__(codegen, function.__qualname__)
        self._has_loop = has_loop(function)

    def _optimize_final_module(self):
        """As Numba's, but only if the function has a loop, which must become vector instructions before it is inlined.

        What has none is optimised as part of its callers; to do both takes a fifth of the time of compiling.
        """
        if self._has_loop:
            super()._optimize_final_module()

    def _finalize_final_module(self):
        """As Numba's, without handing the code to the engine that makes machine code of it."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name):
        """There is none."""
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
        self.state.library = InlinedLibrary(self.state.targetctx.codegen(), function)
        return super().compile_extra(function)


class LinkedLibrary(InlinedLibrary):
    """The code of one of the wrappers that Numba puts around a parallel loop; the kernel holds a copy of it."""

    def __init__(self, codegen, name):
        JITCodeLibrary.__init__(self, codegen, name)
        self._has_loop = False


class KernelCompiler(Compiler):
    """Compiles a function that Python calls, with all that is inlined into it, so that the disk cache can keep it.

    Of a function with a parallel loop Numba would optimise and turn into machine code the body, two wrappers of it and
    the whole, each of which contains the one before; only the whole is ever used.
    """

    def compile_extra(self, function):
        codegen = self.state.targetctx.codegen()
        self.state.library = JITCodeLibrary(codegen, function.__qualname__)
        self.state.library.enable_object_caching()
        usual, codegen._library_class = codegen._library_class, LinkedLibrary
        try:
            result = super().compile_extra(function)
        finally:
            codegen._library_class = usual
        # an error that an inlined function raises looks for the environment of that function
        for environment in result._find_referenced_environments():
            result.library.codegen.set_env(environment.env_name, environment)
        return result


class SharedCache(FunctionCache):
    """Numba's disk cache of the compiled versions of one function, into which several processes may write at once.

    Numba reads an index, chooses the next free file name and writes both.  Two processes that do so at once choose the
    same name, and one kernel would be loaded as the other.

    The index names the classes of all records with which the function was called, and whoever reads it must be able to
    import them.  Versions for classes that are no part of this package are therefore kept apart, in a folder named by
    their modules and by the digests of the code of these: nobody else opens it, and an edit leads to another folder.
    """

    def load_overload(self, types, context):
        place = self._place(types)
        return None if place is None else super(SharedCache, place).load_overload(types, context)

    def save_overload(self, types, result):
        if (place := self._place(types)) is not None:
            with _alone_in(Path(place.cache_path)):
                super(SharedCache, place).save_overload(types, result)

    def holds(self, dispatcher, types):
        """Whether there is an entry for these types of arguments."""
        place, key = self._place(types), self._index_key(types, dispatcher.targetctx.codegen())
        return place is not None and key in place._cache_file._load_index()

    def _place(self, types):
        """The cache of the versions that depend on the same foreign code; None if nothing identifies that code."""
        things = {self._py_func}.union(*map(record_classes, types))
        foreign = sorted({(thing.__module__, modules.digest(thing)) for thing in things if modules.is_foreign(thing)})
        if not foreign:
            return self
        if not all(digest for _, digest in foreign):
            return None
        place, name = copy.copy(self), hashlib.sha256(repr(foreign).encode()).hexdigest()[:16]
        place._cache_path = str(Path(self.cache_path, f"own_{name}"))
        stamp = self._cache_file._source_stamp
        place._cache_file = IndexDataCacheFile(place._cache_path, self._impl.filename_base, stamp)
        return place


def record_classes(numba_type):
    """The classes of all records in a type of Numba: its own, and those of what a tuple, list or array of it holds."""
    found = {numba_type.instance_class} if isinstance(numba_type, numba_types.BaseNamedTuple) else set()
    if isinstance(numba_type, numba_types.BaseTuple):
        inner = numba_type.types
    else:  # a container's or an optional value's
        inner = [getattr(numba_type, name, None) for name in ("dtype", "type")]
    return found.union(*(record_classes(one) for one in inner if isinstance(one, numba_types.Type)))


@contextlib.contextmanager
def _alone_in(folder):
    """Within it no other process is; where the system has no such locks nothing is done."""
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "w") as file:
        if fcntl:
            fcntl.flock(file, fcntl.LOCK_EX)
        yield  # closing the file gives the lock back, and so does the end of the process


def keep_in_shared_cache(dispatcher):
    """Keep the compiled versions of a function on disk; without a compiler there are none."""
    if hasattr(dispatcher, "overloads"):
        dispatcher._cache = SharedCache(dispatcher.py_func)
    return dispatcher


def types_of(dispatcher, arguments):
    """The types for which a call with these arguments compiles; None without a compiler."""
    if not hasattr(dispatcher, "overloads"):
        return None
    return tuple(dispatcher.typeof_pyval(argument) for argument in arguments)


def is_compiled(dispatcher, types):
    """Whether a function is compiled for these types of arguments, in this process or on disk."""
    if types in dispatcher.overloads:
        return True
    cache = dispatcher._cache
    return isinstance(cache, SharedCache) and cache.holds(dispatcher, types)


def runs_uncompiled():
    """Whether :func:`uncompiled` is in force; a function, because compiled functions that name it are pickled."""
    return UNCOMPILED.get()


@contextlib.contextmanager
def uncompiled():
    """Within it, what Python calls of the functions that exist to be inlined is plain Python, kernels are not."""
    token = UNCOMPILED.set(True)
    try:
        yield
    finally:
        UNCOMPILED.reset(token)


def is_compiling():
    """Whether there is a compiler: it can be switched off."""
    return not config.DISABLE_JIT


def is_known_to_the_compiler(value):
    """Whether compiled code may use a value by the name of a global; without a compiler, anything."""
    if not is_compiling():
        return True
    cpu_target.typing_context.refresh()
    try:
        return cpu_target.typing_context.resolve_value_type(value) is not None
    except (ValueError, NumbaError):
        return False


def type_of_result(function, *arguments):
    """The Numba type of what a function returns for such arguments, by compiling it without making machine code.

    None without a compiler; raises what the compiler does.
    """
    if not is_compiling():
        return None
    to_inline = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "pipeline_class": InliningCompiler}
    dispatcher, types = njit(**to_inline)(function), tuple(map(typeof, arguments))
    dispatcher.get_call_template(types, {})
    return dispatcher.overloads[types].signature.return_type


def is_tuple_of_floats(numba_type, length):
    """Whether a type of Numba is that of so many floats in a tuple."""
    return isinstance(numba_type, numba_types.BaseTuple) and tuple(numba_type.types) == (numba_types.float64,) * length


def is_float(numba_type):
    """Whether a type of Numba is that of a float."""
    return numba_type == numba_types.float64
