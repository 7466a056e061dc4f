"""Lie algebras by name, as Lie-Poisson brackets of their generators in the order in which they are listed here.

    so(n)           n = 3: y1, y2, y3 with {y1, y2} = -y3 and cyclic permutations, the rigid body's; n > 3: L12, L13,
                    ..., L23, ... (L_ij turns axis i towards axis j) with {L_ij, L_jk} = L_ik, L_ji = -L_ij
    su(2)           so(3)
    se(n), e(n)     so(n), then n translations: {y1, g2} = -g3 and so on for n = 3, {L_ij, g_i} = -g_j else;
                    n = 2: {L, g1} = -g2, {L, g2} = g1, the bracket of Maxwell-Bloch
    so(p,q)         as so(p+q) with p axes of length 1 and q of length -1;
                    so(2,1): {k1, k2} = k3, {k2, k3} = -k1, {k3, k1} = -k2
    sl(2)           h, e, f with {h, e} = -2 e, {h, f} = 2 f, {e, f} = -h
    sl(n)           h1, ..., with h_i = E_ii - E_(i+1)(i+1), then E12, E13, ..., E21, ...
    su(n)           -i lambda_a / 2 with the matrices of Gell-Mann, in his order: |y|^2 is a Casimir function
    sp(2n)          aij = E_ij - E_(n+j)(n+i) row by row, bij = E_i(n+j) + E_j(n+i) and cij, its transpose, for i <= j,
                    half of that for i = j
    gl(n)           E11, E12, ... with {E_ij, E_jk} = -E_ik for i != k, {E_ij, E_ji} = E_jj - E_ii
    heisenberg(n)   q1, ..., qn, p1, ..., pn, z with {q_i, p_i} = z; heisenberg is heisenberg(1)

The brackets are those of the paper, minus the commutators, except Heisenberg's.  Products: so(3)^8, so(3) * heisenberg.
"""

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import sympy

from spi.expressions.arithmetic import NumberError
from spi.expressions.ranges import parts, whole

from .brackets import BracketEntry, BracketPolynomial
from .text import Symbols

# ---------------------------------------------------------------------------------------------------------------------
# Lie algebras of matrices by their generators: brackets, minus the commutators, and Casimir functions, by traces.
#
# A generator T_a is a matrix M_a, whose entries are a + b i with whole a and b, times a scale.  Its dual D_a is in the
# algebra, tr(D_a T_b) = delta_ab, and with X(y) = sum_a y_a D_a the functions tr X(y)^k are invariant under the
# coadjoint action, which conjugates X.
# ---------------------------------------------------------------------------------------------------------------------

Matrices = list[np.ndarray]
Algebra = tuple[int, list[BracketEntry]]  #: dimension, brackets


def _unit(n: int, i: int, j: int, value: complex = 1.0) -> np.ndarray:
    """N x n matrix with one entry."""
    matrix = np.zeros((n, n), complex)
    matrix[i, j] = value
    return matrix


def sl(n: int) -> Matrices:
    """h_1, ..., h_(n-1) with h_i = E_ii - E_(i+1)(i+1), then E_12, E_13, ..., row by row; for n = 2 h, e, f."""
    diagonal = [_unit(n, i, i) - _unit(n, i + 1, i + 1) for i in range(n - 1)]
    return diagonal + [_unit(n, i, j) for i, j in itertools.permutations(range(n), 2)]


def su(n: int) -> Matrices:
    """-i times the matrices of Gell-Mann, in his order, for n = 2 those of Pauli; diagonal ones of whole numbers."""
    matrices = []
    for k in range(1, n):
        for j in range(k):
            matrices += [_unit(n, j, k, -1j) + _unit(n, k, j, -1j), _unit(n, k, j) - _unit(n, j, k)]
        matrices.append(np.diag([1j * (-1 if j < k else k if j == k else 0) for j in range(n)]))
    return matrices


def sp(size: int) -> Matrices:
    """a_ij = E_ij - E_(n+j)(n+i) row by row, then b_ij and c_ij for i <= j, in the blocks above and below; n = size/2.

    b_ij = E_i(n+j) + E_j(n+i), c_ij = E_(n+i)j + E_(n+j)i, and half of that for i = j.
    """
    n = size // 2
    places = itertools.product(range(n), repeat=2)
    matrices = [_unit(size, i, j) - _unit(size, n + j, n + i) for i, j in places]
    pairs = itertools.combinations_with_replacement(range(n), 2)
    above = [_unit(size, i, n + j) + _unit(size, j, n + i) * (i != j) for i, j in pairs]
    return [*matrices, *above, *(b.T for b in above)]


