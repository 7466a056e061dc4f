"""Lie algebras by name, brackets that are given, and the Casimir functions that are found of them."""

import itertools

import numpy as np
import pytest
import sympy
from yaml_cases import (
    commutators,
    definition,
    given,
    heisenberg,
    product,
    rigid,
    structure,
    su_3,
    symplectic,
    traceless,
    turns,
    unit,
    with_translations,
)

from spi.models import MaxwellBloch, RigidBody
from spi.plugins.systems.algebras import algebra
from spi.plugins.systems.brackets import checked
from spi.plugins.systems.definition import define, make
from spi.plugins.systems.keys import DefinitionError
from spi.plugins.systems.text import Symbols


def constants(text, **sizes):
    """c of an algebra by name."""
    d, brackets = algebra(text, Symbols(indices=sizes))
    return given(d, {(i + 1, j + 1, k + 1): float(x) for _, i, j, linear in brackets for (k,), x in linear.items()})


#: What each algebra is, by matrices.
BY_MATRICES = {
    "so(2)": commutators(turns(2)),
    "so(3)": commutators(rigid()),
    "su(2)": commutators(rigid()),
    "so(4)": commutators(turns(4)),
    "so(5)": commutators(turns(5)),
    "se(2)": commutators(with_translations(turns(2))),
    "e(2)": commutators(with_translations(turns(2))),
    "se(3)": commutators(with_translations(rigid())),
    "e(3)": commutators(with_translations(rigid())),
    "se(4)": commutators(with_translations(turns(4))),
    "so(1,1)": commutators(turns(2, [1.0, -1.0])),
    "so(1,2)": commutators(turns(3, [1.0, -1.0, -1.0])),
    "so(3,1)": commutators(turns(4, [1.0, 1.0, 1.0, -1.0])),
    "so(2,2)": commutators(turns(4, [1.0, 1.0, -1.0, -1.0])),
    "so(2,3)": commutators(turns(5, [1.0, 1.0, -1.0, -1.0, -1.0])),
    "sl(2)": commutators([np.diag([1.0, -1.0]), unit(2, 0, 1), unit(2, 1, 0)]),
    "sl(3)": commutators(traceless(3)),
    "sl(4)": commutators(traceless(4)),
    "sp(2)": commutators(symplectic(1)),
    "sp(4)": commutators(symplectic(2)),
    "sp(2*n-2)": commutators(symplectic(3)),
    "gl(1)": commutators([unit(1, 0, 0)]),
    "gl(2)": commutators([unit(2, i, j) for i in range(2) for j in range(2)]),
    "gl(3)": commutators([unit(3, i, j) for i in range(3) for j in range(3)]),
    "heisenberg": heisenberg(1),
    "heisenberg(3)": heisenberg(3),
    "so(3)^3": product(*[commutators(rigid())] * 3),
    "so(3) * e(2)*heisenberg(2)": product(
        commutators(rigid()), commutators(with_translations(turns(2))), heisenberg(2)
    ),
    "so(n)^(n-2)*sl(2)": product(
        *[commutators(turns(4))] * 2, commutators([np.diag([1.0, -1.0]), unit(2, 0, 1), unit(2, 1, 0)])
    ),
}


@pytest.mark.parametrize("name", BY_MATRICES)
def test_algebras_are_minus_the_commutators_of_matrices(name):
    assert np.array_equal(constants(name, n=4), BY_MATRICES[name])


