"""Systems written in YAML for several test files, and their brackets and flows by another road.

A bracket is computed here from matrices whose commutators it is, or from modes; the flow of a function of commuting
linear functions by SciPy's exponential of the matrix of its field.  Neither uses anything of ``spi.plugins.systems``.
A test file that imports this is skipped where that plug-in is left out.
"""

import functools
import itertools
import math
from typing import Any, NamedTuple

import mpmath
import numpy as np
import pytest
import scipy.linalg
import sympy
import yaml

from spi.checks.registration import vocabulary
from spi.compiler import modules

pytest.importorskip("spi.plugins.systems.source")
from spi.plugins.systems.definition import define
from spi.plugins.systems.source import System, generate


class Made(NamedTuple):
    """A system of a definition, by the steps of which ``spi.plugins.systems.generated.made`` consists."""

    system: System
    text: str  #: of its module
    record: Any

    def with_text(self, text):
        """The record of a module with another text."""
        return modules.stored("custom", text).Custom._make(self.record)


@functools.cache
def made(text):
    """The system of a definition, a text of YAML."""
    system = define(definition(text))
    generated = generate(system, "Custom", vocabulary("model"))
    values = {str(symbol): float(value) for symbol, value in system.world.parameters.items()}
    fields = {field: values[parameter] for parameter, field in generated.fields}
    if generated.constants:
        fields["constants"] = generated.constants
    return Made(system, generated.text, modules.stored("custom", generated.text).Custom(**fields))


def definition(text):
    """The keys of a definition; all values are texts."""
    return yaml.load(text, yaml.BaseLoader)


# --- brackets --------------------------------------------------------------------------------------------------------


def unit(n, i, j, value=1.0):
    """The n x n matrix with one entry."""
    matrix = np.zeros((n, n))
    matrix[i, j] = value
    return matrix


def turns(n, lengths=None):
    """L_ij, i < j, which turn axis i towards axis j; axes of negative length make boosts."""
    lengths = lengths or [1.0] * n
    return [unit(n, j, i, lengths[i]) - unit(n, i, j, lengths[j]) for i, j in itertools.combinations(range(n), 2)]


def rigid():
    """Rotations about the axes 1, 2, 3."""
    return [unit(3, k, j) - unit(3, j, k) for j, k in ((1, 2), (2, 0), (0, 1))]


def with_translations(rotations):
    """Matrices [R g; 0 0] of rotations R, then those of translations."""
    n = len(rotations[0])
    return [np.block([[R, np.zeros((n, 1))], [np.zeros((1, n + 1))]]) for R in rotations] + [
        unit(n + 1, i, n) for i in range(n)
    ]


def symplectic(n):
    """Matrices of sp(2n): a_ij, then b_ij and c_ij for i <= j."""
    pairs = list(itertools.combinations_with_replacement(range(n), 2))
    found = [unit(2 * n, i, j) - unit(2 * n, n + j, n + i) for i, j in itertools.product(range(n), repeat=2)]
    above = [unit(2 * n, i, n + j) + unit(2 * n, j, n + i) * (i != j) for i, j in pairs]
    return [*found, *above, *(b.T for b in above)]


def traceless(n):
    """Matrices of sl(n): those of the diagonal, then E_ij."""
    diagonal = [unit(n, i, i) - unit(n, i + 1, i + 1) for i in range(n - 1)]
    return [*diagonal, *(unit(n, i, j) for i, j in itertools.permutations(range(n), 2))]


def commutators(matrices):
    """c[i, j, k] with {y_i, y_j} = sum_k c[i, j, k] y_k: the bracket that is minus the commutator."""
    columns = np.array([m.ravel() for m in matrices]).T
    d = len(matrices)
    c = np.zeros((d, d, d))
    for i, j in itertools.product(range(d), repeat=2):
        product = matrices[i] @ matrices[j] - matrices[j] @ matrices[i]
        c[i, j], *_ = np.linalg.lstsq(columns, -product.ravel())
        assert np.allclose(columns @ c[i, j], -product.ravel(), atol=1e-12)
    return np.round(c, 12)