def gl(n: int) -> Matrices:
    """E_11, E_12, ..., row by row."""
    return [_unit(n, i, j) for i, j in itertools.product(range(n), repeat=2)]


def rotations(lengths: Sequence[int], translations: bool = False) -> Matrices:
    """L_12, L_13, ..., L_23, ..., which turn axes of these lengths, and the translations along the axes."""
    n = len(lengths)
    size = n + translations
    pairs = itertools.combinations(range(n), 2)
    turns = [_unit(size, j, i, lengths[i]) - _unit(size, i, j, lengths[j]) for i, j in pairs]
    return turns + [_unit(size, i, n) for i in range(n if translations else 0)]


def _scale(name: str, matrix: np.ndarray) -> Any:
    """Scale of a generator: those of su(n) are such that |y|^2 is a Casimir function."""
    if name != "su":
        return sympy.Integer(1)
    return 1 / sympy.sqrt(2 * round(np.sum(abs(matrix) ** 2)))


def _rational(values: np.ndarray) -> list[list[Fraction]]:
    """Numbers with small denominators, from their approximations."""
    return [[Fraction(x).limit_denominator(1000) for x in row] for row in values.tolist()]


def _brackets(name: str, matrices: Matrices) -> Algebra:
    """(dimension, the brackets {y_a, y_b}, minus the commutators)."""
    scales = [_scale(name, matrix) for matrix in matrices]
    pairs = list(itertools.combinations(range(len(matrices)), 2))
    commutators = [matrices[a] @ matrices[b] - matrices[b] @ matrices[a] for a, b in pairs]
    if not pairs:
        return len(matrices), []
    columns, sides = (np.array(several).reshape(len(several), -1).view(float).T for several in (matrices, commutators))
    factors = _rational(np.linalg.lstsq(columns, sides)[0].T)
    brackets = list[BracketEntry]()
    for (a, b), row in zip(pairs, factors, strict=True):
        scale = scales[a] * scales[b]
        linear: BracketPolynomial = {(c,): -sympy.Rational(x) * scale / scales[c] for c, x in enumerate(row) if x}
        brackets += [("", a, b, linear)] if linear else []
    return len(matrices), brackets


#: name -> (generators of a size, powers whose traces are Casimir functions)
WITH_TRACES: dict[str, tuple[Callable[[int], Matrices], Callable[[int], range]]] = {
    "sl": (sl, lambda n: range(2, n + 1)),
    "su": (su, lambda n: range(2, n + 1)),
    "sp": (sp, lambda n: range(2, n + 1, 2)),
}
_MOST_POWER = 6  # a higher one takes thousands of products


