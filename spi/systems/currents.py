"""The current of energy of a system in YAML whose H is a sum of terms that stand at places, such as bonds of a ring.

The place of a term is the mean of the indices of its variables: of x(3) 3, of x(3)*x(4) 7/2.  With e_a the sum of the
terms at place x_a the current is the time derivative of the sum of x_a e_a, along a ring the way round it:

    J = sum over a < b of (x_a - x_b) {e_a, e_b}
"""

import itertools
import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import sympy

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
    terms = defaultdict[float, Any](lambda: sympy.Integer(0))
    for term in sympy.Add.make_args(sympy.expand(reader.hamiltonian(world, formulas))):
        at = [place_of[world.variables[i]] for i in world.used(term)]
        nearest = [at[0] + _way(x - at[0], length) for x in sorted(set(at))] if at else []
        if nearest and max(nearest) - min(nearest) >= length / 2:
            return None
        if nearest:
            terms[sum(nearest) / len(nearest) % length] += term
    fields = {x: world.field(e) for x, e in terms.items()}
    current = sympy.Integer(0)
    for (x, e), (other, field) in itertools.product(terms.items(), fields.items()):
        if x < other and (shared := field.keys() & {*world.used(e)}):
            bracket = sympy.Add(*(sympy.diff(e, world.variables[i]) * field[i] for i in sorted(shared)))
            current += sympy.Rational(2 * _way(x - other, length)) / 2 * bracket
    function = sympy.lambdify(world.variables, current.xreplace(dict(world.parameters)), "numpy", cse=True)
    return lambda states: np.broadcast_to(np.asarray(function(*states), float), np.shape(states)[1:])


def _way(difference: float, length: int) -> float:
    """The shorter way around a ring."""
    return (difference + length / 2) % length - length / 2
