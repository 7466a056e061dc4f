"""Test functions phi of weak errors: expressions in the state such as ``sin(2*pi*y1) + y2^2``.

The grammar is that of ``arithmetic.py`` with the words y1, ..., yd for the components of the state, and tanh.  An
expression is a tree of records; parts without y are one constant: ``2*pi*y1`` is one product.  NumPy evaluates it for
arrays of states.  Overflow gives inf and undefined values are NaN, but there is never an exception.
"""

from .trees import Constant, as_numpy, canonical, functions_of, is_constant, is_step, parse_expression, range_of

__all__ = [
    "Constant",
    "as_numpy",
    "canonical",
    "functions_of",
    "is_constant",
    "is_step",
    "parse_expression",
    "range_of",
]