def given(d, entries):
    """c of brackets {y_i, y_j} = sum_k x y_k, given as (i, j, k): x, counted from 1."""
    c = np.zeros((d, d, d))
    for (i, j, k), x in entries.items():
        c[i - 1, j - 1, k - 1] += x
        c[j - 1, i - 1, k - 1] -= x
    return c


def su_3():
    """-f_abc of Gell-Mann's matrices."""
    half, root = 0.5, math.sqrt(3) / 2
    f = {(1, 2, 3): 1.0, (1, 4, 7): half, (1, 6, 5): half, (2, 4, 6): half, (2, 5, 7): half, (3, 4, 5): half}
    f |= {(3, 7, 6): half, (4, 5, 8): root, (6, 7, 8): root}
    return given(8, {turned: -x for (i, j, k), x in f.items() for turned in ((i, j, k), (j, k, i), (k, i, j))})


def heisenberg(n):
    return given(2 * n + 1, {(i, n + i, 2 * n + 1): 1.0 for i in range(1, n + 1)})


def product(*several):
    """c of a product of algebras."""
    d = sum(len(c) for c in several)
    whole, first = np.zeros((d, d, d)), 0
    for c in several:
        last = first + len(c)
        whole[first:last, first:last, first:last] = c
        first = last
    return whole


def sine_euler(N):
    """c in the sums of real and imaginary parts of modes with {w_m, w_n} = sin(2 pi m x n / N) w_(m+n)."""
    modes = list(itertools.product(range(N), repeat=2))
    place = {m: n for n, m in enumerate(modes)}
    w = np.zeros((N * N, N * N, N * N), complex)
    for (i, j), (k, m) in itertools.product(modes, repeat=2):
        w[place[i, j], place[k, m], place[(i + k) % N, (j + m) % N]] = math.sin(2 * math.pi * (i * m - j * k) / N)
    # h(m) = Re w(m) + Im w(m), and w(-m) is the conjugate of w(m)
    to = np.zeros((N * N, N * N), complex)
    for (i, j), n in place.items():
        to[n, n] += (1 - 1j) / 2
        to[n, place[-i % N, -j % N]] += (1 + 1j) / 2
    found = np.einsum("ia,jb,abc,ck->ijk", to, to, w, np.linalg.inv(to))
    assert np.allclose(found.imag, 0.0, atol=1e-14)
    return found.real


def structure(c, y):
    """B(y)."""
    return np.einsum("ijk,k->ij", c, y)


# --- flows -----------------------------------------------------------------------------------------------------------


def functions(system, expressions):
    """(values, gradients) of functions of y, in floats, from formulas of SymPy."""
    world = system.world
    numbers = {**world.parameters, **{k: sympy.Float(mpmath.nstr(v, 40), 40) for k, v in system.constants.items()}}
    exact = [e.xreplace(numbers) for e in expressions]
    gradients = [[sympy.diff(e, y) for y in world.variables] for e in exact]
    return (sympy.lambdify([world.variables], what, "numpy") for what in (exact, gradients))


def exponential(c, gradient, t, y):
    """exp(t M) y, where M y = B(y) gradient."""
    return scipy.linalg.expm(t * np.einsum("ijk,j->ik", c, gradient)) @ y


# --- the systems -----------------------------------------------------------------------------------------------------

