"""Friction and noise along one direction as one Ornstein-Uhlenbeck flow: against steps of BAOAB in plain NumPy."""

import math

import numpy as np
import pytest
import scipy.linalg
from helpers import LANES, SCHEMES, final_states, loop_in_python, take_step
from yaml_cases import made

from spi.ensemble.protocol import friction_bend, linear_friction, noises
from spi.ensemble.scheme_protocol import substeps
from spi.models.delegation import thermal
from spi.schemes import of_model
from spi.schemes.splitting import splitting
from spi.schemes.stages import flows

PIECES = "{variables: [q, p], bracket: {q p: 1}, parameters: {w: %s, m: %s}, noises: [q], pieces: [w*q^2/2, p^2/(2*m)]}"
JOINED = PIECES.replace("pieces: [w*q^2/2, p^2/(2*m)]", "hamiltonian: w*q^2/2 + p^2/(2*m)")
T, SIGMA = 0.7, 1.3


def heated(text, sigma=(SIGMA,)):
    return thermal(made(text).record._replace(sigma=sigma), T)


def scheme_of(name, model):
    return of_model(SCHEMES[name], model).record


def linear_step(scheme, model, h):
    """(A, b) of a step y -> A y + b dW_1 + ... of a linear system; b has a column for each independent increment."""
    d, m, n = type(model.model).dimension, noises(model), substeps(scheme)
    states, rows = np.zeros((d, LANES)), np.zeros(((2 * n - 1) * m, LANES))
    states[range(d), range(d)] = 1.0
    finest = range((n - 1) * m, (2 * n - 1) * m)  # a row of whole increments, one of halves, ...
    for lane, row in enumerate(finest, d):
        rows[row, lane] = 1.0
        while (part := row // m) > 0:
            row = (part - 1) // 2 * m + row % m
            rows[row, lane] = 1.0
    ends, _ = take_step(scheme, model, h, rows, states)
    return ends[:, :d], ends[:, d : d + len(finest)] * math.sqrt(h / n)


def stationary(step):
    A, b = step
    return scipy.linalg.solve_discrete_lyapunov(A, b @ b.T)


def baoab(h, w, mass, halves="BAOAB"):
    """The same of BAOAB, or of another order of its letters, by hand: kick, drift, and the exact O for the time h."""
    c = math.exp(-(SIGMA**2) / (2 * T * mass) * h)
    A, b = np.eye(2), np.zeros((2, 1))
    for letter in halves:
        share = h / halves.count(letter)
        move = {
            "B": np.array([[1, 0], [-w * share, 1]]),
            "A": np.array([[1, share / mass], [0, 1]]),
            "O": np.diag([1, c]),
        }[letter]
        A, b = move @ A, move @ b + (np.array([[0], [math.sqrt(T * mass * (1 - c**2))]]) if letter == "O" else 0)
    return A, b


@pytest.mark.parametrize("h", [1.0, 0.5, 0.125])
@pytest.mark.parametrize(("w", "mass"), [("1", "1"), ("3/2", "2/3")])
def test_baoab(h, w, mass):
    """E q^2 = T/w at any step size, E p^2 that of BAOAB; where the oscillator is one flow both are exact."""
    text, w, mass = PIECES % (w, mass), eval(w), eval(mass)
    model = heated(text)
    (A, b), (there, noise) = linear_step(scheme_of("splitting_symmetric", model), model, h), baoab(h, w, mass)
    assert np.allclose(A, there, rtol=0.0, atol=1e-14) and np.allclose(b @ b.T, noise @ noise.T, rtol=0.0, atol=1e-14)
    law = stationary((A, b))
    assert abs(law[0, 0] - T / w) < 1e-13 and (h < 0.5 or abs(law[1, 1] - T * mass) > 0.01)


@pytest.mark.parametrize("h", [1.0, 0.5])
def test_an_oscillator_that_is_one_flow_has_its_gibbs_law(h):
    model = heated(JOINED % ("3/2", "2/3"))
    law = stationary(linear_step(scheme_of("splitting_symmetric", model), model, h))
    assert np.allclose(law, np.diag([T / 1.5, T * 2 / 3]), rtol=0.0, atol=1e-13)


def test_lie_splittings_have_the_flow_too():
    """`splitting` is O, then B and A: friction over the whole step before the noise, as one flow."""
    model = heated(PIECES % ("1", "1"))
    A, b = linear_step(scheme_of("splitting", model), model, 0.5)
    there, noise = baoab(0.5, 1.0, 1.0, "OBA")
    assert np.allclose(A, there, atol=1e-14) and np.allclose(b, -noise, atol=1e-14)  # {p, q} = -1


def test_groups_of_friction_and_noise_with_drift_between_them():
    """O over half steps around the drift; and where a share of friction has no noise beside it, nothing is changed."""
    model, h = heated(PIECES % ("1", "1")), 0.5
    half = flows("friction", fraction=1 / 2), flows("noise", fraction=1 / 2)
    A, b = linear_step(splitting(*half, flows("drift"), *half), model, h)
    c = math.exp(-(SIGMA**2) / (2 * T) * h / 2)
    decay, drift = np.diag([1, c]), np.array([[1 - h * h, h], [-h, 1]])
    kicks = np.array([[0], [math.sqrt(T * (1 - c**2))]])
    assert np.allclose(A, decay @ drift @ decay, atol=1e-14)
    assert np.allclose(b @ b.T, sum(x @ x.T for x in (kicks, decay @ drift @ kicks)), atol=1e-14)
    apart = splitting(flows("friction"), flows("drift"), flows("noise"))
    assert np.allclose(linear_step(apart, model, h)[1], [[0], [-SIGMA * math.sqrt(h)]], atol=1e-15)


MASSES = (
    "{variables: [q1, q2, p1, p2], bracket: {q1 p1: 1, q2 p2: 1}, parameters: {k: 1/3}, noises: [q1, q2],"
    " pieces: [(q1^2 + q2^2)/2 + k*q1*q2, p1^2/2 + p2^2]}"
)


@pytest.mark.parametrize("h", [1.0, 0.25])
def test_two_directions(h):
    """Noises whose friction does not act on one another: the law of positions is exact, T times the inverse matrix."""
    model = heated(MASSES, (1.3, 0.6))
    law = stationary(linear_step(scheme_of("splitting_symmetric", model), model, h))
    assert np.allclose(law[:2, :2], T * np.linalg.inv([[1, 1 / 3], [1 / 3, 1]]), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (PIECES % ("1", "2"), {0: 0.5}),
        # an inverted potential: friction drives away from the maximum, at the rate of its own sign
        (PIECES.replace("[q]", "[p]") % ("-2", "1"), {0: -2.0}),
        ("{variables: [q, p], bracket: {q p: 1}, noises: [q, p], hamiltonian: p^2/2 + q^4/4}", {0: 1.0}),
        ("{algebra: so(3), noises: [y1, y2, y3], hamiltonian: y1^2 + y2^2/2 + y3^2/3}", {}),
        ("{variables: [q, p], bracket: {q p: 1}, noises: [q], hamiltonian: p^2*(1 + cos(t)) + q^2}", {}),
    ],
)
def test_where_friction_is_linear(text, expected):
    """X_k X_k H is a number: the rate of friction is the same at all states."""
    if "cos(t)" in text:
        from spi.plugins.systems import generated as systems

        given = {"variables": ["q", "p"], "bracket": {"q p": "1"}, "noises": ["q"], "hamiltonian": "p^2*cos(t) + q^2"}
        record = systems.record(systems.made(given, "Driven"))
    else:
        record = made(text).record
    assert {k: friction_bend(record, k) for k in linear_friction(record)} == expected


def test_strong_orders_stay():
    """Against fine steps on the same increments: order 1 for the one noise, as without a temperature."""
    model = heated("{variables: [q, p], bracket: {q p: 1}, noises: [q], hamiltonian: p^2/2 + q^4/4}")
    for name in ("splitting", "splitting_symmetric"):
        scheme = scheme_of(name, model)
        with loop_in_python():
            states = final_states(scheme, model, h=2.0**-7, steps=64, doublings=(0, 2, 4), blocks=1, initial=(1.0, 0.3))
        errors = [np.sqrt(np.mean(np.sum((states[level] - states[0]) ** 2, axis=0))) for level in (1, 2)]
        order = math.log2(errors[1] / errors[0]) / 2
        assert 0.9 < order < 2.3, (name, order)
