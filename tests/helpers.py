"""What several test files share: a model, records that only tests need, and kernels around the words.

Kernels are found in the disk cache by the types of their arguments, so records live in a module that can be imported;
an edit of this file empties the cache of the tests (see conftest.py).
"""

import contextlib
import io
import itertools
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numba
import numpy as np
import pytest

from spi import views
from spi.compiler.dispatch import kernel, number, unrolled
from spi.compiler.inlining import uncompiled
from spi.ensemble.areas import area_count
from spi.ensemble.fields import add_noise_fields, add_scaled, drift_field
from spi.ensemble.increments import RandomStream, first_lane
from spi.ensemble.lanes import load_lane, store_lane
from spi.ensemble.loop import grid, integrate, integrated, paths_of
from spi.ensemble.observer import STATES, last_states_only
from spi.ensemble.protocol import area_pairs, dimension, drift_flow, large, noise_flow, noise_indices, noises, pieces
from spi.ensemble.scheme_protocol import (
    advance,
    advance_large,
    judges,
    memory_size,
    needs_areas,
    report_row,
    substeps,
    work_size,
)
from spi.models import RigidBody
from spi.models.delegation import Damped
from spi.numerics.angles import ReducedAngles
from spi.numerics.rng import BROWNIAN, LANES
from spi.schemes import SCHEMES as ALL_SCHEMES

COMPILED = not numba.config.DISABLE_JIT
compiled_only = pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")

#: The schemes of the equation itself; those of the multiscale system and at a temperature have test files of their own.
SCHEMES = {name: row for name, row in ALL_SCHEMES.items() if not (row.multiscale or judges(row.record))}
#: Those whose step takes one increment of each noise; what has sub-steps is tested in tests/ensemble/test_substeps.py.
WITHOUT_SUBSTEPS = {name: row for name, row in SCHEMES.items() if substeps(row.record) == 1}
#: Those that have a near relative, with the same stages in another order or fewer of them: their loops are compiled by
#: slow tests only.
RELATIVES = {
    "splitting_drift_first",
    "splitting_joint",
    "splitting_joint_lie",
    "splitting_joint_areas",
    "euler_maruyama_renormalised",
    "isospectral_midpoint",
    "munthe_kaas_euler",
    "munthe_kaas_midpoint",
    "roessler_rs2",
}


def in_loops(*names):
    """Names of schemes as a parameter of a test that compiles their loops."""
    return pytest.param(*names, marks=pytest.mark.slow if RELATIVES & {*names} else ())


#: The example of the paper's section 4.2.
RIGID_BODY = RigidBody((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0))
#: The same equations with one noise.
ONE_NOISE = RIGID_BODY._replace(sigma=(1.0, None, None))
INITIAL = (math.cos(1.1), 0.0, math.sin(1.1))


class LinearlyDamped(NamedTuple):
    """Damping by the factor 1 - gamma t: not exact, and no test of the decay may pass it."""

    model: NamedTuple
    damping: float
    sigma: tuple

    def drift_flow(model, k, t, y, angles):
        if k < pieces(model.model):
            return drift_flow(model.model, k, t, y, angles)
        return add_scaled(y, -model.damping * t, y)


for _name, _word in vars(Damped).items():
    if not _name.startswith("_") and _name not in (*Damped._fields, "drift_flow", "frozen"):
        setattr(LinearlyDamped, _name, _word)


# --- records for the ensemble ----------------------------------------------------------------------------------------


@unrolled(noise_indices)
def put_increments(index, model, y, dW):
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        y[lane] = dW[lane]
    return y


class Increments(NamedTuple):
    """Not a scheme at all: the new state is the increment itself, so that an observer sees it to the last bit."""

    def advance(scheme, model, h, dW, coins, y, work, report):
        put_increments(model, y, dW)


class SubIncrements(NamedTuple):
    """No scheme either: the new state is the increment over sub-step `part` of n."""

    n: int
    part: int

    substeps = 8

    def advance(scheme, model, h, dW, coins, y, work, report):
        put_increments(model, y, dW[first_lane(model, 0, scheme.n, scheme.part) :])


class StepAreas(NamedTuple):
    """No scheme either: the first components of the new state are the Lévy areas of the step."""

    needs_areas = True

    def advance(scheme, model, h, dW, coins, y, work, report):
        for i in range(area_count(model) * LANES):
            y[i] = dW[len(dW) - area_count(model) * LANES + i]


class Coins(NamedTuple):
    """No scheme either: the first component of the new state is the coin."""

    tosses = True

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            y[lane] = coins[lane]


class WithoutCorrection(NamedTuple):
    """A wrong scheme: Euler-Maruyama that takes the Stratonovich equation for an Itô equation."""

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            new = add_scaled(state, h, drift_field(model, state))
            store_lane(y, lane, add_noise_fields(model, new, dW, lane, state))


