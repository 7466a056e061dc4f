"""Quadratic and linear terms that stay one flow: against SciPy's exponential of matrices written by hand."""

import math

import numpy as np
import pytest
import scipy.linalg
from yaml_cases import definition, made

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import drift_flow, frozen, noise_flow
from spi.numerics.angles import ANY_ANGLES
from spi.plugins.systems import generated as systems
from spi.plugins.systems.definition import define, make

PLAIN = "variables: [q, p], bracket: {q p: 1}"
MAGNETIC = "variables: [x, y, u, v], bracket: {x u: 1, y v: 1, u v: B}"
CHAIN = "variables: ['q(i), p(i) for i = 1..n'], bracket: {'q(i) p(i) for i = 1..n': 1}"


@pytest.fixture(autouse=True)
def plain():
    with uncompiled():
        yield


def canonical(hamiltonian, more=""):
    """A definition with {q, p} = 1."""
    return f"{{{PLAIN}, hamiltonian: {hamiltonian}{more}}}"


def in_field(B, given="hamiltonian: (u^2 + v^2)/2 - E*x"):
    return f"{{{MAGNETIC}, parameters: {{B: {B}, E: 1/5}}, {given}}}"


def ring(n):
    bonds = "sum((q(mod(i,n)+1) - q(i))^2/20 for i = 1..n)"
    return f"{{{CHAIN}, sizes: {{n: {n}}}, hamiltonian: 'sum((p(i)^2 + q(i)^2)/2 for i = 1..n) + {bonds}'}}"


def flows(text):
    """What each flow is the flow of, in the words of the definition."""
    system = define(definition(text))
    return [system.world.name(flow.expression) for flow in system.flows]


def step(record, h, y):
    """All flows of H, one after the other."""
    for k in range(type(record).pieces):
        y = drift_flow(record, k, h, y, ANY_ANGLES)
    return y


def exact(matrix, constant, t, y):
    """The solution of y' = M y + b."""
    whole = np.block([[np.array(matrix, float), np.reshape(constant, (-1, 1))], [np.zeros((1, len(y) + 1))]])
    return (scipy.linalg.expm(t * whole) @ [*y, 1.0])[:-1]


def magnetic(B, E):
    """x' = u, y' = v, u' = B v + E, v' = -B u, from H = (u^2 + v^2)/2 - E x with {x, u} = {y, v} = 1, {u, v} = B."""
    return [[0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, B], [0, 0, -B, 0]], [0, 0, E, 0]


def test_a_charged_particle_in_a_magnetic_field():
    """H stays 1/2 up to t = 16 with h = 1/4, and the path is exact; it does not where the terms have two flows."""
    start, ends = (0.0, 0.0, 1.0, 0.0), []
    for given in ("hamiltonian: (u^2 + v^2)/2 - E*x", "pieces: [u^2/2, v^2/2 - E*x]"):
        y = start
        for _ in range(64):
            y = step(made(in_field(1, given)).record, 0.25, y)
        ends.append(y)
    energies = [(u**2 + v**2) / 2 - x / 5 for x, _, u, v in ends]
    assert np.allclose(ends[0], exact(*magnetic(1.0, 0.2), 16.0, start), rtol=0.0, atol=1e-13)
    assert abs(energies[0] - 0.5) < 1e-13 and abs(energies[1] - 0.5) > 0.01, energies


