"""What the tests of the strong study share: cases, and the same numbers computed in plain NumPy.

The oracle takes the normals of the generator and writes everything else out anew, from the printed equations:
increments, schemes, errors, drifts, standard errors and the fit.
"""

import math
from pathlib import Path

import numpy as np
from helpers import COMPILED
from states import finished

from spi.compiler.dispatch import kernel
from spi.kinds.strong import study as strong
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW, draw_normals
from spi.running.run import load
from spi.storage.records import Part

EXPERIMENT = Path(__file__).parents[1] / "experiments" / "rigid_body_strong.yaml"
SIZES = [] if COMPILED else ["steps=2^-2 .. 2^-4", "reference_step=2^-5"]


def case_of(*overrides, profile="quick"):
    return load(EXPERIMENT, profile, [*(SIZES if profile == "quick" else ()), *overrides]).cases[0]


def study(case, scheme):
    """(variables by name, attributes) of a whole study."""
    plan = strong.plan(case, Part(scheme))
    group = plan.results(finished(plan)).group()
    assert list(group.coordinates["h"]) == list(case.steps)
    return {name: values for name, (_, values) in group.variables.items()}, group.attributes


@kernel
def draw(seed, channel, draws, block, words, normals):
    for n in range(draws):
        draw_normals(seed, np.uint64(BROWNIAN), channel, np.uint64(n), block, words, normals[n])


def fine_increments(case):
    """sqrt(h_ref) times the normals, an array [step, noise, path]."""
    steps, blocks = round(case.final_time / case.reference_step), -(-case.samples // LANES)
    draws = -(-steps // STEPS_PER_DRAW)
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((draws, STEPS_PER_DRAW * LANES))
    increments = np.empty((steps, 3, blocks * LANES))
    for block in range(blocks):
        for k in range(3):
            draw(np.uint64(case.seed), np.uint64(k), draws, np.uint64(block), words, normals)
            increments[:, k, block * LANES : (block + 1) * LANES] = normals.reshape(-1, LANES)[:steps]
    return math.sqrt(case.reference_step) * increments[:, :, : case.samples]


def clipped(dW, h):
    """The increments of steps h that lie within sqrt(h) A_h, A_h = sqrt(4 |ln h|), the others put on its ends."""
    bound = math.sqrt(h) * math.sqrt(4 * abs(math.log(h)))
    return np.clip(dW, -bound, bound)


AXES = np.eye(3)


def field(k, inertia, y):
    """B(y) grad (y_k^2 / 2 I_k) = (y_k / I_k) y x e_k, which is a column of the printed matrix B(y)."""
    return y[k] / inertia[k] * np.cross(y, AXES[k][:, np.newaxis], axis=0)


def by_euler_maruyama(model, h, dW, y):
    """The Itô form: f_k' f_k turns twice about the axis k, which takes y to -(y_k / Î_k)^2 (y - y_k e_k)."""
    new = y.copy()
    for k, sigma in enumerate(model.sigma):
        across = y.copy()
        across[k] = 0.0
        new += h * field(k, model.inertia, y) + sigma * dW[k] * field(k, model.noise_inertia, y)
        new -= 0.5 * h * sigma**2 * (y[k] / model.noise_inertia[k]) ** 2 * across
    return new


def turned(k, angle, y):
    """exp(t (y_k / I_k) (y x e_k)): turned by -angle about the axis k (Rodrigues' formula)."""
    axis = AXES[k][:, np.newaxis]
    along = axis * y[k]
    return along + np.cos(angle) * (y - along) + np.sin(angle) * np.cross(y, axis, axis=0)


def by_splitting(model, h, dW, y):
    """Eq. slpI: the noises first, then the pieces of H."""
    for k, sigma in enumerate(model.sigma):
        y = turned(k, sigma * dW[k] * y[k] / model.noise_inertia[k], y)
    for k in range(3):
        y = turned(k, h * y[k] / model.inertia[k], y)
    return y


BY_HAND = {"euler_maruyama": by_euler_maruyama, "splitting": by_splitting}


def paths_by_hand(case, scheme, sizes=None):
    """h -> states [step, component, path] for step sizes, by default the reference step and all others."""
    fine, result = fine_increments(case), {}
    for h in sizes or (case.reference_step, *case.steps):
        dW = fine.reshape(-1, round(h / case.reference_step), 3, case.samples).sum(axis=1)
        y, states = np.repeat(np.array(case.initial)[:, np.newaxis], case.samples, axis=1), []
        with np.errstate(over="ignore", invalid="ignore"):
            for increments in clipped(dW, h) if case.truncate_noise else dW:
                y = BY_HAND[scheme](case.model, h, increments, y)
                states.append(y)
        result[h] = np.array(states)
    return result