def traces(name: str, size: int, variables: Sequence[Any]) -> list[tuple[int, Any]]:
    """(degree, Casimir function) of an algebra of matrices, in its variables; no power above six.

    tr X^k; for su(n), where X is i times a Hermitian matrix Y with tr Y^2 = 2 |y|^2, half of tr Y^k.
    """
    make, powers = WITH_TRACES[name]
    matrices = np.array(make(size))
    inverse = _rational(np.linalg.inv(np.einsum("aij,bji->ab", matrices, matrices).real))  # of the Gram matrix
    scaled = [y / _scale(name, matrix) for y, matrix in zip(variables, matrices, strict=True)]
    factors = np.array([sum(sympy.Rational(x) * y for x, y in zip(row, scaled, strict=True) if x) for row in inverse])
    turned, half = (-1j * matrices, sympy.Rational(1, 2)) if name == "su" else (matrices, sympy.Integer(1))
    real, imaginary = (np.tensordot(factors, part.round().astype(int), 1) for part in (turned.real, turned.imag))
    degrees = [k for k in powers(size) if k <= _MOST_POWER]
    power: dict[int, tuple[np.ndarray, np.ndarray]] = {1: (real, imaginary)}  # of X, real and imaginary part
    for k in range(2, max(degrees, default=2) // 2 + 2):
        a, b = power[k - 1]
        power[k] = a @ real - b @ imaginary, a @ imaginary + b @ real
    functions = []
    for k in degrees:
        (a, b), (c, d) = power[k // 2], power[k - k // 2]
        trace = half * np.trace(a @ c - b @ d)
        functions.append((k, sympy.expand(trace) if k <= 3 else trace))
    return functions


# ---------------------------------------------------------------------------------------------------------------------
# By name
# ---------------------------------------------------------------------------------------------------------------------


_FACTOR = re.compile(r"\s*([a-z]+)\s*(?:\(([^()]*)\))?\s*(?:\^\s*(\w+|\([^()]*\)))?\s*$")
_LARGEST = 64  # components
KNOWN = (
    "so(n), se(n), so(p,q), sl(n), su(n), sp(2n), gl(n), e(2), heisenberg, and products such as so(3)^8 or so(3) * e(2)"
)


def algebra(text: str, symbols: Symbols) -> Algebra:
    """(dimension, brackets) of a product of algebras; NumberError if the text is none."""
    dimension, brackets = 0, list[BracketEntry]()
    for _, _, d, own in _factors(text, symbols):
        moved = ((i, j, {tuple(k + dimension for k in m): c for m, c in linear.items()}) for _, i, j, linear in own)
        brackets += [("", i + dimension, j + dimension, linear) for i, j, linear in moved]
        dimension += d
    return dimension, brackets


def known_casimirs(text: str | None, symbols: Symbols, variables: Sequence[Any]) -> list[tuple[set[int], int, Any]]:
    """(components, degree, Casimir function) of the factors that are algebras of matrices: traces of powers."""
    first, casimirs = 0, []
    for name, sizes, d, _ in _factors(text, symbols) if text else ():
        if name in WITH_TRACES and sizes != [2]:
            functions = traces(name, sizes[0], variables[first : first + d])
            casimirs += [(set(range(first, first + d)), degree, function) for degree, function in functions]
        first += d
    return casimirs


def _factors(text: str, symbols: Symbols) -> Iterator[tuple[str, list[int], int, list[BracketEntry]]]:
    """(name, sizes, dimension, brackets) of each factor of a product."""
    left = _LARGEST
    for factor in map(str.strip, parts(text, "*")):
        match = _FACTOR.match(factor)
        if not match:
            raise NumberError(f"'{factor}' is not an algebra; known: {KNOWN}")
        name, inside, power = match.groups()
        sizes = [whole(part, symbols) for part in inside.split(",")] if inside else []
        count = whole(power, symbols) if power else 1
        if count < 1:
            raise NumberError(f"the power of '{factor}' must be at least 1")
        make, least, most = _MAKE.get((name, len(sizes)), (None, 0, 0))
        if make is None:
            raise NumberError(f"'{factor}' is not a known algebra; known: {KNOWN}")
        if not all(least <= size <= most for size in sizes):
            right = f"from {least} to {most}" if least < most else f"{most}"
            raise NumberError(f"the size in '{factor}' must be {right}")
        if name == "sp" and sizes[0] % 2:
            raise NumberError(f"the size in '{factor}' must be even, that of its matrices")
        d, brackets = make(*sizes)
        left -= d * count
        if left < 0:
            raise NumberError(f"it has more than {_LARGEST} components")
        for _ in range(count):
            yield name, sizes, d, brackets


def _vectors(factors: tuple[int, int, int], translations: bool = False) -> Algebra:
    """{y1, y2} = factors[2] y3 and cyclic permutations, and the same with one vector of translations."""
    brackets: list[BracketEntry] = []
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        c = sympy.Integer(factors[k])
        brackets.append(("", i, j, {(k,): c}))
        brackets += [("", i, j + 3, {(k + 3,): c}), ("", j, i + 3, {(k + 3,): -c})] * translations
    return 3 + 3 * translations, brackets


#: lengths of three axes -> factors of the brackets
_SPECIAL: dict[tuple[int, ...], tuple[int, int, int]] = {(1, 1, 1): (-1, -1, -1), (1, 1, -1): (-1, -1, 1)}


def _turning(lengths: Sequence[int], translations: bool = False) -> Algebra:
    special = _SPECIAL.get(tuple(lengths))
    return _vectors(special, translations) if special else _brackets("so", rotations(lengths, translations))


def _heisenberg(n: int) -> Algebra:
    return 2 * n + 1, [("", i, n + i, {(2 * n,): sympy.Integer(1)}) for i in range(n)]


def _se(n: int) -> Algebra:
    return _turning([1] * n, True)


#: (name, number of sizes) -> (function that makes it, least size, largest size)
_MAKE: dict[tuple[str, int], tuple[Callable[..., Algebra], int, int]] = {
    ("so", 1): (lambda n: _turning([1] * n), 2, 11),
    ("so", 2): (lambda p, q: _turning([1] * p + [-1] * q), 1, 10),
    ("se", 1): (_se, 2, 10),
    ("e", 1): (_se, 2, 10),
    ("su", 1): (lambda n: _brackets("su", su(n)) if n > 2 else _turning([1] * 3), 2, 8),
    ("sl", 1): (lambda n: _brackets("sl", sl(n)), 2, 8),
    ("sp", 1): (lambda n: _brackets("sp", sp(n)), 2, 10),
    ("gl", 1): (lambda n: _brackets("gl", gl(n)), 1, 8),
    ("heisenberg", 0): (lambda: _heisenberg(1), 0, 0),
    ("heisenberg", 1): (_heisenberg, 1, 31),
}
