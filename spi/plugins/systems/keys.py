"""Keys of a definition, and the error about one; without the heavy imports of their readers."""

from types import MappingProxyType
from typing import Any

#: Names that generated modules use for other things than their class.
USED = (
    *("Annotated", "NamedTuple", "NonNegative", "described", "device", "exp", "expm1", "larger", "log", "np"),
    *("sin_versine", "sinh_coshm1", "times"),
)
KEYS = MappingProxyType(
    {
        "algebra": "name of a Lie algebra, such as so(3), se(3), so(2,1), so(3)^n",
        "bracket": "brackets of the variables, as in {P1 P2: -P3}; those not given are 0",
        "variables": "names of the components of the state",
        "sizes": "whole numbers for ranges, as in {n: 4}",
        "parameters": "numbers that formulas name, as in {I1: 2}",
        "hamiltonian": "H, a formula in variables, parameters and the time t",
        "pieces": "H as a list of pieces, in the order of their flows; found by the program if left out",
        "noises": "a list of Hamiltonians of the noises",
        "initial_time": "the time t at the beginning, where formulas name it; 0 if left out",
        "inner": "how compositions move by terms that have no exact flow, midpoint or munthe_kaas",
        "casimirs": "a list of Casimir functions; polynomials up to degree 4 are found if left out",
    }
)


class DefinitionError(ValueError):
    """The definition has a mistake; `keys` lead to its place."""

    def __init__(self, message: str, *keys: Any) -> None:
        super().__init__(message)
        self.keys = keys
