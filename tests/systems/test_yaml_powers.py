"""Polynomials as sums of powers of linear functions."""

import itertools

import pytest
import sympy
from yaml_cases import definition

from spi.systems.definition import define


def flows(text):
    """The system, whose flows are those of H but for a Casimir function."""
    system = define(definition(text)).system
    left = sympy.expand(system.hamiltonian - sympy.Add(*(flow.expression for flow in system.flows)))
    assert left == 0 or system.world.is_casimir(left)
    return system


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("y1*y2*y3", 4),
        ("y1^2*y2", 3),
        ("y1*y2*y3 + y1^2/3 + y2/5", 4 + 2),
        ("y1^2*y2^2 + y2^2*y3^2 + y3^2*y1^2", 3),  # less half the square of the Casimir function
        ("2*(y1^2*y2^2 + y2^2*y3^2 + y3^2*y1^2)/3 - y1", 3),
        ("y1^2*y2^2 - y2^2*y3^2", 6),  # y2^4 drops out
        ("y1^2*y2^2*y3^2", 13),
    ],
)
def test_numbers_of_flows(text, count):
    assert len(flows(f"{{algebra: so(3), hamiltonian: '{text}'}}").flows) == count


def test_variables_that_commute_stay_factors():
    """Three spins that couple: y7 commutes with the others, so that two squares are enough."""
    system = flows("{algebra: so(3)^3, parameters: {J: 2}, hamiltonian: J*y1*y2*y7 + y4*y5*y7^2}")
    names = [system.world.name(flow.expression) for flow in system.flows]
    assert len(names) == 2 and all(name.count("y7") == 2 for name in names)


def test_sites_of_a_lattice_are_taken_one_by_one():
    """Cubic anisotropy of six spins: three flows, of six terms each."""
    text = """{sizes: {n: 6}, algebra: so(3)^n, variables: ['x(i), y(i), z(i) for i = 1..n'],
        hamiltonian: sum(x(i)^2*y(i)^2 + y(i)^2*z(i)^2 + z(i)^2*x(i)^2 for i = 1..n)}"""
    assert [len(flow.terms) for flow in flows(text).flows] == [6, 6, 6]


def test_every_flow_is_a_power_of_one_linear_function():
    for flow in flows("{algebra: so(3), hamiltonian: y1*y2*y3}").flows:
        assert [len(term.functionals) for term in flow.terms] == [1]


def test_the_powers_are_the_polynomial():
    """By its values at points, with fractions only."""
    system = flows("{algebra: gl(2), variables: [a, b, c, d], hamiltonian: a*b^2*c - b*c*d/7}")
    for y in itertools.product((-1, 2, 3), repeat=4):
        at = dict(zip(system.world.variables, y, strict=True))
        assert sum(f.expression.subs(at) for f in system.flows) == system.hamiltonian.subs(at)


@pytest.mark.parametrize(
    ("text", "lacking", "message"),
    [
        ("y1^4*y2^3*y3", "y1^4*y2^3*y3", "is a sum of 20 powers of linear functions, and 16 are the most"),
        ("y1*y2*y3 - y1^4*y2^3*y3", "-y1^4*y2^3*y3", "is a sum of 20 powers"),
        ("exp(y1*y2) + y1^2*y2", "exp(y1*y2)", "'exp(y1*y2)' depends on y1 and y2, which do not commute"),
    ],
)
def test_what_has_no_flow_even_so(text, lacking, message):
    system = flows(f"{{algebra: so(3), hamiltonian: '{text}'}}")
    assert [flow.lacking for flow in system.flows[:-1]] == [""] * (len(system.flows) - 1)
    assert system.world.name(system.flows[-1].expression) == lacking and message in system.flows[-1].lacking
