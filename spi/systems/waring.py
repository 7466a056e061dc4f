"""Polynomials as sums of powers of linear functions, whose flows are exact (Waring's problem for polynomials).

A monomial in variables that do not commute is, by polarisation, with d = sum_i s_i and h_i = s_i/2 - v_i,

    x_1^(s_1) ... x_n^(s_n) = 1/d! sum_(0 <= v <= s) (-1)^(sum v) prod_i binom(s_i, v_i) (sum_i h_i x_i)^d,

in which v and s - v give the same power: (s_1 + 1) ... (s_n + 1)/2 of them, or one less (Kan, J. Multivariate Anal. 99,
2008), as in 24 xyz = (x + y + z)^3 - (x + y - z)^3 - (x - y + z)^3 + (x - y - z)^3.  Variables that commute with all
others stay factors.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import sympy

from .splitting import Lacking, Parts, connected, single
from .symbolics import Symbolics

MOST = 16  #: powers


def powers(lacking: Lacking, world: Symbolics, casimirs: Callable[[], Sequence[Any]]) -> tuple[Parts, Lacking]:
    """What has no exact flow as terms that have one, and what is left of it: no polynomials, or too many powers.

    A power of a quadratic Casimir function, which moves nothing, is added where that leaves fewer terms.
    """
    affine = [addend for addend, _ in lacking if all(map(world.bracket.is_affine, world.used(addend)))]
    polynomials = [addend for addend in affine if addend.is_polynomial(*world.variables)]
    if not polynomials:
        return ([], []), lacking
    still = [(addend, reason) for addend, reason in lacking if addend not in polynomials]
    terms, crossing, left = list[Any](), list[Any](), list[tuple[tuple[int, ...], Any]]()
    for monomial, c in sympy.Poly(sympy.Add(*polynomials), *world.variables).terms():
        product = c * _product(monomial, world)
        if len(connected(_links(monomial, world))) == sum(map(bool, monomial)):
            terms.append(product)
        elif sum(monomial) == 2:
            crossing.append(product)
        else:
            left.append((monomial, c))
    for part in _parts(left):
        tried = [_powers(one, world) for one in _shifted(part, world, casimirs())]
        found = tried[min(range(len(tried)), key=lambda n: len(tried[n]))]
        if len(found) <= MOST:
            terms += [c * power for power, c in found.items()]
        else:
            whole = sympy.Add(*(c * _product(monomial, world) for monomial, c in part.items()))
            what = f"'{world.name(whole)}' is a sum of {len(found)} powers of linear functions"
            still.append((whole, f"{what}, and {MOST} are the most"))
    return ([single(term, world) for term in terms if world.used(term)], crossing), still


def _product(monomial: Sequence[int], world: Symbolics) -> Any:
    return sympy.Mul(*(y**n for y, n in zip(world.variables, monomial, strict=True)))


def _links(monomial: Sequence[int], world: Symbolics) -> list[set[int]]:
    """The variables of a monomial, and pairs of them that do not commute."""
    used = [i for i, n in enumerate(monomial) if n]
    pairs = itertools.combinations(used, 2)
    return [{i} for i in used] + [{i, j} for i, j in pairs if not world.bracket.commute(i, j)]


def _parts(left: Sequence[tuple[tuple[int, ...], Any]]) -> Iterator[dict[tuple[int, ...], Any]]:
    """Monomials with their factors, apart by their degree and where they have no variables in common."""
    for degree in sorted({sum(monomial) for monomial, _ in left}):
        of = {monomial: c for monomial, c in left if sum(monomial) == degree}
        for group in connected([i for i, n in enumerate(monomial) if n] for monomial in of):
            yield {m: c for m, c in of.items() if any(m[i] for i in group)}


def _shifted(
    part: dict[tuple[int, ...], Any], world: Symbolics, casimirs: Sequence[Any]
) -> Iterator[dict[tuple[int, ...], Any]]:
    """A homogeneous polynomial, and with multiples of powers of quadratic Casimir functions that take out monomials."""
    yield part
    degree = sum(next(iter(part)))
    if degree % 2:
        return
    for casimir in casimirs:
        if not casimir.is_polynomial(*world.variables):
            continue
        poly = sympy.Poly(casimir, *world.variables)
        if {sum(monomial) for monomial in poly.monoms()} != {2} or len(poly.terms()) ** (degree // 2) > 1000:
            continue
        power = dict((poly ** (degree // 2)).terms())
        for factor in dict.fromkeys(part[m] / power[m] for m in part if m in power):
            sums = {m: sympy.expand(part.get(m, 0) - factor * power.get(m, 0)) for m in {**part, **power}}
            yield {m: c for m, c in sums.items() if c != 0}


def _powers(part: dict[tuple[int, ...], Any], world: Symbolics) -> dict[Any, Any]:
    """A polynomial as product of powers -> factor."""
    found: dict[Any, Any] = {}
    for monomial, c in part.items():
        groups = [_polarised({i: monomial[i] for i in group}, world) for group in connected(_links(monomial, world))]
        for chosen in itertools.product(*groups):
            power = sympy.Mul(*(base**exponent for base, exponent, _ in chosen))
            found[power] = found.get(power, 0) + c * sympy.Mul(*(factor for *_, factor in chosen))
    return {power: c for power, c in found.items() if sympy.expand(c) != 0}


def _polarised(exponents: dict[int, int], world: Symbolics) -> list[tuple[Any, int, Any]]:
    """(linear function, exponent, factor) whose sum of powers is a monomial."""
    d = sum(exponents.values())
    if len(exponents) == 1:
        return [(world.variables[i], d, sympy.Integer(1)) for i in exponents]
    found: dict[Any, Any] = {}
    for v in itertools.product(*(range(s + 1) for s in exponents.values())):
        h = [s - 2 * n for s, n in zip(exponents.values(), v, strict=True)]
        common = math.gcd(*h)
        if not common:
            continue
        common *= next(1 if x > 0 else -1 for x in h if x)
        line = sympy.Add(*(x // common * world.variables[i] for i, x in zip(exponents, h, strict=True)))
        binomials = math.prod(math.comb(s, n) for s, n in zip(exponents.values(), v, strict=True))
        factor = sympy.Rational((-1) ** sum(v) * binomials * common**d, 2**d * math.factorial(d))
        found[line] = found.get(line, 0) + factor
    return [(line, d, c) for line, c in found.items() if c != 0]
