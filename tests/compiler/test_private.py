"""What this program uses of the inside of Numba is there, and can be done without."""

import os
import subprocess
import sys

import numpy as np
import pytest
from helpers import COMPILED
from numba.core import cgutils, datamodel, event, imputils
from numba.core.registry import cpu_target
from numba.np import arrayobj

from spi import storage
from spi.compiler import private
from spi.running.run import load, run

pytestmark = pytest.mark.skipif(not COMPILED, reason="about the compiler")


@pytest.mark.parametrize("part", private.PARTS)
def test_numba_has_what_the_parts_take(part):
    assert private.missing(part) == (), f"{part} is left out: {private.LOST[part]}"


@pytest.mark.parametrize(
    ("names", "place"),
    [
        ("impl_ret_borrowed", imputils),
        ("do_boundscheck create_struct_proxy alloca_once unpack_tuple get_or_insert_function", cgutils),
        ("enable_boundscheck data_model_manager", cpu_target.target_context),
        ("PrimitiveModel", datamodel.models),
        ("Listener install_listener", event),
        ("populate_array", arrayobj),
    ],
)
def test_numba_has_what_there_is_no_other_way_for(names, place):
    missing = [name for name in names.split() if not hasattr(place, name)]
    assert not missing, f"Numba has no {missing} any more: fields, lanes and vectors must be written in another way"


def test_a_name_that_is_missing_is_noticed_wherever_it_stands(monkeypatch):
    absent = [("numba.core.codegen", "JITCodeLibrary", "_none"), ("numba.core.codegen", "JITCPUCodegen", "._none")]
    absent += [("numba.core.none", "", "x"), ("numba.core.codegen", "None_", "x"), ("llvmlite.ir", "", "x")]
    found = [("numba.core.codegen", "JITCPUCodegen", "._opt_level"), ("llvmlite.ir", "Instruction", ".opname")]
    assert [private._has(*row) for row in (*absent, *found)] == [False] * 5 + [True] * 2
    monkeypatch.setitem(private.TAKEN, "refcounts", absent[:2])
    private.missing.cache_clear()
    try:
        assert private.missing("refcounts") == (
            "numba.core.codegen.JITCodeLibrary._none",
            "numba.core.codegen.JITCPUCodegen._none",
        )
        assert private.left_out() == ("refcounts",) and not private.uses("refcounts") and private.uses("cache")
    finally:
        private.missing.cache_clear()


#: A kernel with an inlined function, vectors and arrays that are lent; how often arrays are counted and freed that a
#: caller owns and that a kernel makes, of which it returns one; and which private modules have been imported.
PROGRAM = """
import sys
from typing import NamedTuple
import numpy as np
from numba import prange
from numba.core.runtime import rtsys
from spi.compiler.dispatch import device, kernel
from spi.compiler.vectors import WIDTH, fused, load, store, without_refcount

class Lent(NamedTuple):
    rows: np.ndarray
    row: np.ndarray

@device
def step(x, y):
    for i in range(0, len(x), WIDTH):
        store(y, i, fused(0.1, load(x, i), load(y, i)))

@kernel(parallel=True)
def steps(x, y):
    for row in prange(len(x)):
        step(without_refcount(x[row]), without_refcount(y[row]))

@kernel
def sum_of_own(n, kept):
    total = 0.0
    for i in range(n):
        rows, pair = np.full((2, 4), 1.0 + i), (np.ones(3), np.full(3, 2.0))
        one, (a, b) = without_refcount(rows[0]), without_refcount(pair)
        lent = without_refcount(Lent(rows, pair[0]))
        for j in range(3):
            total += one[j] + a[j] * b[j] + lent.rows[1, j] + lent.row[j]
    return total, rows[:kept]

x = np.sin(np.arange(64.0)).reshape(4, 16)
y = x * x
held = sys.getrefcount(x), sys.getrefcount(y)
for _ in range(5):
    steps(x, y)
counts = [sys.getrefcount(x) - held[0], sys.getrefcount(y) - held[1]]
sum_of_own(1, 0)
before = rtsys.get_allocation_stats()
total, rows = sum_of_own(100, 2)
counts += [int(now - then) for now, then in zip(rtsys.get_allocation_stats(), before)]
counts += [int(total), int(rows.sum())]
del rows
counts += [rtsys.get_allocation_stats().free - before.free]
used = [name for name in ("libraries", "caching", "rounding") if f"spi.compiler.{name}" in sys.modules]
print(*counts)
print(y.tobytes().hex(), len(steps.signatures), *used)
"""
#: No count of the caller's arrays changes; 100 times 3 arrays are made, and freed but for the one that is held.
COUNTS = [0, 0, 300, 299, 300, 299, sum(3 * (2 * (1 + i) + 3) for i in range(100)), 800, 300]
#: What a later Numba may lack.
WITHOUT_NAMES = """
import llvmlite.ir
import numba.core.caching, numba.core.compiler
del numba.core.compiler.CompileResult._find_referenced_environments, numba.core.caching.UserProvidedCacheLocator
del llvmlite.ir.PhiInstr, llvmlite.ir.InlineAsm
"""


