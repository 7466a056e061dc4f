"""The long-time study: integration in pieces, growth and bias of rounding errors, and the law on the sphere.

The oracles are integration in one go, synthetic errors whose growth is known, quadrature, and the uniform law itself.
All seeds are fixed.
"""

import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED, INITIAL, RIGID_BODY, final_states, printed
from states import check_going_on, finished, same_numbers, taken

from spi import ensemble, storage
from spi import run as runner
from spi.ensemble import FinalStates, RandomStream, empty_report, grid, integrate
from spi.kinds.long_time import study as long_time
from spi.kinds.long_time.study import paths
from spi.kinds.state import State
from spi.models import MaxwellBloch, RigidBodySharedNoise, SineEuler
from spi.protocol import hamiltonian, memory_size
from spi.records import Part
from spi.rng import BROWNIAN, LANES, STEPS_PER_TOSS
from spi.run import load
from spi.schemes import scheme_row
from spi.spec import SpecError
from spi.sphere_law import BINS, SphereLaw, obstacle

compiled_only = pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")

RIGID = """\
title: A title
kind: long_time
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
steps: [1/8, 1/4]
step_count: 640
schemes: [splitting, euler_maruyama_renormalised, euler_maruyama]
samples: 70
seed: 3
"""


@pytest.fixture
def load_text(tmp_path):
    """Load a spec with overrides."""

    def load_text(text, *overrides):
        path = tmp_path / "s.yaml"
        path.write_text(text, encoding="utf-8")
        return load(path, overrides=overrides)

    return load_text


@pytest.fixture
def case_of(load_text):
    return lambda *overrides: load_text(RIGID, *overrides).cases[0]


def study(case, scheme, state=None):
    """(variables by name, group) of a whole study."""
    plan = long_time.plan(case, Part(scheme))
    group = plan.group(finished(plan) if state is None else state)
    return group.arrays, group


def initial_rows(scheme, model, initial, blocks):
    rows = np.zeros((blocks, len(initial) * LANES + memory_size(scheme, model)))
    rows[:, : len(initial) * LANES] = np.repeat(initial, LANES)
    return rows


def rows_after(scheme, model, rows, h, first, steps, seed=3):
    """The rows that ``integrate`` takes and FinalStates keeps, after so many more steps."""
    last, report = FinalStates(np.empty((len(rows), 1, rows.shape[1])), np.array([first + steps])), empty_report(2, 1)
    times, noise = grid(h, steps, first_step=first), RandomStream(np.uint64(seed), np.uint64(BROWNIAN))
    integrate(scheme, model, rows, times, noise, last, report[: len(rows)], 0, len(rows), len(rows) * LANES)
    return last.y[:, 0]


# --- in pieces -------------------------------------------------------------------------------------------------------


def check_pieces(name, eps=None):
    scheme, model = scheme_row(name, eps).record, RIGID_BODY._replace(sigma=(1.0, 0.7, None))
    start, n = initial_rows(scheme, model, INITIAL, 1), STEPS_PER_TOSS
    whole = rows_after(scheme, model, start, 0.1, 0, 2 * n)
    first = rows_after(scheme, model, start, 0.1, 0, n)
    assert np.isfinite(whole).all() and whole.shape == start.shape
    assert np.array_equal(rows_after(scheme, model, first, 0.1, n, n), whole)
    if not memory_size(scheme, model):
        assert not np.array_equal(rows_after(scheme, model, first, 0.1, 0, n), whole)  # other increments
    else:
        forgotten = first.copy()
        forgotten[:, len(INITIAL) * LANES :] = 0.0
        assert not np.array_equal(rows_after(scheme, model, forgotten, 0.1, n, n), whole)


