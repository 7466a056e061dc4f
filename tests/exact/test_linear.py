"""Moments of linear equations against closed forms, and the equations and functions that have none."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

import spi
from spi.api.specs import of_mapping
from spi.expressions import parse_expression
from spi.expressions.polynomials import polynomial
from spi.kinds.linear import linear_moments

QUBIT = {"algebra": "so(3)", "hamiltonian": "2*y3", "noises": ["y3"], "sigma": [0.7]}
PLANE = {"variables": ["q", "p"], "bracket": {"q p": 1}}
OSCILLATOR = {**PLANE, "hamiltonian": "(q^2 + p^2)/2", "noises": ["q"], "sigma": [1]}


def moments(model, functions, initial, times, **keys):
    """(F, times) expectations and bounds of their errors; None where they are not known."""
    data = {"kind": "answer", "model": model, "functions": functions, "initial": initial, "accuracy": 1e-3, **keys}
    (case,) = of_mapping({**data, "final_time": 1, "sampling": True}, "linear").cases
    found = linear_moments(case.model, case.expressions, times)
    return found and found.expectations(case.initial, times)


def assert_known(found, expected):
    value, error = found
    assert value == pytest.approx(np.array(expected, float), rel=1e-12, abs=1e-13)
    assert (error <= 1e-12 * np.maximum(1.0, np.abs(value))).all()
    assert (np.abs(value - expected) <= 4.0 * error + 1e-15).all()


def test_a_qubit_with_dephasing_precesses_and_decays():
    """E y1 + i E y2 = exp(-(sigma^2/2 + 2 i) t), and twice the angle has four times the rate."""
    functions, t = {"x": "y1", "y": "y2", "square": "y1^2", "both": "y1*y2 + H"}, np.array([0.0, 0.5, 1.5, 40.0])
    once, twice = np.exp(-(0.245 + 2j) * t), np.exp(-(0.98 + 4j) * t)
    expected = once.real, once.imag, 0.5 + 0.5 * twice.real, 0.5 * twice.imag
    assert_known(moments(QUBIT, functions, [1, 0, 0], t), expected)


def test_a_tilted_field_and_three_noises_follow_the_equation_of_bloch():
    """E y' = (field - 1/2 sum_k sigma_k^2 (1 - e_k e_k^T)) E y."""
    w, sigma, initial = np.array([0.3, -1.1, 0.7]), np.array([0.4, 0.9, 0.6]), np.array([0.2, -0.5, 0.8])
    model = {"algebra": "so(3)", "hamiltonian": "0.3*y1 - 1.1*y2 + 0.7*y3", "noises": ["y1", "y2", "y3"]}
    field = np.cross(np.eye(3), w).T  # y -> y x w
    rate = field - 0.5 * (np.sum(sigma**2) * np.eye(3) - np.diag(sigma**2))
    expected = [[v] for v in expm(1.3 * rate) @ initial]
    functions = {"x": "y1", "y": "y2", "z": "y3"}
    assert_known(moments({**model, "sigma": [0.4, 0.9, 0.6]}, functions, [0.2, -0.5, 0.8], [1.3]), expected)


def test_oscillators_are_normal():
    """From (0, 0) the variance is t/2 - sin(2 t)/4; at a temperature it becomes T; H grows by sigma^2/2 t."""
    functions, t = {"second": "q^2", "fourth": "q^4", "energy": "H", "odd": "q*p^2/3"}, np.array([1.0, 2.5])
    variance = t / 2 - np.sin(2 * t) / 4
    found = moments(OSCILLATOR, functions, [0, 0], t)
    assert_known(found, [variance, 3 * variance**2, t / 2, 0 * t])
    warm = moments(OSCILLATOR, functions, [3, 0], [160.0], temperature=0.7)
    assert_known(warm, [[0.7], [3 * 0.7**2], [0.7], [0.0]])
    damped = moments(OSCILLATOR, "q", [1, 0], [2.0], damping=0.3)
    assert_known(damped, [[math.exp(-0.6) * math.cos(2.0)]])


