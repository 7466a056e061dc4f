"""Trajectories: the path and its invariants, what is stored of them, and their tables."""

import re

import numpy as np
import pytest
from helpers import INITIAL, LANES, RIGID_BODY, printed, simulate
from states import check_going_on, finished
from trajectory_results import trajectories, trajectory_group

from spi import views
from spi.ensemble.protocol import casimirs, hamiltonian
from spi.kinds.plans import State
from spi.kinds.trajectory import results as trajectory_records
from spi.kinds.trajectory import study
from spi.kinds.trajectory.results import SolverMeans
from spi.schemes import SCHEMES
from spi.storage import Part

SPEC = """\
kind: trajectory
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 2
step: 1/8
schemes: [splitting]
panels: [casimirs, sphere]
path: 70
seed: 3
"""


def test_a_path_is_that_of_the_ensemble_with_its_invariants(spec):
    (case,) = spec(SPEC).cases
    (part,) = study.parts(case)
    plan = study.plan(case, part)
    start, state = State(plan), finished(plan)
    assert len(start.missing()) == 1 and state.missing() == []  # there is nothing left to do
    assert len(check_going_on(plan)) == 2
    assert [plan.progress(one)[:2] for one in (start, state)] == [(0, 1), (1, 1)]
    assert plan.cost().path_steps == 16 * LANES and plan.cost().bytes >= state.total().y.nbytes
    reading = views.readings(trajectories(plan.results(state).group()))[0]
    found, _ = simulate(SCHEMES["splitting"].record, h=1 / 8, steps=16, snapshots=0, blocks=2, seed=3)
    np.testing.assert_array_equal(reading.y[1:], found[0][:, :, 70])
    assert not np.array_equal(reading.y[1:], found[0][:, :, 6])  # the same lane of another block
    np.testing.assert_array_equal(reading.y[0], INITIAL)
    np.testing.assert_array_equal(reading.t, np.arange(17) / 8)
    y = tuple(reading.y.T)
    np.testing.assert_allclose(reading.hamiltonian, hamiltonian(RIGID_BODY, y), rtol=1e-14)
    np.testing.assert_allclose(reading.casimirs[:, 0], casimirs(RIGID_BODY, y)[0], rtol=1e-14)
    assert reading.casimir_drift[0] == np.abs(reading.casimirs - reading.casimirs[0]).max() < 1e-14
    assert (reading.panels, reading.path, reading.step) == (("casimirs", "sphere"), 70, 1 / 8)
    assert (reading.nonfinite_from, reading.solver, reading.largest_angle < np.pi) == (None, None, True)


T = np.arange(5) * 0.25


def group(scheme, casimirs=2, **attributes):
    y = np.column_stack([1.0 + T, -T])
    if scheme == "euler_maruyama":
        y[3:] = np.nan
    kept = np.outer(1 + 1e-15 * T, 1.0 + np.arange(casimirs))
    drift = tuple(1e-15 * 2**c for c in range(casimirs))
    hamiltonian = np.where(np.isnan(y[:, 0]), np.nan, 2.0 - T / 3)
    told = {"scheme_label": SCHEMES[scheme].label, "case_title": "one [path]", "casimir_drift": drift}
    return trajectory_group(scheme, T, y, kept, hamiltonian=hamiltonian, **told, **attributes)


SOLVER = SolverMeans(failures=2, iterations_mean=3.25, largest_residual=1e-15)


@pytest.fixture
def results():
    groups = [group("euler_maruyama", case="one"), group("midpoint", case="one", solver=SOLVER)]
    return trajectories(*groups, group("splitting", 0, case="two"), title="Trajectories")


def test_columns_have_the_names_that_the_system_gives_its_components(results):
    """The names may be those of other components."""
    for group in results.groups:
        group.attributes["variables"] = ["y2", "y1"]
    first = views.rows(results)[7]
    assert (first["y[y2]"], first["y[y1]"]) == (1.5, -0.5) and "y_1" not in first


def test_printed(results):
    text = printed(results)
    assert "Trajectories" in text and "one [path]" in text and all(len(line) <= 100 for line in text.splitlines())
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if " 2^-2 " in line}
    assert rows["Euler-Maruyama"] == ["2^-2", "4", "nan", "1.0e-15", "2.0e-15", "-0.5", "0.75"]
    assert rows["midpoint"] == ["2^-2", "4", "1.66667", "1.0e-15", "2.0e-15", "-1", "2", "3.2"]
    assert rows["splitting"] == ["2^-2", "4", "1.66667", "-1"]
    assert text.count(" C1") == 1 and text.count("failures") == 1


