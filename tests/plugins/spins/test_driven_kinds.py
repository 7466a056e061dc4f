"""Every kind of experiment with spins in a field that depends on time: as plain NumPy has it, or refused."""

import functools

import numpy as np
import pytest
from test_fields_in_time import runge_kutta, slope_in

from spi import storage
from spi.kinds import KINDS
from spi.running.run import run

pytestmark = pytest.mark.needs("dynamics", "comparisons", "answers")

SPEC = """\
kind: KIND
model:
  name: spins
  lattice: chain
  size: [2]
  bonds: {exchange: 1, dm: [0.1, 0.2, 0.3]}
  mu: 2
  alpha: 0.3
  field: ["1.3*cos(2*t)", "1.3*sin(2*t)", 0.7]
  anisotropy: {uniaxial: 0.2}
initial: [0.6, 0, 0.8, 0, -0.6, 0.8]
schemes: [heun_renormalised]
"""
START = np.array([[0.6, 0, 0.8], [0, -0.6, 0.8]])
COARSE, FINE = 2**-3, 2**-6


@functools.cache
def heun(h, time=1.0):
    """(steps + 1, 2, 3) states of Heun's method with lengths scaled back, of the mean of the field over each step."""
    states = [START]
    for t in h * np.arange(round(time / h)):
        mean = np.array([np.sin(2 * t + 2 * h) - np.sin(2 * t), np.cos(2 * t) - np.cos(2 * t + 2 * h)]) / (2 * h)
        a = slope_in(1.3 * mean, states[-1])
        moved = states[-1] + h / 2 * (a + slope_in(1.3 * mean, states[-1] + h * a))
        states.append(moved / np.linalg.norm(moved, axis=1, keepdims=True))
    return np.array(states)


def error_of(h, last=True):
    away = np.array([np.linalg.norm(a - b) for a, b in zip(heun(h), heun(FINE)[:: round(h / FINE)], strict=True)])
    return away[-1] if last else away.max()


def test_these_states_converge_to_those_of_runge_kutta():
    errors = [abs(heun(h)[-1] - runge_kutta(START, 400)).max() for h in (FINE, FINE / 2)]
    assert errors[0] < 5e-4 and 1.9 < np.log2(errors[0] / errors[1]) < 2.1


ERRORS = "final_time: 1\nsteps: [2^-3]\nreference_step: 2^-6\n"
STEPS = "final_time: 1\nstep: 2^-3\nsamples: 64\n"
LONG = "steps: [2^-3]\nsamples: 64\n"
Z = "functions: {z: y3}\n"


def z_error():
    """With what the reference itself lacks by its order, 1 / (1 - 8^-2)."""
    return 64 / 63 * (heun(COARSE)[-1, 0, 2] - heun(FINE)[-1, 0, 2])


#: kind -> (further lines, (field, place) of the results and what NumPy has there), or the reason why it is refused.
CASES = {
    "trajectory": (
        "final_time: 1\nstep: 2^-3\npanels: [components]\n",
        {("y", np.s_[-1]): lambda: heun(COARSE)[-1].ravel()},
    ),
    "strong": (
        ERRORS + "samples: 64\n",
        {("error", 0): lambda: error_of(COARSE, last=False), ("error_final", 0): lambda: error_of(COARSE)},
    ),
    "weak": (ERRORS + Z + "samples: 64\nestimators: [plain]\n", {("error", np.s_[0, 0]): z_error}),
    "statistics": (STEPS + Z, {("mean", 0): lambda: heun(COARSE)[:, 0, 2]}),
    "equilibrium": (
        LONG + Z + "final_time: 64\nburn_in: 0\nspacing: 2^-3\n",
        {("average", np.s_[0, 0]): lambda: heun(COARSE, 64)[1:, 0, 2].mean()},
    ),
    "growth": (LONG + "step_count: 2^10\n", {("casimir_rms", 0): lambda: 0.0}),
    "stability": (
        ERRORS + Z + "samples: 64\nsweep: {m: [2]}\n",
        {("error", np.s_[0, 0]): lambda: error_of(COARSE) / np.linalg.norm(START)},
    ),
    "work_precision": (ERRORS + "samples: 64\n", {("error", 0): lambda: error_of(COARSE)}),
    "answer": (Z + "final_time: 1\naccuracy: 1e-3\n", {("value", 0): lambda: runge_kutta(START, 400)[0, 2]}),
    "lyapunov": (STEPS, "model: has states that are arrays"),
}


#: Of an answer the accuracy that is wanted; the steps are chosen.
TOLERANCES = {"answer": 1e-3}


def test_all_kinds_are_here():
    assert set(CASES) == set(KINDS)


@pytest.mark.parametrize("kind", CASES)
def test_a_kind(spec, error, tmp_path, kind):
    lines, right = CASES[kind]
    text = SPEC.replace("KIND", kind).replace("mu: 2", "mu: m" if kind == "stability" else "mu: 2") + lines
    if isinstance(right, str):
        assert right in error(text)
        return
    variables = storage.read(run(spec(text), tmp_path, fresh=True)).groups[0].variables
    for (name, place), expected in right.items():
        np.testing.assert_allclose(
            np.asarray(variables[name][1])[place], expected(), rtol=1e-9, atol=TOLERANCES.get(kind, 1e-12)
        )


@pytest.mark.parametrize("kind", ["statistics", "weak"])
def test_noise_in_a_field_along_its_own_axis(spec, tmp_path, kind):
    """Free spins: E s_x + i E s_y turns by the integral of the field and falls as exp(-sigma^2 t), in closed form."""
    lines = [line for line in SPEC.splitlines() if not line.startswith(("  bonds", "  mu", "  alpha", "  aniso"))]
    text = "\n".join(lines).replace("KIND", kind).replace("heun_renormalised", "splitting_symmetric")
    text = text.replace('["1.3*cos(2*t)", "1.3*sin(2*t)", 0.7]', "[0, 0, cos(5*t) + t]\n  noise: {sigma: 0.5}")
    text += "\nfunctions: {x: y1, y: y2}\nsamples: 20000\nfinal_time: 1\n"
    text += "step: 2^-2\n" if kind == "statistics" else "steps: [2^-2]\nreference_step: 2^-3\nestimators: [plain]\n"
    variables = storage.read(run(spec(text), tmp_path, fresh=True)).groups[0].variables
    angle = np.sin(5) / 5 + 1 / 2
    right = 0.6 * np.exp(-0.25) * np.array([np.cos(angle), np.sin(angle)])
    if kind == "statistics":
        mean, stderr = (variables[name][1][:, -1] for name in ("mean", "mean_stderr"))
        assert (abs(mean - right) < 4 * stderr).all() and (stderr < 0.005).all()
    else:
        away, stderr = (variables[name][1][..., 0] for name in ("error", "error_stderr"))
        assert (abs(away) < 4 * stderr + 1e-3).all()


def test_what_would_be_about_another_system_is_refused(error):
    text = SPEC.replace("KIND", "statistics").replace("lattice: chain", "lattice: ring") + STEPS
    for given in ("{until: 0.5}", "{until: 0.5, spins: [x, y, z], about: [0, 0, 1]}"):
        message = error(text + f"time_correlations: {given}\n")
        assert "time_correlations: is for paths whose law does not change, and the model depends on time" in message
