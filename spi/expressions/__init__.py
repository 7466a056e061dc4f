"""Test functions phi of weak errors: expressions in the state such as ``sin(2*pi*y1) + y2^2``.

The grammar is that of ``arithmetic.py`` with the words y1, ..., yd for the components of the state, and tanh.  An
expression is a tree of records, so that the compiler knows its shape by its type; constants are run-time values, and
another constant compiles nothing anew.  Parts without y are one constant: ``2*pi*y1`` is one product.

In compiled code the whole tree is written out as one function.  Sines, cosines, exponentials, logarithms, roots and
powers up to 15 are vector instructions; tan, tanh and other powers are library calls.  Overflow gives inf and what has
no value gives NaN, as everywhere in NumPy, but never an exception.
"""

from .trees import Constant, canonical, is_constant, parse_expression
from .values import as_numpy, evaluate, evaluate_lanes, functions_of, value_and_angle

__all__ = [
    "Constant",
    "as_numpy",
    "canonical",
    "evaluate",
    "evaluate_lanes",
    "functions_of",
    "is_constant",
    "parse_expression",
    "value_and_angle",
]
