"""The uniform law on the sphere, and that of long paths."""

import math

import long_cases
import numpy as np
import pytest
from helpers import RIGID_BODY, compiled_only
from long_cases import RIGID, initial_rows, paths_done, rows_after, study

from spi.ensemble.protocol import hamiltonian
from spi.kinds.plans import State
from spi.models import RigidBodySharedNoise, SineEuler
from spi.numerics.rng import LANES
from spi.plugins.dynamics.exact.sphere_law import BINS, SphereLaw, obstacle
from spi.plugins.dynamics.kinds.growth import study as growth
from spi.schemes import scheme_entry
from spi.storage import Part

# fixtures
load_text, case_of = long_cases.load_text, long_cases.case_of


def fibonacci(n):
    """Points that fill the unit sphere evenly, (3, n)."""
    z, phi = (2 * np.arange(n) + 1) / n - 1, np.arange(n) * math.pi * (math.sqrt(5) - 1)
    r = np.sqrt(1 - z * z)
    return np.array([r * np.cos(phi), r * np.sin(phi), z])


BODIES = [((2.0, 1.0, 2 / 3), 1.0), ((1.0, 3.0, 1.0), 3.0), ((0.5, 0.5, 4.0), 3.0), ((1.0, 1.001, 5.0), 1.0)]


@pytest.mark.parametrize(("inertia", "radius"), BODIES)
def test_moments_and_quantiles_are_those_of_the_uniform_law(inertia, radius):
    model = RIGID_BODY._replace(inertia=inertia)
    law = SphereLaw.of(model, (0.0, 0.6 * radius, 0.8 * radius))
    assert math.isclose(law.radius, radius)
    assert law.variables == ("y1", "y2", "y3", "H")
    y = radius * fibonacci(300_000)
    energy = hamiltonian(model, tuple(y))
    sampled = law.moments_of(y).mean(axis=1)
    exact = np.array(list(law.moments.values()))
    assert len(exact) == 11
    np.testing.assert_allclose(sampled, exact, rtol=1e-5, atol=1e-5)
    by_name = dict(zip(law.moments, sampled, strict=True))
    assert math.isclose(by_name["y2^4"], np.mean((y[1] / radius) ** 4), rel_tol=1e-12)
    assert math.isclose(by_name["H^2"], np.mean(energy**2), rel_tol=1e-12)
    quantiles = np.quantile(energy, np.linspace(0, 1, BINS + 1))
    assert np.abs(law.edges[3] - quantiles).max() < 1e-4 * np.ptp(energy)
    assert (np.diff(law.edges, axis=1) > 0).all()
    for edges in law.edges[:3]:
        np.testing.assert_allclose(edges, np.linspace(-1, 1, BINS + 1), atol=1e-15)


def test_a_constant_hamiltonian_is_left_out():
    law = SphereLaw.of(RIGID_BODY._replace(inertia=(2.0, 2.0, 2.0)), (1.0, 2.0, 2.0))
    assert law.variables == ("y1", "y2", "y3")
    assert law.edges.shape == (3, BINS + 1)
    assert (law.moments["H"], law.moments["H^2"]) == (2.25, 2.25**2)
    counts = np.zeros((3, BINS, 4))
    law.count(3 * fibonacci(4), counts)
    assert (counts.sum(axis=1) == 1).all()


def test_bins_have_everything_inside_and_nothing_outside():
    law = SphereLaw.of(RIGID_BODY, (0.0, 1.8, 2.4))
    points = 3 * fibonacci(20_000)
    counts = np.zeros((4, BINS, points.shape[1]))
    law.count(points, counts)
    assert (counts.sum(axis=1) == 1).all()
    assert np.abs(counts.mean(axis=2) - 1 / BINS).max() < 1e-3  # all bins are equally likely
    for k in range(3):
        wanted = np.minimum(((points[k] / 3 + 1) * BINS / 2).astype(int), BINS - 1)
        assert np.array_equal(counts[k].argmax(axis=0), wanted)
    # Poles lie on the ends of y_k and H, off by a rounding or not; other spheres, and what is lost, do not count.
    poles = 3 * np.concatenate([np.eye(3), -np.eye(3)], axis=1)
    for scale, inside in ((1.0, True), (1 + 1e-14, True), (1 - 1e-14, True), (1.01, False)):
        counts = np.zeros((4, BINS, 6))
        law.count(scale * poles, counts)
        for k in range(3):
            assert counts[k].sum(axis=0)[[k, k + 3]].tolist() == [float(inside)] * 2
            assert counts[k, -1, k] == counts[k, 0, k + 3] == inside
        assert counts[3].sum() == (6 if inside else 4)  # the largest H is outside, the others are not
    counts = np.zeros((4, BINS, 2))
    law.count(np.array([[np.nan, np.inf]] * 3), counts)
    assert not counts.any()


