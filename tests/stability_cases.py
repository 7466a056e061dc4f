"""What the tests of the stability study share: specs, and the study in plain NumPy from the same increments.

The oracle takes the words of the generator and writes everything else out anew: normals, increments, schemes, extremes
over time, errors and expectations.
"""

import math

import numpy as np
import pytest
from helpers import turned
from states import finished

from spi.kinds.stability import study as stability
from spi.numerics.rng import LANES, philox
from spi.running.run import load
from spi.storage.records import Part

RIGID = """\
title: A title
kind: stability
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [s, s, s/2]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-1 .. 2^-3
reference_step: 2^-5
schemes: [splitting, euler_maruyama, midpoint]
samples: 70
seed: 5
sweep: {s: [0.5, 2]}
functions: {a: y1, b: y2^2, c: y1*y3}
"""
PREDATORS = """\
kind: stability
model: {name: lotka_volterra, sigma: [s]}
initial: [1, 1]
final_time: 4
steps: 2^0 .. 2^-2
reference_step: 2^-3
schemes: [splitting, euler_maruyama]
samples: 200
sweep: {s: [0.5, 4]}
functions: y1
panels: [positive]
"""
EPS = (
    RIGID.replace("[s, s, s/2]", "[1, 1, 0.5]")
    .replace("[splitting, euler_maruyama, midpoint]", "[ap_splitting]\neps: s")
    .replace("[0.5, 2]", "[0, 0.6]")
)


@pytest.fixture
def case_of(tmp_path):
    """The only case of a spec with overrides."""

    def case(text, *overrides):
        path = tmp_path / "s.yaml"
        path.write_text(text, encoding="utf-8")
        return load(path, overrides=overrides).cases[0]

    return case


def study(case, scheme, state=None):
    """(variables by name, group) of a whole study."""
    plan = stability.plan(case, Part(scheme))
    group = plan.results(finished(plan) if state is None else state).group()
    assert group.coordinates["h"].tolist() == list(case.steps)
    return {name: values for name, (_, values) in group.variables.items()}, group


def increments(seed, channels, steps, paths, h):
    """Increments of steps h, an array [step, channel, path], by Box and Muller's method from the generator's words."""
    draw = np.arange(-(-steps // 4), dtype=np.uint64)[:, None, None]
    channel = np.arange(channels, dtype=np.uint64)[None, :, None]
    path = np.arange(paths, dtype=np.uint64)[None, None, :]
    zero = np.uint64(0) * (draw + channel + path)
    plain = philox.__wrapped__
    words = plain(draw + zero, channel + zero, path + zero, zero, np.uint64(seed), np.uint64(0))
    normals = [None] * 4
    for half in range(2):
        u, angle = words[half] * 2.0**-32 + 2.0**-33, words[half + 2].astype(np.int64)
        radius = np.where(angle >> 31, -1.0, 1.0) * np.sqrt(-2.0 * np.log(u))
        theta = ((angle & 0x3FFFFFFF) - (2**29 - 0.5)) * (math.pi / 2**31)
        c, s = radius * np.cos(theta), radius * np.sin(theta)
        swap = (angle >> 30) & 1 == 1
        normals[half], normals[half + 2] = np.where(swap, s, c), np.where(swap, c, s)
    found = np.stack(normals, axis=1).reshape(-1, channels, paths)[:steps]
    return math.sqrt(h) * found


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


def paths_by_hand(case, scheme, eps=None):
    """h -> (states [step, component, path], largest |angle|) of whole blocks, for the reference step and all others."""
    paths = -(-case.samples // LANES) * LANES
    steps = round(case.final_time / case.reference_step)
    fine = increments(case.seed, type(case.model).noises, steps, paths, case.reference_step)
    found = {}
    for h in (case.reference_step, *case.steps):
        dW = fine.reshape(-1, round(h / case.reference_step), *fine.shape[1:]).sum(axis=1)
        y, z, states, angles = np.repeat(np.array(case.initial)[:, None], paths, axis=1), 0.0, [], [np.zeros(1)]
        with np.errstate(all="ignore"):
            for now in dW:
                if eps is not None:  # the increments of processes z = eps xi, by the implicit Euler scheme
                    z, now = eps**2 / (h + eps**2) * (z + now), h / (h + eps**2) * (z + now)
                y = STEPS[case.model_name, scheme](case.model, h, now, y, angles)
                states.append(np.array(y))
        found[h] = np.array(states), max(a.max() for a in angles)
    return found


def summary_by_hand(case, paths, functions):
    """What the study stores of one value, by name; one entry for each step size."""
    n, size, y0 = case.samples, np.linalg.norm(case.initial), np.array(case.initial)
    found = {}
    reference = paths[case.reference_step][0][-1, :, :n]
    for h in case.steps:
        y, angle = paths[h]
        y = y[:, :, :n]
        with np.errstate(all="ignore"):
            square = (y**2).sum(axis=1)
            changes = (np.abs(square - y0 @ y0) / (y0 @ y0)).max(axis=0)
            away = np.linalg.norm(y[-1] - reference, axis=0) / size
            error = math.sqrt(np.mean(away**2))
            error_stderr = np.std(away**2, ddof=1) / math.sqrt(n) / (2 * error)
            values = np.array([phi(y[-1]) for phi in functions])
            stderr = values.std(axis=1, ddof=1) / math.sqrt(n)
        entry = {
            "finite": np.mean(np.isfinite(y[-1]).all(axis=0)),
            "largest_norm": np.sqrt(square.max()) / size,
            "error": error,
            "error_stderr": error_stderr,
            "casimir_worst": changes.max(),
            "casimir_median": np.median(changes),
            "positive": np.mean((y > 0).all(axis=(0, 1))),
            "expectation": values.mean(axis=1),
            "expectation_stderr": stderr,
            "largest_angle": angle if angle > math.pi / 4 else 0.0,
        }
        for name, value in entry.items():
            found.setdefault(name, []).append(value)
    return {name: np.array(values) for name, values in found.items()}


PHI = (lambda y: y[0], lambda y: y[1] ** 2, lambda y: y[0] * y[2])