def test_pieces_with_coins_and_with_memory_give_the_same_bits():
    """Without the compiler, which would take longer than the few steps."""
    program = "from test_long_time import *; check_pieces('splitting_order2'); check_pieces('ap_splitting', 0.5)"
    tests = Path(__file__).parent
    path = os.pathsep.join([str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


@compiled_only
@pytest.mark.parametrize("scheme", ["splitting", "euler_maruyama"])
def test_records_are_those_of_integration_in_one_go(case_of, scheme):
    case = case_of("steps=[1/64, 1/32]")
    found, group = study(case, scheme)
    records = [128, 256, 512, 640]
    assert group.coordinates["n"].tolist() == records
    assert group.coordinates["h"].tolist() == list(case.steps) == [1 / 32, 1 / 64]
    record, c0 = scheme_row(scheme).record, sum(v * v for v in INITIAL)
    for i, h in enumerate(case.steps):
        for k, n in enumerate(records):
            rows = rows_after(record, case.model, initial_rows(record, case.model, case.initial, 2), h, 0, n)
            y = rows.reshape(2, 3, LANES).transpose(1, 0, 2).reshape(3, -1)[:, : case.samples]
            error = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2] - c0) / c0
            at = i, k, 0
            absolute = 1e-12 * np.abs(error).max()
            assert math.isclose(found["casimir_mean"][at], error.mean(), rel_tol=1e-9, abs_tol=absolute)
            assert math.isclose(found["casimir_rms"][at], np.sqrt(np.mean(error**2)), rel_tol=1e-12)
            assert found["casimir_worst"][at] == np.abs(error).max()
            assert found["casimir_one"][at] == error[0]
            assert (np.abs(error).max() < 1e-13) == (scheme == "splitting")
        end = error / records[-1]
        assert math.isclose(found["bias"][i, 0], end.mean(), rel_tol=1e-9, abs_tol=1e-12 * np.abs(end).max())
        assert math.isclose(found["bias_stderr"][i, 0], end.std(ddof=1) / math.sqrt(case.samples), rel_tol=1e-9)
    assert np.isnan(found["growth"]).all()  # too few steps for a fit
    facts = group.attributes
    assert (facts["steps_each"], facts["samples"], facts["seed"]) == (records[-1], 70, 3)
    assert facts["snapshots"] == len(range(128, records[-1] + 1, 128))  # the warm-up ends before the first


@compiled_only
def test_going_on_from_every_snapshot_gives_the_same_bits(case_of):
    case = case_of()
    plan = long_time.plan(case, Part("splitting"))
    found = check_going_on(plan)
    assert len(found) == 1 + 2 * len(range(128, 640 + 1, 128))
    progress = [plan.progress(taken(plan, plain)) for plain in found]
    assert (np.diff([done for done, _, _ in progress]) > 0).all()
    assert progress[0][0] == 0 and progress[-1][:2] == (case.samples, case.samples)
    whole = finished(plan, 1)
    assert same_numbers(finished(plan), whole)
    other = long_time.plan(case_of("seed=4"), Part("splitting"))
    assert not same_numbers(finished(other), whole)


def test_stops_are_records_and_then_snapshots(case_of):
    """Many steps: snapshots are far apart, but the first records are not left out."""
    plan = long_time.plan(case_of("step_count=2^24+128"), Part("splitting"))
    assert plan.spacing == 2**11
    assert plan.records.tolist() == [*(2**k for k in range(7, 25)), 2**24 + 128]
    stops = [0]
    while stops[-1] < plan.case.step_count:
        stops.append(paths.next_stop(plan, stops[-1]))
    del stops[0]
    assert stops[:6] == [128, 256, 512, 1024, 2048, 4096]
    assert set(plan.records) <= set(stops)
    assert np.diff(stops[4:-1]).tolist() == [2**11] * (2**13 - 1) and stops[-1] == plan.case.step_count
    assert all(n % STEPS_PER_TOSS == 0 for n in stops)


@compiled_only
def test_an_interrupted_run_goes_on_where_it_stopped(load_text, tmp_path, monkeypatch):
    monkeypatch.setattr(long_time, "BATCH_SECONDS", 0.0)
    wanted = load_text(RIGID, "schemes=[splitting, euler_maruyama]")

    def numbers(path):
        groups = storage.read(path).groups
        return repr([{k: (axes, v.tolist()) for k, (axes, v) in g.variables.items()} for g in groups])

    def stop(progress):
        if progress.part == "euler_maruyama" and progress.done > 20:
            raise KeyboardInterrupt

    whole = runner.run(wanted, tmp_path / "whole")
    with pytest.raises(runner.Stopped):
        runner.run(wanted, tmp_path / "stopped", watch=runner.Watch(stop))
    reports = []
    path = runner.run(wanted, tmp_path / "stopped", watch=runner.Watch(reports.append))
    first = {scheme: next(p.done for p in reports if p.part == scheme) for scheme in wanted.cases[0].schemes}
    assert first["splitting"] == 70 and 20 < first["euler_maruyama"] < 70  # nothing is computed twice
    assert numbers(path) == numbers(whole)
    assert "stationary law" in printed(storage.read(path))


