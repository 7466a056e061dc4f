"""What of the functions of the program becomes machine code, and what is only copied into others."""

import gc

import numba
import numpy as np
import pytest
from numba.core import event

from spi.compiler.dispatch import device, kernel
from spi.compiler.libraries import COLLECTIONS, InlinedLibrary, LinkedLibrary, has_loop, unhindered

compiled_only = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="about compiled code")


@device
def _square(x):
    if x < 0.0:
        raise ValueError("negative")
    return x * x


@device
def _sum_of_squares(x):
    total = 0.0
    for i in range(x.size):
        total += _square(x[i])
    return total


@kernel
def sum_of_squares(x):
    return _sum_of_squares(x)


@compiled_only
def test_only_kernels_become_machine_code(monkeypatch):
    """Fails if Numba no longer asks our libraries, which would only be noticed by how long compiling takes."""
    made: dict = {InlinedLibrary: [], LinkedLibrary: [], "machine code": []}
    for library in (InlinedLibrary, LinkedLibrary):

        def finalize(self, library=library, original=library._finalize_final_module):
            made[library].append(self.name)
            original(self)

        monkeypatch.setattr(library, "_finalize_final_module", finalize)
    codegen = numba.core.registry.cpu_target.target_context.codegen()
    add_module = codegen._engine.add_module
    monkeypatch.setattr(
        codegen._engine, "add_module", lambda module: made["machine code"].append(module.name) or add_module(module)
    )

    @device
    def cube(x):
        return x * x * x

    @device
    def sum_of_cubes(x):
        total = 0.0
        for i in range(x.size):
            total += cube(x[i])
        return total

    @device(inline=False)
    def add_up(x, total, row):
        total[row] = sum_of_cubes(x[row])

    @kernel
    def one_row(x, total):
        add_up(x, total, 0)

    @kernel(parallel=True)
    def all_rows(x, total):
        for row in numba.prange(len(x)):
            add_up(x, total, row)

    x, total = np.array([[1.0, 2.0], [1.0, 3.0]]), np.zeros(2)
    one_row(x, total)
    assert total.tolist() == [9.0, 0.0]
    all_rows(x, total)
    assert total.tolist() == [9.0, 28.0]
    last = {what: [name.rpartition(".")[2] for name in names] for what, names in made.items()}
    assert {"cube", "sum_of_cubes", "add_up"} <= set(last[InlinedLibrary])
    assert last[LinkedLibrary]  # the wrappers of the parallel loop
    # "nrt" is Numba's own, made once in a process
    assert set(last["machine code"]) - {"nrt"} == {"one_row", "all_rows"}


@compiled_only
def test_loops_are_optimised_once_if_they_are_inlined_and_else_as_those_of_kernels(monkeypatch):
    codegen, rounds = numba.core.registry.cpu_target.target_context.codegen(), []
    passes = codegen._module_pass_manager
    monkeypatch.setattr(codegen, "_module_pass_manager", lambda **how: rounds.append(how.get("cost")) or passes(**how))

    def total(x):
        result = 0.0
        for i in range(x.size):
            result += x[i]
        return result

    for is_inlined, expected in ((True, ["cheap"]), (False, ["cheap", None])):
        inner = device(inline=is_inlined)(total)

        @kernel
        def twice(x):
            return 2.0 * inner(x)  # noqa: B023 - it is compiled at once

        rounds.clear()
        assert twice(np.ones(3)) == 6.0
        assert rounds == [*expected, "cheap", None]


@compiled_only
def test_the_garbage_collector_and_timers_are_disturbed_only_while_something_compiles():
    before, seconds = gc.get_threshold(), []
    with event.install_timer("numba:llvm_lock", seconds.append):
        with pytest.raises(ZeroDivisionError), unhindered(), unhindered():
            assert gc.get_threshold() == COLLECTIONS
            event.start_event("numba:llvm_lock")
            event.end_event("numba:llvm_lock")
            raise ZeroDivisionError
        assert gc.get_threshold() == before and not seconds
        event.start_event("numba:llvm_lock")
        event.end_event("numba:llvm_lock")
    assert len(seconds) == 1


@pytest.mark.parametrize("x", [[1.0, 2.0], [3.0, -1.0]])
def test_an_error_inside_of_an_inlined_function_is_raised(x):
    x = np.array(x)
    if x.min() >= 0:
        assert sum_of_squares(x) == _sum_of_squares(x) == 5.0
    else:
        for function in (sum_of_squares, _sum_of_squares):
            with pytest.raises(ValueError, match="negative"):
                function(x)


def test_inlined_functions_can_be_called_from_python():
    assert _square.__name__ == "_square" and _square(1.5) == 2.25
    assert _square.__wrapped__(np.float32(1.5)).dtype == np.float32


def test_loops_are_seen():
    def with_while(n):
        while n > 0:
            n -= 1
        return n

    def without(n):
        return n if n > 0 else -n if n < -1 else 0

    assert has_loop(_sum_of_squares.__wrapped__) and has_loop(with_while)
    assert not has_loop(_square.__wrapped__) and not has_loop(without)
