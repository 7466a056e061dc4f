"""The stability study against a plain NumPy computation from the same increments, and the word that it sweeps.

The oracle takes the words of the generator and writes everything else out anew: normals, increments, schemes, extremes
over time, errors and expectations.  All seeds are fixed.
"""

import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from helpers import COMPILED, INITIAL, RIGID_BODY, printed, turned
from states import check_going_on, finished, ignore, same_numbers, taken

from spi import engine, ensemble, kolmogorov, storage
from spi import run as runner
from spi.kinds.stability import study as stability
from spi.kinds.state import State
from spi.models import MaxwellBloch
from spi.records import Part
from spi.rng import LANES, philox
from spi.run import load
from spi.schemes import scheme_row
from spi.schemes.rows import compositions
from spi.spec import SpecError

compiled_only = pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")

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
    group = plan.group(finished(plan) if state is None else state)
    assert group.coordinates["h"].tolist() == list(case.steps)
    return {name: values for name, (_, values) in group.variables.items()}, group


# --- the oracle ------------------------------------------------------------------------------------------------------


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


def check_against_numpy(case, scheme, eps=lambda point: None):
    """Every stored quantity of a study of the rigid body."""
    found, group = study(case, scheme)
    names = {"finite", "largest_norm", "error", "error_stderr", "casimir_worst", "casimir_median"}
    names |= {"expectation", "expectation_stderr", "truth", "truth_bound", "law_distance", "law_distance_stderr"}
    solver = {"solves", "iterations", "failures", "largest_residual"}
    assert set(found) - {"largest_angle"} == names | (solver if scheme == "midpoint" else set())
    assert found["error"].shape == (len(case.sweep.values), len(case.steps))
    for i, point in enumerate(case.sweep.cases):
        expected = summary_by_hand(point, paths_by_hand(point, scheme, eps(point)), PHI)
        drifts = scheme == "euler_maruyama"
        for name in ("error", "error_stderr", "largest_norm", "expectation", "expectation_stderr"):
            np.testing.assert_allclose(found[name][i], expected[name], rtol=1e-9, atol=1e-14, err_msg=name)
        for name in ("casimir_worst", "casimir_median"):
            absolute = 0 if drifts else 1e-14
            np.testing.assert_allclose(found[name][i, :, 0], expected[name], rtol=1e-9, atol=absolute, err_msg=name)
            assert drifts == (found[name][i].min() > 1e-4)
        assert np.array_equal(found["finite"][i], expected["finite"])
        if "splitting" in scheme:
            np.testing.assert_allclose(found["largest_angle"][i], expected["largest_angle"], rtol=1e-12)
        away = np.abs(expected["expectation"] - found["truth"][i])
        farthest = away.argmax(axis=1)[:, None]
        np.testing.assert_allclose(found["law_distance"][i], away.max(axis=1), rtol=1e-9)
        stderr = np.take_along_axis(expected["expectation_stderr"], farthest, 1)[:, 0]
        doubt = np.hypot(stderr, found["truth_bound"][i][farthest[:, 0]])
        np.testing.assert_allclose(found["law_distance_stderr"][i], doubt, rtol=1e-9)
    return found, group


# --- everything that is stored, against the oracle -------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["splitting", "euler_maruyama", pytest.param("midpoint", marks=compiled_only)])
def test_whole_study_is_what_plain_numpy_finds(case_of, scheme):
    """Two values, three step sizes, and a second block of which only six lanes count."""
    case = case_of(RIGID)
    found, group = check_against_numpy(case, scheme)
    if scheme == "splitting":
        assert (found["largest_angle"] == 0).any() and found["largest_angle"].max() > math.pi / 4
    if scheme == "midpoint":  # blocks are computed whole
        assert found["solves"].tolist() == [[2 * LANES * round(1 / h) for h in case.steps]] * 2
        assert (found["iterations"] >= found["solves"]).all()
        assert not found["failures"].any()
        assert 0 < found["largest_residual"].max() < 1e-13
    assert group.coordinates["value"].tolist() == [0.5, 2.0]
    assert group.coordinates["function"].tolist() == ["a", "b", "c"]
    facts = group.attributes
    assert (facts["sweep"], facts["samples"], facts["accurate"], facts["seed"]) == ("s", 70, 0.1, 5)
    assert facts["functions"] == ("y1", "y2^2", "y1*y3")
    assert facts["initial"] == INITIAL
    assert "model_sigma" not in facts  # it differs from value to value
    assert facts["model_inertia"] == (2.0, 1.0, 2 / 3)


