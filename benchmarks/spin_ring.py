"""A model of many components: a ring of n spins, 3 n components, and what its kernels cost to compile and to run.

    python benchmarks/spin_ring.py                     eight spins, one process and one empty cache per scheme
    python benchmarks/spin_ring.py --spins 4 splitting
    python benchmarks/spin_ring.py --profile splitting  where the time of compiling goes

The model is written out as a program would write it: straight-line code, one branch per piece or noise.

Supports: no page; it is for finding, and times kernels by themselves.

Short form: splitting --spins 4
"""

import argparse
import cProfile
import os
import pstats
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

HEAD = '''
from typing import Annotated, NamedTuple

from spi.numerics.angles import sin_versine
from spi.compiler.dispatch import device
from spi.ensemble.protocol import NonNegative, Positive


@device
def turned(angles, theta, p, q):
    """(p, q) turned by the angle -theta."""
    s, v = sin_versine(angles, theta)
    return p + (s * q - v * p), q - (s * p + v * q)


class {name}(NamedTuple):
    """Spins a_i on a ring, da_i/dt = a_i x grad_i H, H = sum_i sum_k J_k a_ik a_(i+1)k, noises in single spins."""

    coupling: Annotated[tuple[Positive, Positive, Positive], "J_1, J_2, J_3"]
    sigma: Annotated[tuple[{strengths}], "strengths of the noises; 0 switches one off"]

    dimension = {dimension}
    pieces = 3
    noises = {noises}
    conserved = {spins}
'''


