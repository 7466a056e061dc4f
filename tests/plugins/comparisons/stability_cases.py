"""What the tests of the stability study share: specs, and extremes, errors and expectations in plain NumPy."""

import math

import numpy as np
import pytest
from states import finished

from spi.plugins.comparisons.kinds.stability import study as stability
from spi.running.run import load
from spi.storage.stored import gathered

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
def cases_of(tmp_path):
    """The cases of a spec with overrides, one for each value."""

    def cases(text, *overrides):
        path = tmp_path / "s.yaml"
        path.write_text(text, encoding="utf-8")
        return load(path, overrides=overrides).cases

    return cases


def plans_of(cases, scheme):
    """The plans of a scheme, one for each value."""
    return [stability.plan(case, part) for case in cases for part in stability.parts(case) if part.scheme == scheme]


def study(cases, scheme, states=None):
    """(variables by name, group) of a whole study."""
    states = [finished(plan) for plan in plans_of(cases, scheme)] if states is None else states
    (record,) = gathered(state.plan.results(state) for state in states)
    group = record.group()
    assert group.coordinates["h"].tolist() == list(cases[0].steps)
    return {name: values for name, (_, values) in group.variables.items()}, group


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