def simulate(
    scheme,
    model=RIGID_BODY,
    *,
    h,
    steps,
    doublings=(0,),
    snapshots=1,
    blocks=1,
    first_block=0,
    samples=None,
    truncate=False,
    reversals=None,
    area_terms=0,
    seed=1,
    initial=INITIAL,
):
    """Run the ensemble with ``steps`` steps of the reference step h.

    Returns the states at ``snapshots`` equidistant times, an array [level, snapshot, component, path] (with 0 in place
    of ``snapshots``: a list of levels, all steps kept), and the report, an array [block, level, column].
    """
    d, levels, counts = type(model).dimension, len(doublings), np.array([steps >> s for s in doublings])
    assert all(count << s == steps for count, s in zip(counts, doublings, strict=True))
    times = grid(h, steps, *from_large_to_small(doublings, truncate, reversals), area_terms=area_terms)
    each = counts // (snapshots or counts)
    kept = np.array([snapshots] * levels if snapshots else counts)
    places = np.cumsum(kept) - kept
    rows = np.full((blocks, kept.sum(), d * LANES), np.nan)
    observer = last_states_only(times)._replace(
        rows=rows, holds=STATES, levels=np.stack([places, each, counts], axis=1)[::-1].astype(np.int64)
    )
    end = (first_block + blocks) * LANES if samples is None else samples
    noise = RandomStream(np.uint64(seed), np.uint64(BROWNIAN))
    _, report = integrated(scheme, model, initial, times, noise, first_block, blocks, end, observer)
    states = rows.reshape(blocks, -1, d, LANES).transpose(1, 2, 0, 3).reshape(-1, d, blocks * LANES)
    of_levels = [states[place : place + count] for place, count in zip(places, kept, strict=True)]
    return (np.stack(of_levels) if snapshots else of_levels), report[:, ::-1]


#: What :func:`final_states` takes of the paths of a grid.
PATHS = {"doublings": (0,), "truncate": False, "reversals": None}


def from_large_to_small(doublings, truncate, reversals):
    """The paths of a grid in its order: tests name them from the reference on."""
    return doublings[::-1], truncate, None if reversals is None else reversals[::-1]


def final_states(scheme, model=RIGID_BODY, *, h, steps, blocks, first_block=0, seed=1, stream=BROWNIAN, **options):
    """The last states alone, an array [level, component, path]; `options` are grid's."""
    initial, noise = options.pop("initial", INITIAL), RandomStream(np.uint64(seed), np.uint64(stream))
    shape = from_large_to_small(*(options.pop(name, no) for name, no in PATHS.items()))
    times, end = grid(h, steps, *shape, **options), (first_block + blocks) * LANES
    states, _ = integrated(scheme, model, initial, times, noise, first_block, blocks, end)
    return paths_of(states, dimension(model))[::-1]


@contextlib.contextmanager
def loop_in_python():
    """Within it the loop over time is not compiled: of few steps of few paths that takes less time."""

    def in_python(*arguments):
        with uncompiled(), np.errstate(all="ignore"):
            getattr(integrate, "py_func", integrate)(*arguments)

    def replace(function, by):
        for name, module in list(sys.modules.items()):
            if name.startswith("spi.") and vars(module).get("integrate") is function:
                module.integrate = by

    replace(integrate, in_python)
    try:
        yield
    finally:
        replace(in_python, integrate)


# --- schemes and flows without the ensemble --------------------------------------------------------------------------


@kernel
def _advance(scheme, model, h, dW, coins, y, work, report):
    for n in range(dW.shape[0]):
        advance(scheme, model, h, dW[n], coins[n], y, work, report)


@kernel
def _advance_large(scheme, model, h, dW, coins, y, work, report):
    for n in range(dW.shape[0]):
        advance_large(scheme, model, h, dW[n], coins[n], y, work, report)


def take_steps(scheme, model, h, dW, y, coins=None, steps=None):
    """The states [component, lane] after steps of size h with increments dW [step, noise, lane], and the report.

    For a scheme with sub-steps dW is [step, place in a row of increments, noise, lane].  One that needs Lévy areas has
    them behind the noises, dW [step, noise or pair, lane]; without them they are 0.  `coins` [step, lane] are all 1
    unless given.
    """
    y = np.array(y, float)
    block, report = np.concatenate([y.ravel(), np.zeros(memory_size(scheme, model))]), report_row()
    dW = np.ascontiguousarray(dW, float)
    if needs_areas(scheme) and dW.shape[1] == noises(model):
        dW = np.concatenate([dW, np.zeros((len(dW), len(area_pairs(model)), LANES))], axis=1)
    dW = dW.reshape(len(dW), -1)
    assert dW.shape[1] >= (2 * substeps(scheme) - 1) * noises(model) * LANES
    coins = np.ones((len(dW), LANES)) if coins is None else np.ascontiguousarray(coins, float)
    steps = steps or (_advance_large if large(model) else _advance)
    steps(scheme, model, float(h), dW, coins, block, np.empty(work_size(scheme, model)), report)
    return block[: y.size].reshape(y.shape), report


