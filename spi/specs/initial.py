"""The key ``initial``: numbers, those of a file, or a vorticity on the torus as modes, an expression or at random.

    initial: [cos(1.1), 0, sin(1.1)]
    initial: {file: field.npy}
    initial: {modes: {"1,0": 0.1+0.3i, "2,-1": 0.2}}
    initial: {vorticity: "cos(x1) + cos(x2)"}
    initial: {random: {spectrum: "k^4*exp(-k^2/18)", energy: 1, seed: 1}}

Whatever stands there becomes the numbers of the state at once, and these are what decides results.  A law by which each
path has a state of its own, ``initial: {law: gaussian, ...}``: see the laws below.
"""

import functools
import hashlib
import math
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Annotated, Any, Literal, cast

import numpy as np
import pydantic
from annotated_types import Ge, Le, MinLen

from ..ensemble.long_states import LONG, LongState, state_of
from ..ensemble.protocol import (
    NonNegative,
    Positive,
    component_names,
    dimension,
    large,
    named_numbers,
    populations,
)
from ..ensemble.random_states import Gaussian, Gibbs, Listed, LongRandomState, RandomState, Spheres, Uniform
from ..exact.surfaces import least_on, quadratic, spheres
from ..expressions import as_numpy, parse_expression
from ..expressions.arithmetic import NumberError, parse
from ..expressions.ranges import has_range, without_ranges
from ..models.delegation import undamped
from ..models.spins import Spins
from ..models.spins.whole import Sampled
from ..models.zeitlin import fields
from ..models.zeitlin.tables import places
from .files import Files, array_in, check_finite, content, unpacked
from .keys import ABSENT, Keys, Seed, State, condition, entries_in, key_of, one_of, quantity, shown, wrong

# ---------------------------------------------------------------------------------------------------------------------
# Laws of initial states, of which each path has its own.
#
# initial: {law: uniform_on_surface, through: [0, 0, 1]}
# initial: {law: gibbs, through: [0, 0, 1], temperature: 0.2}
# initial: {law: gaussian, mean: [0, 0, 1], sd: 0.1, project: true}
# initial: {law: points, file: states.csv}
# ---------------------------------------------------------------------------------------------------------------------

LEAST_ACCEPTANCE = 1e-3  #: of the attempts at a state, with which a law is still drawn
_SWEEPS = 1000  # of lattices of spins
_TRIALS = 2**16  # states by which it is estimated
#: Numbers in a file of states, weights included; a number takes at most 32 bytes, in CSV with its comma 26.
_MOST_NUMBERS = 2**20
_POINTS = "give states of your own by law: points, from a CSV file or an .npz of numpy.savez"
_MATRIX = tuple[tuple[float, ...], ...]

_Through = key_of(State, "a state on the Casimir surface")


class OnSurface(Keys):
    """Uniform on a Casimir surface."""

    law: Literal["uniform_on_surface"]
    through: _Through

    def state(self, model: Any, files: Files) -> RandomState:
        """A typical state, and the law."""
        surface = _surface(model, self.through, "through")
        return RandomState(surface.typical, Uniform(surface), self.model_dump())


