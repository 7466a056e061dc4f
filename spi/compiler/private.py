"""Private parts of Numba that this room uses, what they take from it, and how to do without them.

Only files of this room import names that Numba may change (``numba.core``).  A part of which a name is missing is left
out, neither used nor imported, and so are those that the environment variable SPI_WITHOUT names, with commas between
them.  Without a part everything works, with something lost, see :data:`LOST`.  What this room uses besides, for which
there is no other way, stands in ``tests/compiler/test_private.py``.
"""

import contextlib
import functools
import importlib
import inspect
import os

VARIABLE = "SPI_WITHOUT"

#: The parts, and what is lost without each.
LOST = {
    "libraries": "compiling takes about three times as long",
    "cache": "kernels are compiled anew in every process",
    "rounding": "last digits depend on the width of vectors, which LLVM chooses",
    "refcounts": "steps of models whose states are arrays take longer",
    "pointers": "models whose states are arrays compile more slowly",
    "names": "spi check cannot say which function of a model lacks @device",
}
PARTS = tuple(LOST)

#: part -> what it takes: (module, class or "", names of attributes; those with a dot before them are of instances, or
#: members of a data model, which the class itself does not have).
TAKEN = {
    "libraries": (
        (
            *("numba.core.codegen", "JITCodeLibrary"),
            "_optimize_final_module _finalize_final_module _finalize_dynamic_globals _verify_declare_only_symbols"
            " get_pointer_to_function enable_object_caching codegen ._codegen ._final_module _finalized",
        ),
        ("numba.core.codegen", "JITCPUCodegen", "_library_class set_env _module_pass_manager ._loopvect ._opt_level"),
        ("numba.core.compiler", "Compiler", "compile_extra"),
        ("numba.core.compiler", "CompileResult", "_find_referenced_environments"),
        ("numba.core.event", "", "_registered TimingListener"),
    ),
    "cache": (
        ("numba.core.caching", "", "UserProvidedCacheLocator CompileResultCacheImpl"),
        (
            *("numba.core.caching", "FunctionCache"),
            "load_overload save_overload _index_key _impl_class ._py_func ._cache_path ._cache_file ._impl",
        ),
        (
            *("numba.core.caching", "UserProvidedCacheLocator"),
            "get_suitable_cache_subpath get_source_stamp ._py_file ._lineno ._cache_path",
        ),
        ("numba.core.caching", "CompileResultCacheImpl", "get_filename_base locator filename_base ._filename_base"),
        (
            *("numba.core.caching", "IndexDataCacheFile"),
            "_open_for_write _load_index _load_data ._index_path _data_path ._source_stamp",
        ),
        ("numba.core.dispatcher", "Dispatcher", "._cache typeof_pyval .targetctx .overloads"),
    ),
    "rounding": (
        ("numba.core.codegen", "JITCodeLibrary", "add_ir_module enable_object_caching"),
        ("numba.core.codegen", "JITCPUCodegen", "_library_class"),
        ("numba.core.compiler", "Compiler", "compile_extra"),
        ("llvmlite.ir", "Module", "functions"),
        ("llvmlite.ir", "Function", ".blocks .attributes"),
        ("llvmlite.ir", "Block", ".instructions"),
        ("llvmlite.ir", "Instruction", "._name .operands .flags .opname"),
        ("llvmlite.ir", "CallInstr", ".fastmath"),
        ("llvmlite.ir", "PhiInstr", ".incomings"),
    ),
    "refcounts": (("numba.core.datamodel.models", "ArrayModel", ".meminfo .parent"),),
    "pointers": (
        ("numba.core.datamodel.models", "ArrayModel", ".meminfo .parent"),
        ("numba.core.imputils", "", "lower_getattr_generic"),
        ("numba.core.typing.templates", "", "AttributeTemplate infer_getattr"),
        ("numba.core.datamodel.models", "PrimitiveModel", "__init__"),
        ("llvmlite.ir", "", "InlineAsm"),
    ),
    "names": (("numba.core.typing.context", "Context", "refresh resolve_value_type"),),
}


def left_out():
    """Parts that are left out; the program ends with one line if SPI_WITHOUT names one that there is not."""
    parts = tuple(filter(None, os.environ.get(VARIABLE, "").split(",")))
    if unknown := [part for part in parts if part not in PARTS]:
        raise SystemExit(f"spi: {VARIABLE} names {unknown[0]!r}, which is none of {', '.join(PARTS)}")
    return tuple(part for part in PARTS if part in parts or missing(part))


def uses(part):
    """Whether a part is used."""
    return part not in left_out()


@functools.cache
def missing(part):
    """Names that a part takes and this version of Numba does not have."""
    return tuple(
        ".".join(filter(None, (module, cls, name.lstrip("."))))
        for module, cls, names in TAKEN[part]
        for name in names.split()
        if not _has(module, cls, name)
    )


def _has(module, cls, name):
    """Whether a module or class has an attribute; one of instances is named in a function of the class."""
    try:
        owner = importlib.import_module(module)
        owner = getattr(owner, cls) if cls else owner
    except (ImportError, AttributeError):
        return False
    if not name.startswith("."):
        return hasattr(owner, name)
    codes = [f.__code__ for of in inspect.getmro(owner) for f in vars(of).values() if inspect.isfunction(f)]
    return any(name[1:] in (*code.co_names, *code.co_consts) for code in codes)


@contextlib.contextmanager
def parts_of(codegen, library):
    """Within the block Numba puts other code of a function, such as the body of a parallel loop, into `library`."""
    usual, codegen._library_class = codegen._library_class, library
    try:
        yield
    finally:
        codegen._library_class = usual