def check_eps(folder):
    """The multiscale scheme and its reference have the eps of each value; the truth is that of the limit eps = 0."""
    path = Path(folder) / "eps.yaml"
    path.write_text(EPS, encoding="utf-8")
    case = load(path).cases[0]
    cases = [case, load(path, overrides=["reference_scheme=ap_splitting"]).cases[0]]
    for case in cases:
        found, group = study(case, "ap_splitting")
        for i, (point, eps) in enumerate(zip(case.sweep.cases, case.sweep.values, strict=True)):
            assert point.eps == (eps,)
            expected = summary_by_hand(point, paths_by_hand(point, "splitting", eps), PHI)
            for name in ("error", "error_stderr", "expectation", "largest_angle"):
                np.testing.assert_allclose(found[name][i], expected[name], rtol=1e-9, atol=1e-14, err_msg=name)
        assert np.abs(found["error"][1] / found["error"][0] - 1).max() > 0.1  # eps matters
        assert np.isfinite(found["truth"]).all() and np.array_equal(found["truth"][0], found["truth"][1])
        assert group.attributes["scheme_label"] == "AP splitting"


def test_swept_eps_is_what_plain_numpy_finds(tmp_path):
    """Without the compiler, which would take longer than the few steps."""
    program = f"import test_stability; test_stability.check_eps({str(tmp_path)!r})"
    tests = Path(__file__).parent
    path = os.pathsep.join([str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def test_one_path_has_no_standard_errors(case_of):
    found, _ = study(case_of(RIGID, "samples=1"), "splitting")
    assert (found["error"] > 0).all() and np.isfinite(found["law_distance"]).all()
    for name in ("error_stderr", "expectation_stderr", "law_distance_stderr"):
        assert np.isnan(found[name]).all()


# --- on what the results may not depend ------------------------------------------------------------------------------


@compiled_only
@pytest.mark.parametrize("scheme", ["splitting", "euler_maruyama"])
def test_batches_do_not_matter(case_of, scheme):
    plan = stability.plan(case_of(RIGID, "samples=330"), Part(scheme))
    whole = finished(plan, plan.first.blocks)
    assert same_numbers(whole, whole)
    for blocks in (1, 2, None):
        assert same_numbers(finished(plan, blocks), whole)
    other = stability.plan(case_of(RIGID, "samples=330", "seed=6"), Part(scheme))
    assert not same_numbers(finished(other), whole)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
@compiled_only
@pytest.mark.parametrize("scheme", ["splitting", "euler_maruyama", "midpoint"])
def test_threads_do_not_matter(case_of, scheme):
    plan, before = stability.plan(case_of(RIGID, "samples=330"), Part(scheme)), ensemble.thread_count()
    states = []
    try:
        for threads in (1, 2):
            ensemble.use_threads(threads)
            states.append(finished(plan))
    finally:
        ensemble.use_threads(before)
    assert same_numbers(*states)


def test_going_on_from_the_middle_gives_the_same_bits(case_of):
    plan = stability.plan(case_of(RIGID, "samples=200" if COMPILED else "samples=130"), Part("splitting"))
    found = check_going_on(plan)
    assert len(found) == 1 + 2 * plan.first.blocks + 2  # before the first block, after each, and after each truth
    progress = [plan.progress(taken(plan, plain)) for plain in found]
    done = [one.done for one in progress]
    assert (np.diff(done[:-2]) > 0).all() and done[0] == 0
    assert done[-3:] == [progress[-1].total] * 3  # only the true expectations are still missing


def test_values_and_step_sizes_do_not_influence_one_another(case_of):
    whole, _ = study(case_of(RIGID), "splitting")
    part, _ = study(case_of(RIGID, "sweep={s: [2]}", "steps=[2^-1, 2^-3]"), "splitting")
    for name in set(part) - {"truth", "truth_bound"}:
        assert np.array_equal(part[name][0], whole[name][1][[0, 2]])


class Reports(list):
    """Keeps what is reported, and interrupts after so many reports of a part that has begun."""

    def __init__(self, case=None, scheme=None, after=None):
        self.place, self.left = (case, scheme), after

    def __call__(self, progress):
        self.append(progress)
        if (progress.case, progress.part) == self.place and progress.done:
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt


def numbers(path):
    """Everything in a results file that must repeat."""
    groups = {}
    for group in storage.read(path).groups:
        attributes = {k: v for k, v in group.attributes.items() if k not in ("wall_seconds", "threads")}
        arrays = {k: (axes, v.shape, v.tolist()) for k, (axes, v) in group.variables.items()}
        groups[group.case, group.variant] = repr((arrays, attributes))
    return groups


@compiled_only
def test_an_interrupted_run_goes_on_where_it_stopped(tmp_path, monkeypatch):
    """Also where a model has no Casimir functions, so that some arrays are empty."""
    monkeypatch.setattr(ensemble, "BATCH_SECONDS", 0.0)  # as few blocks to a batch as there are threads
    spec = tmp_path / "s.yaml"
    spec.write_text(PREDATORS, encoding="utf-8")
    wanted = load(spec, overrides=["samples=130"])
    whole = numbers(runner.run(wanted, tmp_path / "whole"))
    assert list(whole) == [("main", "splitting"), ("main", "euler_maruyama")]
    out = tmp_path / "stopped"
    for scheme in wanted.cases[0].schemes:
        with pytest.raises(runner.Stopped):
            runner.run(wanted, out, watch=runner.Watch(Reports("main", scheme, 1)))
    reports = Reports()
    path = runner.run(wanted, out, watch=runner.Watch(reports))
    first = {scheme: next(p.done for p in reports if p.part == scheme) for scheme in wanted.cases[0].schemes}
    assert first["splitting"] == 260 and 0 < first["euler_maruyama"] < 260  # nothing is computed twice
    assert numbers(path) == whole
    text = printed(storage.read(path))
    assert "positive" in text and "Casimir" not in text


# --- paths that leave the finite numbers, or zero --------------------------------------------------------------------


@compiled_only
def test_explosions_are_counted_and_never_left_out(case_of):
    """Of Euler-Maruyama some paths stay finite: their numbers must not stand for all."""
    case = case_of(RIGID, "sweep={s: [0.5, 8]}", "final_time=4", "samples=200")
    found, _ = study(case, "euler_maruyama")
    strong = case.sweep.cases[1]
    paths = paths_by_hand(strong, "euler_maruyama")
    lost = [np.mean(~np.isfinite(paths[h][0][-1, :, : case.samples]).all(axis=0)) for h in case.steps]
    assert min(lost) > 0 and max(lost) < 1
    np.testing.assert_allclose(found["finite"], [[1.0] * 3, [1 - x for x in lost]], rtol=1e-14)
    for name in ("error", "largest_norm", "casimir_worst", "law_distance"):
        assert np.isfinite(found[name][0]).all()
        assert np.isinf(found[name][1]).all() and (found[name][1] > 0).all()
    # the median is that of all paths, the lost ones being infinitely far
    assert (np.isinf(found["casimir_median"][1, :, 0]) == (np.array(lost) >= 0.5)).all()
    splitting, _ = study(case, "splitting")
    assert (splitting["finite"] == 1).all() and splitting["casimir_worst"].max() < 1e-13


@compiled_only
def test_failures_of_the_solver_are_counted(case_of):
    case = case_of(RIGID, "sweep={s: [0.5, 50]}")
    found, _ = study(case, "midpoint")
    assert not found["failures"][0].any()
    assert (found["failures"][1] > 0).all() and (found["failures"][1] < found["solves"][1]).all()
    assert (found["iterations"][1] <= 20 * found["solves"][1]).all()
    assert found["largest_residual"][0].max() < 1e-13 and not (found["largest_residual"][1] < 1e-13).any()
    assert found["casimir_worst"][0].max() < 1e-13 < found["casimir_worst"][1].min()
    assert not np.isnan(found["error"]).any() and not np.isnan(found["casimir_worst"]).any()


@compiled_only
def test_populations_stay_positive_only_by_splitting(case_of):
    """Where the noise is extreme a population may become smaller than all floats, but never negative."""
    case = case_of(PREDATORS)
    for scheme in case.schemes:
        found, _ = study(case, scheme)
        assert found["casimir_worst"].shape == (2, 3, 0)
        assert np.isnan(found["truth"]).all() and np.isnan(found["law_distance"]).all()
        for i, point in enumerate(case.sweep.cases):
            paths = paths_by_hand(point, scheme)
            expected = summary_by_hand(point, paths, [lambda y: y[0]])
            assert np.array_equal(found["positive"][i], expected["positive"])
            assert np.array_equal(found["finite"][i], expected["finite"])
            least = min(np.nanmin(paths[h][0]) for h in case.steps)
            if scheme == "splitting":
                assert least >= 0
            else:
                assert least < 0 and found["positive"][i].min() < 0.9
        if scheme == "splitting":
            assert (found["positive"][0] == 1).all()


# --- the law ---------------------------------------------------------------------------------------------------------


@compiled_only
def test_law_distance_is_nothing_for_small_steps_and_clear_for_large_ones(case_of):
    case = case_of(RIGID, "sweep={s: [1]}", "steps=[2^-1, 2^-8]", "reference_step=2^-9", "samples=8192")
    for scheme in ("splitting", "euler_maruyama"):
        found, _ = study(case, scheme)
        z = found["law_distance"][0] / found["law_distance_stderr"][0]
        assert z[0] > 8
        assert z[1] < 4
        all_z = (found["expectation"][0] - found["truth"][0]) / found["expectation_stderr"][0]
        assert np.abs(all_z[1]).max() < 4
        assert found["law_distance_stderr"].max() < 0.01


@pytest.mark.parametrize("sigma", [0.3, 1.0])
def test_truth_does_not_depend_on_a_scheme(case_of, sigma):
    case = case_of(RIGID, f"sweep={{s: [{sigma}]}}")
    model = case.sweep.cases[0].model
    flows = compositions(scheme_row("splitting").composition, model)
    wanted = kolmogorov.expectations(model, flows, INITIAL, 1.0, [0.5, 0.25, 0.125], PHI, 1e-6)
    limit, error = kolmogorov.exact_expectations(model, INITIAL, 1.0, PHI, 1e-6)
    assert error.max() < 1e-6
    assert (np.abs(limit - wanted.limit) <= error + wanted.limit_bound).all()
    plan = stability.plan(case, Part("splitting"))
    state = State(plan)
    engine.advance_here([state], ignore)
    assert np.isnan(study(case, "splitting", state)[0]["truth"]).all()
    engine.finish([state], ignore)
    found, _ = study(case, "splitting", state)
    assert (np.abs(found["truth"][0] - wanted.limit) <= found["truth_bound"][0] + wanted.limit_bound).all()
    assert found["truth_bound"].max() < 1e-3


def test_truth_where_it_is_elementary():
    """On an axis nothing moves; with equal inertia and noise, E y falls as exp(-(sigma r)^2 T) to first order."""
    limit, error = kolmogorov.exact_expectations(RIGID_BODY, (0.0, 2.0, 0.0), 3.0, PHI, 1e-6)
    assert limit.tolist() == [0.0, 4.0, 0.0] and not error.any()
    with pytest.raises(ValueError, match="no limit without schemes for MaxwellBloch"):
        kolmogorov.exact_expectations(MaxwellBloch(), (1.0, 2.0, 3.0), 1.0, PHI, 1e-3)
    time = 1e-3
    ito = rigid_euler_step(RIGID_BODY, time, np.zeros((3, 1)), np.array(INITIAL)[:, None], [])[:, 0]
    limit, error = kolmogorov.exact_expectations(
        RIGID_BODY, INITIAL, time, [lambda y, k=k: y[k] for k in range(3)], 1e-6
    )
    assert np.abs(limit - ito).max() < 3 * time**2 + error.max() < 1e-5
    assert np.abs(ito - INITIAL).max() > 1e-4


# --- what describes the results --------------------------------------------------------------------------------------


def test_what_differs_from_value_to_value_is_not_described(spec):
    """A swept eps is no eps of the scheme; one that is the same for all values is."""
    swept = stability.plan(spec(EPS).cases[0], Part("ap_splitting"))
    assert "eps" not in swept.description() and swept.description()["model_sigma"] == (1.0, 1.0, 0.5)
    assert [point.scheme.eps for point in swept.points] == [0.0, 0.6]
    fixed = spec(RIGID, overrides=["schemes=[ap_splitting, splitting]", "eps=0.6"]).cases[0]
    told = [stability.plan(fixed, part).description() for part in stability.parts(fixed)]
    assert [one["eps"] for one in told] == [0.6, None] and not any("model_sigma" in one for one in told)
    assert [one["scheme_label"] for one in told] == ["AP splitting", "splitting"]


# --- the swept word --------------------------------------------------------------------------------------------------


WORD, SIGMA, START = "{s: [0.5, 2]}", "[s, s, s/2]", "[cos(1.1), 0, sin(1.1)]"


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (["sweep: " + WORD + "\n", ""], r"1: sweep: missing key 'sweep'; add sweep: .*"),
        ([SIGMA, "[1, 1, 1]"], r"11: sweep: the word 's' stands nowhere; use it in one of model, initial, eps"),
        ([WORD, "{s: [0.5], t: [1]}"], r"11: sweep: has 2 words; must have one word .*"),
        ([WORD, "{s: [0.5, 1/2]}"], r"11: sweep\.s: has a value twice; remove one"),
        ([WORD, "{pi: [0.5]}", SIGMA, "[pi, 1, 1]"], r"11: sweep: 'pi' cannot be swept; must be .*"),
        ([WORD, "{'a b': [0.5]}", SIGMA, "['a b', 1, 1]"], r"11: sweep: 'a b' cannot be swept; must be .*"),
        ([WORD, "{s: [0.5, -1]}"], r"3: model\.sigma: entry 1 is '\(-1\)'; must be at least 0"),
        ([WORD, "{s: []}"], r"11: sweep\.s: is an empty list; .*"),
        ([WORD, "{s: 1}"], r"11: sweep\.s: is '1'; must be a list in square brackets"),
        ([START, "[0, 0, 0]"], r"4: initial: is 0; must not be, because errors are relative to its length"),
        ([WORD, "{s: [0.5, x]}"], r"11: sweep\.s: entry 2 is 'x'.*; must be .*"),
        ([WORD, "s"], r"11: sweep: is 's'; must be a mapping, lines of key: value"),
        ([SIGMA, "[s, t, 1]"], r"3: model\.sigma: entry 2 is 't' \(unknown word 't'\); must be .*"),
        (["samples: 70", "samples: s"], r"9: samples: is 's' \(unknown word 's'\); must be .*"),
        (["final_time: 1", "final_time: s"], r"5: final_time: is 's' \(unknown word 's'\); must be .*"),
        ([START, "[1, s]"], r"4: initial: has 2 entries; must have 3, the dimension of rigid_body"),
    ],
)
def test_each_mistake_gets_one_line(spec, replaced, message):
    with pytest.raises(SpecError) as caught:
        spec(RIGID, *replaced)
    assert re.fullmatch(rf"s\.yaml:{message}", str(caught.value))


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (["eps: s", "eps: [s, 3]"], r"9: eps: has 2 values; must be one number, or the swept word"),
        (["eps: s", "eps: s-1"], r"9: eps: is '\(0\)-1'; must be at least 0"),
        (["[ap_splitting]", "[multiscale_euler]"], r"9: eps: has 0, which 'multiscale_euler' cannot have; .*"),
    ],
)
def test_each_mistake_in_eps_gets_one_line(spec, replaced, message):
    with pytest.raises(SpecError) as caught:
        spec(EPS, *replaced)
    assert re.fullmatch(rf"s\.yaml:{message}", str(caught.value))


