"""What the tests of the model `zeitlin` share: one kernel that asks it everything, compiled once for all N."""

import math
from typing import NamedTuple

import fluids
import numpy as np

from spi.compiler.dispatch import device, kernel
from spi.ensemble.protocol import (
    add_block_drift,
    add_block_ito_correction,
    add_block_noises,
    block_drift_flow,
    block_noise_flow,
    block_work,
    casimirs,
    hamiltonian,
)
from spi.ensemble.scheme_protocol import REPORT, advance_large, of_arrays, report_row, work_size
from spi.numerics.rng import LANES
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.plugins.fluids.models.kernels import tables
from spi.schemes import SCHEMES
from spi.schemes.stages import substeps

#: Sizes that are prime and not; of 9 and 15 modes lie on several lines.
SIZES = (5, 7, 9, 15)

#: The schemes by their numbers in the kernel.
_NAMES = "splitting", "splitting_order2", "splitting_symmetric", "euler_maruyama"
STEPPERS = {name: SCHEMES[name].record for name in _NAMES}

#: What the kernel is asked.
DRIFT_FLOW, NOISE_FLOW, DRIFT_FIELD, NOISE_FIELDS, ITO_CORRECTION, CASIMIRS, ENERGY, STEPS = range(8)


@device(inline=False)  # as the steps are, so that they share what is compiled of the words
def _answer(what, model, k, t, width, times, y, out, work):
    """One of the words; what it returns, or 0."""
    if what == DRIFT_FLOW:
        return block_drift_flow(model, k, t, width, y, work)
    if what == NOISE_FLOW:
        return block_noise_flow(model, k, times[0], width, y, work)
    if what == DRIFT_FIELD:
        add_block_drift(model, t, width, y, out, work)
    elif what == NOISE_FIELDS:
        add_block_noises(model, times[0], width, y, out, work)
    elif what == ITO_CORRECTION:
        add_block_ito_correction(model, t, width, y, out, work)
    elif what == CASIMIRS:
        out[: model.c] = casimirs(model, y)
    elif what == ENERGY:
        return hamiltonian(model, y)
    return 0.0


@kernel
def _ask(what, schemes, model, k, t, width, times, coins, y, out, work):
    """One of the words, or steps of scheme number k; what the word returns, or 0."""
    if what != STEPS:
        return _answer(what, model, k, t, width, times, y, out, work)
    for n in range(len(coins)):
        if k == 0:
            advance_large(schemes[0], model, t, times[n], coins[n], y, work, out)
        elif k == 1:
            advance_large(schemes[1], model, t, times[n], coins[n], y, work, out)
        elif k == 2:
            advance_large(schemes[2], model, t, times[n], coins[n], y, work, out)
        else:
            advance_large(schemes[3], model, t, times[n], coins[n], y, work, out)
    return 0.0


def noisy(n, **options):
    """A model with noises of both kinds, on four lines.

    On the line of (1, 0) are four processes, among them both kinds on one mode; on that of (1, 1) are two, one of them
    given by the mode opposite to the one that stands for both.
    """
    noise = (
        ModeNoise(0.5, modes=((0, 1),), hamiltonian="linear"),
        ModeNoise(0.7, modes=((2, 0), (1, 1), (1, -2))),
        ModeNoise(0.3, modes=((-1, 0),), hamiltonian="linear"),
        ModeNoise(0.9, modes=((-1, 0), (-2, -2))),
    )
    return Zeitlin(n, noise, **options)


def states(n, count):
    """Random states (count, d) with a mean square vorticity of 1."""
    return np.array([fluids.random_state(n, seed) for seed in range(count)])


def increments(model, h, steps, paths, seed=1):
    """Increments over the halves of steps, (steps, 2, m, paths)."""
    return math.sqrt(h / 2) * np.random.default_rng(seed).standard_normal((steps, 2, tables(model).m, paths))