def test_su_3_has_the_structure_constants_of_the_books():
    assert np.allclose(constants("su(3)"), su_3(), rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", [*BY_MATRICES, "so(2,1)", "so(6)", "gl(4)", "se(5)", "so(3,2)", "su(3)", "su(4)"])
def test_jacobi_s_identity_holds_of_every_algebra(name):
    d, brackets = algebra(name, Symbols(indices={"n": 4}))
    checked([f"y{n}" for n in range(d)], brackets)


@pytest.mark.parametrize(
    ("name", "model"),
    [("so(3)", RigidBody((1.0, 1.0, 1.0), (1.0, 1.0, 1.0))), ("e(2)", MaxwellBloch())],
)
def test_the_brackets_of_built_in_models(name, model):
    y = (0.3, -0.7, 1.9)
    built_in = np.transpose([type(model).structure(model, y, tuple(e)) for e in np.eye(3).tolist()])
    assert np.array_equal(structure(constants(name), y), built_in)


# --- given brackets --------------------------------------------------------------------------------------------------


def linear(c, i, j):
    return {(k,): sympy.Rational(str(x)) for k, x in enumerate(c[i, j].tolist()) if x}


def test_random_brackets_violate_jacobi_s_identity_and_the_three_variables_are_named():
    """Antisymmetric ones in four variables; where NumPy finds no violation, none may be said to be there."""
    generator, violated = np.random.default_rng(2), 0
    for _ in range(60):
        c = np.zeros((4, 4, 4))
        for i, j in itertools.combinations(range(4), 2):
            if generator.random() < 0.4:
                c[i, j, generator.integers(4)] = generator.choice([-2.0, 1.0, 3.0])
        full = c - c.transpose(1, 0, 2)
        terms = np.einsum("jkm,imn->ijkn", full, full)  # {i, {j, k}}
        cyclic = terms + terms.transpose(2, 0, 1, 3) + terms.transpose(1, 2, 0, 3)
        wrong = {tuple(sorted(map(int, place[:3]))) for place in zip(*np.nonzero(cyclic), strict=True)}
        pairs = [("", i, j, linear(c, i, j)) for i, j in itertools.combinations(range(4), 2)]
        if wrong:
            violated += 1
            with pytest.raises(DefinitionError) as error:
                checked("abcd", pairs)
            names = str(error.value).partition("for ")[2].partition(";")[0].split(", ")
            assert tuple("abcd".index(name) for name in names) in wrong
        else:
            checked("abcd", pairs)
    assert 10 < violated < 55


# --- Casimir functions -----------------------------------------------------------------------------------------------


def casimirs(text):
    """The Casimir functions of a definition, as polynomials."""
    system = define(definition(text))
    return [sympy.Poly(one.expression, *system.world.variables) for one in system.casimirs]


def degrees(name):
    return [polynomial.total_degree() for polynomial in casimirs(f"{{algebra: '{name}', hamiltonian: 0}}")]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("so(3)", [2]),
        ("so(2,1)", [2]),
        ("sl(2)", [2]),
        ("e(2)", [2]),
        ("se(3)", [2, 2]),
        ("so(4)", [2, 2]),
        ("so(3,1)", [2, 2]),
        ("so(5)", [2, 4]),
        ("se(4)", [2, 4]),
        ("gl(2)", [1, 2]),
        ("gl(3)", [1, 2, 3]),
        ("heisenberg(2)", [1]),
        ("so(2)", [1]),
        ("so(3)^3", [2, 2, 2]),
        ("gl(2)*heisenberg*so(3)", [1, 1, 2, 2]),
        ("sl(3)", [2, 3]),
        ("su(3)", [2, 3]),
        ("sp(4)", [2, 4]),
        ("su(3)*so(3)", [2, 2, 3]),
    ],
)
def test_degrees(name, expected):
    """As many as there are, by the books; none is a product of others, or these would be more."""
    assert degrees(name) == expected


@pytest.mark.parametrize(
    "name", ["sl(3)", "su(3)", "sp(4)", *(pytest.param(name, marks=pytest.mark.slow) for name in ("sl(4)", "su(4)"))]
)
def test_traces_of_powers_are_casimir_functions(name):
    """As many as there are, all independent; one with a factor changed is none."""
    found = define(definition(f"{{algebra: '{name}', hamiltonian: y1}}"))
    known, there = found.independent
    world, functions = found.world, [one.expression for one in found.casimirs]
    assert known == there == len(functions)
    assert all(map(world.is_casimir, functions))
    polynomials = [sympy.Poly(one, *world.variables) for one in functions]
    assert [one.degree for one in found.casimirs] == [one.total_degree() for one in polynomials]
    assert not world.is_casimir(functions[-1].xreplace({world.variables[1]: 2 * world.variables[1]}))
    assert (functions[0] == sum(y**2 for y in world.variables)) == name.startswith("su")


