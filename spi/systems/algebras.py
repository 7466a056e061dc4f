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
from typing import Any, NamedTuple

import numpy as np
import sympy

from .brackets import Linear, added
from .text import NumberError, Symbols, parts, whole

# ---------------------------------------------------------------------------------------------------------------------
# Lie algebras of matrices by their generators: brackets, minus the commutators, and Casimir functions, by traces.
#
# A generator T_a has a dual D_a, tr(D_a T_b) = delta_ab.  Then [T_a, T_b] = sum_c tr(D_c [T_a, T_b]) T_c, and with
# X(y) = sum_a y_a D_a the functions tr X(y)^k are invariant under the coadjoint action, which conjugates X.
# ---------------------------------------------------------------------------------------------------------------------

Entries = dict[tuple[int, int], complex]  #: of a matrix whose entries are a + b i with whole a and b
Complex = tuple[np.ndarray, np.ndarray]  #: a matrix of expressions as its real and imaginary part


class Generator(NamedTuple):
    """A generator and its dual, which is sparse as well."""

    matrix: Entries  #: the generator divided by its scale
    dual: Entries
    weight: Fraction  #: the trace of weight * dual * matrix is 1
    scale: Any = sympy.Integer(1)


def sl(n: int) -> list[Generator]:
    """h_1, ..., h_(n-1) with h_i = E_ii - E_(i+1)(i+1), then E_12, E_13, ..., row by row; for n = 2 h, e, f."""
    generators = []
    for i in range(n - 1):
        dual = {(j, j): complex(n * (j <= i) - i - 1) for j in range(n)}  # n times a fundamental weight
        generators.append(Generator({(i, i): 1, (i + 1, i + 1): -1}, dual, Fraction(1, n)))
    pairs = itertools.permutations(range(n), 2)
    return generators + [Generator({(i, j): 1}, {(j, i): 1}, Fraction(1)) for i, j in pairs]


def su(n: int) -> list[Generator]:
    """-i lambda_a / 2 with the matrices of Gell-Mann, in his order, for n = 2 those of Pauli; |y|^2 is invariant."""
    generators = []
    half = sympy.Rational(1, 2)
    for k in range(1, n):
        for j in range(k):
            for matrix in ({(j, k): -1j, (k, j): -1j}, {(j, k): -1 + 0j, (k, j): 1 + 0j}):
                generators.append(Generator(matrix, {place: -c for place, c in matrix.items()}, Fraction(1, 2), half))
        diagonal = {(j, j): 1j * (k if j == k else -1) for j in range(k + 1)}
        dual = {place: -c for place, c in diagonal.items()}
        generators.append(Generator(diagonal, dual, Fraction(1, k * (k + 1)), 1 / sympy.sqrt(2 * k * (k + 1))))
    return generators


def sp(size: int) -> list[Generator]:
    """a_ij = E_ij - E_(n+j)(n+i) row by row, then b_ij and c_ij for i <= j, in the blocks above and below; n = size/2.

    b_ij = E_i(n+j) + E_j(n+i), c_ij = E_(n+i)j + E_(n+j)i, and half of that for i = j.
    """
    n = size // 2
    generators = []
    for i, j in itertools.product(range(n), repeat=2):
        generators.append(Generator({(i, j): 1, (n + j, n + i): -1}, {(j, i): 1, (n + i, n + j): -1}, Fraction(1, 2)))
    pairs = list(itertools.combinations_with_replacement(range(n), 2))
    above = [{(i, n + j): 1 + 0j, (j, n + i): 1 + 0j} for i, j in pairs]
    below = [{(n + i, j): 1 + 0j, (n + j, i): 1 + 0j} for i, j in pairs]
    for matrices, duals in ((above, below), (below, above)):
        generators += [Generator(a, b, Fraction(1, len(a))) for a, b in zip(matrices, duals, strict=True)]
    return generators


#: name -> (generators of a size, powers whose traces are Casimir functions)
OF_MATRICES: dict[str, tuple[Callable[[int], list[Generator]], Callable[[int], range]]] = {
    "sl": (sl, lambda n: range(2, n + 1)),
    "su": (su, lambda n: range(2, n + 1)),
    "sp": (sp, lambda n: range(2, n + 1, 2)),
}
_MOST_POWER = 6  # a higher one takes thousands of products


