"""Current of energy of a system in YAML whose H is a sum of terms that stand at places, such as bonds of a ring.

The place of a term is the mean of the indices of its variables: of x(3) 3, of x(3)*x(4) 7/2.  With e_a the sum of the
terms at place x_a the current is the time derivative of the sum of x_a e_a, along a ring the way round it:

    J = sum over a < b of (x_a - x_b) {e_a, e_b}

A power or another function of a sum, such as (x(4) - x(3))^2, is one term, and products are multiplied out only where
the parts lie closer together.  Sums within a term are evaluated first: expanded, a difference of large numbers would
lose its digits.
"""

import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import sympy

from .brackets import Symbolics
from .definition import Reader

_INDEX = re.compile(r".*\((\d+)\)")


def energy_current(data: Mapping[str, Any]) -> Callable[[np.ndarray], np.ndarray] | None:
    """J of states (d, ...); None where variables have no index, H depends on time or terms have no places."""
    reader = Reader(data)
    world, formulas = reader.symbols()
    indices = [_INDEX.fullmatch(name) for name in world.bracket.variables]
    if not all(indices):
        return None
    index = [int(match[1]) for match in indices if match]
    length, place_of = max(index) - min(index) + 1, dict(zip(world.variables, index, strict=True))
    terms = defaultdict[float, list[Any]](list)
    for term, at in _placed(reader.hamiltonian(world, formulas), place_of, length):
        if at and max(at) - min(at) >= length / 2:
            return None
        if at:
            terms[sum(at) / len(at) % length].append(term)
    sums = _Sums(world, {}, {})
    gradients = {x: sums.gradient(sympy.Add(*map(sums.named, of))) for x, of in terms.items()}
    return _as_function(_current(gradients, world, length), sums)


def _current(gradients: Mapping[float, dict[int, Any]], world: Symbolics, length: int) -> Any:
    """Sum of (x - x') {h_x, h_x'} over pairs of places x < x', by the gradients of the terms h_x there."""
    current = sympy.Integer(0)
    for other, gradient in gradients.items():
        rates = {i: world.factor(i) * rate for i, rate in world.rates(gradient).items()}
        for x in (x for x in gradients if x < other):
            shared = sorted(rates.keys() & gradients[x].keys())
            bracket = sympy.Add(*(gradients[x][i] * rates[i] for i in shared))
            current += sympy.Rational(2 * _way(x - other, length)) / 2 * bracket
    return current


def _as_function(current: Any, sums: "_Sums") -> Callable[[np.ndarray], np.ndarray]:
    """An expression with symbols for sums as a function of states (d, ...)."""
    world = sums.world
    values, symbols, steps = dict(world.parameters), list(world.variables), []
    for total, symbol in sums.symbols.items():  # each may name those before it
        steps.append(sympy.lambdify(symbols, total.xreplace(values), "numpy"))
        symbols = [*symbols, symbol]
    function = sympy.lambdify(symbols, current.xreplace(values), "numpy", cse=True)

    def of_states(states: np.ndarray) -> np.ndarray:
        known = list(states)
        for step in steps:
            known.append(step(*known))
        return np.broadcast_to(np.asarray(function(*known), float), np.shape(states)[1:])

    return of_states


def _nearest(places: Sequence[int], length: int) -> list[float]:
    """Places the nearest way around the ring from the first of them."""
    return [places[0] + _way(x - places[0], length) for x in sorted(set(places))]


def _placed(e: Any, place_of: Mapping[Any, int], length: int) -> list[tuple[Any, list[float]]]:
    """Terms of a sum with the places of their variables, the nearest way around the ring from the first."""
    if e.is_Add:
        return [pair for term in e.args for pair in _placed(term, place_of, length)]
    nearest = _nearest([place_of[symbol] for symbol in place_of if symbol in e.free_symbols], length)
    for factor in e.args if e.is_Mul else ():
        if not factor.is_Add:
            continue
        others = sympy.Mul(*(other for other in e.args if other != factor))
        parts = [pair for part in factor.args for pair in _placed(others * part, place_of, length)]
        if not others.free_symbols & place_of.keys() or max(map(_reach, parts)) < _reach((e, nearest)):
            return parts
    return [(e, nearest)]


def _reach(placed: tuple[Any, list[float]]) -> float:
    return max(placed[1], default=0.0) - min(placed[1], default=0.0)


class _Sums(NamedTuple):
    """Symbols for the sums within terms, each with its gradient."""

    world: Symbolics
    symbols: dict[Any, Any]  #: sum, in earlier symbols -> symbol
    gradients: dict[Any, dict[int, Any]]  #: symbol -> derivatives by component

    def named(self, e: Any) -> Any:
        """A term with symbols in place of the sums of variables in it."""
        if not self.world.used(e) or not e.args:
            return e
        inside = e.func(*map(self.named, e.args))
        if not inside.is_Add:
            return inside
        if inside not in self.symbols:
            symbol = sympy.Symbol(f"σ{len(self.symbols)}", real=True)
            self.symbols[inside], self.gradients[symbol] = symbol, self.gradient(inside)
        return self.symbols[inside]

    def gradient(self, e: Any) -> dict[int, Any]:
        """Derivatives by component of a term with such symbols, which are not 0."""
        found: dict[int, Any] = {}
        own = {y: {i: sympy.Integer(1)} for i, y in enumerate(self.world.variables)} | self.gradients
        for symbol in sorted(e.free_symbols & own.keys(), key=str):
            for i, inner in own[symbol].items():
                found[i] = found.get(i, 0) + sympy.diff(e, symbol) * inner
        return {i: slope for i, slope in sorted(found.items()) if slope != 0}


def _way(difference: float, length: int) -> float:
    """Shorter way around a ring."""
    return (difference + length / 2) % length - length / 2