def outcome(tmp_path, left_out, before=""):
    """The words that the program prints; what it says of an error otherwise, or of a crash."""
    (tmp_path / "program.py").write_text(before + PROGRAM)
    folder = {"SPI_CACHE_DIR": str(tmp_path / "cache")}
    environment = {**os.environ, private.VARIABLE: left_out, "NUMBA_NRT_STATS": "1", **folder}
    command = [sys.executable, tmp_path / "program.py"]
    answer = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    if answer.returncode:
        return answer.stderr or f"exit code {answer.returncode}"
    counts, words = answer.stdout.splitlines()
    assert [*map(int, counts.split())] == COUNTS, "references are counted wrongly: without_refcount"
    return words.split()


@pytest.fixture(scope="module")
def with_all(tmp_path_factory):
    return outcome(tmp_path_factory.mktemp("all"), "")


def test_the_results_are_the_same_without_the_inside_of_numba(tmp_path, with_all):
    without = outcome(tmp_path, ",".join(part for part in private.PARTS if part != "rounding"))
    assert with_all[1:] == ["1", "libraries", "caching", "rounding"], with_all
    assert without == [*with_all[:2], "rounding"]


def test_they_agree_to_rounding_where_a_later_numba_lacks_names(tmp_path, with_all):
    without = outcome(tmp_path, "", WITHOUT_NAMES)
    assert without[1:] == ["1"]
    values = [np.frombuffer(bytes.fromhex(text)) for text in (without[0], with_all[0])]
    np.testing.assert_allclose(*values, rtol=4e-16)


@pytest.mark.parametrize("scheme", ["euler_maruyama", pytest.param("splitting", marks=pytest.mark.slow)])
def test_the_demo_works_without_any_part_and_its_numbers_agree_to_rounding(tmp_path, scheme):
    options = ["--profile", "quick", "--samples", "64", "--set", f"schemes=[{scheme}]"]
    environment = {**os.environ, private.VARIABLE: ",".join(private.PARTS), "SPI_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-c", "from spi.cli import main; main()", "run", "rigid_body_strong", *options]
    subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, check=True, timeout=600)
    (file,) = (tmp_path / "results").glob("*.h5")
    without = storage.read(file)
    experiment = load("rigid_body_strong", "quick", [f"schemes=[{scheme}]", "samples=64"])
    usual = storage.read(run(experiment, tmp_path / "usual"))
    assert without.attributes["machine_without"] == ", ".join(private.PARTS)
    assert without.attributes["machine_vector_bits"] == 0 and "machine_without" not in usual.attributes
    for name in ("error", "error_final"):
        np.testing.assert_allclose(without.groups[0].arrays[name], usual.groups[0].arrays[name], rtol=1e-12)


def test_an_unknown_part_is_refused(tmp_path):
    right = "libraries, cache, rounding, refcounts, pointers, names"
    assert outcome(tmp_path, "cache,cash") == f"spi: {private.VARIABLE} names 'cash', which is none of {right}\n"