def source(name, spins):
    """The text of a module with the model `name`, with a noise for each spin and three that turn all spins."""
    y = [f"y{i}" for i in range(3 * spins)]
    everything = ", ".join(y)
    unpack = f"{everything} = y"
    noises = [(i % 3, [i]) for i in range(spins)]
    noises += [(k, list(range(spins))) for k in range(3)]

    def turn(theta, i, k):
        p, q = 3 * i + (k + 1) % 3, 3 * i + (k + 2) % 3
        return f"y{p}, y{q} = turned(angles, {theta}, y{p}, y{q})"

    def field(k, i, v="y"):
        return f"model.coupling[{k}] * ({v}{3 * ((i - 1) % spins) + k} + {v}{3 * ((i + 1) % spins) + k})"

    def method(head, *lines):
        text.append(f"\n    def {head}:\n" + "\n".join("        " + line for line in lines))

    def branches(cases):
        """Lines of `if k == ...`, the last without a condition."""
        lines = []
        for k, case in enumerate(cases):
            last = k == len(cases) - 1
            lines += case if last else [f"if k == {k}:", *("    " + line for line in case)]
        return lines

    text = [
        HEAD.format(
            name=name,
            strengths=", ".join(["NonNegative | None"] * len(noises)),
            dimension=3 * spins,
            noises=len(noises),
            spins=spins,
        )
    ]
    ring = range(spins)
    drift, drift_angles = [], []
    for k in range(3):
        drift.append([turn(f"t * ({field(k, i)})", i, k) for i in ring] + [f"return {everything}"])
        sizes = [f"abs({field(k, i)})" for i in ring]
        drift_angles.append([f"return abs(t) * max({', '.join(sizes)})"])
    method("drift_flow(model, k, t, y, angles)", unpack, *branches(drift))
    method("drift_angle(model, k, t, y)", unpack, *branches(drift_angles))
    kicks = [[turn("t", i, k) for i in acting] + [f"return {everything}"] for k, acting in noises]
    method("noise_flow(model, k, t, y, angles)", unpack, *branches(kicks))
    method("noise_angle(model, k, t, y)", "return abs(t)")
    cross = []
    for i in ring:
        a, b, c = 3 * i, 3 * i + 1, 3 * i + 2
        for p, q in ((b, c), (c, a), (a, b)):
            cross.append(f"y[{p}] * v[{q}] - y[{q}] * v[{p}]")
    method("structure(model, y, v)", f"return {', '.join(cross)}")
    lengths = ["y[{0}] * y[{0}] + y[{1}] * y[{1}] + y[{2}] * y[{2}]".format(3 * i, 3 * i + 1, 3 * i + 2) for i in ring]
    method("casimirs(model, y)", f"return ({', '.join(lengths)},)")
    pairs = [f"model.coupling[{k}] * y[{3 * i + k}] * y[{3 * ((i + 1) % spins) + k}]" for i in ring for k in range(3)]
    method("hamiltonian(model, y)", f"return {' + '.join(pairs)}")
    fields = ", ".join(field(k, i, "v") for i in ring for k in range(3))
    unpack_v = unpack.replace("y", "v")
    method("drift_hessian(model, y, v)", unpack_v, f"return {fields}")
    method("drift_gradient(model, y)", unpack.replace("y", "v").replace("= v", "= y"), f"return {fields}")
    components = range(3 * spins)
    units = [["return " + ", ".join(str(float(j % 3 == k and j // 3 in on)) for j in components)] for k, on in noises]
    method("noise_gradient(model, k, y)", *branches(units))
    method("noise_hessian(model, k, y, v)", f"return {', '.join(['0.0'] * 3 * spins)}")
    return "\n".join(text) + "\n"


def ring(spins, folder, on=None):
    """A record of the model, from a module written into `folder`; the first `on` of its noises are on, or all."""
    name = f"SpinRing{spins}"
    with open(os.path.join(folder, "spin_ring_model.py"), "w") as file:
        file.write(source(name, spins))
    if folder not in sys.path:
        sys.path.insert(0, folder)
    import spin_ring_model

    cls = getattr(spin_ring_model, name)
    return cls((1.0, 0.8, 0.6), tuple(0.3 if on is None or k < on else None for k in range(cls.noises)))


def strong_run(model, scheme, steps):
    """Have the kernel of strong errors make `steps` reference steps of one block, and as many of twice the size."""
    import numpy as np

    from spi.ensemble.increments import brownian
    from spi.ensemble.loop import integrated, nested_grid
    from spi.ensemble.observer import path_observer
    from spi.ensemble.protocol import dimension
    from spi.schemes import SCHEMES

    times = nested_grid(steps * 2.0**-10, 2.0**-10, [2.0**-9], True, None)
    initial = tuple(np.cos(np.arange(dimension(model))).tolist())
    observer = path_observer(model, initial, times, 1, squares=True)
    integrated(SCHEMES[scheme].record, model, initial, times, brownian(1), 0, 1, 64, observer)
    return observer.extremes.max()


class Measured(NamedTuple):
    """What one process found."""

    compile_seconds: float  #: processor time of the first call
    ns_per_step: float  #: and path
    drift: float


def measure(spins, scheme, on=None):
    """Compile and time the kernel of a scheme in this process, whose cache should be empty."""
    with tempfile.TemporaryDirectory() as folder:
        model = ring(spins, folder, on)
        began = time.process_time()
        strong_run(model, scheme, 2)
        compiled = time.process_time() - began
        steps, best = 2048, float("inf")
        for _ in range(7):
            began = time.perf_counter()
            drift = strong_run(model, scheme, steps)
            best = min(best, time.perf_counter() - began)
    return Measured(compiled, best / (1.5 * steps * 64) * 1e9, drift)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("schemes", nargs="*")
    parser.add_argument("--spins", type=int, default=8)
    parser.add_argument("--noises", type=int, help="how many are on, with --here or --profile; default: all")
    parser.add_argument("--profile", action="store_true", help="where the time of compiling goes")
    parser.add_argument("--here", action="store_true", help="in this process, with the cache as it is")
    chosen = parser.parse_args()
    schemes = chosen.schemes or ["splitting", "euler_maruyama", "midpoint"]
    if chosen.profile or chosen.here:
        profile = cProfile.Profile(time.process_time)
        arguments = chosen.spins, schemes[0], chosen.noises
        found = profile.runcall(measure, *arguments) if chosen.profile else measure(*arguments)
        print(f"{schemes[0]:16} {found.compile_seconds:8.1f} s  {found.ns_per_step:8.1f} ns  drift {found.drift:.1e}")
        if chosen.profile:
            pstats.Stats(profile).sort_stats("tottime").print_stats(30)
        return
    print(f"{3 * chosen.spins} components: processor time to compile, time per step and path, largest Casimir drift")
    for scheme in schemes:
        with tempfile.TemporaryDirectory() as cache:
            command = [sys.executable, __file__, "--here", "--spins", str(chosen.spins), scheme]
            subprocess.run(command, env={**os.environ, "SPI_CACHE_DIR": cache}, check=True)


if __name__ == "__main__":
    main()