SECTION = """\
title: t
kind: trajectory
model: {name: rigid_body, inertia: [1e300, 1e300, 4/5], noise_inertia: [1, 1, 1], sigma: [0, 0, 0]}
initial: [3/5, 0, 4/5]
final_time: 32
step: 1/4
schemes: [splitting_symmetric]
functions: {flat: y1^2 + y2^2, twice: 2*flat}
section: {of: y2, direction: both, store: [y1, H]}
panels: [functions, section]
"""


def test_drifts_of_large_casimirs_are_also_said_relative_to_them():
    casimirs = np.array([[0.5, 2e5, -400.0], [0.5, 2e5 + 1e-4, -400.0 - 8e-8]])
    group = trajectory_group("splitting", np.arange(2.0), np.ones((2, 3)), casimirs)
    told = "drifts are absolute; those of Casimirs above 100, the largest 2.0e5, are at most 5.0e-10 of their values"
    assert told in printed(trajectories(group))
    group = trajectory_group("splitting", np.arange(2.0), np.ones((2, 3)), casimirs / 1e4)
    assert "drifts are absolute" not in printed(trajectories(group))


def test_functions_and_a_section_by_the_map_of_the_step(spec):
    """A turn of a top of period 2 pi with exact flows: so are the crossings, unlike those on lines between states."""
    plan = study.plan(spec(SECTION).cases[0], Part("splitting_symmetric"))
    found = plan.results(finished(plan))
    np.testing.assert_allclose(found.values.value, [np.full(129, 0.36), np.full(129, 0.72)], rtol=1e-13)
    section = found.section
    turns = np.pi * np.arange(1, 11)
    np.testing.assert_allclose(section.t[-10:], turns, atol=1e-12)
    np.testing.assert_allclose(section.value[0][-10:], 0.6 * np.cos(turns), atol=1e-12)
    np.testing.assert_allclose(section.value[1], 0.4, rtol=1e-14)
    y, n = found.y[:, 1], np.floor(turns * 4).astype(int)
    lines = (n + y[n] / (y[n] - y[n + 1])) / 4
    assert abs(lines - turns).max() > 1e-4
    up = study.plan(spec(SECTION, "direction: both", "direction: up").cases[0], Part("splitting_symmetric"))
    assert len(up.results(finished(up)).section.t) in (5, 6)


def test_functionals_are_those_of_the_values_at_stored_times(spec):
    """Of y1 = 0.6 cos t, y2 = 0.6 sin t or -0.6 sin t: an integral by the trapezoidal rule, also over uneven times."""
    own = "functions: {work: {integral: y1*cos(t)}, far: {maximum: y1 - t}, low: {minimum: y1}, y1: y1}"
    text = re.sub("functions: .*", own, SECTION)
    for more, error in (("", 0.6 * 32 / 6 * (1 / 4) ** 2), ("save: [1, 1.5, 32]\n", np.inf)):
        plan = study.plan(spec(text + more).cases[0], Part("splitting_symmetric"))
        found = plan.results(finished(plan))
        t, (work, far, low, y1) = found.t, found.values.value
        np.testing.assert_allclose(y1, 0.6 * np.cos(t), atol=1e-12)
        areas = np.diff(t) * ((y1 * np.cos(t))[1:] + (y1 * np.cos(t))[:-1]) / 2
        np.testing.assert_allclose(work, [0, *np.cumsum(areas)], atol=1e-12)
        assert abs(work - 0.6 * (t / 2 + np.sin(2 * t) / 4)).max() < error
        np.testing.assert_array_equal(far, 0.6)
        np.testing.assert_array_equal(low, [y1[: n + 1].min() for n in range(len(y1))])
    assert found.values.texts[0] == "integral of y1*cos(t)"
    assert abs(work[-1] - 0.6 * (16 + np.sin(64) / 4)) > 1  # of three intervals


def test_a_section_of_a_noisy_path_is_on_lines(spec):
    system, body = (re.search("model: .*", text)[0] for text in (SECTION, SPEC))
    plan = study.plan(spec(SECTION, system, body).cases[0], Part("splitting_symmetric"))
    found = plan.results(finished(plan))
    y, n = found.y[:, 1], np.floor(found.section.t[1:] * 4).astype(int)
    np.testing.assert_allclose(found.section.t[1:], (n + y[n] / (y[n] - y[n + 1])) / 4, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("of: y2", "of: y4", "the state has y1 .. y3"),
        ("functions: {flat: y1^2 + y2^2, twice: 2*flat}\n", "", "is 'functions', and the key functions is missing"),
        ("[functions, section]", "[spins]", "which is for the model spins"),
        ("2*flat", "flat + twice", "cannot be written out: twice names twice"),
        ("2*flat", "{integal: flat}", "functions.twice.integal: is not a known functional; did you mean 'integral'?"),
        ("2*flat", "{passage: flat > 1}", "is not a known functional; known: maximum, minimum, integral"),
    ],
)
def test_faults_of_functions_and_sections(error, old, new, told):
    assert told in error(SECTION, old, new)


