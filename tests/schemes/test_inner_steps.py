"""Inner steps in the place of flows that are not known: orders, what they preserve and what they do not."""

import numpy as np
import pytest
from inner_cases import CASES, FAILURES, METHODS, SYSTEMS, field, flow, moved, system
from yaml_cases import structure

from spi.ensemble.protocol import casimirs
from spi.schemes import SCHEMES, of_model


@pytest.mark.parametrize("part", ["drift", "noise"])
@pytest.mark.parametrize(("name", "method"), CASES)
def test_steps_are_flows_up_to_the_third_power_of_their_size(name, method, part):
    record, of, y = system(name, method).record, field(name, method, part), np.array(SYSTEMS[name][2])
    times = np.array([0.2, 0.1, 0.05, -0.2, -0.1, -0.05])
    found, report = moved(record, part, times, np.repeat(y[:, np.newaxis], 6, axis=1))
    errors = [np.linalg.norm(found[:, i] - flow(of, t, y)) for i, t in enumerate(times)]
    orders = np.log2([errors[0] / errors[1], errors[1] / errors[2], errors[3] / errors[4], errors[4] / errors[5]])
    assert np.all((orders > 2.6) & (orders < 3.5))
    assert errors[2] < 1e-3 < np.linalg.norm(found[:, 0] - y) and report[FAILURES] == 0


@pytest.mark.parametrize(("name", "method"), CASES)
def test_implicit_steps_are_undone_by_those_of_the_opposite_size(name, method):
    record, y = system(name, method).record, np.array(SYSTEMS[name][2])[:, np.newaxis]
    for part in ("drift", "noise"):
        there, _ = moved(record, part, [0.4], y)
        back, _ = moved(record, part, [-0.4], there)
        distance = np.linalg.norm(back - y)
        assert distance < 1e-13 if method == "midpoint" else 1e-7 < distance < 1e-1


def poisson_defect(record, c, part, t, y):
    """The largest entry of D B(y) D^T - B(Phi(y)); D by differences of fourth order."""
    d, delta = len(y), 1e-3
    offsets = [np.zeros(d)] + [j * delta * e for e in np.eye(d) for j in (-2, -1, 1, 2)]
    new, _ = moved(record, part, t, (np.array(y) + np.array(offsets)).T)
    columns = []
    for i in range(d):
        a, b, e, f = (new[:, 1 + 4 * i + j] for j in range(4))
        columns.append((8.0 * (e - b) - (f - a)) / (12.0 * delta))
    jacobian = np.transpose(columns)
    return np.abs(jacobian @ structure(c, y) @ jacobian.T - structure(c, new[:, 0])).max()


@pytest.mark.parametrize(("name", "method"), CASES)
def test_what_is_a_poisson_map_and_what_is_not(name, method):
    """The isospectral rule on so(3); the midpoint rule where the entries of B are kept; nothing else."""
    found, (_, c, y) = system(name, method), SYSTEMS[name]
    for part in ("drift", "noise"):
        defect = poisson_defect(found.record, c, part, 0.5, np.array(y))
        assert defect < 1e-9 if method == "midpoint" and name in ("body", "mass") else defect > 1e-5
    claimed = "Poisson structure" in of_model(SCHEMES["splitting"], found.record).preserves
    assert claimed == (method == "midpoint" and name in ("body", "mass"))


@pytest.mark.parametrize(("name", "method"), CASES)
def test_casimir_functions(name, method):
    """All by Munthe-Kaas; quadratic ones by the midpoint rule, which loses the cubic one."""
    found, y = system(name, method), np.array(SYSTEMS[name][2])[:, np.newaxis]
    record, new = found.record, y
    for _ in range(4):
        new, _ = moved(record, "drift", [0.3], new)
        new, _ = moved(record, "noise", [-0.2], new)
    before, after = (np.array(casimirs(record, tuple(z[:, 0]))) for z in (y, new))
    drift = np.abs(after / before - 1.0)
    lost = name == "cubic" and method == "midpoint"
    assert drift.min() > 1e-5 if lost else drift.max() < 1e-13
    assert ("quadratic" in of_model(SCHEMES["splitting"], record).preserves) == (
        method == "midpoint" and name in ("cubic", "two bodies")
    )


@pytest.mark.parametrize("method", METHODS)
def test_the_mean_over_a_noise_lacks_terms_of_the_size_of_h_squared(method):
    """E of the step less E of the flow over normal increments, by quadrature: weak order 1, and not 2."""
    record, of, y = system("body", method).record, field("body", method, "noise"), np.array(SYSTEMS["body"][2])
    nodes, weights = np.polynomial.hermite_e.hermegauss(16)
    weights = weights / weights.sum()
    differences = []
    for h in (0.04, 0.02, 0.01):
        found, _ = moved(record, "noise", np.sqrt(h) * nodes, np.repeat(y[:, np.newaxis], 16, axis=1))
        exact = np.array([flow(of, t, y) for t in np.sqrt(h) * nodes]).T
        differences.append(np.linalg.norm((found - exact) @ weights))
    slopes = np.log2(np.array(differences[:-1]) / differences[1:])
    assert np.all(np.abs(slopes - 2) < 0.3) and differences[0] > 1e-6


def test_newtons_method_solves_what_simple_iteration_does_not():
    """Beyond |t F'| = 2/3 or so; the equation of the step is checked by the field written down here."""
    record, of, y = system("mass", "midpoint").record, field("mass", "midpoint", "drift"), np.array([0.8, 0.9, 1.2])
    for t, simple in ((0.3, True), (2.5, False)):
        new, report = moved(record, "drift", [t], y[:, np.newaxis])
        assert np.allclose(new[:, 0] - y, t * of((y + new[:, 0]) / 2), rtol=0, atol=1e-12) and report[FAILURES] == 0
        assert (report[1] / report[0] < 30) == simple


def test_equations_that_are_not_solved_are_reported():
    record, y = system("mass", "midpoint").record, np.array([[0.8], [40.0], [1.0]])
    _, report = moved(record, "drift", [30.0], y)
    assert report[FAILURES] > 0
