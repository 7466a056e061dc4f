"""Lie algebras of matrices by their generators: brackets, minus the commutators, and Casimir functions, by traces.

A generator T_a has a dual D_a, tr(D_a T_b) = delta_ab.  Then [T_a, T_b] = sum_c tr(D_c [T_a, T_b]) T_c, and with
X(y) = sum_a y_a D_a the functions tr X(y)^k are kept by the coadjoint action, which conjugates X.
"""

import itertools
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import sympy

from .brackets import Linear

Entries = dict[tuple[int, int], complex]  #: of a matrix whose entries are a + b i with whole a and b
Part = tuple[Any, Any]  #: a complex number as its real and imaginary part


class Generator(NamedTuple):
    """A generator and its dual, which is sparse as well."""

    matrix: Entries  #: the generator divided by its scale
    dual: Entries
    weight: Fraction  #: the trace of weight * dual * matrix is 1
    scale: Any = sympy.Integer(1)


def sl(n: int) -> list[Generator]:
    """h_1, ..., h_(n-1) with h_i = E_ii - E_(i+1)(i+1), then E_12, E_13, ..., row by row; for n = 2 h, e, f."""
    found = []
    for i in range(n - 1):
        dual = {(j, j): complex(n * (j <= i) - i - 1) for j in range(n)}  # n times a fundamental weight
        found.append(Generator({(i, i): 1, (i + 1, i + 1): -1}, dual, Fraction(1, n)))
    pairs = itertools.permutations(range(n), 2)
    return found + [Generator({(i, j): 1}, {(j, i): 1}, Fraction(1)) for i, j in pairs]


def su(n: int) -> list[Generator]:
    """-i lambda_a / 2 with the matrices of Gell-Mann, in his order, for n = 2 those of Pauli; |y|^2 is kept."""
    found = []
    half = sympy.Rational(1, 2)
    for k in range(1, n):
        for j in range(k):
            for matrix in ({(j, k): -1j, (k, j): -1j}, {(j, k): -1 + 0j, (k, j): 1 + 0j}):
                found.append(Generator(matrix, {place: -c for place, c in matrix.items()}, Fraction(1, 2), half))
        diagonal = {(j, j): 1j * (k if j == k else -1) for j in range(k + 1)}
        dual = {place: -c for place, c in diagonal.items()}
        found.append(Generator(diagonal, dual, Fraction(1, k * (k + 1)), 1 / sympy.sqrt(2 * k * (k + 1))))
    return found


def sp(size: int) -> list[Generator]:
    """a_ij = E_ij - E_(n+j)(n+i) row by row, then b_ij and c_ij for i <= j, in the blocks above and below; n = size/2.

    b_ij = E_i(n+j) + E_j(n+i), c_ij = E_(n+i)j + E_(n+j)i, and half of that for i = j.
    """
    n = size // 2
    found = []
    for i, j in itertools.product(range(n), repeat=2):
        found.append(Generator({(i, j): 1, (n + j, n + i): -1}, {(j, i): 1, (n + i, n + j): -1}, Fraction(1, 2)))
    pairs = list(itertools.combinations_with_replacement(range(n), 2))
    above = [{(i, n + j): 1 + 0j, (j, n + i): 1 + 0j} for i, j in pairs]
    below = [{(n + i, j): 1 + 0j, (n + j, i): 1 + 0j} for i, j in pairs]
    for one, other in ((above, below), (below, above)):
        found += [Generator(a, b, Fraction(1, len(a))) for a, b in zip(one, other, strict=True)]
    return found


#: name -> (generators of a size, by which powers the traces are Casimir functions)
OF_MATRICES: dict[str, tuple[Callable[[int], list[Generator]], Callable[[int], range]]] = {
    "sl": (sl, lambda n: range(2, n + 1)),
    "su": (su, lambda n: range(2, n + 1)),
    "sp": (sp, lambda n: range(2, n + 1, 2)),
}
_MOST_POWER = 6  # a higher one takes thousands of products


def brackets_of(generators: Sequence[Generator]) -> list[tuple[int, int, Linear]]:
    """(a, b, {y_a, y_b}), minus the commutators."""
    at: dict[tuple[int, int], list[int]] = {}
    for c, one in enumerate(generators):
        for i, j in one.dual:
            at.setdefault((j, i), []).append(c)
    found = []
    for (a, first), (b, second) in itertools.combinations(enumerate(generators), 2):
        commutator = _product(first.matrix, second.matrix)
        for place, value in _product(second.matrix, first.matrix).items():
            commutator[place] = commutator.get(place, 0) - value
        linear: Linear = {}
        for c in sorted({c for place, value in commutator.items() if value for c in at.get(place, ())}):
            third = generators[c]
            trace = sum(value * commutator.get((j, i), 0) for (i, j), value in third.dual.items())
            if trace:
                whole = sympy.Rational(round(trace.real) * third.weight.numerator, third.weight.denominator)
                linear[c] = -whole * first.scale * second.scale / third.scale
        if linear:
            found.append((a, b, linear))
    return found


def _product(first: Entries, second: Entries) -> Entries:
    found: Entries = {}
    for (i, j), a in first.items():
        for (k, m), b in second.items():
            if j == k:
                found[i, m] = found.get((i, m), 0) + complex(a) * b
    return found


def traces(name: str, size: int, variables: Sequence[Any]) -> list[tuple[int, Any]]:
    """(degree, Casimir function) of an algebra of matrices, in its variables; no power above six.

    tr X^k; for su(n), where X is i times a Hermitian matrix Y with tr Y^2 = 2 |y|^2, half of tr Y^k.
    """
    make, powers = OF_MATRICES[name]
    generators, rotation = make(size), -1j if name == "su" else 1
    x: list[list[Part]] = [[(sympy.Integer(0), sympy.Integer(0))] * size for _ in range(size)]
    for y, one in zip(variables, generators, strict=True):
        factor = sympy.Rational(one.weight.numerator, one.weight.denominator) / one.scale
        for (i, j), value in one.dual.items():
            c = complex(value) * rotation
            x[i][j] = (x[i][j][0] + round(c.real) * factor * y, x[i][j][1] + round(c.imag) * factor * y)
    found, half = [], sympy.Rational(1, 2) if name == "su" else sympy.Integer(1)
    power, known = {1: x}, [k for k in powers(size) if k <= _MOST_POWER]
    for k in range(2, max(known, default=2) // 2 + 1):
        power[k] = _multiplied(power[k - 1], x)
    for k in known:
        trace = half * _trace(
            power[k // 2], power[k - k // 2] if k - k // 2 in power else _multiplied(power[k // 2], x)
        )
        found.append((k, sympy.expand(trace) if k <= 3 else trace))
    return found


def _multiplied(a: list[list[Part]], b: list[list[Part]]) -> list[list[Part]]:
    n = range(len(a))
    return [[_sum(_times(a[i][k], b[k][j]) for k in n) for j in n] for i in n]


def _trace(a: list[list[Part]], b: list[list[Part]]) -> Any:
    """The real part of the trace of a product."""
    n = range(len(a))
    return _sum(_times(a[i][k], b[k][i]) for i in n for k in n)[0]


def _times(a: Part, b: Part) -> Part:
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def _sum(parts: Any) -> Part:
    real, imaginary = zip(*parts, strict=True)
    return sympy.Add(*real), sympy.Add(*imaginary)
