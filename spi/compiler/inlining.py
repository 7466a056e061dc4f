"""Options and pipelines of the compiler, and questions to it."""

import contextlib
from contextvars import ContextVar

from numba import config, njit, typeof
from numba.core.errors import NumbaError

from .private import uses

#: Options for a function that is compiled by itself, for one that exists only to be inlined, and for a kernel.
ALONE: dict = {}
if uses("rounding"):
    from .rounding import RoundedCompiler

    ALONE["pipeline_class"] = RoundedCompiler
TO_INLINE = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **ALONE}
TO_RUN = {"no_cfunc_wrapper": True, **ALONE}
if uses("libraries"):
    from .libraries import InliningCompiler, KernelCompiler

    TO_INLINE["pipeline_class"], TO_RUN["pipeline_class"] = InliningCompiler, KernelCompiler
if uses("cache"):
    from .caching import SharedCache

#: Whether functions that exist to be inlined run as plain Python where Python calls them, see :func:`uncompiled`.
UNCOMPILED = ContextVar("UNCOMPILED", default=False)


def keep_on_disk(dispatcher):
    """Store the compiled versions of a function on disk; without a compiler there are none."""
    if hasattr(dispatcher, "overloads") and uses("cache"):
        dispatcher._cache = SharedCache(dispatcher.py_func)
    return dispatcher


def types_of(dispatcher, arguments):
    """Types for which a call with these arguments compiles; None without a compiler or without the cache."""
    if not hasattr(dispatcher, "overloads") or not uses("cache"):
        return None
    return tuple(dispatcher.typeof_pyval(argument) for argument in arguments)


def is_compiled(dispatcher, types):
    """Whether a function is compiled for these types of arguments, in this process or on disk."""
    if types in dispatcher.overloads:
        return True
    cache = dispatcher._cache
    return isinstance(cache, SharedCache) and cache.holds(dispatcher, types)


def is_loaded(dispatcher, arguments):
    """Whether this process has the code for a call with these arguments; True without a compiler."""
    types = types_of(dispatcher, arguments)
    return types is None or types in dispatcher.overloads


def runs_uncompiled():
    """Whether :func:`uncompiled` is in force; a function, because compiled functions that name it are pickled."""
    return UNCOMPILED.get()


@contextlib.contextmanager
def uncompiled():
    """Within the block, functions that exist to be inlined run as plain Python if Python calls them; kernels do not."""
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
    if not is_compiling() or not uses("names"):
        return True
    from numba.core.registry import cpu_target

    cpu_target.typing_context.refresh()
    try:
        return cpu_target.typing_context.resolve_value_type(value) is not None
    except (ValueError, NumbaError):
        return False


def type_of_result(function, *arguments):
    """Numba type of the result of a function for such arguments, by compiling it without making machine code.

    None without a compiler; errors of the compiler are passed on.
    """
    if not is_compiling():
        return None
    dispatcher = njit(**TO_INLINE)(function)
    dispatcher.compile(tuple(map(typeof, arguments)))
    return dispatcher.nopython_signatures[0].return_type
