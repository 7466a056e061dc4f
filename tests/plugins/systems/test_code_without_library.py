"""The code of generated models calls no function of the C library: its last digits are other ones elsewhere."""

import ast
import re

import numpy as np
import pytest
from helpers import COMPILED
from numba import njit
from test_no_library import LIBRARY, library_calls
from yaml_cases import definition

from spi.compiler.dispatch import OPTIONS
from spi.compiler.inlining import TO_RUN
from spi.ensemble.protocol import drift_gradient, hamiltonian
from spi.plugins.systems import generated as systems

#: Every function that formulas have, in H.
ALL = """
    bracket: {q p: 1}
    variables: [q, p]
    parameters: {a: 1.3}
    hamiltonian: p^2/2 + sin(q) + cos(2*q) + tan(q/5) + sinh(q) + cosh(q) + tanh(q) + atan(q) + exp(q) + log(2 + q^2)
      + (1 + q^2)^a + sqrt(1 + q^2) + abs(q) + max(q, p)
    noises: [sin(q)]
"""


def generated():
    return systems.made(definition(ALL), "all_functions")


def test_generated_models_name_no_function_of_the_library():
    names = set(re.findall(r"\bnp\.(\w+)", generated().text))
    assert names <= {"sqrt", "nan"}, names
    assert not library_calls(ast.parse(generated().text))


def value_and_slope(model, y, out):
    out[0] = hamiltonian(model, (y[0], y[1]))
    gradient = drift_gradient(model, (y[0], y[1]))
    out[1], out[2] = gradient[0], gradient[1]


def of_the_library(x, out):
    out[0] = np.exp(x) + np.tanh(x) + np.power(x, 1.3)


def called(function, *arguments):
    """The functions of the library among the symbols of a kernel, compiled anew because the cache has no symbols."""
    compiled = njit(**OPTIONS, **TO_RUN)(function)
    compiled(*arguments)
    return set(re.findall(r"[A-Za-z_]\w*", "".join(compiled.inspect_asm().values()))) & LIBRARY


@pytest.mark.skipif(not COMPILED, reason="about the compiler")
def test_the_code_of_a_generated_model_calls_no_function_of_the_library():
    """H and its gradient; those of NumPy in a kernel are noticed."""
    model = systems.record(generated())
    out, y = np.empty(3), np.array([0.3, -0.7])
    assert not called(value_and_slope, model, y, out)
    assert called(of_the_library, 0.3, np.empty(1)) == {"exp", "tanh", "pow"}
    q, p = y
    value = p**2 / 2 + np.sin(q) + np.cos(2 * q) + np.tan(q / 5) + np.sinh(q) + np.cosh(q) + np.tanh(q) + np.arctan(q)
    value += np.exp(q) + np.log(2 + q**2) + (1 + q**2) ** 1.3 + np.sqrt(1 + q**2) + abs(q) + max(q, p)
    assert out[0] == pytest.approx(value, rel=1e-14)
