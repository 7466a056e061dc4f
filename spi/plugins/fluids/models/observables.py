"""Functions of a vorticity on the torus by name, as docs/fluids.md writes them: modes, spectrum, enstrophy, fields."""

import functools
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from spi.numerics.arrays import Cos, Sin, of_array
from spi.numerics.types import Array, FunctionFamily, NumberError

from .tables import modes, places, shell


@functools.lru_cache(8)
def observables_of(n: int, tracers: int, particles: int) -> Mapping[str, Callable[[Array], Any] | FunctionFamily]:
    """Observables of the states ((1 + tracers) (N^2 - 1) + 2 particles, ...) of an N by name."""
    named = {
        "omega_re": _real_part,
        "omega_im": _imaginary_part,
        "omega_abs": _modulus,
        "omega": _complex,
        "E": _energy,
    }
    of_places = {"vorticity": _vorticity, "velocity1": _velocity1, "velocity2": _velocity2}
    families = {name: _family(member, name, n, 0) for name, member in (named | of_places).items()}
    for j in range(1, tracers + 1):
        of_tracer = {f"tracer{j}": _vorticity, f"tracer{j}_re": _real_part, f"tracer{j}_im": _imaginary_part}
        families |= {name: _family(member, name, n, j) for name, member in of_tracer.items()}
    if particles:
        families |= {f"x{a + 1}": FunctionFamily(functools.partial(_place_of, a, particles)) for a in (0, 1)}
    return {**families, "enstrophy": functools.partial(_of_part, _squares, n, 0)}


def _family(member: Callable[..., Callable[[Array], Any]], name: str, n: int, part: int) -> FunctionFamily:
    """FunctionFamily of functions of the vorticity, part 0, or of a tracer."""
    return FunctionFamily(lambda *arguments: functools.partial(_of_part, member(n, name, *arguments), n, part))


def _of_part(function: Callable[[Array], Any], n: int, part: int, y: Array) -> Any:
    """Function of one part of states."""
    return function(y[part * (n * n - 1) : (part + 1) * (n * n - 1)])


def _place_of(axis: int, particles: int, *number: Any) -> Callable[[Array], Any]:
    """x_1 or x_2 of a particle by its number, from 1 on; the places stand at the end of states."""
    if len(number) != 1 or number[0] != int(number[0]) or not 1 <= number[0] <= particles:
        raise NumberError(f"x{axis + 1} takes a particle, a whole number from 1 to {particles}")
    i = int(number[0]) - 1 - (2 - axis) * particles
    return lambda y: y[i]


# ---------------------------------------------------------------------------------------------------------------------
# Modes
# ---------------------------------------------------------------------------------------------------------------------


def _place(n: int, name: str, m: tuple[Any, ...]) -> tuple[int, int]:
    """(number of the mode in the state, -1 where omega_m is the complex conjugate of that, else 1)."""
    if len(m) != 2 or any(k != int(k) for k in m):
        raise NumberError(f"{name} takes two whole numbers, as {name}(1,0)")
    mode = int(m[0]), int(m[1])
    if mode not in places(n):
        raise NumberError(f"{name} takes numbers from -{n // 2} to {n // 2}, not both 0")
    return places(n)[mode]


def _real_part(n: int, name: str, *m: Any) -> Callable[[Array], Any]:
    """Re omega_m."""
    i, _ = _place(n, name, m)
    return lambda y: y[2 * i]


def _imaginary_part(n: int, name: str, *m: Any) -> Callable[[Array], Any]:
    """Im omega_m."""
    i, sign = _place(n, name, m)
    return lambda y: sign * y[2 * i + 1]


def _modulus(n: int, name: str, *m: Any) -> Callable[[Array], Any]:
    """|omega_m|."""
    i, _ = _place(n, name, m)
    return lambda y: np.sqrt(np.square(y[2 * i]) + np.square(y[2 * i + 1]))


def _complex(n: int, name: str, *m: Any) -> Callable[[Array], Any]:
    """Error about omega_m, which is no real number."""
    raise NumberError(f"{name} is complex; write {name}_re, {name}_im or {name}_abs")


def _squares(y: Array, some: Any = slice(None), weights: Any = 1.0) -> Any:
    """Sum of |omega_m|^2 times weights over some modes of the state."""
    squares = np.square(y[::2][some]) + np.square(y[1::2][some])
    return (np.reshape(weights, (-1, *[1] * (y.ndim - 1))) * squares).sum(axis=0)


def _energy(n: int, name: str, *k: Any) -> Callable[[Array], Any]:
    """1/2 sum of |omega_m|^2 / |m|^2 over all m of shell k."""
    last = max(map(shell, modes(n)))
    if len(k) != 1 or k[0] != int(k[0]) or not 1 <= k[0] <= last:
        raise NumberError(f"{name} takes a shell, a whole number from 1 to {last}")
    some = [i for i, m in enumerate(modes(n)) if shell(m) == k[0]]
    weights = [1.0 / (a * a + b * b) for a, b in map(modes(n).__getitem__, some)]
    return functools.partial(_squares, some=some, weights=weights)


# ---------------------------------------------------------------------------------------------------------------------
# Fields at a place: sums of 2 Re(g omega_m exp(i m.x)) over the modes of the state, g real or imaginary
# ---------------------------------------------------------------------------------------------------------------------


def _vorticity(n: int, name: str, *x: Any) -> Callable[[Array], Any]:
    cos, sin, _, _ = _waves(n, name, x)
    return _sum_of(2 * cos, -2 * sin)


def _velocity1(n: int, name: str, *x: Any) -> Callable[[Array], Any]:
    """u_1, with i m_2 omega_m / |m|^2; the fluid moves with -u."""
    cos, sin, _, m2 = _waves(n, name, x)
    return _sum_of(-2 * m2 * sin, -2 * m2 * cos)


def _velocity2(n: int, name: str, *x: Any) -> Callable[[Array], Any]:
    """u_2, with -i m_1 omega_m / |m|^2; the fluid moves with -u."""
    cos, sin, m1, _ = _waves(n, name, x)
    return _sum_of(2 * m1 * sin, 2 * m1 * cos)


def _waves(n: int, name: str, x: tuple[Any, ...]) -> tuple[Array, Array, Array, Array]:
    """Cos and sin of m.x, and m_1 and m_2 over |m|^2, of each mode of the state."""
    if len(x) != 2:
        raise NumberError(f"{name} takes a place, as {name}(pi,pi/2)")
    m1, m2 = np.array(modes(n), float).T
    angle, square = m1 * x[0] + m2 * x[1], m1 * m1 + m2 * m2
    return of_array(Cos(), angle), of_array(Sin(), angle), m1 / square, m2 / square


def _sum_of(real: Array, imaginary: Array) -> Callable[[Array], Any]:
    """Sum over the modes of real parts times `real` and imaginary parts times `imaginary`."""
    weights = np.stack([real, imaginary], axis=1).ravel()
    return lambda y: (weights.reshape(-1, *[1] * (y.ndim - 1)) * y).sum(axis=0)