LONG = ("steps=[1/4]", "step_count=2^14", "samples=256")


@compiled_only
def test_law_of_splitting_is_uniform_and_that_of_a_scheme_that_is_not_symplectic_is_not(case_of):
    case = case_of(*LONG)
    found, group = study(case, "splitting")
    assert group.attributes["snapshots"] == 120  # every 128 steps after a sixteenth of them
    z = (found["mean"][0] - found["mean_exact"]) / found["mean_stderr"][0]
    assert np.abs(z).max() < 4.5
    assert (found["law_distance"] < 4.5 * found["law_distance_stderr"]).all()
    z = (found["fraction"] - 1 / BINS) / found["fraction_stderr"]
    assert np.abs(z).max() < 4.5
    np.testing.assert_allclose(found["fraction"].sum(axis=2), 1, rtol=1e-12)
    assert found["nonfinite"].tolist() == [0]
    # About as many independent snapshots as there are: a uniform variable has the standard deviation 3^(-1/2).
    independent = math.sqrt(1 / 3 / (120 * 256))
    assert (np.abs(found["mean_stderr"][0, :3] / independent - 1) < 0.4).all()
    control, _ = study(case, "euler_maruyama_renormalised")
    z = (control["mean"][0] - control["mean_exact"]) / control["mean_stderr"][0]
    assert np.abs(z).max() > 8
    assert (control["law_distance"] / control["law_distance_stderr"]).max() > 8
    assert control["nonfinite"].tolist() == [0]
    assert np.abs(control["casimir_worst"]).max() < 1e-11  # and yet its paths stay on the sphere


@compiled_only
def test_paths_that_are_lost_are_counted(case_of):
    case = case_of("steps=[1/2]", "step_count=2^12")
    found, _ = study(case, "euler_maruyama")
    scheme = scheme_entry("euler_maruyama").record
    rows = rows_after(scheme, case.model, initial_rows(scheme, case.model, case.initial, 2), 0.5, 0, 2**12)
    y = rows.reshape(2, 3, LANES).transpose(0, 2, 1).reshape(-1, 3)[: case.samples]
    lost = np.count_nonzero(~np.isfinite(y).all(axis=1))
    assert found["nonfinite"].tolist() == [lost] and lost > 0
    assert not np.isfinite(found["mean"]).any()
    assert not np.isfinite(found["casimir_rms"][0, -1]).any()
    assert (found["fraction"].sum(axis=2) < 1).all()


def test_without_noise_or_off_the_sphere_no_law_is_known(load_text, case_of):
    for case in (
        case_of("model.sigma=[0, 0, 0]"),
        load_text(RIGID, "model={name: maxwell_bloch}", "schemes=[splitting]").cases[0],
    ):
        plan = growth.plan(case, Part("splitting"))
        assert plan.law is None
        state = State(plan)
        for chunk in state.missing():
            state.put(chunk, paths_done(plan, chunk))
        found, _ = study(case, "splitting", state)
        assert "nonfinite" in found and "law_distance" not in found and "mean" not in found
    assert isinstance(growth.plan(case_of(), Part("splitting")).law, SphereLaw)


def test_on_an_axis_nothing_moves_and_no_law_is_known(case_of):
    for initial in ("[1, 0, 0]", "[0, 0, -2]", "[0, 0, 0]"):
        assert growth.plan(case_of(f"initial={initial}"), Part("splitting")).law is None


@pytest.mark.parametrize(
    ("model", "initial", "reason"),
    [
        (RIGID_BODY._replace(sigma=(None, 1.0, None)), (0.6, 0.0, 0.8), "at least two axes, not with 1"),
        (RIGID_BODY._replace(sigma=(0.0, 1.0, None)), (0.6, 0.0, 0.8), "at least two axes, not with 1"),
        (RIGID_BODY._replace(noise_inertia=(math.inf, math.inf, 1.0)), (0.6, 0.0, 0.8), "not with 1"),
        (RIGID_BODY, (0.0, 2.0, 0.0), "on an axis"),
        (RigidBodySharedNoise((2.0, 1.0, 0.5), (1.0, 2.0, 3.0)), (0.6, 0.0, 0.8), "RigidBodySharedNoise, which does"),
        (SineEuler(), (0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1), "does not answer axis_inertias"),
    ],
)
def test_what_the_law_needs_is_said(model, initial, reason):
    with pytest.raises(ValueError, match=reason):
        SphereLaw.of(model, initial)
    assert reason in obstacle(model, initial)
    assert obstacle(RIGID_BODY._replace(sigma=(None, 1.0, 0.3)), (0.6, 0.0, 0.8)) is None