class OfGibbs(Keys):
    """Density exp(-H/T) on a Casimir surface."""

    law: Literal["gibbs"]
    through: key_of(State, "a state on the Casimir surface; not for the model spins") = ABSENT
    temperature: key_of(float, "T in the density exp(-H/T); may be negative", "energy")
    sweeps: key_of(
        Annotated[int, Ge(1), Le(10**7)], "of the model spins: sweeps over the lattice by which a state is drawn"
    ) = ABSENT

    def state(self, model: Any, files: Files) -> Any:
        """A typical state, and the law."""
        if not self.temperature:
            raise wrong("is 0", "must not be", "temperature")
        own, other = ("sweeps", "through") if isinstance(model, Spins) else ("through", "sweeps")
        if other in self.model_fields_set:
            raise wrong(f"is not for the model {type(model).__qualname__}", f"leave it out, or give {own}", other)
        if isinstance(model, Spins):
            sampled = Sampled(model, self.temperature, self.sweeps or _SWEEPS)
            start = sampled.states(np.random.default_rng(1).standard_normal((sampled.numbers, 1)))[:, 0]
            given = self.model_dump(exclude={"through"}) | {"sweeps": sampled.sweeps}
            if len(start) > LONG:
                return LongRandomState(start, sampled, given)
            return RandomState(tuple(start.tolist()), sampled, given)
        if self.through is None:
            raise wrong("missing key 'through'", "add through: a state on the Casimir surface", "through")
        surface = _surface(model, self.through, "through")
        polynomial = quadratic(model)
        if polynomial is None:
            right = "draw states elsewhere, and give them by law: points"
            raise wrong("is 'gibbs', which is drawn where H is a quadratic polynomial", right, "law")
        _, b, matrix = (part / self.temperature for part in polynomial)
        terms: list[tuple] = [(i, float(c)) for i, c in enumerate(b) if c]
        for i, j in np.argwhere(np.triu(matrix)).tolist():
            terms.append((i, j, float(matrix[i, j] if i < j else 0.5 * matrix[i, i])))
        law = Gibbs(surface, tuple(terms), least_on(surface, b, matrix))
        rate = float(np.exp(law.least - law.energy(_trials(surface))).mean())
        if rate < LEAST_ACCEPTANCE:
            fault = (
                f"is {quantity(self.temperature)}, at which about {rate:.1g} of the attempts at a state are accepted"
            )
            right = f"must be so far from 0 that {LEAST_ACCEPTANCE:g} are; or give states of your own by law: points"
            raise wrong(fault, right, "temperature")
        return RandomState(surface.typical, law, self.model_dump(exclude={"sweeps"}))


class OfGauss(Keys):
    """Normal."""

    law: Literal["gaussian"]
    mean: key_of(State, "the mean, a number per component")
    sd: key_of(NonNegative | tuple[NonNegative, ...], "standard deviation, of all components or of each") = ABSENT
    covariance: key_of(_MATRIX, "covariance matrix of the components, in place of sd") = ABSENT
    project: key_of(pydantic.StrictBool, "move states to the Casimir surface through the mean, along rays") = False

    @condition
    def _check_one(self) -> None:
        given = [key for key in ("sd", "covariance") if key in self.model_fields_set]
        if len(given) != 1:
            raise wrong(f"has {' and '.join(given) or 'no width'}", "must have one of sd, covariance")

    def state(self, model: Any, files: Files) -> RandomState:
        """The state that is a standard deviation from the mean in each component, and the law."""
        if populations(model):
            raise wrong("is 'gaussian', whose states may be negative", "use points, all of them positive", "law")
        _check_length(self.mean, model, "mean")
        rows = self._factor()
        surface = _surface(model, self.mean, "project") if self.project else None
        factor = tuple((i, j, c) for i, row in enumerate(rows) for j, c in enumerate(row) if c)
        law = Gaussian(self.mean, factor, surface)
        away = np.array(self.mean) + np.sqrt((np.array(rows) ** 2).sum(axis=1))
        return RandomState(surface.typical if surface else tuple(away.tolist()), law, self.model_dump())

    def _factor(self) -> list[list[float]]:
        """L of the covariance matrix L L^T."""
        d = len(self.mean)
        if self.covariance is None:
            each = self.sd if isinstance(self.sd, tuple) else (self.sd,) * d
            if len(each) != d:
                raise wrong(f"has {entries_in(len(each))}", f"must be one number or have {d}, as mean", "sd")
            return np.diag(each).tolist()
        matrix = self.covariance
        if len(matrix) != d or any(len(row) != d for row in matrix):
            right = f"must have {d} rows of {d} numbers, as mean has"
            raise wrong(f"has {len(matrix)} rows, the first of {len(matrix[0]) if matrix else 0}", right, "covariance")
        return _cholesky(matrix)