#: name -> (definition, its bracket c).
SYSTEMS = {
    "rigid body": (
        "{algebra: so(3), parameters: {a: 2, b: 1, c: 2/3}, hamiltonian: y1^2/(2*a) + y2^2/(2*b) + y3^2/(2*c),"
        " noises: [y1^2/3, y2, cos(y3)]}",
        commutators(rigid()),
    ),
    "tilted": (
        "{algebra: so(3), parameters: {a: 1/3, b: 2}, hamiltonian: a*(y1 + 2*y2)^2 + y1*y2 + b*y2*y3 + y3^2/b,"
        " noises: [y1 - y2/3, '(y1 + b*y3)^2', sin(y1 + y2 - y3)]}",
        commutators(rigid()),
    ),
    "many functions": (
        "{algebra: su(2), hamiltonian: cos(y1) + exp(y2/3) + log(2 + y3^2) + tanh(y1 + y2) + y2^4/5,"
        " noises: ['sqrt(1 + y1^2)', sinh(y2/2)*cosh(y2), 'tan(y3/9)']}",
        commutators(rigid()),
    ),
    "so(2,1)": (
        "{algebra: 'so(2,1)', hamiltonian: k1^2/2 + k2^2/3 + k3^2/5, variables: [k1, k2, k3],"
        " noises: [k3, k1, k1 + k3, '(k1 + 2*k3)^2/2', '(2*k1 + k3)^2/2', '(k2 - k3)^2']}",
        given(3, {(1, 2, 3): 1, (2, 3, 1): -1, (3, 1, 2): -1}),
    ),
    "so(2,1) with cross terms": (
        "{algebra: 'so(2,1)', parameters: {e: 1/5}, hamiltonian: y1^2 + e*y1*y2 + y2^2/2 + e*y2*y3 - y3^2,"
        " noises: [y1 + e*y3, y3 + e*y1]}",
        given(3, {(1, 2, 3): 1, (2, 3, 1): -1, (3, 1, 2): -1}),
    ),
    "sl(2)": (
        "{algebra: sl(2), variables: [h, e, f], hamiltonian: h^2/2 + e*f + e^2/7, "
        " noises: [e, f, h, 'e + 3*f', 'e - f']}",
        commutators([np.diag([1.0, -1.0]), unit(2, 0, 1), unit(2, 1, 0)]),
    ),
    "e(2)": (
        "{algebra: e(2), variables: [L, g1, g2], hamiltonian: L^2/2 + g2 + g1*g2, noises: [L, g2, L + g1/2]}",
        commutators(with_translations([unit(2, 1, 0) - unit(2, 0, 1)])),
    ),
    "heavy top": (
        "{algebra: se(3), variables: [P1, P2, P3, G1, G2, G3], parameters: {I1: 2, I2: 1, I3: 2/3, weight: 1},"
        " hamiltonian: P1^2/(2*I1) + P2^2/(2*I2) + P3^2/(2*I3) + weight*G3, noises: [G3, P1]}",
        commutators(with_translations(rigid())),
    ),
    "heisenberg(2)": (
        "{algebra: heisenberg(2), variables: [q1, q2, p1, p2, z],"
        " hamiltonian: q1^2/2 + q2^2/2 + p1^2/2 + p2^2/2 + z*q1 + q1^2*q2, noises: [q1*q2, z*p2, q1*p2, z + p1^3]}",
        heisenberg(2),
    ),
    "Manakov": (
        "{algebra: so(4), variables: [m12, m13, m14, m23, m24, m34], parameters: {J: 3},"
        " hamiltonian: m12^2/6 + m13^2/8 + m14^2/(2 + 2*J) + m23^2/10 + m24^2/12 + m34^2/14, noises: [m12, m23^2]}",
        commutators(turns(4)),
    ),
    "gl(3)": (
        "{algebra: gl(3), variables: ['E(i,j) for i = 1..3, j = 1..3'],"
        " hamiltonian: 'sum(E(i,i)^2 for i = 1..3)/2 + E(1,2)*E(1,3) + (E(2,1) - E(1,2))^2/3 + E(2,3)',"
        " noises: ['E(1,2)', 'E(1,1) - E(3,3)/2', 'E(3,1)^2']}",
        commutators([unit(3, i, j) for i in range(3) for j in range(3)]),
    ),
    "ring of 4 spins": (
        "{algebra: so(3)^n, sizes: {n: 4}, variables: ['x(i), y(i), z(i) for i = 1..n'],"
        " parameters: {J: 1/2}, hamiltonian: 'sum(x(i)*x(mod(i,n)+1) + J*y(i)*y(mod(i,n)+1)"
        " + z(i)*z(mod(i,n)+1)/3 for i = 1..n)', noises: [z(1), 'sum(x(i) for i = 1..n)', 'y(1)*z(2)']}",
        product(*[commutators(rigid())] * 4),
    ),
    "su(3)": (
        "{algebra: su(3), parameters: {a: 1/3}, hamiltonian: y3^2/2 + y8 + y1*y4/3 + a*(y6 + 2*y7)^2,"
        " noises: [y2, y3 + a*y8, y7^2/2]}",
        su_3(),
    ),
    "sp(4)": (
        "{algebra: sp(4), hamiltonian: y1^2/2 + y5*y8/3 + y6^2 + y10, noises: [y1 - y4, y6, y5 + y8]}",
        commutators(symplectic(2)),
    ),
    "kinks": (
        "{algebra: so(3), parameters: {a: 1/3}, hamiltonian: 'atan(2*y1) + max(y2, a)^2 + min(y3, y3^2, 2)',"
        " noises: ['max(y1 - 2*y2, -a*(y1 - 2*y2), 0)', 'atan(y3)*y3']}",
        commutators(rigid()),
    ),
    "Toda": (
        "{sizes: {n: 4}, variables: ['a(i) for i = 1..n-1', 'b(i) for i = 1..n'],"
        " bracket: {'a(i) b(i) for i = 1..n-1': -a(i), 'a(i) b(i+1) for i = 1..n-1': a(i)},"
        " hamiltonian: 'sum(b(i)^2 for i = 1..n)/2 + 2*sum(a(i)^2 for i = 1..n-1)',"
        " noises: [b(1), 'a(2)^2', a(1)*a(3)]}",
        given(7, {(i, i + 3, i): -1 for i in (1, 2, 3)} | {(i, i + 4, i): 1 for i in (1, 2, 3)}),
    ),
    "sine-Euler, N = 3": (
        "{sizes: {N: 3}, variables: 'h(i,j) for i = 0..N-1, j = 0..N-1', bracket: {"
        "'h(i,j) h(k,l) for i = 0..N-1, j = 0..N-1, k = 0..N-1, l = 0..N-1': "
        "'sin(2*pi*(i*l - j*k)/N)/2 * (h(mod(i+k,N), mod(j+l,N)) - h(mod(-i-k,N), mod(-j-l,N))"
        " - h(mod(i-k,N), mod(j-l,N)) - h(mod(k-i,N), mod(l-j,N)))'},"
        " hamiltonian: 'sum(h(i,j)^2/((mod(i+1,N)-1)^2 + (mod(j+1,N)-1)^2) for i = 1..N-1, j = 0..N-1)/2"
        " + sum(h(0,j)^2 for j = 1..N-1)/2', noises: ['(h(1,0)^2 + h(2,0)^2)/4', 'h(0,1)']}",
        sine_euler(3),
    ),
    "bracket with parameters": (
        "{variables: [x, y, z], parameters: {a: 2, b: 1/3, c: 3/2}, bracket: {x y: a*z, 'y, z': b*x, z x: c*y},"
        " hamiltonian: x^2/2 + y^2*a/5 + z^2 + x*y/3, noises: [x, y - z, z^2*c]}",
        given(3, {(1, 2, 3): 2, (2, 3, 1): 1 / 3, (3, 1, 2): 3 / 2}),
    ),
    "spin in a cavity": (
        "{algebra: so(3) * heisenberg, variables: [s1, s2, s3, q, p, i], parameters: {g: 1/3},"
        " hamiltonian: s3 + (q^2 + p^2)/2 + g*s1*q, noises: [s3, q*s2, p + s1]}",
        product(commutators(rigid()), heisenberg(1)),
    ),
    "spirals": (
        "{variables: [r, x, y, u, v], parameters: {d: 1/4}, "
        " bracket: {r x: d*x + y, r y: d*y - x, r u: u/2, r v: u + v/2},"
        " hamiltonian: r^2/2 + x*u + cos(y), noises: [r, x^2 + y^2, r + x]}",
        given(
            5,
            {
                **{(1, 2, 2): 1 / 4, (1, 2, 3): 1, (1, 3, 3): 1 / 4, (1, 3, 2): -1},
                **{(1, 4, 4): 1 / 2, (1, 5, 4): 1, (1, 5, 5): 1 / 2},
            },
        ),
    ),
}