def coins_of(paths):
    """Coins on both sides, in no regular order."""
    return np.where(np.random.default_rng(3).random(paths) < 0.5, 1.0, -1.0)


def apart(a, b):
    """The largest distance of two states, relative to the length of the second."""
    return np.max(np.linalg.norm(np.asarray(a) - b, axis=-1) / np.linalg.norm(b, axis=-1))


_NO_TIMES, _NO_COINS = np.zeros((1, 1)), np.zeros((0, LANES))


def moved(model, what, k, t, states):
    """The states (paths, d), 1 or 8 of them, after the flow of line or group number k; and its largest angle.

    `t` is a time or, of a group of noises, times (m,) or (m, paths).
    """
    y, _, largest = _of_block(model, what, k, t, states)
    return y, largest


def field(model, what, t, states):
    """What the words that add fields add to 0."""
    return _of_block(model, what, 0, t, states)[1]


def _of_block(model, what, k, t, states):
    of, (width, d) = tables(model), np.shape(states)
    y, out, times = np.array(states).T.ravel(), np.zeros(d * width), _NO_TIMES
    if what in (NOISE_FLOW, NOISE_FIELDS):
        times, t = np.array(np.broadcast_to(np.reshape(t, (of.m, -1)), (of.m, width))).reshape(1, -1), 0.0
    work = np.full(block_work(of), np.nan)
    largest = _ask(what, _schemes(of), of, k, t, width, times, _NO_COINS, y, out, work)
    return y.reshape(d, width).T, out.reshape(d, width).T, largest


def casimirs_of(model, y):
    """(C_2, C_3, ...) by the kernel."""
    out = np.zeros(len(y))
    _ask(
        CASIMIRS, _schemes(tables(model)), tables(model), 0, 0.0, 1, _NO_TIMES, _NO_COINS, np.array(y), out, np.zeros(1)
    )
    return out[: tables(model).c]


def energy_of(model, y):
    """H by the kernel."""
    return _ask(
        ENERGY,
        _schemes(tables(model)),
        tables(model),
        0,
        0.0,
        1,
        _NO_TIMES,
        _NO_COINS,
        np.array(y),
        np.zeros(1),
        np.zeros(1),
    )


def _schemes(of):
    """The records of all schemes for a model."""
    return tuple(of_arrays(scheme, of) for scheme in STEPPERS.values())


class Taken(NamedTuple):
    """Where steps lead."""

    states: np.ndarray  #: (paths, d)
    report: np.ndarray


def take(name, model, h, halves, states, coins=1.0, in_python=False):
    """The states (paths, d) after steps of size h with increments `halves` (steps, 2, m, paths) over their halves.

    `coins` are those of the paths, in all steps.  What belongs to no path, and scratch, are NaN.  `in_python` asks the
    kernel's own Python function.
    """
    scheme, of = STEPPERS[name], tables(model)
    steps, _, m, paths = halves.shape
    rows = [halves[:, 0] + halves[:, 1]]
    if substeps(getattr(scheme, "stages", ())) == 2:
        rows += [halves[:, 0], halves[:, 1]]
    dW, tossed = np.full((steps, len(rows) * m, LANES), np.nan), np.full((steps, LANES), np.nan)
    dW[:, :, :paths] = np.concatenate(rows, axis=1)
    tossed[:, :paths] = coins
    y = np.full((of.d, LANES), np.nan)
    y[:, :paths] = np.transpose(states)
    y, report, work = y.ravel(), report_row(end=paths), np.full(work_size(of_arrays(scheme, of), of), np.nan)
    number = list(STEPPERS).index(name)
    asked = _ask.py_func if in_python else _ask
    asked(STEPS, _schemes(of), of, number, h, paths, dW.reshape(steps, len(rows) * m * LANES), tossed, y, report, work)
    return Taken(y.reshape(of.d, LANES)[:, :paths].T, report[: len(REPORT)])