class OfPoints(Keys):
    """Drawn from given states, with replacement."""

    law: Literal["points"]
    file: key_of(
        str,
        "states: a CSV file with a column per component, named in the first line or not, and perhaps one named weight; "
        "or an array y (states, components) and perhaps weight (states,) in a file of numpy.savez",
    )

    def state(self, model: Any, files: Files) -> RandomState:
        """The first state that is not 0, and the law."""
        data = content(files.text(self.file, "file", 32 * _MOST_NUMBERS, binary=True))
        y, weight = (_of_npz if data[:2] == b"PK" else _of_csv)(data, self.file, model)
        if len(y) * (y.shape[1] + 1) > _MOST_NUMBERS:
            most = _MOST_NUMBERS // (y.shape[1] + 1)
            raise wrong(f"is {shown(self.file)}, with {len(y)} states", f"must have at most {most}", "file")
        check_finite(y, shown(self.file), "file")
        if populations(model) and not (y > 0).all():
            number = int(np.argmin((y > 0).all(axis=1)))
            raise wrong(f"is {shown(self.file)}, whose state {number + 1} is not positive", "all must be", "file")
        if not (np.isfinite(weight).all() and (weight >= 0).all() and weight.any()):
            right = "weights must be finite and not negative, and some of them positive"
            raise wrong(f"is {shown(self.file)}, which has other weights", right, "file")
        share = np.cumsum(weight) / weight.sum()
        with np.errstate(divide="ignore"):
            below = -np.log1p(-np.minimum(share[:-1], 1.0))
        digest = hashlib.sha256(y.tobytes() + weight.tobytes()).hexdigest()
        plain = {"law": self.law, "points": len(y), "digest": digest}
        return RandomState(tuple(y[np.argmax(y.any(axis=1))].tolist()), Listed(y, below), plain)


_CLASSES = (OnSurface, OfGibbs, OfGauss, OfPoints)
LAWS = ("uniform_on_surface", "gibbs", "gaussian", "points")
Law = one_of(_CLASSES, "law", LAWS)
_READ = pydantic.TypeAdapter(Law)


def random_state(data: dict[str, Any], model: Any, files: Files) -> Any:
    """The :class:`RandomState` of a mapping with the key ``law``; () if the model is not known yet."""
    given = _READ.validate_python(data)
    if model is None:
        return ()
    if large(model) and not (isinstance(given, OfGibbs) and isinstance(undamped(model), Spins)):
        right = "give one state; or move states of your own by spi.Integrator, see docs/integrator.md"
        raise wrong(f"is a law, which is for models of few components, not for {type(model).__qualname__}", right)
    return given.state(undamped(model), files)


def _check_length(values: tuple, model: Any, key: str) -> None:
    if len(values) != dimension(model):
        raise wrong(f"has {entries_in(len(values))}", f"must have {dimension(model)}, the dimension of the model", key)


@lru_cache(1)  # the cases of a sweep often share it
def _trials(surface: Spheres) -> Any:
    """States of the uniform law on a surface."""
    return surface.onto(np.random.default_rng(2).standard_normal((len(surface.point), _TRIALS)))


def _surface(model: Any, point: tuple[float, ...], key: str) -> Spheres:
    """The Casimir surface through a state; raises the error where it is none on which states can be drawn."""
    if key != "project":
        _check_length(point, model, key)
    surface = spheres(model, point)
    name = type(model).__qualname__
    if surface is None:
        fault = f"is for Casimir surfaces that are spheres or products of them, which those of {name} are not"
        if key == "project":
            raise wrong(fault, f"leave it out, or {_POINTS}", key)
        raise wrong(fault, f"use gaussian, or {_POINTS}", "law")
    if not any(surface.lengths):
        raise wrong("is 0, a surface of one state", "give another state", key if key != "project" else "mean")
    return surface


