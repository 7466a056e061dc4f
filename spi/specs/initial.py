"""How ``initial`` is read: numbers, those of a file, or a vorticity on the torus as modes, an expression or at random.

    initial: [cos(1.1), 0, sin(1.1)]
    initial: {file: field.npy}
    initial: {results: results/vortex_merger.h5, case: calm, time: 4}
    initial: {modes: {"1,0": 0.1+0.3i, "2,-1": 0.2}}
    initial: {vorticity: "cos(x1) + cos(x2)"}
    initial: {random: {spectrum: "k^4*exp(-k^2/18)", energy: 1, seed: 1}}

Whatever stands there becomes the numbers of the state at once, and these are what decides results.  A law by which each
path has a state of its own, ``initial: {law: gaussian, ...}``, is read in ``initial_laws.py``.
"""

import functools
import re
from collections.abc import Callable
from typing import Annotated, Any, cast

import numpy as np
import pydantic
from annotated_types import MinLen

from ..ensemble.protocol import NonNegative, Positive
from ..ensemble.random_states import RandomState
from ..expressions import as_numpy, parse_expression
from ..expressions.arithmetic import NumberError, parse
from ..models.zeitlin import fields
from ..models.zeitlin.lattice import places
from ..systems import expanded, has_range
from .files import Files, array_in, state_in
from .initial_laws import Law, random_state
from .keys import ABSENT, Keys, Seed, State, condition, key_of, shown, wrong

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

    @condition()
    def _check_one(self) -> None:
        given = [key for key in _FIELDS if key in self.model_fields_set]
        if len(given) != 1:
            known = _FIELDS if given else (*_FIELDS, "file", "results")
            raise wrong(f"has {' and '.join(given) or 'no field'}", f"must have one of {', '.join(known)}")
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
    ) = ABSENT
    subtract_mean: key_of(pydantic.StrictBool, "subtract the mean of the vorticity on the grid") = False
    results: key_of(str, "a results file of kind trajectory") = ABSENT
    time: key_of(NonNegative, "time of a stored state in it", "time") = ABSENT
    case: key_of(str, "name of the case in it; default: the only one") = ABSENT
    scheme: key_of(str, "scheme in it; default: the only one") = ABSENT

    @condition()
    def _check_one(self) -> None:
        given = self.model_fields_set
        if {"file", "results"} <= given:
            raise wrong("has file and results", "must have one of them")
        if "results" in given and "time" not in given:
            raise wrong("missing key 'time'", "add time: that of a stored state", "time")
        of_other = {"time", "case", "scheme"} if "file" in given else {"subtract_mean"}
        if beside := sorted(of_other & given):
            which, other = ("file", "results") if "file" in given else ("results", "file")
            raise wrong(f"stands beside {which}", f"leave it out, it is for {other}", beside[0])

    def state(self, files: Any, n: int | None) -> tuple[float, ...]:
        """The numbers of the state, on the lattice modulo `n` if there is one."""
        if self.results is not None:
            return tuple(state_in(files, self.results, self.case, self.scheme, self.time).tolist())
        values = array_in(files, self.file)
        if values.ndim == 1:
            return tuple(values.tolist())
        shape = f"{values.shape[0]} x {values.shape[1]}"
        if n is None:
            raise wrong(f"has {shape} numbers", "must have one dimension, a number per component", "file")
        if values.shape[0] != values.shape[1] or len(values) < n:
            right = f"must have as many columns as rows, at least {n}; or one dimension"
            raise wrong(f"is a vorticity on {shape} points", right, "file")
        return _of_samples(values, self.subtract_mean, n, "file")


def _of_modes(given: dict[str, Any], n: int) -> tuple[float, ...]:
    """The state in which all modes but the given ones are 0."""
    y, known = np.zeros(n * n - 1), places(n)
    written: dict[int, str] = {}
    for key, value in given.items():
        if not (match := _MODE.fullmatch(key)):
            raise wrong("is not a mode", 'must be two whole numbers, as in "2,-1"', "modes", key)
        mode = int(match[1]), int(match[2])
        if mode == (0, 0):
            raise wrong("is the mean, which is 0", "leave it out", "modes", key)
        if mode not in known:
            right = f"both numbers must be between -{n // 2} and {n // 2}"
            raise wrong(f"is not a mode of the lattice modulo {n}", right, "modes", key)
        place, sign = known[mode]
        if place in written:
            what = f"is given twice, also as {shown(written[place])}"
            raise wrong(what, "remove one, since -m has the complex conjugate of m", "modes", key)
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
        what = f"has the mean {mean:.12g}, which must be 0 on the torus"
        raise wrong(what, "subtract it, or add subtract_mean: true", key)
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
        if other := re.search(r"\b[yY][0-9]+\b", text):  # what components of states are called
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


# ---------------------------------------------------------------------------------------------------------------------
# All of them
# ---------------------------------------------------------------------------------------------------------------------


def _read(value: Any, numbers: Callable[[Any], Any], info: pydantic.ValidationInfo) -> Any:
    """The state that `value` stands for; `numbers` reads a list."""
    if not isinstance(value, dict):
        return numbers(_with_ranges(value, info))
    if "law" in value:
        known, files = info.data.get("model"), cast(Files, info.context)
        return random_state(value, None if isinstance(known, dict) else known, files)
    stored = "file" in value or "results" in value
    given, model = (Stored if stored else Vorticity).model_validate(value), info.data.get("model")
    if model is None or isinstance(model, dict):  # of one layer, when it is not known yet which system it is
        return ()
    n = fields.lattice_of(model)
    if isinstance(given, Stored):
        return given.state(info.context, n)
    if n is None:
        right = "must be a list, a number per component, or have file or results"
        raise wrong("is a vorticity, which is for sine_euler and zeitlin", right)
    return given.state(n)


def _with_ranges(value: Any, info: pydantic.ValidationInfo) -> Any:
    """An initial value in which ``cos(i), 0 for i = 1..n`` is written out with the sizes of the system."""
    if not isinstance(value, list):
        return value
    # Sizes are unknown where the model is wrong, of which alone is told then, and of one layer, before it is chosen.
    if isinstance(info.data.get("model"), dict | None):
        return [entry for entry in value if not has_range(entry)]
    try:
        return expanded(value, info.data["model"])
    except NumberError as error:
        raise wrong(f"has a range that cannot be read ({error})", "write it as in cos(i), 0 for i = 1..n") from None


def _plain(value: Any) -> Any:
    """What decides results: the numbers, or of a law what tells it."""
    return value.told if isinstance(value, RandomState) else value


#: The annotation of ``initial``.
Initial = Annotated[
    State,
    pydantic.WrapValidator(_read, json_schema_input_type=State | Vorticity | Stored | Law),
    pydantic.PlainSerializer(_plain),
]