def test_crossings_have_the_order_of_the_scheme(spec):
    """Of a free rigid body: the time of the first crossing at three step sizes against a much smaller one."""
    text = SPEC.replace("sigma: [1, 1, 1]", "sigma: [0, 0, 0]").replace("final_time: 2", "final_time: 16")
    text = "title: t\n" + text.replace("[casimirs, sphere]", "[section]").replace(
        "[splitting]", "[splitting_symmetric]"
    )
    first = {}
    for k in (3, 4, 5, 8):
        own = text.replace("step: 1/8", f"step: 2^-{k}\nsection: {{of: y2 - 1/5, direction: up, store: [y1]}}")
        plan = study.plan(spec(own).cases[0], Part("splitting_symmetric"))
        first[k] = plan.results(finished(plan)).section.t[0]
    errors = [abs(first[k] - first[8]) for k in (3, 4, 5)]
    assert 1.9 < np.log2(errors[0] / errors[1]) < 2.1 and 1.9 < np.log2(errors[1] / errors[2]) < 2.1


def test_what_is_stored_does_not_change_what_is_seen(spec):
    """States at times, or one of several, are those of all steps, and a section looks at each step."""
    some, every, whole = (
        (plan := study.plan(spec(SECTION + more).cases[0], Part("splitting_symmetric"))).results(finished(plan))
        for more in ("save: [3.25, 10, 32]\n", "every: 8\n", "")
    )
    np.testing.assert_array_equal(some.t, [0, 3.25, 10, 32])
    np.testing.assert_array_equal(some.y, whole.y[[0, 13, 40, 128]])
    np.testing.assert_array_equal(every.y, whole.y[::8])
    for other in (some, every):
        np.testing.assert_array_equal(other.section.value, whole.section.value)
    spare = study.plan(
        spec(
            SECTION,
            "section: {of: y2, direction: both, store: [y1, H]}\n",
            "save: [10, 32]\n",
            "[functions, section]",
            "[functions]",
        ).cases[0],
        Part("splitting_symmetric"),
    )
    assert spare.case.spacing == 8 and finished(spare).total().y.shape == (17, 3)


def test_states_that_are_recorded_decide_what_is_used_again(spec):
    """A section looks at all steps, so that every eighth state is not enough; times are, if they are among them."""
    bare = SECTION.replace("section: {of: y2, direction: both, store: [y1, H]}\n", "").replace(", section]", "]")
    texts = (
        SECTION + "every: 8\n",
        SECTION,
        bare,
        bare + "every: 8\n",
        bare + "save: [10, 32]\n",
        bare + "save: [32]\n",
    )
    deciding = [repr(study.plan(spec(text).cases[0], Part("splitting_symmetric")).deciding(0)) for text in texts]
    assert deciding[0] == deciding[1] == deciding[2] and deciding[3] == deciding[4]
    assert len(set(deciding)) == 3


def test_functions_of_a_python_file(spec, tmp_path):
    """They are words of formulas, whose values are those of the same formula, to the last bit; the text decides."""
    (tmp_path / "my.py").write_text("def flat2(y):\n    return y[0] * y[0] + y[1] * y[1]\n", encoding="utf-8")
    text = SECTION.replace(
        "functions: {flat: y1^2", "python: my.py\nfunctions: {mine: flat2, double: 2*mine, flat: y1^2"
    )
    experiment = spec(text)
    plan = study.plan(experiment.cases[0], Part("splitting_symmetric"))
    mine, double, flat, twice = plan.results(finished(plan)).values.value
    np.testing.assert_array_equal(mine, flat)
    np.testing.assert_array_equal(double, twice)
    assert [name for name, _ in experiment.files] == ["my.py"]
    (tmp_path / "my.py").write_text("def flat2(y):\n    return 2 * y[0]\n", encoding="utf-8")
    assert spec(text).hash != experiment.hash


@pytest.mark.parametrize("at_a_time", [1, 7, 2**20])
def test_parts_of_states_are_looked_at_as_all_of_them(monkeypatch, at_a_time):
    """The smallest components and the times at which a path is finite, however much is looked at together."""
    monkeypatch.setattr(trajectory_records, "_AT_A_TIME", at_a_time)
    y = np.random.default_rng(1).standard_normal((6, 5))
    y[3, 1], y[4, 2], y[:, 4] = np.nan, -np.inf, np.nan
    y[0, 4] = 2.0
    found = trajectory_records.finite(y)
    assert found.tolist() == [True, False, False, False, False, False]
    (reading,) = views.readings(trajectories(trajectory_group("splitting", np.arange(6.0), y, np.ones((6, 1)))))
    expected = [min(v for v in column if np.isfinite(v)) for column in y.T.tolist()]
    assert reading.lowest.tolist() == expected
    assert reading.lost == "not finite: 5 of 6 times"
