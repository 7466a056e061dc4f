"""Key ``initial``: numbers, or a mapping that one of :data:`INITIAL` reads, by the first of its keys that is there.

    initial: [cos(1.1), 0, sin(1.1)]
    initial: {file: field.npy}

Whatever stands there becomes the numbers of the state at once, and these are what decides results.  A law by which each
path has a state of its own, ``initial: {law: gaussian, ...}``: see the laws below.
"""

import hashlib
import math
from collections.abc import Callable
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal

import numpy as np
import pydantic

from ..ensemble.long_states import LONG, LongState, state_of
from ..ensemble.protocol import NonNegative, component_names, dimension, geometry, large, named_numbers, populations
from ..ensemble.random_states import DrawnFromList, Gaussian, RandomState, Spheres
from ..exact.surfaces import spheres
from ..expressions.arithmetic import NumberError
from ..expressions.ranges import has_range, without_ranges
from ..models.delegation import undamped
from ..plugins import Registry, lacking
from .files import Files, array_in, check_finite, content, table_of, unpacked
from .keys import (
    ABSENT,
    Keys,
    SchemaOf,
    StateKey,
    check_here,
    condition,
    entries_in,
    key_of,
    one_of,
    shown,
    suggestion,
    wrong,
)

# ---------------------------------------------------------------------------------------------------------------------
# Laws of initial states, of which each path has its own.
#
# initial: {law: gaussian, mean: [0, 0, 1], sd: 0.1, project: true}
# initial: {law: points, file: states.csv}
# ---------------------------------------------------------------------------------------------------------------------

#: Numbers in a file of states, weights included; a number takes at most 32 bytes, in CSV with its comma 26.
_MOST_NUMBERS = 2**20
_POINTS = "give states of your own by law: points, from a CSV file or an .npz of numpy.savez"
_MATRIX = tuple[tuple[float, ...], ...]


class Law(Keys):
    """A law; a subclass has a key ``law`` of one value, and a method ``state(model, files)``."""

    def is_for(self, model: Any) -> bool:
        """Whether there are such laws for a model."""
        return not large(model)


class OfGauss(Law):
    """Normal."""

    law: Literal["gaussian"]
    mean: key_of(StateKey, "the mean, a number per component")
    sd: key_of(NonNegative | tuple[NonNegative, ...], "standard deviation, of all components or of each") = ABSENT
    covariance: key_of(_MATRIX, "covariance matrix of the components, in place of sd") = ABSENT
    project: key_of(pydantic.StrictBool, "move states to the Casimir surface through the mean, along rays") = False

    @condition
    def _check_one(self) -> None:
        given = [key for key in ("sd", "covariance") if key in self.model_fields_set]
        if len(given) != 1:
            raise wrong(f"has {' and '.join(given) or 'no width'}", "must have one of sd, covariance")

    def state(self, model: Any, files: Files) -> RandomState:
        """State that is a standard deviation from the mean in each component, and the law."""
        if populations(model):
            raise wrong("is 'gaussian', whose states may be negative", "use points, all of them positive", "law")
        _check_length(self.mean, model, "mean")
        rows = self._factor()
        surface = surface_through(model, self.mean, "project") if self.project else None
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


class OfPoints(Law):
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
        return RandomState(tuple(y[np.argmax(y.any(axis=1))].tolist()), DrawnFromList(y, below), plain)


#: The name of a law -> the class of its keys.
LAWS = Registry("laws", {"gaussian": OfGauss, "points": OfPoints})


class OfLaw:
    """Reader of a mapping with the key ``law``."""

    @staticmethod
    def model_validate(data: dict[str, Any]) -> Any:
        """Record of a mapping, by the name of its law."""
        name = data["law"]
        if isinstance(name, str) and name in LAWS:
            return LAWS[name].model_validate(data)
        check_here("laws", name, "law")
        return pydantic.TypeAdapter(OfLaw.hint()).validate_python(data)

    @staticmethod
    def hint() -> Any:
        """Annotation of all laws."""
        return one_of([*LAWS.values()], "law", LAWS)


def _check_length(values: tuple, model: Any, key: str) -> None:
    if len(values) != dimension(model):
        raise wrong(f"has {entries_in(len(values))}", f"must have {dimension(model)}, the dimension of the model", key)


def surface_through(model: Any, point: tuple[float, ...], key: str) -> Spheres:
    """Casimir surface through a state; raises the error where it is none on which states can be drawn."""
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