def test_overrides_and_profiles_replace_the_word_or_its_values(spec):
    assert spec(RIGID, overrides=["sweep.s=[3]"]).cases[0].sweep[:2] == ("s", (3.0,))
    case = spec(RIGID, overrides=["sweep={t: [3]}", "model.sigma=[t, 1, 2*t]"]).cases[0]
    assert (case.sweep.word, case.sweep.cases[0].model.sigma) == ("t", (3.0, 1.0, 6.0))
    quick = spec(RIGID + "profiles:\n  quick: {sweep: {s: [7]}}\n", profile="quick").cases[0]
    assert [c.model.sigma[0] for c in quick.sweep.cases] == [7.0]
    with pytest.raises(SpecError, match=r"^s\.yaml: --set sweep: the word 't' stands nowhere; .*"):
        spec(RIGID, overrides=["sweep={t: [3]}", "model.sigma=[1, 1, 1]"])


def test_the_word_stands_for_its_values(spec):
    case = spec(RIGID, WORD, "{s: [-1, 0.25]}", SIGMA, "[2*s^2, abs(s), 0]", START, "[s, -s, s^2]").cases[0]
    first, second = case.sweep.cases
    assert (first.model.sigma, first.initial) == ((2.0, 1.0, None), (-1.0, 1.0, 1.0))
    assert (second.model.sigma, second.initial) == ((0.125, 0.25, None), (0.25, -0.25, 0.0625))
    assert first.model.inertia == second.model.inertia == (2.0, 1.0, 2 / 3)
    assert [c.eps for c in spec(EPS).cases[0].sweep.cases] == [(0.0,), (0.6,)]
    assert [c.eps for c in spec(EPS, "eps: s", "eps: [2*s+1]").cases[0].sweep.cases] == [(1.0,), (2.2,)]


