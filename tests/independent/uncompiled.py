"""The program through its public face, without its compiler: a process of its own that answers for all tests here.

What it is asked and what it answers are Python data and arrays, so that the tests import nothing of `spi`.
"""

import functools
import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from unittest import mock

import numpy as np

if multiprocessing.parent_process() is not None:
    import spi
    from spi.api.paths import plan_of
    from spi.schemes import SCHEMES, strong_order


@functools.cache
def process():
    executor = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"))
    with mock.patch.dict(os.environ, NUMBA_DISABLE_JIT="1"):
        executor.submit(os.getpid).result()  # it starts now, with this environment
    return executor


def answer(name, args, options):
    try:
        return globals()[name](*args, **options)
    except Exception as error:  # not every one can be sent
        raise RuntimeError(f"{type(error).__name__}: {error}") from None


class Program:  # program.step(...) and so on: the functions below, called in that process
    def __getattr__(self, name):
        return lambda *args, **options: process().submit(answer, name, args, options).result()


program = Program()


def step(model, scheme, h, y, dW=None, **options):
    """The state after steps of size h from y with the rows of dW, one for each step, or for each part of one"""
    y = np.array(y, float)
    integrator = spi.Integrator(model, scheme, h, initial=y.ravel(), **options)
    dW = np.zeros((integrator.substeps, integrator.noises)) if dW is None else np.array(dW, float, ndmin=2)
    return integrator.steps(y.reshape(1, -1), dW[:, None].copy()).reshape(y.shape)


def start(model, paths=1, **options):
    """The states in which paths begin, by the key `initial` among the options"""
    return spi.Integrator(model, "splitting", 1.0, **options).start(paths)


def paths(*args, **options):
    return spi.trajectory(*args, **options).y.to_numpy()


def values(model, y, functions, **options):
    """Functions by name, or a text of names alone, of the state y, as a trajectory stores them at its start"""
    functions = functions if isinstance(functions, dict) else {f"f_{name}": name for name in functions.split()}
    spec = {"kind": "trajectory", "final_time": 1, "step": 1, "panels": ["functions"], "schemes": ["splitting"]}
    found = run(spec | {"model": model, "initial": np.ravel(y), "functions": functions} | options)
    return {name.removeprefix("f_"): f[0] for name, f in zip(found["function"].tolist(), found["value"], strict=True)}


def run(spec):
    """The arrays of the one part of the results of a spec"""
    results = spi.run(spec, name="independent", out=None)
    (part,) = results.parts
    dataset = results[part].dataset
    return {name: np.asarray(dataset[name]) for name in (*dataset.coords, *dataset.data_vars)}


def fluid(name, *args):
    """What spi.fluid gives"""
    return getattr(spi.fluid, name)(*args)


def schemes():
    return [name for name, row in SCHEMES.items() if not row.multiscale]


def paths_after(model, scheme, h, y, dW, areas, **options):
    """The stated strong order, states (coins, paths, d) after a step, whether five paths alone have the same, and what
    these report; the message where a scheme is refused
    """
    try:
        integrator = spi.Integrator(model, scheme, h, initial=y, **options)
        plan = plan_of(model, scheme, {"initial": y, "final_time": h, "step": h, **options})
    except spi.SpecError as error:
        return str(error)
    n, coins = integrator.substeps, (1.0, -1.0) if "coins" in integrator.needs else (1.0,)
    parts = np.repeat(dW[np.newaxis, :, : integrator.noises] / n, n, axis=0)
    areas = np.stack([areas[pair] for pair in integrator.pairs], axis=-1) if integrator.pairs else None
    start, few = np.repeat(np.array(y, float)[np.newaxis], len(dW), axis=0), slice(3, 8)
    ends = [integrator.step(start, parts, areas, np.full(len(dW), coin)) for coin in coins]
    alone = integrator.step(start[few], parts[:, few], None if areas is None else areas[few], np.full(5, coins[-1]))
    order = strong_order(plan.row, plan.model, plan.initial)
    return order, np.array(ends), np.array_equal(alone, ends[-1][few]), integrator.report
