"""What joint flows cost: sweeps of one kind alone, and whole steps, with increments and areas given.

    python benchmarks/joint.py [model ...]

Times are ns per step and path on one thread, the best of interleaved repetitions, where all angles are small.

Supports: docs/joint.md, "Which flows are joint". It times kernels, not `spi run`, since runs draw increments.

Short form: rigid_body
"""

import math
import sys
import time

import numpy as np
from examples import example

from spi.compiler.dispatch import kernel
from spi.compiler.vectors import without_refcount
from spi.ensemble.areas import area_count
from spi.ensemble.lanes import aligned
from spi.ensemble.protocol import dimension, noises
from spi.ensemble.scheme_protocol import advance, needs_areas, report_row, work_size
from spi.numerics.rng import LANES
from spi.schemes import SCHEMES
from spi.schemes.splitting import Splitting
from spi.schemes.stages import flows

STEP, STEPS, REPEATS = 2.0**-14, 512, 200
MODELS = ("rigid_body", "maxwell_bloch", "sine_euler")
ALONE = {f"flows of the {part} alone": Splitting((flows(part),)) for part in ("drift", "noise", "joint")}
WHOLE = ("splitting", "splitting_joint_lie", "splitting_joint", "splitting_areas", "splitting_joint_areas")


@kernel
def take_steps(scheme, model, h, dW, coins, y, work, report):
    dW, coins, y, work, report = without_refcount((dW, coins, y, work, report))
    for n in range(len(dW)):
        advance(scheme, model, h, dW[n], coins[n], y, work, report)


def work_of(scheme, model, initial):
    """A function that makes the steps of one block."""
    generator, m = np.random.default_rng(1), noises(model)
    pairs = area_count(model) if needs_areas(scheme) else 0
    dW = aligned(STEPS * (m + pairs) * LANES).reshape(STEPS, -1)
    dW[:] = math.sqrt(STEP) * generator.standard_normal(dW.shape)
    dW[:, m * LANES :] *= 0.5 * math.sqrt(STEP)
    coins = generator.choice([-1.0, 1.0], (STEPS, LANES))
    y, begin = aligned(dimension(model) * LANES), np.repeat(initial, LANES)
    work, report = aligned(work_size(scheme, model)), report_row()

    def make_steps():
        y[:] = begin
        take_steps(scheme, model, STEP, dW, coins, y, work, report)

    make_steps()  # which compiles
    return make_steps


def best_times(works):
    """ns per step and path of each of some works."""
    best = dict.fromkeys(works, math.inf)
    for _ in range(REPEATS):
        for name, work in works.items():
            began = time.perf_counter()
            work()
            best[name] = min(best[name], time.perf_counter() - began)
    return {name: 1e9 * seconds / (STEPS * LANES) for name, seconds in best.items()}


def main():
    for name in sys.argv[1:] or MODELS:
        model, initial = example(name)
        schemes = ALONE | {scheme: SCHEMES[scheme].record for scheme in WHOLE}
        found = best_times({scheme: work_of(record, model, initial) for scheme, record in schemes.items()})
        print(name)
        for scheme, ns in found.items():
            print(f"  {scheme:28}{ns:7.2f} ns")
        ratio = found["flows of the joint alone"] / found["flows of the noise alone"]
        print(f"  a joint flow takes {ratio:.2f} times what a noise flow takes", flush=True)


if __name__ == "__main__":
    main()
