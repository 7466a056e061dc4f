"""Initial vorticity on the torus, under the key ``initial``: as modes, as an expression, at random, or on a grid.

    initial: {modes: {"1,0": 0.1+0.3i, "2,-1": 0.2}}
    initial: {vorticity: "cos(x1) + cos(x2)"}
    initial: {random: {spectrum: "k^4*exp(-k^2/18)", energy: 1, seed: 1}}
    initial: {file: field.npy}

What stands there becomes the numbers of the state, which decide results.
"""

import functools
import re
from typing import Annotated, Any

import numpy as np
import pydantic
from annotated_types import MinLen

from spi.ensemble.protocol import Positive, geometry
from spi.expressions import as_numpy, parse_expression
from spi.expressions.arithmetic import NumberError, parse
from spi.plugins.fluids.models import fields
from spi.plugins.fluids.models.tables import places
from spi.specs.files import Files
from spi.specs.keys import ABSENT, Keys, Seed, condition, entries_in, key_of, shown, wrong

_MODE = re.compile(r"\s*([+-]?[0-9]{1,6})\s*,\s*([+-]?[0-9]{1,6})\s*")
_FIELDS = ("modes", "vorticity", "random")
_POINTS_A_MODE = 4  # and more: of the grid on which a field is sampled, along each side and for each of N


class Random(Keys):
    """A random vorticity."""

    spectrum: key_of(str, "energy of shell k up to a factor, an expression in k such as k^4*exp(-k^2/18)")
    energy: key_of(Positive, "H of the state") = 1.0
    seed: key_of(Seed, "seed of the random phases and amplitudes") = 1


class Cloud(Keys):
    """Places of particles at random, independent and uniform, on the whole torus or in a disc."""

    centre: key_of(tuple[float, float] | None, "centre of the disc") = None
    radius: key_of(Positive | None, "radius of the disc") = None
    seed: key_of(Seed, "seed of the places") = 1

    @condition
    def _check_both(self) -> None:
        if (self.centre is None) != (self.radius is None):
            raise wrong("has one of centre and radius", "give both, or none for the whole torus")


class Vorticity(Keys):
    """An initial vorticity on the torus, given in one of three ways."""

    modes: key_of(
        Annotated[dict[str, Any], MinLen(1)], 'modes that are not 0, as in {"1,0": 0.1+0.3i, "2,-1": 0.2}'
    ) = ABSENT
    vorticity: key_of(str, "an expression in x1 and x2, which go from 0 to 2*pi") = ABSENT
    random: key_of(Random, "a random field of a given energy spectrum") = ABSENT
    subtract_mean: key_of(pydantic.StrictBool, "subtract the mean of the vorticity") = False
    tracers: key_of(
        tuple[str, ...],
        "an expression in x1 and x2 for each passive tracer; its mean, which nothing moves, is left out",
    ) = ()
    particles: key_of(tuple[tuple[float, float], ...], "places of particles, as [[1, 2], [pi, pi/2]]") = ()
    cloud: key_of(Cloud, "places of particles at random, instead of particles") = ABSENT

    @condition
    def _check_one(self) -> None:
        given = [key for key in _FIELDS if key in self.model_fields_set]
        if len(given) > 1:
            raise wrong(f"has {' and '.join(given)}", f"must have one of {', '.join(_FIELDS)}")
        if "subtract_mean" in self.model_fields_set and given != ["vorticity"]:
            raise wrong(f"stands beside {given[0]}", "leave it out, it is for vorticity", "subtract_mean")

    def state(self, model: Any, files: Files) -> tuple[float, ...]:
        """State of a model of vorticity; raises the error about the key that is wrong."""
        n = fields.lattice_of(model)
        if n is None:
            right = "must be a list, a number per component, or have file"
            raise wrong("is a vorticity, which is for sine_euler and zeitlin", right)
        _check_count(model, "tracers", self.tracers)
        each = [_of_field(text, True, n, ("tracers", i)) for i, text in enumerate(self.tracers)]
        return sum(each, self._vorticity(n)) + self._places(model)

    def _places(self, model: Any) -> tuple[float, ...]:
        """x_1 of all particles, and x_2 of all."""
        if self.cloud is None:
            _check_count(model, "particles", self.particles)
            return sum(zip(*self.particles, strict=True), ())
        if not (count := geometry(model).get("particles", 0)):
            raise wrong("is for a model with particles", "leave it out", "cloud")
        if self.particles:
            raise wrong("stands beside particles", "leave one of them out", "cloud")
        return fields.random_places(count, self.cloud.centre, self.cloud.radius, self.cloud.seed)

    def _vorticity(self, n: int) -> tuple[float, ...]:
        """The first components."""
        if self.modes is not None:
            return _of_modes(self.modes, n)
        if self.random is not None:
            return _at_random(self.random.spectrum, self.random.energy, self.random.seed, n)
        return _of_field(self.vorticity, self.subtract_mean, n)


def _check_count(model: Any, key: str, given: tuple[Any, ...]) -> None:
    """Error about a key that has not an entry for each tracer, or particle, of the model."""
    if len(given) != (wanted := geometry(model).get(key, 0)):
        right = f"must have {entries_in(wanted)}, one for each of the model" if wanted else "leave it out"
        raise wrong(f"has {entries_in(len(given))}", right, key)


