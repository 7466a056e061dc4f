"""What formulas of a system are: polynomials in the variables, of which degree, and what may be a name in them."""

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from .brackets import Polynomial
from .keys import DefinitionError
from .symbolics import Symbolics
from .text import TAKEN, NumberError, Symbols


def degree_of(value: Any, world: Symbolics) -> int | None:
    """The degree of a homogeneous polynomial; None for another function."""
    if not value.is_polynomial(*world.variables):
        return None
    return sympy.Poly(value, *world.variables).homogeneous_order()


def check_name(name: str, key: str) -> None:
    """DefinitionError if formulas cannot name a parameter or a size so."""
    is_name = name.isidentifier() and name.isascii() and not name.startswith("_")
    if not is_name or name in TAKEN:
        raise DefinitionError(
            "is not a valid name; use letters from a to z and digits, and not the name of a function", key, name
        )


def polynomial(value: Any, formulas: Symbols) -> Polynomial:
    """A polynomial in the variables, as factors by monomial; NumberError if it is none."""
    symbols = list(formulas.variables.values())
    expanded = sympy.expand(value)
    if not expanded.is_polynomial(*symbols):
        raise NumberError("a bracket must be a polynomial in the variables")
    found: Polynomial = {}
    for powers, c in sympy.Poly(expanded, *symbols).terms():
        if c != 0:
            found[tuple(n for n, power in enumerate(powers) for _ in range(power))] = c
    return found


def merged_powers(function: Any) -> Any:
    """A function in which (b - a)^2 is written as (a - b)^2, so that terms which differ by that alone are merged."""

    def turned(power: Any) -> bool:
        even = power.is_Pow and power.exp.is_Integer and power.exp % 2 == 0
        return bool(even and power.base.is_Add and power.base.could_extract_minus_sign())

    return function.replace(turned, lambda power: (-power.base) ** power.exp)


def shortened(text: Any) -> str:
    """At most 60 characters of a text."""
    text = str(text)
    return text if len(text) <= 60 else f"{text[:57]}..."


def check_finite(functions: Sequence[Any], world: Symbolics, constants: Mapping[Any, Any]) -> None:
    """DefinitionError if the parameters make one of some Hamiltonians infinite or complex everywhere."""
    for function in functions:
        for y in world.used(function):
            derivative = sympy.diff(function, world.variables[y])
            for factor in derivative.atoms(sympy.Pow):
                if not factor.exp.is_negative or factor.free_symbols & set(world.variables):
                    continue
                value = factor.base.xreplace(world.parameters).xreplace(constants)
                if value == 0:
                    name = next((str(s) for s in sorted(factor.base.free_symbols, key=str)), "")
                    raise DefinitionError(
                        f"makes the Hamiltonian infinite, '{world.name(factor.base)}' is 0; take another value",
                        *(
                            ["parameters", name]
                            if any(name == str(symbol) for symbol in world.parameters)
                            else ["hamiltonian"]
                        ),
                    )
        if function.xreplace(dict(world.parameters)).has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
            name = world.name(function)
            what = f"has no finite real value at these parameters: '{shortened(name)}'"
            raise DefinitionError(f"{what}; take others", "parameters")
