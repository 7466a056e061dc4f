"""Eigenvalues that are nearly equal, long Jordan chains, and mixtures of matrices whose eigenvalues meet by chance.

A variable r acts on others by a matrix that is written here, {r, x_i} = -sum_j M_ij x_j, so that the flow of r is
exp(t M) x; mpmath takes the exponential to 90 digits.
"""

import time
from pathlib import Path

import mpmath
import numpy as np
import pytest
import sympy
from yaml_cases import definition, made

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import drift_flow
from spi.numerics.angles import ANY_ANGLES
from spi.plugins.systems.definition import make


def acting(*matrices, hamiltonian="r0"):
    """A definition in which r0, r1, ... act on x0, x1, ... by matrices."""
    rows = [
        f"r{k} x{i}: {sympy.Add(*(-M[i, j] * sympy.Symbol(f'x{j}') for j in range(M.cols)))}"
        for k, M in enumerate(matrices)
        for i in range(M.rows)
        if any(M[i, :])
    ]
    names = [*(f"r{k}" for k in range(len(matrices))), *(f"x{i}" for i in range(matrices[0].rows))]
    bracket = ", ".join(rows).replace("**", "^")
    return f"{{variables: [{', '.join(names)}], bracket: {{{bracket}}}, hamiltonian: {hamiltonian}, casimirs: []}}"


def relative_error(text, matrices, rates, t):
    """Of the flow that is exp(t sum_k rates[k](r) matrices[k])."""
    d = matrices[0].rows
    y = np.random.default_rng(5).uniform(0.5, 1.5, len(matrices) + d)
    with uncompiled():
        found = drift_flow(made(text).record, 0, t, tuple(y.tolist()), ANY_ANGLES)[len(matrices) :]
    with mpmath.workdps(90):
        M = mpmath.zeros(d)
        for matrix, rate in zip(matrices, rates(*map(mpmath.mpf, y[: len(matrices)])), strict=True):
            M += rate * mpmath.matrix([[mpmath.mpf(x.p) / x.q for x in matrix.row(i)] for i in range(d)])
        exact = mpmath.expm(t * M, method="taylor") * mpmath.matrix(y[len(matrices) :])
        return float(mpmath.norm(mpmath.matrix(found) - exact) / mpmath.norm(exact))


E = sympy.Symbol("e")
ONE = sympy.eye(2)


def test_two_lose_digits_and_are_refused_where_they_lose_too_many():
    matrix = sympy.Matrix([[1, 1], [0, 1 + E]])
    near, nearer = (matrix.subs(E, sympy.Rational(1, 10**digits)) for digits in (3, 8))
    (line,) = [line for line in make(definition(acting(near)), "x")[3] if "r0" in line]
    assert line.endswith("2 scalings; eigenvalues are nearly equal, 3 of 16 digits are lost")
    assert relative_error(acting(near), [near], lambda r: [1], 0.5) < 1e-12
    assert "each step would lose 9 of 16 digits" in "".join(make(definition(acting(nearer)), "x")[3])


def test_three_are_refused_where_they_lose_too_many_digits():
    matrix = sympy.Matrix([[1, 1, 0], [0, 1 + E, 1], [0, 0, 1 - E]])
    text = acting(matrix.subs(E, sympy.Rational(1, 10)))
    assert relative_error(text, [matrix.subs(E, sympy.Rational(1, 10))], lambda r: [1], 0.5) < 1e-13
    assert (
        "eigenvalues are nearly equal, 3 of 16 digits are lost"
        in make(definition(acting(matrix.subs(E, sympy.Rational(1, 30)))), "x")[3][1]
    )
    for eps, lost in ((4, 9), (6, 13)):
        report = make(definition(acting(matrix.subs(E, sympy.Rational(1, 10**eps)))), "x")[3]
        (line,) = [line for line in report if "no exact flow" in line]
        assert "r0: no exact flow, as its field has eigenvalues so close" in line
        assert f"lose {lost} of 16 digits" in line


def test_six_functions_whose_eigenvalues_are_2_to_1():
    """A mixture of their matrices by fixed factors had one eigenvalue where they have two."""
    third, last = sympy.Matrix([[1, 1], [1, 1]]), sympy.Matrix([[1, -1], [-1, 1]]) / 2
    matrices = [ONE, 2 * ONE, third, ONE, 3 * ONE, last]
    text = acting(*matrices, hamiltonian="r0 + r1 + r2^2/2 + r3 + r4 + r5")
    assert relative_error(text, matrices, lambda *r: [1, 1, r[2], 1, 1, 1], 0.3) < 1e-15


def test_a_lattice_of_many_functions_is_read_in_seconds():
    """Rows of matrices were computed again for each pair of vectors, and eigenvalues of what is triangular sought."""
    text = (Path(__file__).parents[3] / "experiments/systems/toda.yaml").read_text()
    lattice = {key: value for key, value in definition(text).items() if key != "sigma"} | {"sizes": {"n": "18"}}
    begun = time.process_time()
    assert "flow 2" in "\n".join(make(lattice, "x")[3])
    assert time.process_time() - begun < 15.0  # 2 s; it was 60


@pytest.mark.parametrize("rate", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_long_jordan_chain(rate):
    """An eigenvalue that has 10 generalised eigenvectors is found to a tenth of the digits."""
    d, generator = 10, np.random.default_rng(3)
    change = sympy.eye(d)
    for i, j in generator.choice(d, (2 * d, 2)).tolist():
        if i != j:
            change[i, :] = change[i, :] + change[j, :]
    matrix = change * (rate * sympy.eye(d) + sympy.Matrix(d, d, lambda i, j: int(j == i + 1))) * change.inv()
    assert relative_error(acting(matrix), [matrix], lambda r: [1], 0.7) < 1e-13