def take_step(scheme, model, h, dW, y, coins=None):
    """The same for one step with increments dW [noise, lane] and coins [lane], uncompiled: that takes less time.

    What kernels make of the same Python code is tested for every scheme, see test_ensemble.py.
    """
    coins, plain = None if coins is None else coins[np.newaxis], getattr(_advance, "py_func", _advance)
    with uncompiled(), np.errstate(all="ignore"):
        return take_steps(scheme, model, h, np.asarray(dW)[np.newaxis], y, coins, plain)


class LibraryAngles(NamedTuple):
    """Angles of any size, and arrays of them, by NumPy's functions."""

    def sin_versine(angles, x):
        half = np.sin(0.5 * x)
        return np.sin(x), 2.0 * half * half

    sinc_versinc = ReducedAngles.sinc_versinc
    adding_to_zero = ReducedAngles.adding_to_zero


def composed(model, flows, h, y, dW):
    """One step of one path, or of arrays of them, by the flows of ``schemes.stages.compositions``, uncompiled."""
    for part, k, share in flows:
        if part == "drift":
            y = drift_flow(model, k, share * h, y, LibraryAngles())
        elif model.sigma[k] is not None:
            y = noise_flow(model, k, model.sigma[k] * dW[k], y, LibraryAngles())
    return y


def by_quadrature(model, compositions, initial, h, n, phi, points):
    """E phi after n steps of ((probability, flows), ...), by Gauss-Hermite quadrature in all increments."""
    on = [k for k, sigma in enumerate(model.sigma) if sigma is not None]
    x, w = np.polynomial.hermite_e.hermegauss(points)
    grid = math.sqrt(h) * np.array(np.meshgrid(*[x] * (n * len(on)))).reshape(n, len(on), -1)
    weight = math.prod(np.meshgrid(*[w / w.sum()] * (n * len(on)))).ravel()
    total = 0.0
    for words in itertools.product(compositions, repeat=n):
        y = tuple(np.full(weight.shape, v) for v in initial)
        for (_, word), increments in zip(words, grid, strict=True):
            y = composed(model, word, h, y, dict(zip(on, increments, strict=True)))
        total += math.prod(p for p, _ in words) * np.sum(weight * phi(np.array(y)))
    return total


def random_states(generator, d=3):
    """States of one block, an array [component, lane] of standard normals."""
    return generator.standard_normal((d, LANES))


# --- the rigid body by hand, from the paper's section 4.2 ------------------------------------------------------------


def turned(k, angle, y, sin=math.sin, cos=math.cos):
    """exp of the flow about axis k = 0, 1, 2, as the paper prints it for k = 0 and cyclically for the others."""
    c, s = cos(angle), sin(angle)
    y1, y2, y3 = y
    if k == 0:
        return y1, c * y2 + s * y3, c * y3 - s * y2
    if k == 1:
        return c * y1 - s * y3, y2, c * y3 + s * y1
    return c * y1 + s * y2, c * y2 - s * y1, y3


def composition(model, h, dW, y, noise_first=True):
    """One step of slpI (or of its variant with the deterministic part first) for one path, by the printed formulas."""

    def noise(y):
        for k in range(3):
            y = turned(k, (model.sigma[k] or 0.0) * dW[k] * y[k] / model.noise_inertia[k], y)
        return y

    def drift(y):
        for k in range(3):
            y = turned(k, h * y[k] / model.inertia[k], y)
        return y

    return drift(noise(y)) if noise_first else noise(drift(y))


def order_2(model, h, dW, coin, y):
    """One step of the remark rem:order2 for one path: Phi^det_{h/2} o Phi^sto_{h,coin} o Phi^det_{h/2}."""

    def drift(k, t, y):
        return turned(k, t * y[k] / model.inertia[k], y)

    def noise(k, y):
        return turned(k, (model.sigma[k] or 0.0) * dW[k] * y[k] / model.noise_inertia[k], y)

    def half(y):
        return drift(0, h / 4, drift(1, h / 4, drift(2, h / 2, drift(1, h / 4, drift(0, h / 4, y)))))

    y = half(y)
    y = noise(2, noise(1, noise(0, y))) if coin == 1 else noise(0, noise(1, noise(2, y)))
    return half(y)


#: name of a scheme -> its step by the printed formulas, (model, h, dW, coin, y) -> y
BY_HAND = {
    "splitting": lambda model, h, dW, coin, y: composition(model, h, dW, y),
    "splitting_drift_first": lambda model, h, dW, coin, y: composition(model, h, dW, y, noise_first=False),
    "splitting_order2": order_2,
}


# --- tables -----------------------------------------------------------------------------------------------------------


def without_the_compiler(program):
    """What a program prints as JSON that runs in a process without the compiler, and may import what tests do."""
    tests = Path(__file__).parent
    path = os.pathsep.join([str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path}
    answer = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert answer.returncode == 0, answer.stderr
    return json.loads(answer.stdout)


def printed(results):
    """What ``spi show`` prints."""
    text = io.StringIO()
    views.print_tables(results, text)
    return text.getvalue()
