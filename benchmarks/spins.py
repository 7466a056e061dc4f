"""Nanoseconds per spin and step of one lattice of spins: python benchmarks/spins.py [CELLS] [LARGE].

A cubic lattice of CELLS^3 spins (32), damped and at a temperature, on one thread.  One of LARGE^3 (64) on one thread
and on two, with its memory.  Where the program Spirit can be imported (`pip install spirit`), its solvers on the same
lattice in the same run, on one thread.  A step by sites has about 255 operations on floats, counted in the source: 1.5
damped flows of 110 and a turn of 90 about a random axis; the peak beside it is that of a polynomial of high degree.

Short form: 8 16
"""

import os
import resource
import sys
import time

import numba
import numpy as np
from numba import njit

from spi.compiler.rounding import instruction_set
from spi.compiler.vectors import WIDTH, fused, load, store
from spi.ensemble.protocol import at_temperature, one_path
from spi.models.spins import Spins, Terms
from spi.schemes import SCHEMES, of_model

ROUNDS = 20  # short ones, of which the best is least disturbed
OPERATIONS = 255  # of a step by sites
CHAINS, LONG = 7, 10**6  # sums that stay in registers at once, and products and sums in each


@njit(fastmath={"contract"}, error_model="numpy")
def polynomial(x):
    """Products and sums of seven vectors."""
    a, b, c, d, e, f, g = load(x, 0), load(x, 1), load(x, 2), load(x, 3), load(x, 4), load(x, 5), load(x, 6)
    for _ in range(LONG):
        a, b, c, d = fused(0.5, a, a), fused(0.5, b, b), fused(0.5, c, c), fused(0.5, d, d)
        e, f, g = fused(0.5, e, e), fused(0.5, f, f), fused(0.5, g, g)
    for i, vector in enumerate((a, b, c, d, e, f, g)):
        store(x, i * WIDTH, vector)


def peak():
    """Operations on floats per ns of one thread, at most."""
    x, best = np.zeros(64), float("inf")
    for _ in range(10):
        start = time.perf_counter()
        polynomial(x)
        best = min(best, time.perf_counter() - start)
    return 2 * CHAINS * WIDTH * LONG / (1e9 * best)


def lattice(cells, by, scheme, h=0.1):
    """(mover, state) of a cubic lattice at J/T = 1, all spins up."""
    model = at_temperature(Spins("cubic", (cells,) * 3, (Terms(1.0),), alpha=0.1, by=by), 1.0)
    mover = one_path(model, of_model(SCHEMES[scheme], model).record, h)
    return mover, mover.block(np.tile([0.0, 0.0, 1.0], cells**3))


def nanoseconds(mover, y, threads, steps):
    """The least of some rounds, per spin and step."""
    numba.set_num_threads(threads)
    mover.move(y, 0, 1, 1)
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        mover.move(y, 0, steps, 1)
        best = min(best, time.perf_counter() - start)
    return 1e9 * best / steps / mover.sites.size


def spirit(cells, solver):
    """The same by a solver of Spirit."""
    os.environ["OMP_NUM_THREADS"] = "1"  # read when it is imported
    from spirit import configuration, geometry, hamiltonian, parameters, simulation, state

    with state.State(quiet=True) as p_state:
        geometry.set_n_cells(p_state, [cells] * 3)
        hamiltonian.set_boundary_conditions(p_state, [1, 1, 1])
        hamiltonian.set_exchange(p_state, 1, [1.0])
        hamiltonian.set_dmi(p_state, 0, [])
        hamiltonian.set_anisotropy(p_state, 0.0, [0, 0, 1])
        hamiltonian.set_field(p_state, 0.0, [0, 0, 1])
        parameters.llg.set_damping(p_state, 0.1)
        parameters.llg.set_temperature(p_state, 10.0)
        parameters.llg.set_output_general(p_state, False, False, False)
        configuration.plus_z(p_state)
        best, steps = float("inf"), 100
        for _ in range(ROUNDS):
            parameters.llg.set_iterations(p_state, steps, steps)
            start = time.perf_counter()
            simulation.start(p_state, simulation.METHOD_LLG, getattr(simulation, f"SOLVER_{solver}"))
            best = min(best, time.perf_counter() - start)
    return 1e9 * best / steps / cells**3


def main(cells=32, large=64):
    print(f"vector instructions: {instruction_set()}")
    ours = 0.0
    for by, scheme in (
        ("sites", "splitting_symmetric"),
        ("bonds", "splitting_symmetric"),
        ("sites", "splitting_metropolis"),
    ):
        ns = nanoseconds(*lattice(cells, by, scheme), 1, max(8, 6 * 10**5 // cells**3))
        print(f"{cells}^3 spins by {by}, {scheme}, one thread: {ns:.1f} ns per spin and step")
        ours = ours or ns
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    mover, y = lattice(large, "sites", "splitting_symmetric")
    size = sum(np.asarray(value).nbytes for value in mover.model) + mover.sites.nbytes + y.nbytes
    print(f"{large}^3 spins: {size / large**3:.0f} bytes a spin of tables and state")
    one, two = (nanoseconds(mover, y, threads, 4) for threads in (1, min(2, numba.config.NUMBA_NUM_THREADS)))
    print(f"    one thread {one:.1f} ns, two {two:.1f} ns: {one / two:.2f} times as fast")
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / large**3
    print(f"    the process grew by {grown:.0f} bytes a spin")
    try:
        for solver in ("HEUN", "DEPONDT"):
            ns = spirit(cells, solver)
            print(f"Spirit, {solver.title()}, one thread: {ns:.1f} ns per spin and step, {ns / ours:.1f} times ours")
    except ImportError:
        print("Spirit is not installed: pip install spirit")
    most = peak()
    speed = OPERATIONS / ours
    print(f"by sites {speed:.1f} operations on floats per ns, {most:.1f} at most: {speed / most:.0%}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
