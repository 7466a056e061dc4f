"""Specs of the model `zeitlin`: what is said of bad ones, and a strong study against steps taken by hand."""

import fluids
import numpy as np
import pytest
from helpers import COMPILED, loop_in_python
from paths_by_hand import draw
from zeitlin_cases import take

from spi import storage
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import hamiltonian, in_kernels
from spi.kinds.functions import path_function
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.running import run as runner
from spi.running.remarks import reports
from spi.specs import SpecError

MODEL = "{name: zeitlin, n: 5, noise: {shell: 1, sigma: 0.5}}"
INITIAL = ", ".join(f"{x:.3f}" for x in fluids.random_state(5))
TEXT = f"""\
kind: strong
model: {MODEL}
initial: [{INITIAL}]
final_time: 1
steps: 2^-2 .. 2^-4
reference_step: 2^-6
schemes: [splitting]
samples: 200
"""
#: The same model, whose noises are all on the shell 1.
SAME = Zeitlin(5, (ModeNoise(0.5, modes=((1, 0), (1, 1), (0, 1), (-1, 1))),))


def model(text):
    return f"{{name: zeitlin, n: 5, noise: {text}}}"


def test_a_noise_of_strength_0_is_off(spec):
    (case,) = spec(TEXT, MODEL, model("[{shell: 1, sigma: 0}, {modes: [[2, 0]], sigma: 1}]")).cases
    assert [process.mode for process in case.model.processes] == [(2, 0)]


def test_many_noises(spec):
    noise = "[" + ", ".join(f"{{shell: {shell}, sigma: 1}}" for shell in range(60, 80)) + "]"
    with pytest.raises(SpecError, match="has 4364 Wiener processes; at most 4096 are possible"):
        spec(TEXT, MODEL, f"{{name: zeitlin, n: 255, noise: {noise}}}")


def test_good_specs(spec):
    """Noises by shell or by mode, and one mode in both forms; of few modes in the terms of the small model."""
    (case,) = spec(TEXT).cases
    assert case.model.processes == SAME.processes and case.model_name == "zeitlin"
    both = "[{modes: [[1, 0]], sigma: 1}, {modes: [[1, 0]], sigma: 1, hamiltonian: linear}]"
    (case,) = spec(TEXT, MODEL, model(both)).cases
    assert [process.form for process in case.model.processes] == ["quadratic", "cosine", "sine"]
    experiment = spec(TEXT, MODEL, "{name: zeitlin, n: 5}", "schemes: [splitting]", "schemes: [splitting_symmetric]")
    ((sense, cell, kept),) = reports(experiment).values()
    assert (
        "move with -u" in sense
        and cell.startswith("N = 5 resolves cells of")
        and kept.startswith("Casimirs at the start")
    )
    assert runner.cost(experiment).seconds < 60


def increments_of(count, m, seed=0):
    """Those of the first block of paths over `count` steps of size 1 / count, [step, noise, path]."""
    draws = -(-count // STEPS_PER_DRAW)
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((draws, STEPS_PER_DRAW * LANES))
    found = np.empty((count, m, LANES))
    for k in range(m):
        draw(np.uint64(seed), np.uint64(BROWNIAN), np.uint64(k), draws, np.uint64(0), words, normals)
        found[:, k] = normals.reshape(-1, LANES)[:count] / np.sqrt(count)
    return found


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
def test_a_strong_study(spec, tmp_path):
    """Its errors are those of steps taken by hand, with increments drawn and added up by hand."""
    experiment = spec(TEXT, "samples: 200", "samples: 8")
    with loop_in_python():
        (group,) = storage.read(runner.run(experiment, tmp_path)).groups
    y, fine = np.repeat([experiment.cases[0].initial], 8, axis=0), increments_of(64, 4, experiment.cases[0].seed)
    ends = []
    for count in (64, 4, 8, 16):
        dW = fine[..., :8].reshape(count, -1, 4, 8).sum(axis=1)
        ends.append(take("splitting", SAME, 1 / count, np.stack([dW, 0 * dW], axis=1), y).states)
    exact, *others = ends
    errors = [np.sqrt(np.mean(np.sum((end - exact) ** 2, axis=1))) for end in others]
    np.testing.assert_allclose(group.arrays["error_final"], errors, rtol=1e-12)
    assert np.all(group.arrays["casimir_drift"] < 1e-13) and not group.arrays["nonfinite"].any()
    assert np.all(np.diff(errors) < 0) and errors[-1] > 1e-4


def test_the_energy_is_a_function_of_states(spec):
    """In expressions; kernels take another record than specs have."""
    case, y = spec(TEXT).cases[0], np.array([fluids.random_state(5), np.arange(24) / 24]).T
    found = path_function(case.model, tuple(f"y{k + 1}" for k in range(24)), "2*H").values(y)
    with uncompiled():
        expected = [2 * hamiltonian(in_kernels(case.model), state) for state in np.ascontiguousarray(y.T)]
    np.testing.assert_allclose(found, expected, rtol=1e-13)