def test_the_word_is_no_part_of_other_words_or_numbers(spec):
    """`e` is neither the e of 1e-3 nor that of exp."""
    case = spec(RIGID, WORD, "{e: [0.5]}", SIGMA, "[2*e, 1e-3*exp(e), 1.e-3]").cases[0]
    assert case.sweep.cases[0].model.sigma == (1.0, 1e-3 * math.exp(0.5), 1e-3)
    case = spec(RIGID, WORD, "{s_1: [0.5]}", SIGMA, "[s_1, sin(s_1), 1]", START, "[s_1*s_1, 0, 1]").cases[0]
    assert case.sweep.cases[0].model.sigma == (0.5, math.sin(0.5), 1.0)
    assert case.sweep.cases[0].initial == (0.25, 0.0, 1.0)


def test_the_hash_is_that_of_what_decides_results(spec):
    base = spec(RIGID).hash
    assert spec(RIGID, "A title", "Another title").hash == base
    assert spec(RIGID, WORD, "{s: [1/2, 2e0]}").hash == base
    others = [
        spec(RIGID, WORD, "{s: [0.5, 3]}").hash,
        spec(RIGID, WORD, "{s: [2, 0.5]}").hash,
        spec(RIGID, WORD, "{s: [0.5]}").hash,
        spec(RIGID, SIGMA, "[s, s, s]").hash,
        spec(RIGID, START, "[cos(1.1), s, sin(1.1)]").hash,
        spec(EPS).hash,
        spec(EPS, "[0, 0.6]", "[0, 0.5]").hash,
    ]
    assert len({base, *others}) == 1 + len(others)


def test_an_empty_sweep_gets_one_line(spec):
    with pytest.raises(SpecError, match=r"^s\.yaml:11: sweep: has 0 words; must .*"):
        spec(RIGID, WORD, "{}")