def test_parametric_noise_has_moments_that_grow():
    """q' = q o dW: E q^n = exp(n^2 sigma^2 t/2)."""
    model = {**PLANE, "hamiltonian": "0", "noises": ["q*p"], "sigma": [0.8]}
    found = moments(model, {"one": "q", "four": "q^4", "kept": "q*p"}, [1, 2], [0.9])
    assert_known(found, [[math.exp(0.32 * 0.9)], [math.exp(16 * 0.32 * 0.9)], [2.0]])


def test_many_moments_are_those_of_a_sparse_matrix():
    """A chain of 5 oscillators: 1,001 moments, against the covariance of its linear equation."""
    n, t = 5, 1.5
    x = [f"x{i}" for i in range(1, n + 1)]
    p = [f"p{i}" for i in range(1, n + 1)]
    energy = " + ".join(f"{v}^2/2" for v in p) + " + " + " + ".join(f"({a} - {b})^2/2" for a, b in pairwise(x))
    bracket = {f"{a} {b}": 1 for a, b in zip(x, p, strict=True)}
    model = {"variables": [*x, *p], "bracket": bracket, "hamiltonian": energy, "noises": ["x1"], "sigma": [0.6]}
    links = np.diff(np.eye(n), axis=0)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-links.T @ links, np.zeros((n, n))]])
    b = np.zeros(2 * n)
    b[n] = -0.6  # sigma times the field of the noise x1
    steps, w = np.polynomial.legendre.leggauss(40)
    fields = [expm(0.5 * t * (1.0 + s) * A) @ b for s in steps]
    covariance = 0.5 * t * sum(v * np.outer(f, f) for v, f in zip(w, fields, strict=True))
    found = moments(model, {"a": "x2^4", "b": "x1*x1*p2*p3"}, [0] * 2 * n, [t])
    c = covariance
    expected = [[3 * c[1, 1] ** 2], [c[0, 0] * c[6, 7] + 2 * c[0, 6] * c[0, 7]]]
    assert found[0] == pytest.approx(np.array(expected), rel=1e-10) and (found[1] < 1e-10).all()


@pytest.mark.parametrize(
    ("model", "function"),
    [
        ({"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3]}, "y1"),
        ({**QUBIT, "noises": ["y3^2/2"]}, "y1"),
        ({**OSCILLATOR, "hamiltonian": "p^2/2 + 1e-6*q^4"}, "q"),
        ({**OSCILLATOR, "hamiltonian": "p^2/2 + cos(q)"}, "q"),
        (OSCILLATOR, "abs(q)"),
        (OSCILLATOR, "q^(-1)"),
        (OSCILLATOR, "q/p"),
        (OSCILLATOR, "q > 0"),
    ],
)
def test_other_equations_and_functions_are_not_known(model, function):
    initial = [0.6, 0, 0.8] if "variables" not in model else [1, 1]
    assert moments(model, function, initial, [1.0]) is None


def test_polynomials_are_multiplied_out():
    def of(text):
        return polynomial(parse_expression(text, 3), 3, 100)

    assert of("(y1 - 2*y2)^2/4 + y3*1") == {(0, 0): 0.25, (0, 1): -1.0, (1, 1): 1.0, (2,): 1.0}
    assert of("sum(y(i)*y(4-i) for i = 1..3) - -3") == {(0, 2): 2.0, (1, 1): 1.0, (): 3.0}
    assert of("(1 + y1 + y2 + y3)^9") is None and of("sin(y1)") is None and of("y1/y1") is None


@pytest.mark.needs("answers", "systems")
def test_answers_have_them():
    """Nothing is sampled, at any accuracy; with `sampling: true` it is."""
    decay = math.exp(-0.245) * math.cos(2.0)
    found = spi.answer(QUBIT, {"x": "y1", "y": "y2^2"}, initial=[1, 0, 0], final_time=1, accuracy=1e-12, progress=False)
    assert found.value[0] == pytest.approx(decay, abs=1e-13) and (found.half <= 1e-12).all() and found.reached
    assert "without sampling, by the moments of a linear equation" in str(found)