def test_the_cubic_of_su_3_is_that_of_the_books():
    """d_abc y_a y_b y_c with d_118 = 1/sqrt(3) = -d_888, d_146 = d_157 = d_344 = 1/2."""
    cubic = casimirs("{algebra: su(3), hamiltonian: y1}")[1]
    one, root = lambda *places: [places.count(n + 1) for n in range(8)], 1 / sympy.sqrt(3)
    expected = {(8, 8, 8): -root, (1, 1, 8): 3 * root, (1, 4, 6): sympy.Integer(3), (3, 4, 4): sympy.Rational(3, 2)}
    for places, value in expected.items():
        assert sympy.simplify(cubic.coeff_monomial(one(*places)) - value) == 0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{algebra: se(3), hamiltonian: y1}", "2 of 2: y1*y4 + "),
        ("{algebra: so(3)*heisenberg(2), hamiltonian: y1, casimirs: [y8]}", "1 of 2: y8"),
        ("{variables: [r, x], bracket: {r x: x}, hamiltonian: r}", ": there are none"),
        (
            "{variables: [r, x, y], bracket: {r x: 'sqrt(2)*x', r y: y}, hamiltonian: r}",
            "0 of 1: none found among polynomials of degree up to 4; give them as `casimirs: [...]`",
        ),
        (
            "{variables: [r, x, y], parameters: {a: 0.123456}, bracket: {r x: y, r y: -a*x}, hamiltonian: r}",
            "0 of 1: ",
        ),
        ("{variables: [r, x, y], bracket: {r x: 1e-15*x, r y: 1e-15*y}, hamiltonian: r}", "0 of 1: "),
        (
            "{variables: [r, x, y, z, w], bracket: {r x: y, r y: z, r z: w}, hamiltonian: r}",
            "3 of 3 independent ones, by 4: ",
        ),
    ],
)
def test_it_is_told_how_many_there_are(text, line):
    """By the corank of the bracket; what was not found is not said to be absent."""
    *_, found = make(definition(text), "x")[3]
    assert found.removeprefix("Casimir functions").removeprefix(", ").startswith(line)


@pytest.mark.slow
def test_the_degree_that_was_searched_drops_with_the_number_of_variables():
    *_, found = make(definition("{algebra: so(6), hamiltonian: y1}"), "x")[3]
    assert found.startswith("Casimir functions, 2 of 3: y1^2 + ") and "no other found among polynomials of deg" in found


def test_given_ones_are_verified():
    text = "{algebra: se(3), hamiltonian: y1, casimirs: ["
    system = define(definition(text + "'y1*y4 + y2*y5 + y3*y6', sqrt(y4^2 + y5^2 + y6^2)]}"))
    assert [one.text for one in system.casimirs] == ["y1*y4 + y2*y5 + y3*y6", "sqrt(y4^2 + y5^2 + y6^2)"]
    square = " + ".join(f"y{n}^2" for n in range(1, 7))  # comes first, because schemes that renormalise take the first
    so_4 = define(definition(f"{{algebra: so(4), hamiltonian: y1, casimirs: [y1*y6 - y2*y5 + y3*y4, {square}]}}"))
    assert so_4.casimirs[0].text == square
    for wrong in ("y1^2 + y2^2 + y3^2", "y4^2 + y5^2 + 1.000001*y6^2", "y6", "y4^2 + y5^2 + y6^2 + 1e-12*y1"):
        with pytest.raises(DefinitionError) as error:
            define(definition(text + f"y4^2 + y5^2 + y6^2, {wrong}]}}"))
        assert error.value.keys == ("casimirs", 1)
        assert str(error.value) == f"is '{wrong}', no Casimir function; its brackets must all be 0"
    with pytest.raises(DefinitionError, match="is constant; leave it out"):
        define(definition(text + "1]}"))
    assert define(definition(text + "]}")).casimirs == ()