def _cholesky(matrix: _MATRIX) -> list[list[float]]:
    """L, lower triangular, with L L^T = matrix, which may be singular; the error about another matrix.

    numpy.linalg refuses singular matrices, and its last bits depend on the machine.
    """
    a = np.array(matrix)
    size = np.abs(a).max()
    if not np.allclose(a, a.T, rtol=1e-12, atol=0.0):
        raise wrong("is not symmetric", "must be", "covariance")
    factor = np.zeros_like(a)
    for j in range(len(a)):
        left = a[j:, j].copy()
        for k in range(j):
            left -= factor[j:, k] * factor[j, k]
        if left[0] > 1e-14 * size:
            factor[j, j] = math.sqrt(left[0])
            factor[j + 1 :, j] = left[1:] / factor[j, j]
        elif np.abs(left).max() > 1e-12 * size:
            raise wrong("is no covariance matrix", "must have no negative eigenvalue", "covariance")
    return factor.tolist()


# ---------------------------------------------------------------------------------------------------------------------
# Files of states
# ---------------------------------------------------------------------------------------------------------------------


def _names(model: Any) -> list[str]:
    return list(component_names(model)) or [f"y{i + 1}" for i in range(dimension(model))]


def _of_csv(data: bytes, path: str, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """The states (n, d) and weights (n,) in a CSV file."""
    names = _names(model)
    right = f"must have the columns {', '.join(names)}, and perhaps weight"
    try:
        lines = [line for line in data.decode("utf-8-sig").splitlines() if line.strip()]
        head = [name.strip() for name in lines[0].split(",")] if lines else []
        head, rows = (names, lines) if any(map(_is_number, head)) else (head, lines[1:])
        values = np.loadtxt(rows, delimiter=",", comments=None, ndmin=2) if rows else np.empty(0)
    except ValueError as error:  # which UnicodeDecodeError is as well
        right += f"; or be an .npz of numpy.savez with an array y of {len(names)} columns, and perhaps weight"
        raise wrong(f"is {shown(path)}, which is no CSV of numbers ({error})", right, "file") from None
    if not rows:
        raise wrong(f"is {shown(path)}, which has no states", right, "file")
    if sorted({*head} - {"weight"}) != sorted(names) or len({*head}) != len(head) or values.shape[1] != len(head):
        fault = f"with {values.shape[1]} columns" if head == names else f"with the columns {', '.join(head)}"
        raise wrong(f"is {shown(path)}, {fault}", right, "file")
    columns = dict(zip(head, values.T, strict=True))
    return np.stack([columns[name] for name in names], axis=1), columns.get("weight", np.ones(len(rows)))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _of_npz(data: bytes, path: str, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """The states (n, d) and weights (n,) in a file of ``numpy.savez``."""
    d = dimension(model)
    right = f"must have an array y of {d} columns, and perhaps weight, a number per state"
    try:
        arrays = unpacked(data, (1, 2))
        y = arrays["y"]
    except (ValueError, KeyError):
        raise wrong(f"is {shown(path)}, in which there are no such arrays", right, "file") from None
    weight = arrays.get("weight", np.ones(len(y)))
    if y.ndim != 2 or y.shape[1] != d or weight.shape != y.shape[:1]:
        shapes = ", ".join(f"{name} of shape {values.shape}" for name, values in arrays.items())
        raise wrong(f"is {shown(path)}, with {shapes}", right, "file")
    return y, weight


_MODE = re.compile(r"\s*([+-]?[0-9]{1,6})\s*,\s*([+-]?[0-9]{1,6})\s*")
_FIELDS = ("modes", "vorticity", "random")
_POINTS_A_MODE = 4  # and more: of the grid on which a field is sampled, along each side and for each of N


class Random(Keys):
    """A random vorticity."""

    spectrum: key_of(str, "energy of shell k up to a factor, an expression in k such as k^4*exp(-k^2/18)")
    energy: key_of(Positive, "H of the state") = 1.0
    seed: key_of(Seed, "seed of the random phases and amplitudes") = 1


class Vorticity(Keys):
    """An initial vorticity on the torus, given in one of three ways."""

    modes: key_of(
        Annotated[dict[str, Any], MinLen(1)], 'modes that are not 0, as in {"1,0": 0.1+0.3i, "2,-1": 0.2}'
    ) = ABSENT
    vorticity: key_of(str, "an expression in x1 and x2, which go from 0 to 2*pi") = ABSENT
    random: key_of(Random, "a random field of a given energy spectrum") = ABSENT
    subtract_mean: key_of(pydantic.StrictBool, "subtract the mean of the vorticity") = False

    @condition
    def _check_one(self) -> None:
        given = [key for key in _FIELDS if key in self.model_fields_set]
        if len(given) != 1:
            keys = _FIELDS if given else (*_FIELDS, "file")
            raise wrong(f"has {' and '.join(given) or 'no field'}", f"must have one of {', '.join(keys)}")
        if "subtract_mean" in self.model_fields_set and given != ["vorticity"]:
            raise wrong(f"stands beside {given[0]}", "leave it out, it is for vorticity", "subtract_mean")

    def state(self, n: int) -> tuple[float, ...]:
        """The state of the lattice modulo `n`; raises the error about the key that is wrong."""
        if self.modes is not None:
            return _of_modes(self.modes, n)
        if self.random is not None:
            return _at_random(self.random.spectrum, self.random.energy, self.random.seed, n)
        return _of_field(self.vorticity, self.subtract_mean, n)


class Stored(Keys):
    """An initial value of any model that stands in a file."""

    file: key_of(
        str, "a file of numpy.save: a number per component, or a vorticity on a square grid of at least N points a side"
    )
    subtract_mean: key_of(pydantic.StrictBool, "subtract the mean of the vorticity on the grid") = False

    def state(self, files: Any, n: int | None) -> Any:
        """The numbers of the state, on the lattice modulo `n` if there is one."""
        values = array_in(files, self.file)
        if values.ndim == 1:
            return state_of(values)
        shape = f"{values.shape[0]} x {values.shape[1]}"
        if n is None:
            raise wrong(f"has {shape} numbers", "must have one dimension, a number per component", "file")
        if values.shape[0] != values.shape[1] or len(values) < n:
            right = f"must have as many columns as rows, at least {n}; or one dimension"
            raise wrong(f"is a vorticity on {shape} points", right, "file")
        return _of_samples(values, self.subtract_mean, n, "file")


def _of_modes(given: dict[str, Any], n: int) -> tuple[float, ...]:
    """The state in which all modes but the given ones are 0."""
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
    """The number that stands under the name of a mode."""
    reason = ""
    if isinstance(value, str):
        try:
            return complex(parse(value))
        except NumberError as error:
            reason = f" ({error})"
    raise wrong(f"is {shown(value)}{reason}", "must be a number such as 0.2 or 0.1+0.3i", "modes", key)


@functools.lru_cache(maxsize=16)
def _of_field(text: str, subtract_mean: bool, n: int) -> tuple[float, ...]:
    """The state that is nearest to a vorticity, sampled on a grid; kept, as all profiles of a file are read."""
    points = 1 << (_POINTS_A_MODE * n - 1).bit_length()
    x = 2 * np.pi * np.arange(points) / points
    right = "must be an expression in x1 and x2 such as sin(x1)*cos(2*x2)"
    values = _values(text, ("x1", "x2"), np.stack(np.meshgrid(x, x, indexing="ij")), right, "vorticity")
    return _of_samples(values, subtract_mean, n, "vorticity")


def _of_samples(values: np.ndarray, subtract_mean: bool, n: int, key: str) -> tuple[float, ...]:
    """The state that is nearest to a vorticity on a grid, which stands under `key`."""
    mean, largest = float(values.mean()), float(np.abs(values).max())
    if subtract_mean:
        values = values - mean
    elif abs(mean) > fields.MEAN_ROUNDING * largest:
        fault = f"has the mean {mean:.12g}, which must be 0 on the torus"
        raise wrong(fault, "subtract it, or add subtract_mean: true", key)
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


def _values(text: str, names: tuple[str, ...], points: np.ndarray, right: str, *keys: str) -> np.ndarray:
    """The values of an expression in some names at points (names, ...), all of them finite."""
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


def _one_or_more(value: Any) -> Any:
    """A single direction as a list of it."""
    return [value] if isinstance(value, list) and not any(isinstance(entry, list) for entry in value) else value


class SpinStates(Keys):
    """Spins along one direction, along one for each site of the cell, or in random directions."""

    spins: key_of(
        Annotated[
            Literal["random"] | tuple[State, ...],
            pydantic.BeforeValidator(_one_or_more),
        ],
        "the direction of all spins, a list of those of the sites of a cell, or random",
    )
    seed: key_of(Seed, "of random directions") = 1

    def state(self, model: Any) -> Any:
        """The state of a lattice of spins."""
        if model is None:  # it is wrong, which is reported
            return ()
        if not isinstance(undamped(model), Spins):
            raise wrong("has spins, which is for the model spins", "give a list, a number per component", "spins")
        sites, per_cell = dimension(model) // 3, len(undamped(model).cell.sites)
        if self.spins == "random":
            directions = np.random.default_rng(self.seed).standard_normal((sites, 3))
        else:
            if any(len(direction) != 3 or not any(direction) for direction in self.spins):
                raise wrong("has a direction that is none", "give three numbers, not all 0, such as [0, 0, 1]", "spins")
            given = np.array(self.spins, float)
            if len(given) not in (1, per_cell):
                raise wrong(f"has {entries_in(len(given))}", f"must have 1 or {per_cell}", "spins")
            directions = np.tile(given, (sites // len(given), 1))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return state_of(directions)


# ---------------------------------------------------------------------------------------------------------------------
# All of them
# ---------------------------------------------------------------------------------------------------------------------


def _read(value: Any, numbers: Callable[[Any], Any], info: pydantic.ValidationInfo) -> Any:
    """The state that `value` stands for; `numbers` reads a list."""
    if not isinstance(value, dict):
        given = numbers(_with_ranges(value, info))
        return state_of(given) if len(given) > LONG else given
    if "law" in value:
        return random_state(value, info.data.get("model"), cast(Files, info.context))
    model = info.data.get("model")
    if "spins" in value:
        return SpinStates.model_validate(value).state(model)
    given = (Stored if "file" in value else Vorticity).model_validate(value)
    if model is None:  # it is wrong, which is reported
        return ()
    n = fields.lattice_of(model)
    if isinstance(given, Stored):
        return given.state(info.context, n)
    if n is None:
        right = "must be a list, a number per component, or have file"
        raise wrong("is a vorticity, which is for sine_euler and zeitlin", right)
    return given.state(n)


def _with_ranges(value: Any, info: pydantic.ValidationInfo) -> Any:
    """An initial value in which ``cos(i), 0 for i = 1..n`` is written out with the whole numbers of the model."""
    if not isinstance(value, list):
        return value
    if info.data.get("model") is None:  # it is wrong, which is reported, and its sizes are not known
        return [entry for entry in value if not has_range(entry)]
    try:
        return without_ranges(value, named_numbers(info.data["model"]))
    except NumberError as error:
        raise wrong(f"has a range that cannot be read ({error})", "write it as in cos(i), 0 for i = 1..n") from None


def _plain(value: Any) -> Any:
    """All that decides results: the numbers, of very many their digest, or the keys of a law."""
    if isinstance(value, RandomState):
        return value.parameters
    return {"numbers": len(value), "digest": value.digest} if isinstance(value, LongState) else value


#: The annotation of ``initial``.
Initial = Annotated[
    State,
    pydantic.WrapValidator(_read, json_schema_input_type=State | Vorticity | SpinStates | Stored | Law),
    pydantic.PlainSerializer(_plain),
]
