"""What this program uses of the inside of Numba is there, and can be done without."""

import os
import subprocess
import sys

import numpy as np
import pytest
from helpers import COMPILED
from llvmlite import ir
from numba.core import caching, cgutils, codegen, compiler, datamodel, event, imputils
from numba.core.registry import cpu_target
from numba.core.typing import templates

from spi.compiler import private
from spi.compiler.dispatch import kernel
from spi.compiler.vectors import without_refcount

pytestmark = pytest.mark.skipif(not COMPILED, reason="about the compiler")

LIBRARIES = "functions that are inlined become machine code, without SPI_WITHOUT=libraries compiling fails"
CACHE = "processes that compile at once mix up their kernels, without SPI_WITHOUT=cache nothing is kept"
REFCOUNTS = "arrays are counted where they are lent, without SPI_WITHOUT=refcounts steps crash"
INTRINSICS = "there are no intrinsics: fields, lanes and vectors must be written in another way"
ROUNDING = "sums and products are rounded as LLVM pleases, by the width of vectors"
NAMES = "spi check cannot say which function of a model lacks @device"

BLOCK = ir.Block(ir.Function(ir.Module(), ir.FunctionType(ir.VoidType(), []), "nothing"))


@kernel
def add_one(x):
    for i in range(x.size):
        x[i] += 1.0


@pytest.mark.parametrize(
    ("names", "place", "breaks"),
    [
        (
            "_optimize_final_module _finalize_final_module _finalize_dynamic_globals _verify_declare_only_symbols"
            " get_pointer_to_function enable_object_caching codegen",
            lambda: codegen.JITCodeLibrary,
            LIBRARIES,
        ),
        ("compile_extra", lambda: compiler.Compiler, LIBRARIES),
        ("_find_referenced_environments", lambda: compiler.CompileResult, LIBRARIES),
        ("_library_class set_env", lambda: cpu_target.target_context.codegen(), LIBRARIES),
        ("_module_pass_manager _loopvect _opt_level", lambda: cpu_target.target_context.codegen(), LIBRARIES),
        ("_registered TimingListener", lambda: event, LIBRARIES),
        ("add_ir_module", lambda: codegen.JITCodeLibrary, ROUNDING),
        ("_get_host_cpu_features", lambda: cpu_target.target_context.codegen(), ROUNDING),
        ("_name operands flags opname", lambda: ir.Instruction(BLOCK, ir.DoubleType(), "fneg", []), ROUNDING),
        ("load_overload save_overload _index_key _impl_class", lambda: caching.FunctionCache, CACHE),
        ("UserProvidedCacheLocator CompileResultCacheImpl", lambda: caching, CACHE),
        ("get_suitable_cache_subpath get_source_stamp", lambda: caching.UserProvidedCacheLocator, CACHE),
        ("get_filename_base locator filename_base", lambda: caching.CompileResultCacheImpl, CACHE),
        ("_py_file _lineno _cache_path", lambda: add_one._cache._impl.locator, CACHE),
        ("_py_func _cache_path _cache_file _impl", lambda: add_one._cache, CACHE),
        ("_load_index _source_stamp", lambda: add_one._cache._cache_file, CACHE),
        ("filename_base", lambda: add_one._cache._impl, CACHE),
        ("_cache typeof_pyval targetctx", lambda: add_one, CACHE),
        ("ArrayModel PrimitiveModel", lambda: datamodel.models, REFCOUNTS),
        ("impl_ret_borrowed lower_getattr_generic", lambda: imputils, INTRINSICS),
        ("AttributeTemplate infer_getattr", lambda: templates, INTRINSICS),
        ("do_boundscheck", lambda: cgutils, INTRINSICS),
        ("enable_boundscheck", lambda: cpu_target.target_context, INTRINSICS),
        ("refresh resolve_value_type", lambda: cpu_target.typing_context, NAMES),
    ],
)
def test_numba_has_what_is_used_of_its_inside(names, place, breaks):
    missing = [name for name in names.split() if not hasattr(place(), name)]
    assert not missing, f"Numba has no {missing} any more: {breaks}"


@kernel
def sum_of_rows(x):
    total = 0.0
    for i in range(len(x)):
        row = without_refcount(x[i])
        for j in range(len(row)):
            total += row[j]
    return total


def test_an_array_without_a_count_is_neither_freed_nor_kept():
    """A count too low would free it while it is used, one too high never."""
    x = np.ones((3, 4))
    before = sys.getrefcount(x)
    assert [sum_of_rows(x) for _ in range(5)] == [12.0] * 5
    assert sys.getrefcount(x) == before and x.sum() == 12.0


#: A kernel with an inlined function, vectors and an array that is lent, and which private modules have been imported.
PROGRAM = """
import sys
import numpy as np
from numba import prange
from spi.compiler.dispatch import device, kernel
from spi.compiler.vectors import WIDTH, fused, load, store, without_refcount

@device
def step(x, y):
    for i in range(0, len(x), WIDTH):
        store(y, i, fused(0.1, load(x, i), load(y, i)))

@kernel(parallel=True)
def steps(x, y):
    for row in prange(len(x)):
        step(without_refcount(x[row]), without_refcount(y[row]))

x = np.sin(np.arange(64.0)).reshape(4, 16)
y = x * x
steps(x, y)
used = [name for name in ("libraries", "caching") if f"spi.compiler.{name}" in sys.modules]
print(y.tobytes().hex(), len(steps.signatures), *used)
"""


def outcome(tmp_path, left_out):
    (tmp_path / "program.py").write_text(PROGRAM)
    environment = {**os.environ, private.VARIABLE: left_out, "SPI_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, tmp_path / "program.py"]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    return answer.stdout.split() or answer.stderr


def test_the_results_are_the_same_without_the_inside_of_numba(tmp_path):
    with_all, without = outcome(tmp_path, ""), outcome(tmp_path, ",".join(private.PARTS))
    assert with_all[1:] == ["1", "libraries", "caching"]
    assert without == with_all[:2]


def test_an_unknown_part_is_refused(tmp_path):
    right = "libraries, cache, refcounts"
    assert outcome(tmp_path, "cache,cash") == f"spi: {private.VARIABLE} names 'cash', which is none of {right}\n"