def names_in_formulas(model: Any) -> list[str]:
    """Names of the components: those that the system gives them, or y1, y2, ..."""
    return list(component_names(model)) or [f"y{i + 1}" for i in range(dimension(model))]


def _of_csv(data: bytes, path: str, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """States (n, d) and weights (n,) in a CSV file."""
    names = names_in_formulas(model)
    right = f"must have the columns {', '.join(names)}, and perhaps weight"
    try:
        head, values = table_of(data)
    except ValueError as error:  # which UnicodeDecodeError is as well
        right += f"; or be an .npz of numpy.savez with an array y of {len(names)} columns, and perhaps weight"
        raise wrong(f"is {shown(path)}, which is no CSV of numbers ({error})", right, "file") from None
    if not len(values):
        raise wrong(f"is {shown(path)}, which has no states", right, "file")
    head = head or names
    if sorted({*head} - {"weight"}) != sorted(names) or len({*head}) != len(head) or values.shape[1] != len(head):
        fault = f"with {values.shape[1]} columns" if head == names else f"with the columns {', '.join(head)}"
        raise wrong(f"is {shown(path)}, {fault}", right, "file")
    columns = dict(zip(head, values.T, strict=True))
    return np.stack([columns[name] for name in names], axis=1), columns.get("weight", np.ones(len(values)))


def _of_npz(data: bytes, path: str, model: Any) -> tuple[np.ndarray, np.ndarray]:
    """States (n, d) and weights (n,) in a file of ``numpy.savez``."""
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


class FromFile(Keys):
    """An initial value of any model that stands in a file."""

    file: key_of(
        str, "an array, of numpy.save or CSV: a number per component, or values on the grid or lattice of the states"
    )
    subtract_mean: key_of(pydantic.StrictBool, "subtract the mean of the field on the grid") = False

    def state(self, model: Any, files: Files) -> Any:
        """Numbers of the state, or what the model makes of values on a grid."""
        values = array_in(files, self.file)
        if values.ndim == 1:
            return state_of(values)
        on = geometry(model).get("on", "")
        if on in GRIDS:
            return GRIDS[on](model, values, self.subtract_mean)
        shape = " x ".join(map(str, values.shape))
        right = lacking("grids", on) or "must have one dimension, a number per component"
        raise wrong(f"has {shape} numbers", right, "file")


# ---------------------------------------------------------------------------------------------------------------------
# All of them
# ---------------------------------------------------------------------------------------------------------------------


#: What a state is on -> what makes one of values on a grid: of (model, values, whether to subtract their mean).
GRIDS = Registry("grids")

#: Key under ``initial`` -> class of the keys of such a mapping, with a method ``state(model, files)`` that gives the
#: numbers for the record of a model without damping.
INITIAL = Registry("initial", {"law": OfLaw, "file": FromFile})


def _read(value: Any, numbers: Callable[[Any], Any], info: pydantic.ValidationInfo) -> Any:
    """State that `value` stands for; `numbers` reads a list."""
    if not isinstance(value, dict):
        given = numbers(_with_ranges(value, info))
        return state_of(given) if len(given) > LONG else given
    return state_in(value, info.data.get("model"), info.context)


def state_in(data: dict[str, Any], model: Any, files: Any) -> Any:
    """State that a mapping stands for; () if the model is wrong, which is reported."""
    key = next((key for key in INITIAL if key in data), None)
    if key is None:
        for name in data:
            advice = lacking("initial", name)
            raise wrong("is not a known key", advice or suggestion(name, INITIAL), name)
        raise wrong("is an empty mapping", f"must have one of {', '.join(INITIAL)}")
    given = INITIAL[key].model_validate(data)
    if model is None:
        return ()
    if isinstance(given, Law) and not given.is_for(model):
        right = "give one state; or move states of your own by spi.Integrator, see docs/integrator.md"
        raise wrong(f"is a law, which is for models of few components, not for {type(model).__qualname__}", right)
    return given.state(undamped(model), files)


def _hint() -> Any:
    """Annotation of whatever may stand there."""
    mappings = [reader.hint() if reader is OfLaw else reader for reader in dict.fromkeys(INITIAL.values())]
    return reduce(or_, [StateKey, *mappings])


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
    StateKey,
    pydantic.WrapValidator(_read, json_schema_input_type=Annotated[Any, SchemaOf(_hint)]),
    pydantic.PlainSerializer(_plain),
]
