"""Functions of Casimir, quadratic and linear functions: flows against solutions of y' = B(y) grad f by SciPy."""

import numpy as np
import pytest
import scipy.integrate
import sympy
from yaml_cases import (
    commutators,
    definition,
    given,
    heisenberg,
    made,
    product,
    rigid,
    structure,
    turns,
    with_translations,
)

from spi.checks.model_checks import check_model, states_on_surface
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import noise_flow
from spi.numerics.angles import ANY_ANGLES
from spi.plugins.systems.definition import define
from spi.plugins.systems.keys import DefinitionError

SPIN = commutators(rigid())
BOOST = given(3, {(1, 2, 3): 1, (2, 3, 1): -1, (3, 1, 2): -1})

DOT = "y1*y4 + y2*y5 + y3*y6"

#: algebra -> (its bracket, functions with exact flows, functions without)
CASES = {
    "so(3)": (
        SPIN,
        [
            *("y1^2 + y2^2", "(y1^2 + y2^2)^2", "y3*(y1^2 + y2^2 + y3^2)", "sqrt(y1^2 + y2^2)", "y1^2*(y2^2 + y3^2)"),
            *("exp(-y1^2 - y2^2)*cos(y3)", "log(5 + y2^2 + y3^2)", "y1^2 + y2^2 - 3*y3"),
        ],
        ["y1^2 + 2*y2^2", "y1*(y1^2 + y2^2)", "y2^3 + y1^2*y2", "y1*y2*y3"],
    ),
    "so(2,1)": (BOOST, ["y1^2 + y2^2", "(y2^2 - y3^2)^2/4", "y1^2 - y3^2 + y2", "y1*(y2^2 - y3^2)"], ["y1^2 - y3"]),
    "so(3)^2": (
        product(SPIN, SPIN),
        [
            *("y4*(y1^2 + y2^2)", "(y1^2 + y2^2)^2*y6", "(y1^2 + y2^2)*(y4^2 + y3)"),
        ],
        ["(y1^2 + y2^2)*(y4^2 + y1)", "y1*y4 + y2*y5 + 2*y3*y6", DOT, f"log(9 - ({DOT}))", f"y1*({DOT})"],
    ),
    "so(4)": (commutators(turns(4)), [], ["y1^2 + y2^2 + y4^2", "y1^2 + y2^2 + 2*y3^2"]),
    "heisenberg": (
        heisenberg(1),
        [
            *(
                "y1^2 + y2^2",
                "(y1^2 + y2^2)^2",
                "log(1 + 3*y1^2/10 + 2*y2^2)",
                "y1*y2",
                "(y1*y2)^3",
                "y1^4 + 2*y1^2*y2^2 + y2^4",
                "y3*(y1^2 + y2^2)^2",
            ),
            *(
                "exp(y1^2/9 - y2^2/5)",
                "(y1 - 2)^2 + y2^2",
                "log((y1 - y3)^2 + (y2 + 1)^2)",
                "sqrt(1 + y1^2 + y1*y2 + y2^2)",
            ),
        ],
        ["y1^2*(y1^2 + y2^2)", "y1^4 + y2^2", "y1 + y1^2*y2", "sin(y1) + y2^2"],
    ),
    "heisenberg(2)": (
        heisenberg(2),
        [
            *("log((y1 - y2)^2 + (y3 - y4)^2)", "(y1^2 + y3^2)*(y2^2 + y4^2)", "(y1*y4 - y2*y3)^3"),
            *("(y1^2 + y2^2 + y3^2 + y4^2)^2 + y1*y4 - y2*y3", "y1*(y2^2 + y4^2)", "y1*y4 + y2*y3"),
        ],
        ["(y1^2 + y3^2)*(y1*y4 - y2*y3)"],
    ),
    "so(3)*heisenberg": (
        product(SPIN, heisenberg(1)),
        [
            "y3*(y4^2 + y5^2)",
            "(y1^2 + y2^2)*(y4^2 + y5^2)",
            "(y3 + (y4^2 + y5^2)/2)^2",
            "sqrt(y4^2 + y1^2 + y2^2 + y5^2)",
        ],
        ["y3*y4*y5*y1"],
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


@pytest.mark.share(20)
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
    (noise,) = define(definition(defined(algebra, text))).noises
    assert "which do not commute" in noise.lacking


def test_matrices_and_their_numbers():
    """Control of the above: the flow of u^2 at a time is that of u at 2 u times it, and no other."""
    algebra, u = "heisenberg(2)", "y1*y4 - y2*y3"
    y = np.linspace(0.4, 1.3, len(CASES[algebra][0]))
    values = {f"y{n + 1}": x for n, x in enumerate(y)}
    twice = 2 * float(sympy.sympify(u).subs(values))
    with uncompiled():
        plain, squared = (made(defined(algebra, text)).record for text in (u, f"({u})^2"))
        found = noise_flow(squared, 0, 0.3, tuple(y.tolist()), ANY_ANGLES)
        expected, other = (noise_flow(plain, 0, t, tuple(y.tolist()), ANY_ANGLES) for t in (0.3 * twice, 0.3))
    assert np.allclose(found, expected, rtol=0, atol=1e-14) and not np.allclose(found, other, atol=1e-2)


def test_phase_noise_decays_as_it_must():
    """E (q + i p) = exp(-2 sigma^2 T) (q_0 + i p_0) for dy = sigma B grad(q^2 + p^2) o dW."""
    record = made(defined("heisenberg", "y1^2 + y2^2")).record
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    with uncompiled():
        ends = np.array([noise_flow(record, 0, 0.6 * x, (0.8, -0.3, 1.0), ANY_ANGLES) for x in nodes])
    mean = weights @ ends / weights.sum()
    assert np.allclose(mean, [0.8 * np.exp(-0.72), -0.3 * np.exp(-0.72), 1.0], rtol=0, atol=1e-13)


def test_a_noise_that_moves_nothing():
    with pytest.raises(DefinitionError, match="a Casimir function, which moves nothing; leave it out"):
        define(definition(defined("so(3)", "(y1^2 + y2^2 + y3^2)^2")))


def test_functions_that_do_not_commute_are_none_of_one_flow():
    """Not even where their fields do, as those of q and p, whose bracket is the constant z."""
    text = "{algebra: so(3) * heisenberg, hamiltonian: y1, noises: ['(y1^2 + y2^2)^2*exp(y4*y5^3)']}"
    (noise,) = define(definition(text)).noises
    assert "which do not commute" in noise.lacking


def test_pieces_of_a_hamiltonian():
    """The formula stays what the person wrote; its squares are split as before."""
    system = define(definition("{algebra: so(3), hamiltonian: '(y1^2 + y2^2)^2 + y1^2/2 + y2^2/3'}"))
    texts = [system.world.name(flow.expression) for flow in system.flows]
    assert texts == ["(y1^2 + y2^2)^2", "y1^2/2", "y2^2/3"]


def test_disjoint_pairs_of_vortices_move_together():
    """Of the pairs of four those without a common vortex commute: three flows."""
    text = """{sizes: {n: 4}, algebra: heisenberg(n), variables: ['q(i) for i = 1..n, p(i) for i = 1..n', z],
        hamiltonian: "-sum(log((q(i) - q(j))^2 + (p(i) - p(j))^2) for i = 1..n, j = 1..i-1)/2"}"""
    text = text.replace("'q(i) for i = 1..n, p(i) for i = 1..n'", "q(i) for i = 1..n, p(i) for i = 1..n")
    system = define(definition(text))
    assert [len(flow.terms) for flow in system.flows] == [2, 2, 2]
