"""Elementary functions of arrays, by the formulas of ``elementary.py``.

NumPy chooses its own by the vectors of the processor, and they differ in the last digits.  Test functions use these,
so that means over paths are equal to the last bit on all processors with fused operations.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import calling, kernel, method
from ..compiler.inlining import is_compiling
from . import elementary, functions


@method
def value(function, x):
    """Value of an elementary function at a float."""


@method(default=True)
def far_value(function, x):
    """Value at a float where :func:`value` is not accurate, beyond 1.6e6."""
    return value(function, x)


class Sin(NamedTuple):
    """sin x."""

    of_numpy = np.sin

    def value(function, x):
        return elementary.sin_cos(x)[0]

    far_value = calling(functions.sine, "function")


class Cos(NamedTuple):
    """cos x."""

    of_numpy = np.cos

    def value(function, x):
        return elementary.sin_cos(x)[1]

    far_value = calling(functions.cosine, "function")


class Tan(NamedTuple):
    """tan x."""

    of_numpy = np.tan

    def value(function, x):
        sine, cosine = elementary.sin_cos(x)
        return sine / cosine

    far_value = calling(functions.tangent, "function")


class Tanh(NamedTuple):
    """tanh x = (e^(2 |x|) - 1) / (e^(2 |x|) + 1) with the sign of x; 1 beyond 20."""

    of_numpy = np.tanh

    def value(function, x):
        double = 2.0 * abs(x)
        rest = elementary.expm1(40.0 if double > 40.0 else double)
        return np.copysign(rest / (rest + 2.0), x)


class Exp(NamedTuple):
    """e^x."""

    of_numpy = np.exp

    value = calling(elementary.exp, "function")


class Log(NamedTuple):
    """ln x."""

    of_numpy = np.log

    value = calling(elementary.log, "function")


_OF_ANGLES = (Sin, Cos, Tan)


@kernel
def fill(function, x, values):
    """values[i] = function(x[i])."""
    for i in range(x.size):
        values[i] = value(function, x[i])


@kernel
def fill_far(function, x, values):
    """values[i] = function(x[i]) where x[i] is beyond 1.6e6."""
    for i in range(x.size):
        if abs(x[i]) > elementary.REDUCIBLE:
            values[i] = far_value(function, x[i])


@kernel
def fill_powers(x, exponents, values):
    """values[i] = x[i]^exponents[i]."""
    for i in range(x.size):
        values[i] = functions.power(x[i], exponents[i])


def of_array(function, x):
    """A function of this module of an array of any shape."""
    x = np.ascontiguousarray(x, float)
    if not is_compiling():
        return function.of_numpy(x)
    values = np.empty_like(x)
    fill(function, x.reshape(-1), values.reshape(-1))
    if isinstance(function, _OF_ANGLES) and (np.abs(x) > elementary.REDUCIBLE).any():
        fill_far(function, x.reshape(-1), values.reshape(-1))
    return values


def power(x, exponents):
    """x^e of arrays whose shapes go together."""
    if not is_compiling():
        return np.power(x, exponents)
    x, exponents = np.broadcast_arrays(np.asarray(x, float), np.asarray(exponents, float))
    values = np.empty(x.shape)
    fill_powers(np.ascontiguousarray(x).reshape(-1), np.ascontiguousarray(exponents).reshape(-1), values.reshape(-1))
    return values


def log(x):
    """ln x of an array of any shape."""
    return of_array(Log(), x)


def exp(x):
    """e^x of an array of any shape."""
    return of_array(Exp(), x)


def whole_power(x, exponent):
    """x^n for an array and n = 1, 2, 3, ..., by squares and products."""
    if exponent == 1:
        return x
    half = whole_power(x, exponent // 2)
    return half * half * x if exponent % 2 else half * half


def runge_kutta(field, y, h, steps):
    """State y after `steps` steps h of the classical Runge-Kutta method of order 4 for y' = field(y)."""
    for _ in range(steps):
        a = field(y)
        b = field(y + 0.5 * h * a)
        c = field(y + 0.5 * h * b)
        y = y + h / 6 * (a + 2 * b + 2 * c + field(y + h * c))
    return y
