"""Into which flows Hamiltonians written in YAML split, and which are refused."""

from pathlib import Path

import pytest
import yaml
from yaml_cases import SYSTEMS, definition, made

from spi.plugins.systems.definition import define

GALLERY = Path(__file__).parents[3] / "experiments" / "systems"


def defined(text):
    keys = yaml.load((GALLERY / text).read_text(), yaml.BaseLoader) if text.endswith(".yaml") else definition(text)
    return define({key: value for key, value in keys.items() if key != "sigma"})


def flows(system):
    """What each flow is the flow of, in the words of the definition; "square" if that is a principal axis."""
    texts = [system.world.name(flow.expression) for flow in system.flows]
    return ["square" if "κ" in text else text for text in texts]


def spin(*terms, more=""):
    return f"{{algebra: so(3), hamiltonian: {' + '.join(terms)}{more}}}"


TURNED = ["(y(1) + y(3))^4/4", "(y(2) + y(3))^4/4"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (SYSTEMS["heavy top"][0], ["P1^2/(2*I1)", "P2^2/(2*I2)", "G3*weight + P3^2/(2*I3)"]),
        (SYSTEMS["Manakov"][0], ["m12^2/6 + m34^2/14", "m13^2/8 + m24^2/12", "m14^2/(2*J + 2) + m23^2/10"]),
        (SYSTEMS["spin in a cavity"][0], ["p^2/2 + q^2/2 + s3", "g*q*s1"]),
        (SYSTEMS["heisenberg(2)"][0], ["p1^2/2 + p2^2/2 + q1^2/2 + q1*z + q2^2/2", "q1^2*q2"]),
        # the order is that of the terms
        (spin("y3^2", "y1", "y3", "y2"), ["y3^2", "y1 + y2 + y3"]),
        (spin("y3^2", "y1", "y3"), ["y3^2", "y1 + y3"]),
        (spin("y2", "y1^2", "y1^3"), ["y2", "y1^3 + y1^2"]),
        ("{algebra: se(3), variables: [a, b, c, d, e, f], hamiltonian: f + a^2 + c + d}", ["c + d + f", "a^2"]),
        # a constant moves nothing, and terms that cancel are no terms
        (spin("3", "y1", "pi"), ["y1"]),
        (spin("y1*y2", "y3", "(-y2*y1)"), ["y3"]),
        # products of commuting variables are no quadratic forms to be diagonalised
        ("{algebra: so(3)^2, hamiltonian: y1*y4 + y1*y5 + y2*y4}", ["y1*y4", "y1*y5", "y2*y4"]),
        # only what a product links is diagonalised
        (spin("y1*y2", "y3^2"), ["y3^2", "square", "square"]),
        (spin("y1^2", "y2^2", "y1*y2", "y3^2", "cos(y1)"), ["y3^2", "cos(y1)", "square", "square"]),
        (spin("y1*y2", "y2*y3"), ["square", "square"]),
        (spin("y1*y2", "y2*y3", "y3*y1"), ["square"] * 3),
        # squares of linear functions and functions of one stay as they are
        (spin("(y1 + 2*y2)^2", "sin(y1 - y3)"), ["(y1 + 2*y2)^2", "sin(y1 - y3)"]),
        (spin("(y1 + 2*y2)^2", "(2*y2 + y1)"), ["y1 + 2*y2 + (y1 + 2*y2)^2"]),
        # a product that has to be expanded first
        (spin("(y1 + y2)*(y1 - y2)"), ["y1^2", "-y2^2"]),
        # and a sum whose powers have no flow when they are expanded, whatever stands before it or behind
        (spin("((y1 + y2)^4 + (y2 - y3)^4)/4"), ["(y1 + y2)^4/4", "(y2 - y3)^4/4"]),
        (spin("(-((y1 + y2)^4 + (y2 - y3)^4))"), ["-(y1 + y2)^4", "-(y2 - y3)^4"]),
        (spin("sum((y(i) + y(3))^4 for i = 1..2)/4", more=", variables: [y(i) for i = 1..3]"), TURNED),
        (
            spin("'a*(a + 1)*(cos(y1 - y2)/3 - (y3^4 + (y2 - y3)^4)/5) + y3'", more=", parameters: {a: 2}"),
            ["a*(a + 1)*cos(y1 - y2)/3", "-a*(a + 1)*(y2 - y3)^4/5", "-a*y3^4*(a + 1)/5 + y3"],
        ),
    ],
)
def test_flows(text, expected):
    assert flows(defined(text)) == expected


def test_sine_euler_splits_by_the_lines_through_the_lattice():
    """One flow for the modes on each line through 0, in which all commute: N + 1 lines for a prime N."""
    assert flows(made(SYSTEMS["sine-Euler, N = 3"][0]).system) == [
        "h(1,0)^2/2 + h(2,0)^2/2",
        "h(1,1)^2/4 + h(2,2)^2/4",
        "h(1,2)^2/4 + h(2,1)^2/4",
        "h(0,1)^2/2 + h(0,2)^2/2",
    ]


TOP = "{algebra: se(3), variables: [P1, P2, P3, G1, G2, G3], "


def test_given_pieces_are_kept_in_their_order():
    text = TOP + "pieces: [G3, P3^2, P2^2 + G2/2, P1^2]}"
    assert flows(defined(text)) == ["G3", "P3^2", "G2/2 + P2^2", "P1^2"]
    with_sum = TOP + "hamiltonian: P1^2 + P2^2 + P3^2 + G2/2 + G3, pieces: [G3, P3^2, P2^2 + G2/2, P1^2]}"
    assert flows(defined(with_sum)) == flows(defined(text))
    assert flows(defined(with_sum.replace("pieces: [G3, P3^2, P2^2 + G2/2, P1^2]", ""))) != flows(defined(text))


@pytest.mark.parametrize(
    ("text", "lacking"),
    [
        (
            TOP + "pieces: [G3, P1^2 + P2^2]}",
            {"P1^2 + P2^2": "'P1^2 + P2^2' depends on P1 and P2, which do not commute"},
        ),
        (TOP + "pieces: [P1*P2, G3]}", {"P1*P2": "'P1*P2' depends on P1 and P2, which do not commute"}),
        (spin("y3", "y1*y2*y3"), {"y1*y2*y3": "'y1*y2*y3' depends on y1 and y2, which do not commute"}),
        (spin("y3", "cos(y1*y2)"), {"cos(y1*y2)": "'cos(y1*y2)' depends on y1 and y2, which do not commute"}),
        # all of them are one piece, which gives the reason of the first
        (
            spin("cos(y1*y2)", "(y1 + y2)^3", "sqrt(y1^2 + 2*y3^2)/2"),
            {"sqrt(y1^2 + 2*y3^2)/2 + cos(y1*y2)": "'cos(y1*y2)' depends on y1 and y2, which do not commute"},
        ),
        # of a sum times factors only those parts that have none
        (
            spin("(y1^2 + cos(y1*y2) + y3)/5"),
            {"cos(y1*y2)/5": "'cos(y1*y2)/5' depends on y1 and y2, which do not commute"},
        ),
        (
            spin("y1", more=", noises: [y3, y1^2 + y2]"),
            {"y1^2 + y2": "'y1^2 + y2' depends on y1 and y2, which do not commute"},
        ),
    ],
)
def test_what_has_no_exact_flow_is_known(text, lacking):
    system = defined(text)
    both = (*system.flows, *system.noises)
    assert {system.world.name(flow.expression): flow.lacking for flow in both if flow.lacking} == lacking
    assert all(flow.lacking in ("", *lacking.values()) for flow in both) and len(both) > len(lacking) - 1
