"""Whether what a file holds has the types and shapes that a record says; checksums only tell who wrote last."""

import sys
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

import numpy as np


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotated type: a number, a text, None, a tuple or a union of these."""
    if hint is Any:
        return True
    if get_origin(hint) in (Union, UnionType):
        return any(fits(value, one) for one in get_args(hint))
    if hint in (None, NoneType):
        return value is None
    if get_origin(hint) is tuple:
        each = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
        return each and all(fits(one, get_args(hint)[0]) for one in value)
    if get_origin(hint) is dict:
        return isinstance(value, Mapping)
    if hint in (int, float):
        number = isinstance(value, Integral if hint is int else Real) and not isinstance(value, bool | np.bool_)
        return number and not (isinstance(value, Integral) and abs(int(value)) > sys.float_info.max)
    return isinstance(value, bool | np.bool_ if hint is bool else hint)


def check_fact(name: str, value: Any, hint: Any) -> None:
    """Raise TypeError if a fact is not of its type."""
    if not fits(value, hint):
        told = getattr(hint, "__name__", str(hint)) if get_origin(hint) is None else str(hint)
        raise TypeError(f"{name!r} is {type(value).__name__}, not {told}")


def check_axis(name: str, values: np.ndarray, is_text: bool) -> None:
    """Raise ValueError if the values along an axis are none, of a wrong type, or no row."""
    if values.ndim != 1 or not values.size or (values.dtype.kind == "U") != is_text:
        raise ValueError(f"{name!r} is an axis of {values.dtype} of shape {values.shape}")


def check_array(name: str, variable: tuple[tuple[str, ...], np.ndarray], axes: tuple[str, ...], sizes: Any) -> None:
    """Raise ValueError if an array is not one of numbers over its axes; `sizes` are the values along each axis."""
    found, values = variable
    if values.dtype.kind not in "iufb":
        raise ValueError(f"{name!r} holds no numbers but {values.dtype}")
    shape = tuple(len(sizes[axis]) for axis in axes if axis in sizes)
    if tuple(found) != axes or len(shape) != len(axes) or values.shape != shape:
        raise ValueError(f"{name!r} is over {found} and of shape {values.shape}, not over {axes}")