@compiled_only
def test_threads_do_not_matter(case_of):
    plan, before = long_time.plan(case_of("samples=200"), Part("splitting")), ensemble.thread_count()
    try:
        ensemble.use_threads(1)
        one = finished(plan)
    finally:
        ensemble.use_threads(before)
    assert same_numbers(finished(plan), one)


# --- growth and bias, of errors made by hand -------------------------------------------------------------------------

RECORDS = 128 << np.arange(15)


def walks(generator, paths, drift=0.0):
    """Errors (records, paths) that are sums of as many normals as steps, and a drift per step."""
    steps = generator.standard_normal((len(RECORDS), paths)) * np.sqrt(np.diff(RECORDS, prepend=0))[:, None]
    return 1e-17 * (np.cumsum(steps, axis=0) + drift * RECORDS[:, None])


def paths_done(plan, chunk, casimir=None):
    """The paths of a chunk as if all steps were done: no counts, and these errors of the Casimirs, or none known."""
    start = paths.paths_at_start(plan, chunk.blocks)
    of_paths = {name: getattr(start, name)[..., : chunk.paths] for name in paths.OF_PATHS}
    done = start._replace(paths=chunk.paths, n=plan.case.step_count, y=start.y[:0], **of_paths)
    return done if casimir is None else done._replace(casimir=casimir)


def study_of_errors(case_of, errors):
    """The study of a plan whose Casimir errors are these, one array for each of two step sizes."""
    case = case_of(f"samples={errors[0].shape[1]}", f"step_count={RECORDS[-1]}", "model.sigma=[0, 0, 0]")
    plan = long_time.plan(case, Part("splitting"))
    state = State(plan)
    assert plan.records.tolist() == RECORDS.tolist()
    for stream, error in enumerate(errors):
        for chunk in state.streams[stream].chunks(stream):
            state.put(chunk, paths_done(plan, chunk, error[:, np.newaxis, chunk.first * LANES : chunk.end]))
    return study(case, "splitting", state)[0]


def test_growth_of_walks_and_drifts(case_of):
    generator, covered, widths = np.random.default_rng(7), 0, []
    for _ in range(20):
        found = study_of_errors(case_of, [walks(generator, 100), walks(generator, 100)])
        covered += np.count_nonzero((found["growth_low"] <= 0.5) & (found["growth_high"] >= 0.5))
        widths += (found["growth_high"] - found["growth_low"]).ravel().tolist()
        assert np.abs(found["growth"] - 0.5).max() < 0.1
        z = found["bias"] / found["bias_stderr"]
        assert np.abs(z).max() < 4.5
    assert covered >= 34  # of 40, 95 % wanted
    assert 0.02 < np.median(widths) < 0.12
    # Negative controls: a drift throughout, and one that only the last records show.
    found = study_of_errors(case_of, [walks(generator, 100, 1.0), walks(generator, 100, 0.01)])
    assert np.abs(found["growth"][0, 0] - 1) < 0.01
    assert found["growth_low"][0, 0] > 0.9 and found["growth_low"][1, 0] > 0.6
    z = found["bias"] / found["bias_stderr"]
    assert z.min() > 8
    assert np.allclose(found["bias"][:, 0], [1e-17, 1e-19], rtol=0.2)


def test_growth_of_what_cannot_be_fitted(case_of):
    none = np.zeros((len(RECORDS), 10))
    lost = walks(np.random.default_rng(1), 10)
    lost[7:, 3] = np.nan  # of the records that count only two are left
    found = study_of_errors(case_of, [none, lost])
    assert np.isnan(found["growth"]).all()
    assert found["bias"][0, 0] == 0 and np.isnan(found["bias"][1, 0])
    one = study_of_errors(case_of, [walks(np.random.default_rng(1), 1)] * 2)
    assert np.isnan(one["growth"]).all() and np.isnan(one["bias_stderr"]).all()


# --- the law on the sphere -------------------------------------------------------------------------------------------


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


def test_quantiles_of_a_symmetric_body_are_elementary():
    """H = (a (1 - z^2) + b z^2) r^2, and |z| is uniform."""
    law = SphereLaw.of(RIGID_BODY._replace(inertia=(1.0, 1.0, 0.25)), (0.0, 1.2, 1.6))
    np.testing.assert_allclose(law.edges[3], 4 * (0.5 + 1.5 * np.linspace(0, 1, BINS + 1) ** 2), rtol=2e-4)


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


