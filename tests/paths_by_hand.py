"""Paths computed in plain NumPy, from the normals of the generator.

All but the normals is written out anew, from the printed equations: increments, schemes, and the filtered processes of
the multiscale system.
"""

import math

import numpy as np
from helpers import turned

from spi.compiler.dispatch import kernel
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW, draw_increments


@kernel
def draw(seed, stream, channel, draws, block, words, normals):
    for n in range(draws):
        draw_increments(seed, stream, channel, np.uint64(n), block, 1.0, words, normals[n], LANES)


def fine_increments(case):
    """sqrt(h_ref) times the normals of whole blocks of paths, an array [step, noise, path]."""
    steps, blocks = round(case.final_time / case.reference_step), -(-case.samples // LANES)
    draws, noises = -(-steps // STEPS_PER_DRAW), type(case.model).noises
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((draws, STEPS_PER_DRAW * LANES))
    increments = np.empty((steps, noises, blocks * LANES))
    for block in range(blocks):
        for k in range(noises):
            draw(np.uint64(case.seed), np.uint64(BROWNIAN), np.uint64(k), draws, np.uint64(block), words, normals)
            increments[:, k, block * LANES : (block + 1) * LANES] = normals.reshape(-1, LANES)[:steps]
    return math.sqrt(case.reference_step) * increments


def clipped(dW, h):
    """The increments of steps h that lie within sqrt(h) A_h, A_h = sqrt(4 |ln h|), the others put on its ends."""
    bound = math.sqrt(h) * math.sqrt(4 * abs(math.log(h)))
    return np.clip(dW, -bound, bound)


def rigid_splitting_step(model, h, dW, y, angles):
    """All noises, then all pieces of H, each a rotation; `angles` collects their |angles|."""
    noises = [s * increment / i for s, increment, i in zip(model.sigma, dW, model.noise_inertia, strict=True)]
    for k, rate in [*enumerate(noises), *enumerate(h / i for i in model.inertia)]:
        angles.append(np.abs(rate * y[k]))
        y = turned(k, rate * y[k], y, np.sin, np.cos)
    return y


def rigid_drift(model, h, dW):
    """The diagonal of D in y' = y x D y, the Stratonovich field of one step, an array [component, path]."""
    strengths = np.array(model.sigma)[:, None] / np.array(model.noise_inertia)[:, None]
    return h / np.array(model.inertia)[:, None] + strengths * dW


def rigid_euler_step(model, h, dW, y, angles):
    """The Itô form: f_k' f_k takes y to -(y_k / Î_k)^2 (y - y_k e_k)."""
    y = np.array(y)
    new = y + np.cross(y, rigid_drift(model, h, dW) * y, axis=0)
    for k, (sigma, inertia) in enumerate(zip(model.sigma, model.noise_inertia, strict=True)):
        across = y.copy()
        across[k] = 0.0
        new = new - 0.5 * h * (sigma * y[k] / inertia) ** 2 * across
    return new


def midpoint_step(model, h, dW, y, angles):
    """x = y + F(x)/2 by Newton's method, F(x) = x x D x; then y + F(x)."""
    y, D = np.array(y), rigid_drift(model, h, dW)
    x = y + 0.5 * np.cross(y, D * y, axis=0)

    def across(v):
        """The matrices of w -> v x w."""
        return np.cross(v.T[:, :, None], np.eye(3)[None], axis=1)

    for _ in range(30):
        residual = y + 0.5 * np.cross(x, D * x, axis=0) - x
        jacobian = np.eye(3) - 0.5 * (across(x) * D.T[:, None, :] - across(D * x))
        x = x + np.linalg.solve(jacobian, residual.T[:, :, None])[:, :, 0].T
    return y + np.cross(x, D * x, axis=0)


def predators_splitting_step(model, h, dW, y, angles):
    """Both are multiplied by exp(sigma dW), then y2 by exp(h (1 - y1)), then y1 by exp(h (y2 - 2))."""
    y1, y2 = y * np.exp(model.sigma[0] * dW[0])
    y2 = y2 * np.exp(h * (1 - y1))
    return np.array([y1 * np.exp(h * (y2 - 2)), y2])


def predators_euler_step(model, h, dW, y, angles):
    """y1' = y1 (y2 - 2), y2' = y2 (1 - y1), and both are multiplied by 1 + sigma dW + sigma^2 h / 2."""
    noise = model.sigma[0] * dW[0] + 0.5 * h * model.sigma[0] ** 2
    return y[0] + y[0] * (h * (y[1] - 2) + noise), y[1] + y[1] * (h * (1 - y[0]) + noise)


STEPS = {
    ("rigid_body", "splitting"): rigid_splitting_step,
    ("rigid_body", "euler_maruyama"): rigid_euler_step,
    ("rigid_body", "midpoint"): midpoint_step,
    ("lotka_volterra", "splitting"): predators_splitting_step,
    ("lotka_volterra", "euler_maruyama"): predators_euler_step,
}


def paths_by_hand(case, scheme, eps=None, sizes=None):
    """h -> (states [step, component, path] of whole blocks, largest |angle| of the paths), by default of all sizes."""
    fine, found = fine_increments(case), {}
    for h in sizes or (case.reference_step, *case.steps):
        dW = fine.reshape(-1, round(h / case.reference_step), *fine.shape[1:]).sum(axis=1)
        dW = clipped(dW, h) if case.truncate_noise else dW
        y, z, states = np.repeat(np.array(case.initial)[:, None], fine.shape[2], axis=1), 0.0, []
        angles = [np.zeros(1)]
        with np.errstate(all="ignore"):
            for now in dW:
                if eps is not None:  # the increments of processes z = eps xi, by the implicit Euler scheme
                    z, now = eps**2 / (h + eps**2) * (z + now), h / (h + eps**2) * (z + now)
                y = STEPS[case.model_name, scheme](case.model, h, now, y, angles)
                states.append(np.array(y))
        found[h] = np.array(states), max(a[: case.samples].max() for a in angles)
    return found
