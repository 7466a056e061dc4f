"""Functions of Casimir functions and linear ones: flows against solutions of y' = B(y) grad f by SciPy."""

import numpy as np
import pytest
import scipy.integrate
import sympy
from yaml_cases import commutators, definition, given, made, product, rigid, structure, with_translations

from spi.checks.model_checks import check_model
from spi.checks.states import states_on_surface
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import noise_flow
from spi.numerics.angles import ANY_ANGLES
from spi.systems.definition import DefinitionError, define

SPIN = commutators(rigid())
BOOST = given(3, {(1, 2, 3): 1, (2, 3, 1): -1, (3, 1, 2): -1})

#: algebra -> (its bracket, functions with exact flows, functions without)
CASES = {
    "so(3)": (
        SPIN,
        [
            *("y1^2 + y2^2", "(y1^2 + y2^2)^2", "y3*(y1^2 + y2^2 + y3^2)", "sqrt(y1^2 + y2^2)", "y1^2*(y2^2 + y3^2)"),
            *("exp(-y1^2 - y2^2)*cos(y3)", "log(5 + y2^2 + y3^2)", "y1^2 + y2^2 - 3*y3"),
        ],
        ["y1^2 + 2*y2^2", "y1*(y1^2 + y2^2)", "y2^3 + y1^2*y2"],
    ),
    "so(2,1)": (BOOST, ["y1^2 + y2^2", "(y2^2 - y3^2)^2/4", "y1*(y2^2 - y3^2)", "y1^2 - y3^2 + y2"], ["y1^2 - y3"]),
    "so(3)^2": (
        product(SPIN, SPIN),
        ["y4*(y1^2 + y2^2)", "(y1^2 + y2^2)^2*y6", "(y1^2 + y2^2)*(y4^2 + y3)"],
        ["(y1^2 + y2^2)*(y4^2 + y1)"],
    ),
    "se(3)": (commutators(with_translations(rigid())), ["(y4^2 + y5^2)^2", "y4^2 + y5^2 + y4*y6"], ["y1^2 + y2^2"]),
}
WITH_FLOW = [(algebra, text) for algebra, (_, texts, _) in CASES.items() for text in texts]
WITHOUT = [(algebra, text) for algebra, (*_, texts) in CASES.items() for text in texts]


def defined(algebra, text):
    return f"{{algebra: '{algebra}', hamiltonian: y1, noises: ['{text}']}}"


def solution(bracket, text, t, y):
    """At time t, by an explicit method of order 8."""
    d = len(y)
    symbols = sympy.symbols(f"y1:{d + 1}", real=True)
    function = sympy.sympify(text.replace("^", "**"), dict(zip(map(str, symbols), symbols, strict=True)))
    gradient = sympy.lambdify([symbols], [sympy.diff(function, s) for s in symbols], "numpy")

    def field(_, z):
        return structure(bracket, z) @ np.array(gradient(z), float)

    return scipy.integrate.solve_ivp(field, (0.0, t), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


@pytest.mark.parametrize(("algebra", "text"), WITH_FLOW)
def test_flows_are_solutions(algebra, text):
    bracket = CASES[algebra][0]
    record = made(defined(algebra, text)).record
    for y in np.random.default_rng(4).uniform(0.3, 1.1, (2, len(bracket))):
        for t in (0.7, -0.4):
            with uncompiled():
                found = noise_flow(record, 0, t, tuple(y.tolist()), ANY_ANGLES)
            assert np.allclose(found, solution(bracket, text, t, y), rtol=0, atol=1e-9)
        assert not np.allclose(found, y, atol=1e-3)
    assert check_model(record, states_on_surface(tuple(y.tolist()), record), written=False) == []


@pytest.mark.parametrize(("algebra", "text"), WITHOUT)
def test_what_is_no_such_function_has_no_flow(algebra, text):
    (noise,) = define(definition(defined(algebra, text))).system.noises
    assert "which do not commute" in noise.lacking


def test_a_noise_that_moves_nothing():
    with pytest.raises(DefinitionError, match="a Casimir function, which moves nothing; leave it out"):
        define(definition(defined("so(3)", "(y1^2 + y2^2 + y3^2)^2")))


def test_pieces_of_a_hamiltonian():
    """The formula stays what the person wrote; its squares are split as before."""
    system = define(definition("{algebra: so(3), hamiltonian: '(y1^2 + y2^2)^2 + y1^2/2 + y2^2/3'}")).system
    texts = [system.world.name(flow.expression) for flow in system.flows]
    assert texts == ["(y1^2 + y2^2)^2", "y1^2/2", "y2^2/3"]