@pytest.mark.parametrize("B", ["-3/2", "-1/1000", "0", "1/10^12", "1/1000", "1", "7/3"])
@pytest.mark.parametrize("t", [0.25, -1.7, 9.0])
def test_any_strength_of_a_field(B, t):
    """Turns to either side, none at all, and turns so slow that digits would be lost, where the terms stay apart."""
    text = in_field(B)
    y, value = (0.3, -0.4, 0.9, 0.2), eval(B.replace("^", "**"))
    found = step(made(text).record, t, y)
    if value == 1e-12:
        assert flows(text) == ["u^2/2", "-E*x + v^2/2"]
    else:
        assert np.allclose(found, exact(*magnetic(value, 0.2), t, y), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("k", ["-2", "-1/10^6", "0", "1/10^6", "1", "5/7"])
@pytest.mark.parametrize("drive", ["0", "1/3"])
def test_rotations_hyperbolic_rotations_and_shears(k, drive):
    """H = p^2/2 + k q^2/2 + a q: one flow whatever the sign of k, at 0 too."""
    text = canonical("p^2/2 + k*q^2/2 + a*q", f", parameters: {{k: {k}, a: {drive}}}")
    record, y = made(text).record, (0.7, -0.4)
    assert type(record).pieces == 1
    for t in (0.5, -1.3, 4.0):
        there = exact([[0, 1], [-eval(k.replace("^", "**")), 0]], [0, -eval(drive)], t, y)
        assert np.allclose(step(record, t, y), there, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(
    ("text", "matrix", "constant"),
    [
        (canonical("q*p"), [[1, 0], [0, -1]], [0, 0]),
        (canonical("k*q*p + p^2", ", parameters: {k: 0}"), [[0, 2], [0, 0]], [0, 0]),
        (canonical("w*(q^2 + p^2)/2", ", parameters: {w: -3}"), [[0, -3], [3, 0]], [0, 0]),
        (canonical("(p + q/2)^2/2 + q^2 - p"), [[0.5, 1], [-2.25, -0.5]], [-1, 0]),
        (canonical("2*(q^2 + p^2)"), [[0, 4], [-4, 0]], [0, 0]),
        # spins in a field: y' = y x grad H
        (
            "{algebra: so(3), parameters: {a: 1/2, b: 2}, hamiltonian: a*y1 + b*y3 - y2}",
            [[0, 2, 1], [-2, 0, 0.5], [-1, -0.5, 0]],
            [0, 0, 0],
        ),
    ],
)
def test_one_flow(text, matrix, constant):
    record = made(text).record
    assert type(record).pieces == 1
    y = (0.7, -0.4, 0.9)[: len(matrix)]
    for t in (0.5, -1.3, 4.0):
        assert np.allclose(step(record, t, y), exact(matrix, constant, t, y), rtol=1e-13, atol=1e-13)


def test_a_component_that_nothing_moves_may_be_a_factor():
    """On heisenberg(1) with z = 3: q' = z p, p' = -z q."""
    record = made("{algebra: heisenberg, variables: [q, p, z], hamiltonian: (q^2 + p^2)/2}").record
    assert type(record).pieces == 1
    q, p, z = step(record, 0.3, (0.7, -0.4, 3.0))
    assert np.allclose((q, p), exact([[0, 3], [-3, 0]], [0, 0], 0.3, (0.7, -0.4)), atol=1e-14) and z == 3.0


def stiffness(n, coupling):
    """The matrix of p' = -K q of a ring of oscillators with H = sum (p^2 + q^2)/2 + coupling (q_i+1 - q_i)^2/2."""
    around = np.roll(np.eye(n), 1, axis=0)
    return np.eye(n) * (1 + 2 * coupling) - coupling * (around + around.T)


@pytest.mark.parametrize("n", [3, 4])
def test_few_oscillators_are_one_flow(n):
    record = made(ring(n)).record
    assert type(record).pieces == 1
    y = np.random.default_rng(n).standard_normal(2 * n)
    matrix = np.zeros((2 * n, 2 * n))
    matrix[::2, 1::2], matrix[1::2, ::2] = np.eye(n), -stiffness(n, 0.1)
    assert np.allclose(step(record, 0.8, tuple(y)), exact(matrix, np.zeros(2 * n), 0.8, y), atol=1e-13)


@pytest.mark.parametrize("n", [5, 32])
def test_a_long_chain_is_no_dense_matrix(n):
    """The oscillators are turned, each by itself, and the bonds between them are a flow of their own."""
    definition_ = definition(ring(n))
    text, _, _, report = make(definition_, "Chain")
    first, second, why = report[1:4]
    assert first.endswith(f"({2 * n} terms joined): {n} rotations") and second.endswith(f"{n} shears")
    assert f"it would move {2 * n} components by one matrix, more than 8" in why
    motions = text[: text.index("class Chain")]
    assert len(motions.splitlines()) < 20 * n


@pytest.mark.parametrize(
    ("hamiltonian", "expected"),
    [
        # what does not commute with the rest, or has another factor of time, is a flow of its own
        ("(q^2 + p^2)/2 + q^4/4", ["p^2/2 + q^2/2", "q^4/4"]),
        ("cos(q) + p^2/2", ["cos(q)", "p^2/2"]),
        ("p^2/2 + (1 + cos(t))*q^2/2", ["p^2/2", "q^2*(cos(t) + 1)/2"]),
        ("p^2/2 + q^2/2 + cos(t)*q", ["p^2/2 + q^2/2", "q*cos(t)"]),
        ("cos(t)*(q^2 + p^2)/2", ["(p^2/2 + q^2/2)*cos(t)"]),
        # and what commutes with the flow is moved by with it
        ("q^2 + p^2 + q^2 - p/2", ["p^2 - p/2 + 2*q^2"]),
        ("q*p - p*q + q^2 - q^2 + p^4", ["p^4"]),
        ("(q^2 + p^2)/2 + (q^2 + p^2)^2/10", ["p^2/2 + q^2/2 + (p^2 + q^2)^2/10"]),
    ],
)
def test_what_is_joined(hamiltonian, expected):
    assert flows(canonical(hamiltonian)) == expected


def test_quadratic_functions_on_other_brackets_stay_apart():
    """On so(3) y1^2 turns by an angle that depends on y1: no flow of a sum of such terms is linear."""
    assert flows("{algebra: so(3), hamiltonian: y1^2 + y2^2/2 + y3}") == ["y1^2", "y2^2/2", "y3"]


def test_a_common_factor_of_time_is_one_rotation():
    """H = cos(t) (q^2 + p^2)/2 turns by the mean of cos, so by sin(h) in a step from 0, see driving.py."""
    given = {"variables": ["q", "p"], "bracket": {"q p": "1"}, "hamiltonian": "cos(t)*(q^2 + p^2)/2"}
    h, y = 0.8, (0.7, -0.4)
    model = frozen(systems.record(systems.made(given, "Driven")), 0.0, h)
    there = exact([[0, 1], [-1, 0]], [0, 0], math.sin(h), y)
    assert type(model).pieces == 1 and np.allclose(step(model, h, y), there, atol=1e-10)


def test_a_noise_may_be_such_a_sum():
    record = made(canonical("q, noises: [p^2/2 - q/3, q*p + p]")).record
    y = (0.7, -0.4)
    for k, (matrix, constant) in enumerate((([[0, 1], [0, 0]], [0, 1 / 3]), ([[1, 0], [0, -1]], [1, 0]))):
        assert np.allclose(noise_flow(record, k, 0.9, y, ANY_ANGLES), exact(matrix, constant, 0.9, y), atol=1e-14)


def test_energy_does_not_drift_over_many_steps():
    """The flow with a parameter in its numbers keeps H to roundings: no more than a walk of them over 10^5 steps."""
    record, y = made(canonical("p^2/2 + k*q^2/2", ", parameters: {k: 0.7}")).record, (1.0, 0.5)
    before = y[1] ** 2 / 2 + 0.35 * y[0] ** 2
    for _ in range(100_000):
        y = drift_flow(record, 0, 0.1, y, ANY_ANGLES)
    assert abs(y[1] ** 2 / 2 + 0.35 * y[0] ** 2 - before) < 1e-13
    assert math.isfinite(y[0])
