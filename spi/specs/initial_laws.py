"""How an ``initial`` at random is read: laws of states, of which each path has its own.

initial: {law: uniform_on_surface, through: [0, 0, 1]}
initial: {law: gibbs, through: [0, 0, 1], temperature: 0.2}
initial: {law: gaussian, mean: [0, 0, 1], sd: 0.1, project: true}
initial: {law: points, file: states.csv}
"""

import csv
import hashlib
import io
import math
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import pydantic

from ..ensemble.protocol import NonNegative, dimension, large, populations
from ..ensemble.random_states import Gaussian, Gibbs, Listed, RandomState, Spheres, Uniform
from ..exact.surfaces import least_on, quadratic, spheres
from ..models.delegation import undamped
from ..systems import variables
from .files import Files, check_finite, content, unpacked
from .keys import ABSENT, Keys, State, condition, entries_in, key_of, one_of, quantity, shown, wrong

LEAST_ACCEPTANCE = 1e-3  #: of the attempts at a state, with which a law is still drawn
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
    through: _Through
    temperature: key_of(float, "T in the density exp(-H/T); may be negative", "energy")

    def state(self, model: Any, files: Files) -> RandomState:
        """A typical state, and the law."""
        if not self.temperature:
            raise wrong("is 0", "must not be", "temperature")
        surface = _surface(model, self.through, "through")
        found = quadratic(model)
        if found is None:
            right = "draw states elsewhere, and give them by law: points"
            raise wrong("is 'gibbs', which is drawn where H is a quadratic polynomial", right, "law")
        _, b, matrix = (part / self.temperature for part in found)
        terms: list[tuple] = [(i, float(c)) for i, c in enumerate(b) if c]
        for i, j in np.argwhere(np.triu(matrix)).tolist():
            terms.append((i, j, float(matrix[i, j] if i < j else 0.5 * matrix[i, i])))
        law = Gibbs(surface, tuple(terms), least_on(surface, b, matrix))
        rate = float(np.exp(law.least - law.energy(_trials(surface))).mean())
        if rate < LEAST_ACCEPTANCE:
            what = f"is {quantity(self.temperature)}, at which about {rate:.1g} of the attempts at a state are accepted"
            right = f"must be so far from 0 that {LEAST_ACCEPTANCE:g} are; or give states of your own by law: points"
            raise wrong(what, right, "temperature")
        return RandomState(surface.typical, law, self.model_dump())


class OfGauss(Keys):
    """Normal."""

    law: Literal["gaussian"]
    mean: key_of(State, "the mean, a number per component")
    sd: key_of(NonNegative | tuple[NonNegative, ...], "standard deviation, of all components or of each") = ABSENT
    covariance: key_of(_MATRIX, "covariance matrix of the components, in place of sd") = ABSENT
    project: key_of(pydantic.StrictBool, "move states to the Casimir surface through the mean, along rays") = False

    @condition()
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
        told = {"law": self.law, "points": len(y), "digest": digest}
        return RandomState(tuple(y[np.argmax(y.any(axis=1))].tolist()), Listed(y, below), told)


_CLASSES = (OnSurface, OfGibbs, OfGauss, OfPoints)
LAWS = ("uniform_on_surface", "gibbs", "gaussian", "points")
Law = one_of(_CLASSES, "law", LAWS)
_READ = pydantic.TypeAdapter(Law)


def random_state(data: dict[str, Any], model: Any, files: Files) -> Any:
    """The :class:`RandomState` of a mapping with the key ``law``; () if the model is not known yet."""
    given = _READ.validate_python(data)
    if model is None:
        return ()
    if large(model):
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
        what = f"is for Casimir surfaces that are spheres or products of them, which those of {name} are not"
        if key == "project":
            raise wrong(what, f"leave it out, or {_POINTS}", key)
        raise wrong(what, f"use gaussian, or {_POINTS}", "law")
    if not any(surface.lengths):
        raise wrong("is 0, a surface of one state", "give another state", key if key != "project" else "mean")
    return surface


def _cholesky(matrix: _MATRIX) -> list[list[float]]:
    """L, lower triangular, with L L^T = matrix, which may be singular; the error about another matrix."""
    a = np.array(matrix)
    size = np.abs(a).max()
    if not np.allclose(a, a.T, rtol=1e-12, atol=0.0):
        raise wrong("is not symmetric", "must be", "covariance")
    d, found = len(a), np.zeros_like(a)
    for j in range(d):
        for i in range(j, d):
            left = float(a[i, j])
            for k in range(j):
                left -= float(found[i, k]) * float(found[j, k])
            if i == j and left > 1e-14 * size:
                found[j, j] = math.sqrt(left)
            elif found[j, j] > 0.0:
                found[i, j] = left / float(found[j, j])
            elif abs(left) > 1e-12 * size:
                raise wrong("is no covariance matrix", "must have no negative eigenvalue", "covariance")
    return found.tolist()


# ---------------------------------------------------------------------------------------------------------------------
# Files of states
# ---------------------------------------------------------------------------------------------------------------------


def _names(model: Any) -> list[str]:
    """What the components are called."""
    return list(variables(model)) or [f"y{i + 1}" for i in range(dimension(model))]


def _of_csv(data: bytes, path: str, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """The states (n, d) and weights (n,) in a CSV file."""
    names = _names(model)
    right = f"must have the columns {', '.join(names)}, and perhaps weight"
    try:
        rows = [row for row in csv.reader(io.StringIO(data.decode("utf-8-sig"))) if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error):
        right += f"; or be an .npz of numpy.savez with an array y of {len(names)} columns, and perhaps weight"
        raise wrong(f"is {shown(path)}, which is neither CSV nor .npz", right, "file") from None
    head = [name.strip() for name in rows[0]] if rows else []
    if head and not any(map(_is_number, head)):
        rows = rows[1:]
    else:
        head = names
    if sorted(set(head) - {"weight"}) != sorted(names) or len(set(head)) != len(head):
        raise wrong(f"is {shown(path)}, with the columns {', '.join(head)}", right, "file")
    if not rows:
        raise wrong(f"is {shown(path)}, which has no states", right, "file")
    for number, row in enumerate(rows, 1):
        if len(row) != len(head) or not all(map(_is_number, row)):
            what = f"is {shown(path)}, whose state {number} is {shown(','.join(row))}"
            raise wrong(what, f"must be {len(head)} numbers with commas between them", "file")
    values = dict(zip(head, np.array(rows, float).T, strict=True))
    return np.stack([values[name] for name in names], axis=1), values.get("weight", np.ones(len(rows)))


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