def brackets_of(generators: Sequence[Generator], size: int) -> list[tuple[int, int, Linear]]:
    """(a, b, {y_a, y_b}), minus the commutators."""
    matrices, duals = (
        np.array([_dense(entries, size) for entries in parts])
        for parts in zip(*((g.matrix, g.dual) for g in generators), strict=True)
    )
    brackets = []
    for (a, first), (b, second) in itertools.combinations(enumerate(generators), 2):
        commutator = matrices[a] @ matrices[b] - matrices[b] @ matrices[a]
        linear: Linear = {}
        for c, trace in enumerate(np.einsum("cij,ji->c", duals, commutator).real.round().astype(int).tolist()):
            if trace:
                third = generators[c]
                whole = sympy.Rational(trace * third.weight.numerator, third.weight.denominator)
                linear[c] = -whole * first.scale * second.scale / third.scale
        if linear:
            brackets.append((a, b, linear))
    return brackets


def _dense(entries: Entries, size: int) -> np.ndarray:
    matrix = np.zeros((size, size), complex)
    for place, value in entries.items():
        matrix[place] = value
    return matrix


def traces(name: str, size: int, variables: Sequence[Any]) -> list[tuple[int, Any]]:
    """(degree, Casimir function) of an algebra of matrices, in its variables; no power above six.

    tr X^k; for su(n), where X is i times a Hermitian matrix Y with tr Y^2 = 2 |y|^2, half of tr Y^k.
    """
    make, powers = OF_MATRICES[name]
    rotation, half = (-1j, sympy.Rational(1, 2)) if name == "su" else (1, sympy.Integer(1))
    real, imaginary = (np.full((size, size), sympy.Integer(0)) for _ in range(2))
    for y, generator in zip(variables, make(size), strict=True):
        factor = sympy.Rational(generator.weight.numerator, generator.weight.denominator) / generator.scale
        for place, value in generator.dual.items():
            c = complex(value) * rotation
            real[place] += round(c.real) * factor * y
            imaginary[place] += round(c.imag) * factor * y
    degrees = [k for k in powers(size) if k <= _MOST_POWER]
    power: dict[int, Complex] = {1: (real, imaginary)}
    for k in range(2, max(degrees, default=2) // 2 + 2):
        power[k] = _product(power[k - 1], power[1])
    functions = []
    for k in degrees:
        product, _ = _product(power[k // 2], power[k - k // 2])
        trace = half * np.trace(product)
        functions.append((k, sympy.expand(trace) if k <= 3 else trace))
    return functions


def _product(a: Complex, b: Complex) -> Complex:
    """The product of two matrices, with real and imaginary parts of expressions."""
    return a[0] @ b[0] - a[1] @ b[1], a[0] @ b[1] + a[1] @ b[0]


Brackets = list[tuple[int, int, Linear]]  #: (i, j, {y_i, y_j})
Algebra = tuple[int, Brackets]  #: dimension, brackets

_FACTOR = re.compile(r"\s*([a-z]+)\s*(?:\(([^()]*)\))?\s*(?:\^\s*(\w+|\([^()]*\)))?\s*$")
_LARGEST = 64  # components
KNOWN = (
    "so(n), se(n), so(p,q), sl(n), su(n), sp(2n), gl(n), e(2), heisenberg, and products such as so(3)^8 or so(3) * e(2)"
)


def algebra(text: str, symbols: Symbols) -> Algebra:
    """(dimension, brackets) of a product of algebras; NumberError if the text is none."""
    dimension, brackets = 0, Brackets()
    for name, sizes, count, factor in _factors(text, symbols):
        d, factor_brackets = _simple(name, sizes, factor)
        if dimension + d * count > _LARGEST:
            raise NumberError(f"it has more than {_LARGEST} components")
        for _ in range(count):
            for i, j, linear in factor_brackets:
                brackets.append((i + dimension, j + dimension, {k + dimension: c for k, c in linear.items()}))
            dimension += d
    return dimension, brackets


def known_casimirs(text: str | None, symbols: Symbols, variables: Sequence[Any]) -> list[tuple[set[int], int, Any]]:
    """(components, degree, Casimir function) of the factors that are algebras of matrices: traces of powers."""
    first, casimirs = 0, []
    for name, sizes, count, factor in _factors(text, symbols) if text else ():
        d, _ = _simple(name, sizes, factor)
        for n in range(first, first + d * count, d):
            if name in OF_MATRICES and sizes != [2]:
                functions = traces(name, sizes[0], variables[n : n + d])
                casimirs += [(set(range(n, n + d)), degree, function) for degree, function in functions]
        first += d * count
    return casimirs


def _factors(text: str, symbols: Symbols) -> Iterator[tuple[str, list[int], int, str]]:
    """(name, sizes, power, text) of each factor of a product."""
    for factor in parts(text, "*"):
        match = _FACTOR.match(factor)
        if not match:
            raise NumberError(f"'{factor.strip()}' is not an algebra; known: {KNOWN}")
        name, inside, power = match.groups()
        sizes = [whole(part, symbols) for part in inside.split(",")] if inside else []
        count = whole(power, symbols) if power else 1
        if count < 1:
            raise NumberError(f"the power of '{factor.strip()}' must be at least 1")
        yield name, sizes, count, factor.strip()


def _simple(name: str, sizes: list[int], text: str) -> Algebra:
    """(dimension, brackets) of an algebra that is no product."""
    make, least, most = _MAKE.get((name, len(sizes)), (None, 0, 0))
    if make is None:
        raise NumberError(f"'{text}' is not a known algebra; known: {KNOWN}")
    if not all(least <= size <= most for size in sizes):
        sizes_known = f"from {least} to {most}" if least < most else f"{most}"
        raise NumberError(f"the size in '{text}' must be {sizes_known}")
    if name == "sp" and sizes[0] % 2:
        raise NumberError(f"the size in '{text}' must be even, that of its matrices")
    return make(*sizes)


def _rotations(metric: tuple[int, ...], translations: bool) -> Algebra:
    """{L_ij, L_jk} = metric_j L_ik, and {L_ij, g_i} = -metric_i g_j, {L_ij, g_j} = metric_j g_i."""
    n = len(metric)
    pairs = {pair: k for k, pair in enumerate(itertools.combinations(range(n), 2))}

    def generator(i: int, j: int, factor: int) -> Linear:
        """factor L_ij."""
        return {pairs[min(i, j), max(i, j)]: sympy.Integer(factor if i < j else -factor)}

    brackets = Brackets()
    for (first, a), (second, b) in itertools.combinations(pairs.items(), 2):
        shared = set(first) & set(second)
        if len(shared) == 1:
            (j,) = shared
            (i,), (k,) = set(first) - shared, set(second) - shared
            sign = (1 if first == (i, j) else -1) * (1 if second == (j, k) else -1)
            brackets.append((a, b, generator(i, k, sign * metric[j])))
    d = len(pairs)
    if translations:
        for (i, j), a in pairs.items():
            brackets.append((a, d + i, {d + j: sympy.Integer(-metric[i])}))
            brackets.append((a, d + j, {d + i: sympy.Integer(metric[j])}))
    return d + n * translations, brackets


def _of_vectors(factors: tuple[int, int, int], translations: bool) -> Algebra:
    """{y1, y2} = factors[2] y3 and cyclic permutations, and the same with one vector of translations."""
    brackets = Brackets()
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        brackets.append((i, j, {k: sympy.Integer(factors[k])}))
        if translations:
            brackets.append((i, j + 3, {k + 3: sympy.Integer(factors[k])}))
            brackets.append((j, i + 3, {k + 3: sympy.Integer(-factors[k])}))
    return 6 if translations else 3, brackets


def _so(n: int) -> Algebra:
    return _of_vectors((-1, -1, -1), False) if n == 3 else _rotations((1,) * n, False)


def _se(n: int) -> Algebra:
    return _of_vectors((-1, -1, -1), True) if n == 3 else _rotations((1,) * n, True)


def _so_mixed(p: int, q: int) -> Algebra:
    if (p, q) == (2, 1):
        return _of_vectors((-1, -1, 1), False)
    return _rotations((1,) * p + (-1,) * q, False)


def _gl(n: int) -> Algebra:
    brackets = Brackets()
    places = list(itertools.product(range(n), repeat=2))
    for (a, (i, j)), (b, (k, m)) in itertools.combinations(enumerate(places), 2):
        one = sympy.Integer(1)
        linear = added([(i * n + m, -one)] * (j == k) + [(k * n + j, one)] * (m == i))
        brackets.append((a, b, {place: c for place, c in linear.items() if c}))
    return n * n, brackets


def _of_matrices(name: str, n: int) -> Algebra:
    generators = OF_MATRICES[name][0](n)
    return len(generators), brackets_of(generators, n)


def _heisenberg(n: int) -> Algebra:
    return 2 * n + 1, [(i, n + i, {2 * n: sympy.Integer(1)}) for i in range(n)]


#: (name, number of sizes) -> (function that makes it, least size, largest size)
_MAKE: dict[tuple[str, int], tuple[Callable[..., Algebra], int, int]] = {
    ("so", 1): (_so, 2, 11),
    ("so", 2): (_so_mixed, 1, 10),
    ("se", 1): (_se, 2, 10),
    ("e", 1): (_se, 2, 10),
    ("su", 1): (lambda n: _of_matrices("su", n) if n > 2 else _so(3), 2, 8),
    ("sl", 1): (lambda n: _of_matrices("sl", n), 2, 8),
    ("sp", 1): (lambda n: _of_matrices("sp", n), 2, 10),
    ("gl", 1): (_gl, 1, 8),
    ("heisenberg", 0): (lambda: _heisenberg(1), 0, 0),
    ("heisenberg", 1): (_heisenberg, 1, 31),
}
