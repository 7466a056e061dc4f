"""Benchmarks of fluids: the solution of Euler's equations beside paths of `zeitlin`, and a naive midpoint rule."""

import importlib
import json
import sys
from pathlib import Path

import fluids
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from trajectory_results import trajectories, trajectory_group

from spi import storage
from spi.plugins.fluids.models import Zeitlin, fields

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))  # no package: programs, and what they share
euler, zeitlin = map(importlib.import_module, ("euler", "zeitlin"))

X = 2 * np.pi * np.arange(64) / 64
X1, X2 = np.meshgrid(X, X, indexing="ij")


def test_what_a_fluid_keeps_and_the_sense_of_rotation():
    field = np.cos(X1) + 0.8 * np.sin(X1 + X2) + 0.5 * np.cos(2 * X2 + 1)
    first, last = euler.solution(field, [0, 1])
    assert np.abs(last - first).max() > 0.5
    for power in (2, 3, 4):
        assert (last**power).mean() == pytest.approx((first**power).mean(), rel=1e-9, abs=1e-9)
    backwards = euler.solution(-last, [1])[0]  # time runs backwards for -omega
    np.testing.assert_allclose(-backwards, first, atol=1e-7)
    patch = 10 * np.exp(-4 * ((X1 - np.pi) ** 2 + 4 * (X2 - np.pi) ** 2))
    turned = euler.solution(patch - patch.mean(), [0, 1])
    slants = [(one * (X1 - np.pi) * (X2 - np.pi)).mean() for one in turned]
    assert slants[1] < slants[0] - 1e-3  # clockwise, as docs/fluids.md says


def rate_of_kolmogorov_flow(wave=3, half=60):
    """Of 2 cos(wave x2) and modes (1, q): the largest eigenvalue of Euler's equations linearised, a matrix over q."""
    q = np.arange(-half, half + 1)
    rate = np.zeros((len(q), len(q)))
    for s in (wave, -wave):
        for i in range(len(q)):
            if 0 <= i - s < len(q):
                rate[i, i - s] = s / wave**2 - s / (1 + (q[i] - s) ** 2)
    return np.linalg.eigvals(rate).real.max()


def path(name, n, y, end, h=0.1):
    """The results of a path without noise by the classical Runge-Kutta scheme, not by kernels of the package."""
    model, states = Zeitlin(n=n, normalisation="zeitlin"), [y]
    for _ in range(round(end / h)):
        a = fluids.drift_field(model, y)
        b = fluids.drift_field(model, y + h / 2 * a)
        c = fluids.drift_field(model, y + h / 2 * b)
        d = fluids.drift_field(model, y + h * c)
        y = y + h / 6 * (a + 2 * b + 2 * c + d)
        states.append(y)
    place = json.dumps({"on": "torus", "modes": n})
    t, told = h * np.arange(len(states)), {"model_normalisation": "zeitlin", "geometry": place, "times": (0.0, end)}
    return trajectory_group("splitting", t, np.array(states), np.ones((len(t), 1)), case=f"{name}_{n}", **told)


def test_what_is_printed_and_drawn(tmp_path, capsys):
    """Growth rates, for Euler that of the matrix and for N = 15 less; and errors that fall with N squared."""
    smooth = np.cos(X1) + 0.8 * np.sin(X1 + X2)
    wave = 2 * np.cos(3 * X2) + 2e-7 * np.cos(X1)
    groups = [path("smooth", n, fields.projected(smooth, n), 1.0) for n in (9, 15)]
    groups += [path("wave", n, fields.projected(wave, n), 21.0) for n in (9, 15)]
    storage.write(tmp_path / "both.h5", trajectories(*groups))
    euler.main(tmp_path / "both.h5", 48)
    first, second = capsys.readouterr().out.split("\n\n")[:2]
    order = float(next(line for line in first.splitlines() if line.startswith("  15") and " 1.00 " in line).split()[4])
    assert 1.7 < order < 2.1
    *rates, exact = (float(text) for text in second.splitlines()[-1].replace(",", "").split() if text[:2] == "0.")
    assert exact == pytest.approx(rate_of_kolmogorov_flow(), abs=1e-3)
    assert rate_of_kolmogorov_flow() == pytest.approx(0.41399, abs=1e-5)
    assert rates[-1] == pytest.approx(0.3135, abs=1e-3)
    assert (tmp_path / "both_euler.png").stat().st_size > 10_000


def test_midpoint_rule_for_fluids_solves_their_equations(monkeypatch):
    n, model = 7, Zeitlin(7, normalisation="zeitlin")
    y, W0 = fluids.state(n, zeitlin.typical(n)), zeitlin.matrix(zeitlin.typical(n))
    times = (0, zeitlin.ERROR_TIME)
    exact = solve_ivp(lambda t, y: fluids.drift_field(model, y), times, y, rtol=1e-12, atol=1e-12).y[:, -1]
    assert np.allclose(fluids.state(n, fluids.table_of(n, zeitlin.reference(n))), exact, rtol=0, atol=1e-11)
    assert np.linalg.norm(y - exact) > 0.01
    errors = []
    for h in zeitlin.STEPS:
        path, iterations = zeitlin.midpoint_path(n, h, 10)
        errors.append(zeitlin.error(path, h))
        assert np.all(zeitlin.casimir_errors(path) < 1e-13) and iterations > 1
        assert np.array_equal(path[0], W0) and np.array_equal(path[-1], path[-1].conj().T)
    assert np.log(errors[1] / errors[0]) / np.log(np.divide(*zeitlin.STEPS[::-1])) == pytest.approx(2, abs=0.1)
    monkeypatch.setattr(zeitlin, "MOST_ITERATIONS", 2)
    with pytest.raises(RuntimeError, match="N = 7, h = 1: no solution after 2 iterations"):
        zeitlin.Midpoint(n, 1).step(W0)
