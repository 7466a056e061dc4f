"""Rows for what the studies ask of a kernel beyond its plain form, timed together in one process."""

import math
from types import SimpleNamespace

import numpy as np
from examples import STEP, example
from pairs import BLOCKS, REPEATS, THREADS, our_work, seconds

from spi.ensemble.increments import RandomStream
from spi.ensemble.loop import arguments_of, grid, integrate, use_threads
from spi.ensemble.observer import path_observer
from spi.expressions import parse_expression
from spi.kinds.blocks import values_at_end
from spi.numerics.rng import BROWNIAN, LANES
from spi.schemes import SCHEMES
from spi.statistics.estimators import GROUPS, with_powers
from spi.statistics.tallies import Batch

STEPS = 2048
NOISE = RandomStream(np.uint64(1), np.uint64(BROWNIAN))
SPLITTING = SCHEMES["splitting"].record


def strong_work(model, initial, doublings):
    """The pass of the strong study, with several step sizes; per step of the smallest."""
    times = grid(STEP, STEPS, doublings, True)
    observer = path_observer(model, initial, times, BLOCKS, squares=True)
    arguments = arguments_of(SPLITTING, model, initial, times, NOISE, 0, BLOCKS, BLOCKS * LANES, observer)
    return lambda: integrate(*arguments)


def weak_work(model, initial, blocks, steps):
    """The pass of the weak study: the paper's test function and sums over paths."""
    functions = (parse_expression("sin(2*pi*y1) + sin(2*pi*y2) + sin(2*pi*y3)", type(model).dimension),)
    case = SimpleNamespace(expressions=functions)
    plan = SimpleNamespace(scheme=SPLITTING, model=model, initial=initial, case=case)
    times, batch = grid(STEP, steps), Batch.of_first(blocks)

    def work():
        values, _ = values_at_end(plan, times, NOISE, batch)
        with_powers(np.zeros((2, 1, 1, GROUPS)), values, batch)

    return work


def jobs():
    """{name: (steps of paths, work)}."""
    body, top = example("rigid_body")
    usual, many, few = BLOCKS * LANES * STEPS, 64, 256
    short = many * LANES * few
    result = {
        "rigid_body splitting": (usual, our_work(SPLITTING, body, top, STEPS)),
        "  every angle reduced": (usual, our_work(SPLITTING, body, top, STEPS, h=16.0)),
        "  truncated noise": (usual, our_work(SPLITTING, body, top, STEPS, truncate=True)),
        "  strong study, 9 coarser steps": (usual, strong_work(body, top, (*range(11, 2, -1), 0))),
        "  paths of 256 steps": (short, our_work(SPLITTING, body, top, few, blocks=many)),
        "  the same with the weak study": (short, weak_work(body, top, many, few)),
    }
    for name in ("rigid_body", "maxwell_bloch", "sine_euler"):
        model, initial = example(name)
        one_noise = model._replace(sigma=(1.0, *[None] * (len(model.sigma) - 1)))
        result[f"{name} splitting, one noise"] = usual, our_work(SPLITTING, one_noise, initial, STEPS)
    return result


def table():
    """Print the rows."""
    rows = jobs()
    for _, work in rows.values():
        work()  # compile
    best = {name: [math.inf, math.inf] for name in rows}
    for _ in range(REPEATS):
        for i, threads in enumerate((1, THREADS)):
            use_threads(threads)
            for name, (path_steps, work) in rows.items():
                best[name][i] = min(best[name][i], 1e9 * seconds(work) / path_steps)
    print("ns per step and path; per step of the smallest size where there are several")
    print(f"{'':36}{'1 thread':>10}{f'{THREADS} threads':>11}{'ratio':>8}")
    for name, (one, more) in best.items():
        print(f"{name:36}{one:10.2f}{more:11.2f}{one / more:8.2f}")
