"""Nanoseconds per spin and step of one lattice of spins through `spi run`: python benchmarks/spins.py [CELLS].

A cubic lattice of CELLS^3 spins (32), damped and at a temperature, by the spec below on one thread: what a run of three
times as many steps takes longer.  What `spi check` says of time and memory stands beside what the run takes.  Where the
program Spirit can be imported (`pip install spirit`), its solvers on the same lattice in the same run, on one thread.
Times are those of the processor.  A step by sites has about 255 operations on floats, counted in the source: 1.5 damped
flows of 110 and a turn of 90 about a random axis; the peak beside it is that of a polynomial of high degree.

Supports: docs/appendix/spins.md, table of "Speed"; the time of whole runs and the memory of larger lattices are those
of front_door.py.

Short form: 16
"""

import os
import sys
import time

import numpy as np
from numba import njit
from through_spec import said

import spi
from spi.compiler.rounding import instruction_set
from spi.compiler.vectors import WIDTH, fused, load, store

ROUNDS = 20  # short ones of Spirit, of which the best is least disturbed
REPEATS = 3
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


def spec(cells, by, scheme, steps):
    """One path of a cubic lattice at J/T = 1 that begins with all spins up, and is looked at once."""
    bonds = {"exchange": 1}
    model = {"name": "spins", "lattice": "cubic", "size": [cells] * 3, "bonds": bonds, "alpha": 0.1, "by": by}
    return {
        "kind": "trajectory",
        "model": model,
        "temperature": 1,
        "initial": {"spins": [0, 0, 1]},
        "step": 0.1,
        "final_time": f"{steps}/10",
        "every": steps,
        "schemes": [scheme],
        "functions": {"m": "mz"},
        "panels": ["functions"],
    }


def taken(wanted):
    """Processor seconds of all that `spi.run` does for a spec, on one thread."""
    began = time.process_time()
    spi.run(wanted, out=None, threads=1, progress=False)
    return time.process_time() - began


def nanoseconds(cells, by, scheme, steps):
    """Of a spin and step: what a run of three times the steps takes longer, the median (least, most) of some."""
    short, long = spec(cells, by, scheme, steps), spec(cells, by, scheme, 3 * steps)
    taken(short)  # compiles
    found = sorted(1e9 * (taken(long) - taken(short)) / (2 * steps * cells**3) for _ in range(REPEATS))
    return found[REPEATS // 2], found[0], found[-1]


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
        best, steps = float("inf"), 20
        for _ in range(ROUNDS):
            parameters.llg.set_iterations(p_state, steps, steps)
            start = time.process_time()
            simulation.start(p_state, simulation.METHOD_LLG, getattr(simulation, f"SOLVER_{solver}"))
            best = min(best, time.process_time() - start)
    return 1e9 * best / steps / cells**3


def main(cells=32):
    print(f"vector instructions: {instruction_set()}; load {os.getloadavg()[0]:.1f}; one thread, processor time")
    ours = 0.0
    for by, scheme in (
        ("sites", "splitting_symmetric"),
        ("bonds", "splitting_symmetric"),
        ("sites", "splitting_metropolis"),
    ):
        steps = max(8, 2 * 10**7 // cells**3)
        told, _ = said(spec(cells, by, scheme, 3 * steps))
        ns, least, most = nanoseconds(cells, by, scheme, steps)
        whole = taken(spec(cells, by, scheme, 3 * steps))
        print(f"{cells}^3 spins by {by}, {scheme}: {ns:.1f} ({least:.1f} to {most:.1f}) ns per spin and step;", end=" ")
        print(f"{3 * steps} steps: said {told}; took {whole:.1f} s", flush=True)
        ours = ours or ns
    try:
        for solver in ("HEUN", "DEPONDT"):
            ns = spirit(cells, solver)
            print(f"Spirit, {solver.title()}: {ns:.1f} ns per spin and step, {ns / ours:.1f} times ours", flush=True)
    except ImportError:
        print("Spirit is not installed: pip install spirit")
    most = peak()
    speed = OPERATIONS / ours
    print(f"by sites {speed:.1f} operations on floats per ns, {most:.1f} at most: {speed / most:.0%}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
