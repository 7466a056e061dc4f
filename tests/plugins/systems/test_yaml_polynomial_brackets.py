"""Brackets with constants and products: flows against solutions by SciPy, coordinates, Casimir functions, refusals."""

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import sympy
from helpers import LANES, SCHEMES, take_step
from yaml_cases import definition, made

from spi.checks import model_checks
from spi.checks.model_checks import check_model, states_on_surface
from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import lie_poisson
from spi.ensemble.protocol import (
    commuting_noises,
    inexact_pieces,
    noise_flow,
    populations,
    structure,
    structure_derivative,
)
from spi.models import LotkaVolterra
from spi.numerics.angles import ANY_ANGLES
from spi.plugins.systems.definition import make

#: name -> (variables, bracket, functions with exact flows, Casimir functions)
CASES = {
    "canonical": (
        "q, p, Q, P",
        "{q p: 1, Q P: 1}",
        [
            "cos(q)",
            "exp(q*Q) - q^3",
            "sqrt(1 + p^2 + (p - P)^2)",
            "q^2 + 2*P",
            "(q + 2*p)^3",
            "exp(p + Q/3)*Q",
            "(q^2 + p^2)^2",
            "cos(q*p)",
            "log((q - Q)^2 + (p - P - 2)^2)",
        ],
        [],
    ),
    "two constants and a rotation": (  # e(2) and a charge: {g, h} is the same everywhere
        "L, g, h",
        "{L g: -h, L h: g, g h: 1/2}",
        ["L^2", "g^2/2", "sin(2*h)", "(g + h)^2", "(g^2 + h^2)^2"],
        ["L - g^2 - h^2"],
    ),
    "a uniform magnetic field": (
        "x, y, u, v",
        "{x u: 1, y v: 1, u v: 3}",
        ["u^2/2", "v^4", "cos(x)*y^2", "(u - 3*y)^2", "u*y^3", "u^2 + v^2", "sqrt(2 + u^2 + v^2)"],
        [],
    ),
    "Lotka-Volterra of three": (
        "x, y, z",
        "{x y: x*y/2, y z: -2*y*z, z x: 3*x*z}",
        ["x", "log(y)", "x - 2*log(x)", "sqrt(x*y)", "x^2/z", "log(x) + 3*log(y)", "exp(-x*y*z)", "y^3 + 1/y"],
        ["x^4/(y^6*z)"],
    ),
    "Volterra lattice": (
        "x1, x2, x3, x4",
        "{x1 x2: x1*x2, x2 x3: x2*x3, x3 x4: x3*x4}",
        ["x1 + x3 + x1*x3^2", "x2^2 - log(x4)", "x1*x3", "x1*x4^(1/3)"],
        [],
    ),
    "logarithms of some": (
        "x, q, p",
        "{x q: x, q p: 1, x p: x*q}",
        ["log(x)", "x^2", "q^2/2", "p^2/2", "sin(3*p)"],
        ["p - q^2/2 + log(x)"],
    ),
    "log-canonical and canonical": (
        "x, y, q, p",
        "{x y: x*y, q p: 1, x q: 2*x}",
        ["x*y", "x^2", "q^2 + log(y)", "cos(p)", "y^2*p", "q^3*y", "log(x) - 2*p + log(y)", "q^2 + p^2"],
        [],
    ),
    "a magnetic field in the plane": (
        "x, y, u, v",
        "{x u: 1, y v: 1, u v: 1 + x^2*y - y^3}",
        ["u^2/2", "sqrt(1 + v^2)", "x^2*sin(y)", "u*y^2", "cos(u)"],
        [],
    ),
    "a magnetic field in space": (
        "x, y, z, u, v, w",
        "{x u: 1, y v: 1, z w: 1, v w: x^2, u v: -2*x*z}",
        ["u^2/2", "v^2 + x*z^2", "cos(w)", "y*sin(x)"],
        [],
    ),
}
WITH_FLOW = [(name, text) for name, (_, _, functions, _) in CASES.items() for text in functions]


def text_of(name, noise):
    variables, bracket, *_ = CASES[name]
    return f"{{variables: [{variables}], bracket: {bracket}, hamiltonian: 0, noises: ['{noise}']}}"


