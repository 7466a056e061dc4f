"""Systems written in YAML beside the models of the package, timed in one run.

    python benchmarks/systems.py [system ...]      all of them, about a minute and a half, most of it compiling

Each line is the time of a step of `splitting`, random numbers included, of a system from YAML over that of a built-in
model: of the same system, or per flow of the rigid body.  The least of several interleaved repetitions counts.

Supports: no page; it is for finding, and times kernels by themselves.

Short form: rigid_body
"""

import argparse
import itertools
import time
from pathlib import Path

import numpy as np
import yaml
from examples import example
from pairs import our_work

from spi.ensemble.loop import use_threads
from spi.ensemble.protocol import dimension, noises, pieces, structure
from spi.plugins.systems import generated as systems
from spi.schemes import SCHEMES

GALLERY = Path(__file__).parent.parent / "experiments" / "systems"
OF_GALLERY = ("heavy_top", "spin_ring")
REPEATS, STEPS = 25, 2048
#: What the Hamiltonian and the noises of the built-in models are, in y1, y2, ...
HAMILTONIANS = {
    "rigid_body": ("y1^2/4 + y2^2/2 + y3^2*3/4", ["y1^2/2", "y2^2/4", "y3^2/6"]),
    "maxwell_bloch": ("y1^2/2 + y3", ["y1^2/2", "y3"]),
    "sine_euler": (
        "y1^2 + y2^2 + (y3^2 + y4^2)/2 + y5^2 + y6^2 + (y7^2 + y8^2)/2",
        ["y1^2 + y2^2", "(y3^2 + y4^2)/2", "y5^2 + y6^2", "(y7^2 + y8^2)/2"],
    ),
}
#: Numbers that occur in their brackets, as formulas.
EXACT = {0.5: "1/2", 1.0: "1", np.sqrt(3) / 2: "sqrt(3)/2", np.sqrt(3) / 4: "sqrt(3)/4", np.sqrt(3) / 8: "sqrt(3)/8"}


def twin(name):
    """The built-in model as a definition; B(y) is linear in y, so that its values at unit vectors tell it."""
    model, _ = example(name)
    d = dimension(model)
    units = [tuple(map(float, row)) for row in np.eye(d)]
    entries = np.array([[structure(model, y, v) for v in units] for y in units])  # [k, j, i]
    bracket = {}
    for i, j in itertools.combinations(range(d), 2):
        terms = [f"({formula(entries[k, j, i])})*y{k + 1}" for k in range(d) if entries[k, j, i]]
        if terms:
            bracket[f"y{i + 1} y{j + 1}"] = " + ".join(terms)
    hamiltonian, noise = HAMILTONIANS[name]
    names = [f"y{i + 1}" for i in range(d)]
    return {"variables": names, "bracket": bracket, "hamiltonian": hamiltonian, "noises": noise}


def formula(value):
    """A number of a bracket, exactly."""
    near = min(EXACT, key=lambda known: abs(known - abs(value)))
    assert abs(near - abs(value)) < 1e-15
    return ("-" if value < 0 else "") + EXACT[near]


def record(definition, name):
    """The model of a definition."""
    definition = {key: value for key, value in definition.items() if key != "sigma"}
    return systems.record(systems.made(definition, name))


def flows(model):
    """How many flows a step of `splitting` has."""
    return pieces(model) + noises(model)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    everything = [*HAMILTONIANS, *OF_GALLERY]
    parser.add_argument("systems", nargs="*", metavar="system", help=f"of {', '.join(everything)}; default: all")
    chosen = parser.parse_args().systems or everything
    if unknown := set(chosen) - set(everything):
        parser.error(f"no such system: {', '.join(sorted(unknown))}")
    use_threads(1)
    generator = np.random.default_rng(1)
    compared = [(name, record(twin(name), name), name, 1.0) for name in HAMILTONIANS if name in chosen]
    body = flows(example("rigid_body")[0])
    for name in OF_GALLERY:
        if name in chosen:
            model = record(yaml.load((GALLERY / f"{name}.yaml").read_text(), yaml.BaseLoader), name)
            compared.append((name, model, "rigid_body", flows(model) / body))
    scheme, jobs = SCHEMES["splitting"].record, []
    for _, model, built_in, _ in compared:
        own = tuple(generator.uniform(0.2, 0.6, dimension(model)).tolist())
        other, initial = example(built_in)
        own = initial if dimension(other) == dimension(model) else own
        jobs.append((our_work(scheme, model, own, STEPS), our_work(scheme, other, initial, STEPS)))
    best = np.full((len(jobs), 2), np.inf)
    for _ in range(REPEATS):
        for n, pair in enumerate(jobs):
            for side, job in enumerate(pair):
                start = time.perf_counter()
                job()
                best[n, side] = min(best[n, side], time.perf_counter() - start)
    for (name, _, built_in, per), (own, other) in zip(compared, best, strict=True):
        against = f"{built_in} of the package" if per == 1.0 else f"{built_in} of the package, per flow"
        print(f"{name:14} {own / other / per:6.2f} times the {against}")


if __name__ == "__main__":
    main()
