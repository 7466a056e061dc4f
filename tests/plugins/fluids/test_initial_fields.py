"""Initial values of fluids that stand in files: states, fields and complex modes, and long arrays from Python."""

from pathlib import Path

import numpy as np
import pytest

from spi.api.specs import experiment_of
from spi.plugins.fluids.models import fields
from spi.running.load import SpecSource, plans_of

N = 101
SPEC = f"""\
kind: trajectory
model: {{name: zeitlin, n: {N}}}
initial: {{file: y.npy}}
final_time: 1
step: 2^-4
schemes: [splitting]
panels: [vorticity]
"""


def state(n=N):
    return np.random.default_rng(n).standard_normal(n * n - 1)


def test_states_fields_and_complex_modes(spec, tmp_path):
    """A state with more numbers than a YAML file may have is the same in all ways, to the last bit."""
    y = state()
    np.save(tmp_path / "y.npy", y)
    found = spec(SPEC)
    assert found.cases[0].initial == tuple(y)
    np.save(tmp_path / "y.npy", y.view(complex))
    assert spec(SPEC).hash == found.hash
    np.save(tmp_path / "y.npy", np.asfortranarray(fields.vorticity(y, 128)))
    np.testing.assert_allclose(spec(SPEC).cases[0].initial, y, atol=1e-12)
    (small,) = spec(SPEC, overrides=["model={n: 5}"]).cases
    np.testing.assert_allclose(small.initial, fields.projected(fields.vorticity(y, 128), 5), atol=1e-15)
    np.save(tmp_path / "y.npy", y[:8].astype(np.float32))
    listed, three = y[:8].astype(np.float32).tolist(), (f"n: {N}", "n: 3")
    assert spec(SPEC, *three).hash == spec(SPEC, *three, overrides=[f"initial={listed}"]).hash


def test_a_mean_is_subtracted_on_demand(spec, error, tmp_path):
    np.save(tmp_path / "y.npy", fields.vorticity(state(5), 16) + 1)
    five = (f"n: {N}", "n: 5")
    assert "initial.file: has the mean 1" in error(SPEC, *five)
    (case,) = spec(SPEC, "y.npy", "y.npy, subtract_mean: true", *five).cases
    np.testing.assert_allclose(case.initial, state(5), atol=1e-14)


def test_the_mean_of_single_numbers_has_their_rounding_error(spec, error, tmp_path):
    """A mean that rounding to single precision has made is none; the same in double precision is one."""
    five, field = (f"n: {N}", "n: 5"), fields.vorticity(state(5), 16)
    single = field.astype(np.float32)
    assert abs(single.mean(dtype=float)) > 1e-10
    np.save(tmp_path / "y.npy", single)
    np.testing.assert_allclose(spec(SPEC, *five).cases[0].initial, state(5), atol=1e-6)
    np.testing.assert_allclose(fields.projected(single, 5), state(5), atol=1e-6)
    np.save(tmp_path / "y.npy", field + single.mean(dtype=float))
    assert "initial.file: has the mean" in error(SPEC, *five)
    np.save(tmp_path / "y.npy", single + np.float32(1e-4))
    assert "initial.file: has the mean" in error(SPEC, *five)


def test_arrays_from_python(tmp_path, monkeypatch):
    """They go past the reader of YAML, in a mapping, a case and an override; a short list stays in the text."""
    monkeypatch.chdir(tmp_path)
    y = state()
    data = _keys()
    first = experiment_of(data | {"initial": y}, "a", "laptop", {})
    again = experiment_of(data | {"initial": [0.0] * len(y)}, "a", "laptop", {"initial": fields.vorticity(y, 128)})
    assert first.cases[0].initial == tuple(y) and "initial_" in first.text
    np.testing.assert_allclose(again.cases[0].initial, y, atol=1e-12)
    assert tuple(plans_of(SpecSource.of(again))[0].initial) == again.cases[0].initial
    cases = {"cases": [{"name": "one", "initial": y}, {"name": "two", "initial": 2 * y}]}
    assert experiment_of(data | cases, "a", "laptop", {}).cases[1].initial == tuple(2 * y)
    short = experiment_of(data | {"model": {"name": "sine_euler"}, "initial": y[:8]}, "a", "laptop", {})
    assert not short.files and str(y[0]) in short.text
    Path("s.yaml").write_text(SPEC)
    np.save("y.npy", y)
    assert experiment_of("s.yaml", None, "laptop", {"initial": 3 * y}).cases[0].initial == tuple(3 * y)


def _keys():
    model = {"name": "zeitlin", "n": N}
    return {"kind": "trajectory", "model": model, "final_time": 1, "step": 0.5, "schemes": ["splitting"]} | {
        "panels": ["vorticity"]
    }


GRID, LATTICE = "must have as many columns as rows, at least 101; or one dimension", "is a vorticity on"


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (state(3), "has 8 entries; must have 10200, the dimension of zeitlin"),
        (np.zeros((101, 102)), f"{LATTICE} 101 x 102 points; {GRID}"),
        (np.zeros((99, 99)), f"{LATTICE} 99 x 99 points; {GRID}"),
    ],
)
def test_bad_arrays(error, tmp_path, array, message):
    np.save(tmp_path / "y.npy", array)
    found = error(SPEC)
    assert found.startswith("3: initial") and message in found