def formulas(name):
    """(symbols, B as a matrix of formulas), read by SymPy."""
    variables, bracket, *_ = CASES[name]
    symbols = sympy.symbols(variables, real=True)
    named = dict(zip(map(str, symbols), symbols, strict=True))
    matrix = sympy.zeros(len(symbols))
    for pair in bracket.strip("{}").split(", "):
        (first, second), value = pair.partition(": ")[0].split(), pair.partition(": ")[2]
        i, j = symbols.index(named[first]), symbols.index(named[second])
        matrix[i, j] = sympy.sympify(value.replace("^", "**"), named)
        matrix[j, i] = -matrix[i, j]
    return symbols, named, matrix


def solution(name, text, t, y):
    """At time t, by an explicit method of order 8."""
    symbols, named, matrix = formulas(name)
    function = sympy.sympify(text.replace("^", "**"), named)
    field = matrix * sympy.Matrix([sympy.diff(function, s) for s in symbols])
    velocity = sympy.lambdify([symbols], list(field), "numpy")
    return scipy.integrate.solve_ivp(
        lambda _, z: np.array(velocity(z), float), (0.0, t), y, method="DOP853", rtol=1e-12, atol=1e-13
    ).y[:, -1]


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Nothing asks the compiler for the types of the words."""
    monkeypatch.setattr(model_checks, "obstacle", lambda record: None)


@pytest.mark.parametrize(("name", "text"), WITH_FLOW)
def test_flows_are_solutions(name, text):
    system = made(text_of(name, text))
    record = system.record
    for y in np.random.default_rng(4).uniform(0.3, 0.9, (2, type(record).dimension)):
        for t in (0.7, -0.4):
            with uncompiled():
                found = noise_flow(record, 0, t, tuple(y.tolist()), ANY_ANGLES)
            assert np.allclose(found, solution(name, text, t, y), rtol=1e-10, atol=1e-9)
        assert not np.allclose(found, y, atol=1e-3)
    assert check_model(record, states_on_surface(tuple(y.tolist()), record), written=False) == []


@pytest.mark.parametrize("name", CASES)
def test_the_bracket_is_that_of_the_formulas(name):
    """And its derivative that by SymPy."""
    symbols, _, matrix = formulas(name)
    record = made(text_of(name, CASES[name][2][0])).record
    generator = np.random.default_rng(3)
    y, u, v = generator.uniform(0.3, 1.0, (3, len(symbols))).tolist()
    values = dict(zip(symbols, y, strict=True))
    derivative = sum((sympy.diff(matrix, s) * x for s, x in zip(symbols, u, strict=True)), sympy.zeros(len(symbols)))
    with uncompiled():
        assert np.allclose(structure(record, y, v), np.array(matrix.subs(values), float) @ v, rtol=1e-13)
        found = structure_derivative(record, y, u, v)
    assert np.allclose(found, np.array(derivative.subs(values), float) @ v, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("name", CASES)
def test_casimir_functions(name):
    *_, functions, expected = CASES[name]
    system = made(text_of(name, functions[0])).system
    assert [one.text for one in system.casimirs] == expected
    assert made(text_of(name, functions[0])).system.independent[1] == len(expected)


@pytest.mark.parametrize("n", [5, 6])
def test_casimir_functions_of_decimals_and_irrational_numbers(n):
    """Exponents are in the kernel of a, by SciPy; polynomials with small fractions would not do."""
    generator = np.random.default_rng(n)
    a = np.round(generator.uniform(-1, 1, (n, n)), 2)
    root = [("*sqrt(2)", np.sqrt(2)) if (i + j) % 3 == 0 else ("", 1.0) for i in range(n) for j in range(n)]
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    entries = ", ".join(f"x{i} x{j}: {a[i, j]}*x{i}*x{j}{root[i * n + j][0]}" for i, j in pairs)
    names = ", ".join(f"x{i}" for i in range(n))
    system = made(f"{{variables: [{names}], bracket: {{{entries}}}, hamiltonian: 0, noises: [log(x0)]}}")
    matrix = np.zeros((n, n))
    for i, j in pairs:
        matrix[i, j] = a[i, j] * root[i * n + j][1]
    kernel = scipy.linalg.null_space(matrix - matrix.T)
    assert len(system.system.casimirs) == kernel.shape[1] == n % 2
    y = generator.uniform(0.5, 1.5, n)
    for one in system.system.casimirs:
        slopes = [sympy.diff(sympy.log(one.expression), v) * v for v in system.system.world.variables]
        found = np.array([float(s.subs(dict(zip(system.system.world.variables, y, strict=True)))) for s in slopes])
        assert np.allclose(found / np.linalg.norm(found), kernel[:, 0] * np.sign(found[0] * kernel[0, 0]), atol=1e-12)


# --- what follows from the coordinates -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "noises", "commuting"),
    [
        ("canonical", ["q", "p", "Q*p", "P"], {(0, 1), (0, 3), (1, 2), (1, 3)}),
        ("Lotka-Volterra of three", ["log(x)", "log(y)", "x*y", "2*log(x*z)"], {(0, 1), (0, 3), (1, 3)}),
        ("a uniform magnetic field", ["u", "v", "x"], {(0, 1), (0, 2), (1, 2)}),
        ("a magnetic field in the plane", ["u", "v", "x"], {(0, 2), (1, 2)}),
    ],
)
def test_noises_commute_where_their_bracket_is_constant(name, noises, commuting):
    record = made(text_of(name, "', '".join(noises))).record
    assert set(commuting_noises(record)) == commuting
    y = tuple(np.linspace(0.3, 0.8, type(record).dimension).tolist())
    assert check_model(record, states_on_surface(y, record), written=False) == []


def test_populations_are_variables_whose_logarithms_are_coordinates():
    for name, expected in (("Lotka-Volterra of three", True), ("log-canonical and canonical", False)):
        record = made(text_of(name, "log(x)")).record
        assert populations(record) is expected and not lie_poisson(record)
    report = make(definition(text_of("log-canonical and canonical", "log(x)")), "made")[-1]
    assert "flows multiply x, y by exponentials: what is positive stays positive" in report


PARAMETERS = """{{variables: [x, y, q, p], parameters: {{a: '{a}', b: '{b}'}}, hamiltonian: x + log(y),
    bracket: {{x y: a*x*y + (b - {b})*q*x, q p: b}}, noises: [x - 2*p]}}"""


def test_parameters_of_a_bracket_are_numbers_of_the_class():
    first, other = (made(PARAMETERS.format(a=a, b=b)).record for a, b in (("2", "1/3"), ("-0.7", "3")))
    y, t = (0.4, 1.1, 0.7, -0.2), 0.3
    assert type(first) is type(other) and first != other
    with uncompiled():
        assert np.allclose(
            noise_flow(other, 0, t, y, ANY_ANGLES), (0.4, 1.1 * np.exp(0.7 * 0.4 * t), 0.7 - 6 * t, -0.2)
        )
    for record in (first, other):
        assert check_model(record, states_on_surface(y, record), written=False) == []


NAMBU = "{variables: [x, y, z], bracket: {x y: z^2, y z: x^2, z x: y^2}, hamiltonian: x^2/2 + z, inner: midpoint}"


def test_what_nothing_simplifies_has_no_exact_flow():
    """Its Casimir function is found all the same, and the class passes the checks of models without flows."""
    system = made(NAMBU)
    assert [one.text for one in system.system.casimirs] == ["x^3 + y^3 + z^3"]
    assert inexact_pieces(system.record) == (0,)
    assert check_model(system.record, states_on_surface((0.4, 0.7, 0.5), system.record), written=False) == []


# --- whole steps -----------------------------------------------------------------------------------------------------

TWO = """{variables: [x, y], bracket: {x y: x*y}, hamiltonian: x - log(x) + y - 2*log(y), noises: [log(y) - log(x)]}"""


def test_the_same_paths_as_the_built_in_model():
    """Over 20 steps, without the compiler."""
    model, again = LotkaVolterra(), made(TWO).record
    generator, h = np.random.default_rng(8), 0.05
    first = y = generator.uniform(0.2, 3.0, (2, LANES))
    for _ in range(20):
        dW = np.sqrt(h) * generator.standard_normal((1, LANES))
        (first, _), (y, _) = (
            take_step(SCHEMES["splitting"].record, m, h, dW, z) for m, z in ((model, first), (again, y))
        )
    assert np.allclose(y, first, rtol=1e-12) and not np.allclose(first, generator.uniform(0.2, 3.0, (2, LANES)))
