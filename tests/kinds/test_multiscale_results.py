"""The multiscale system from a spec to results."""

from pathlib import Path

import numpy as np
from helpers import COMPILED

from spi import storage
from spi.running.run import load, run
from spi.storage.stored import Description

EXPERIMENTS = Path(__file__).parents[2] / "experiments"


def groups_of(experiment, folder):
    return {(g.case, g.variant): g for g in storage.read(run(experiment, folder)).groups}


WEAK = ["estimators=[plain]", "steps=2^-4 .. 2^-5", "reference_step=2^-7", "eps=[1e-2, 1e-5]"]


def weak(folder, *overrides):
    """Groups by the name of the scheme: all of one test function."""
    samples = 20_000 if COMPILED else 64
    experiment = load(EXPERIMENTS / "rigid_body_ap_weak.yaml", "quick", [*WEAK, f"samples={samples}", *overrides])
    return {scheme: group for (_, scheme), group in groups_of(experiment, folder).items()}


def values(group, name):
    return group.variables[name][1]


def test_weak_errors_from_spec_to_results(tmp_path):
    found = weak(tmp_path)
    assert list(found) == ["ap_splitting_eps_0.01", "ap_splitting_eps_1e-05", "splitting"]
    small, limit = found["ap_splitting_eps_1e-05"], found["splitting"]
    assert [g.attributes.get("eps") for g in found.values()] == [0.01, 1e-5, None]
    assert (small.attributes["scheme_label"], small.attributes["scheme"]) == ("AP splitting", "ap_splitting")
    assert Description.of(small).label == "AP splitting, eps = 1e-05"
    for name in ("error", "expectation", "reference"):
        assert np.abs(values(small, name) - values(limit, name)).max() < 1e-9  # the same paths
    if not COMPILED:
        return
    assert np.abs(values(found["ap_splitting_eps_0.01"], "error") - values(limit, "error")).max() > 1e-7
    other = weak(tmp_path / "other", "schemes=[splitting]", "eps=null", "seed=2")["splitting"]
    assert values(other, "resolved").any()
    for name in ("error", "expectation"):
        stderr = np.hypot(values(small, f"{name}_stderr"), values(other, f"{name}_stderr"))
        difference = np.abs(values(small, name) - values(other, name))
        assert np.all(difference > 0)
        assert np.all(difference < 4 * stderr)


def test_trajectories_for_several_eps(tmp_path):
    step = "1/93" if COMPILED else "1/31"
    experiment = load(
        EXPERIMENTS / "rigid_body_ap_trajectories.yaml",
        "quick",
        ["eps=[0.1, 0, 1e-3]", f"step={step}", "final_time=1", "path=70"],
    )
    found = {scheme: group for (_, scheme), group in groups_of(experiment, tmp_path).items()}
    assert list(found) == ["ap_splitting_eps_0.1", "ap_splitting_eps_0", "ap_splitting_eps_0.001", "splitting"]
    assert [g.attributes.get("eps") for g in found.values()] == [0.1, 0.0, 1e-3, None]
    limit = values(found["splitting"], "y")
    assert np.array_equal(values(found["ap_splitting_eps_0"], "y"), limit)
    far, near = (np.abs(values(found[f"ap_splitting_eps_{eps}"], "y") - limit).max() for eps in ("0.1", "0.001"))
    assert 0 < near < 1e-3 and far > 0.03
    for group in found.values():
        assert max(group.attributes["casimir_drift"]) < 1e-14
