"""Kernels call no function of the C library: its last digits are other ones on other systems."""

import ast
from pathlib import Path

import spi

PACKAGE = Path(spi.__file__).parent

#: The names of functions of the C library, and of NumPy's own vectors; sqrt, floor and the like are exact anywhere.
LIBRARY = {"exp", "exp2", "expm1", "log", "log2", "log10", "log1p", "power", "pow", "sin", "cos", "tan", "arcsin"}
LIBRARY |= {"arccos", "arctan", "arctan2", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh", "hypot", "cbrt"}
LIBRARY |= {"asin", "acos", "atan", "atan2", "asinh", "acosh", "atanh", "erf", "erfc", "gamma", "lgamma", "float_power"}

#: (file, function) -> why it may: each runs in Python alone, before or after kernels.
ALLOWED = {
    ("ensemble/increments.py", "clipped_variance"): "a factor of increments, rounded to 40 bits",
    ("ensemble/loop.py", "nested_grid"): "the whole number of doublings of a step",
    ("ensemble/observer.py", "path_observer"): "the size of a state, of which errors are shares",
    ("plugins/spins/models/observables.py", "_angles"): "angles of triangles of spins, for a report",
    ("plugins/fluids/models/fields.py", "*"): "the order and the lengths of modes, of fields in figures",
    ("plugins/fluids/models/kernels.py", "*"): "the lengths of modes of noises",
    ("plugins/fluids/models/tables.py", "*"): "tables of cosines",
    ("numerics/arrays.py", "*"): "where there is no compiler",
    ("plugins/drivers/ensemble/drivers.py", "_coefficients"): "the weights of a step of the Ornstein-Uhlenbeck process",
    ("plugins/drivers/ensemble/drivers.py", "circulant"): "covariances of increments, for NumPy's Fourier transform",
}


def library_calls(tree: ast.AST):
    """(function in which it stands, name) of each function of the library that a module names."""

    def walk(node, inside):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            inside = node.name
        named = isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name)
        if named and node.value.id in ("np", "numpy", "math", "cmath") and node.attr in LIBRARY:
            yield inside, node.attr
        for child in ast.iter_child_nodes(node):
            yield from walk(child, inside)

    return [*walk(tree, "")]


def test_kernels_name_no_function_of_the_library():
    """In the sources of kernels only what runs in Python alone does, each place with a reason; none is left over."""
    used = set()
    for file in spi.kernel_sources():
        for function, name in library_calls(ast.parse((PACKAGE / file).read_text(encoding="utf-8"))):
            place = next(((file.as_posix(), f) for f in (function, "*") if (file.as_posix(), f) in ALLOWED), None)
            assert place, f"{file}: {function} calls {name}, whose last digits differ between systems"
            used.add(place)
    assert used == {place for place in ALLOWED if (PACKAGE / place[0]).exists()}  # plug-ins may be left out


def test_a_call_is_noticed():
    assert library_calls(ast.parse("import numpy as np\ndef f(x):\n    return np.sqrt(np.exp(x))")) == [("f", "exp")]