# --- the law of long paths -------------------------------------------------------------------------------------------

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
    scheme = scheme_row("euler_maruyama").record
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
        plan = long_time.plan(case, Part("splitting"))
        assert plan.law is None
        state = State(plan)
        for chunk in state.missing():
            state.put(chunk, paths_done(plan, chunk))
        found, _ = study(case, "splitting", state)
        assert "nonfinite" in found and "law_distance" not in found and "mean" not in found
    assert isinstance(long_time.plan(case_of(), Part("splitting")).law, SphereLaw)


def test_on_an_axis_nothing_moves_and_no_law_is_known(case_of):
    for initial in ("[1, 0, 0]", "[0, 0, -2]", "[0, 0, 0]"):
        assert long_time.plan(case_of(f"initial={initial}"), Part("splitting")).law is None


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


def test_one_noise_about_an_axis_of_symmetry_keeps_the_component_along_it():
    """Why one noise is not enough: the law of y_3 stays where it was, far from the uniform one."""
    model = RIGID_BODY._replace(inertia=(1.0, 1.0, 0.5), sigma=(None, None, 1.0))
    y = final_states(scheme_row("midpoint").record, model, h=0.1, steps=16, blocks=1, initial=(0.6, 0.0, 0.8))[0]
    assert np.abs(y[2] - 0.8).max() < 1e-14
    assert np.ptp(y[0]) > 0.3


def test_cost(case_of):
    case = case_of()
    plan = long_time.plan(case, Part("splitting"))
    steps, seconds, needed = plan.cost()
    assert steps == 2 * 640 * 2 * LANES
    assert 1e-9 < seconds / steps < 1e-7
    assert needed >= sum(np.asarray(v).nbytes for _ in case.steps for v in paths.paths_at_start(plan, plan.blocks))


# --- the spec --------------------------------------------------------------------------------------------------------

SCHEMES = "[splitting, euler_maruyama_renormalised, euler_maruyama]"
MODEL = "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}"


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (["640", "641"], r"6: step_count: is 641; must be a multiple of 128, such as 640 or 768"),
        (["640", "100"], r"6: step_count: is 100; must be a multiple of 128, such as 128 or 256"),
        (["640", "0"], r"6: step_count: is '0'; must be at least 1"),
        (["640", "2^35"], r"6: step_count: is '2\^35'; must be at most 17179869184"),
        (["step_count: 640\n", ""], r"1: step_count: missing key 'step_count'; add step_count: .*"),
        ([SCHEMES, "[ap_splitting]\neps: 0.1"], r"7: schemes: has a multiscale scheme; use schemes without eps"),
        ([SCHEMES, "[splitting, midpoint]"], r"7: schemes: has 'midpoint', which needs bounded increments; .*"),
        ([SCHEMES, "[splitting, splitting]"], r"7: schemes: has 'splitting' twice; remove one"),
        (["[1/8, 1/4]", "[1/8, 2^-3]"], r"5: steps: has '0.125' twice; remove one"),
        (
            [MODEL, "{name: maxwell_bloch}", "[cos(1.1), 0, sin(1.1)]", "[1, 2, 3]"],
            r"7: schemes: has 'euler_maruyama_renormalised', which is for rigid_body and .*; use another",
        ),
    ],
)
def test_each_mistake_gets_one_line(load_text, replaced, message):
    text = RIGID
    for old, new in zip(replaced[::2], replaced[1::2], strict=True):
        assert text.count(old) == 1
        text = text.replace(old, new)
    with pytest.raises(SpecError) as caught:
        load_text(text)
    assert re.fullmatch(rf".*s\.yaml:{message}", str(caught.value))


def test_good_specs(load_text, case_of):
    case = case_of()
    assert (case.steps, case.step_count, case.panels, case.truncate_noise) == ((0.25, 0.125), 640, ("growth",), False)
    assert case_of("schemes=[midpoint]", "truncate_noise=true").schemes == ("midpoint",)
    bloch = load_text(RIGID, "model={name: maxwell_bloch}", "schemes=[splitting]").cases[0]
    assert type(bloch.model) is MaxwellBloch
    base = load_text(RIGID).hash
    assert load_text(RIGID, "step_count=2^7*5").hash == load_text(RIGID.replace("A title", "Other")).hash == base
    assert len({base, *(load_text(RIGID, o).hash for o in ("step_count=768", "samples=71", "steps=[1/8]"))}) == 4