def of_grid(model: Any, values: np.ndarray, subtract_mean: bool) -> tuple[float, ...]:
    """State that is nearest to the vorticity with these values on a grid, which stand in a file."""
    n: Any = fields.lattice_of(model)
    if carried := next((key for key in ("tracers", "particles") if geometry(model).get(key)), ""):
        right = "give all components in one dimension, as np.concatenate of spi.fluid.state of each"
        raise wrong(f"is a vorticity, and the model has {carried}", right, "file")
    if values.ndim != 2 or values.shape[0] != values.shape[1] or len(values) < n:
        shape = " x ".join(map(str, values.shape))
        right = f"must have as many columns as rows, at least {n}; or one dimension"
        raise wrong(f"is a vorticity on {shape} points", right, "file")
    return _of_samples(values, subtract_mean, n, "file")


def _of_modes(given: dict[str, Any], n: int) -> tuple[float, ...]:
    """State in which all modes but the given ones are 0."""
    y, lattice = np.zeros(n * n - 1), places(n)
    written: dict[int, str] = {}
    for key, value in given.items():
        if not (match := _MODE.fullmatch(key)):
            raise wrong("is not a mode", 'must be two whole numbers, as in "2,-1"', "modes", key)
        mode = int(match[1]), int(match[2])
        if mode == (0, 0):
            raise wrong("is the mean, which is 0", "leave it out", "modes", key)
        if mode not in lattice:
            right = f"both numbers must be between -{n // 2} and {n // 2}"
            raise wrong(f"is not a mode of the lattice modulo {n}", right, "modes", key)
        place, sign = lattice[mode]
        if place in written:
            fault = f"is given twice, also as {shown(written[place])}"
            raise wrong(fault, "remove one, since -m has the complex conjugate of m", "modes", key)
        written[place] = key
        omega = _complex(value, key)
        y[2 * place : 2 * place + 2] = omega.real, sign * omega.imag
    return tuple(y.tolist())


def _complex(value: Any, key: str) -> complex:
    """Number that stands under the name of a mode."""
    reason = ""
    if isinstance(value, str):
        try:
            return complex(parse(value))
        except NumberError as error:
            reason = f" ({error})"
    raise wrong(f"is {shown(value)}{reason}", "must be a number such as 0.2 or 0.1+0.3i", "modes", key)


@functools.lru_cache(maxsize=16)
def _of_field(
    text: str, subtract_mean: bool, n: int, keys: tuple[str | int, ...] = ("vorticity",)
) -> tuple[float, ...]:
    """State that is nearest to a vorticity, sampled on a grid; kept, as all profiles of a file are read."""
    points = 1 << (_POINTS_A_MODE * n - 1).bit_length()
    x = 2 * np.pi * np.arange(points) / points
    right = "must be an expression in x1 and x2 such as sin(x1)*cos(2*x2)"
    values = _values(text, ("x1", "x2"), np.stack(np.meshgrid(x, x, indexing="ij")), right, *keys)
    return _of_samples(values, subtract_mean, n, *keys)


def _of_samples(values: np.ndarray, subtract_mean: bool, n: int, *keys: str | int) -> tuple[float, ...]:
    """State that is nearest to a vorticity on a grid, which stands under the `keys`."""
    mean, largest = float(values.mean()), float(np.abs(values).max())
    if subtract_mean:
        values = values - mean
    elif abs(mean) > fields.mean_rounding(values) * largest:
        fault = f"has the mean {mean:.12g}, which must be 0 on the torus"
        raise wrong(fault, "subtract it, or add subtract_mean: true", *keys)
    return tuple(fields.projected(values, n).tolist())


@functools.lru_cache(maxsize=16)
def _at_random(text: str, energy: float, seed: int, n: int) -> tuple[float, ...]:
    """A random state; kept as well."""
    k = np.arange(1.0, fields.shells_of(n).max() + 1)
    right = "must be an expression in k such as k^4*exp(-k^2/18)"
    spectrum = _values(text, ("k",), k[None], right, "random", "spectrum")
    where = None
    if (spectrum < 0).any():
        where = f"negative for k = {k[np.argmin(spectrum)]:.0f}"
    elif not spectrum.any():
        where = f"0 for k = 1 to {len(k)}"
    if where:
        right = "energies must not be negative, nor 0 in all shells"
        raise wrong(f"is {shown(text)}, which is {where}", right, "random", "spectrum")
    return tuple(fields.random_state(n, spectrum, energy, seed).tolist())


def _values(text: str, names: tuple[str, ...], points: np.ndarray, right: str, *keys: str | int) -> np.ndarray:
    """Values of an expression in some names at points (names, ...), all of them finite."""
    try:
        if other := re.search(r"\b[yY][0-9]+\b", text):  # the names of components of states
            raise NumberError(f"unknown word '{other[0]}'")
        tree = parse_expression(text, len(names), names)
    except NumberError as error:
        raise wrong(f"is {shown(text)} ({error})", right, *keys) from None
    values = as_numpy(tree)(points)
    if not np.isfinite(values).all():
        first = np.unravel_index(np.argmin(np.isfinite(values)), values.shape)
        where = ", ".join(f"{name} = {x[first]:.6g}" for name, x in zip(names, points, strict=True))
        raise wrong(f"is {shown(text)}, which is not finite at {where}", "must be finite everywhere", *keys)
    return values
