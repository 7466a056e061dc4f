"""Known means of functions: formulas, the rows of a file, and words for what is known without sampling."""

import functools
import io
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from spi.expressions import as_numpy, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.kinds.functions import PathFunction
from spi.numerics.types import Array
from spi.plugins.dynamics.exact import gibbs
from spi.specs.checks import ROUNDING
from spi.specs.keys import shown, wrong
from spi.specs.names import numbers_of

#: Words for the mean of the equation or of the Gibbs law, that at the smallest step size, and that of a stationary law.
EXACT, FINEST, STATIONARY = "exact", "finest", "stationary"

#: Times, means and standard errors.
TimeCurve = tuple[tuple[float, float, float], ...]


class Word(NamedTuple):
    """A word for a mean that is known without sampling; both are functions of a case and the name of a function."""

    obstacle: Callable[[Any, str], str | None]  #: why it is not known, in a phrase; None if it is
    mean: Callable[[Any, str], tuple[Any, Any]]  #: the mean, at all times, and its numerical error
    remedy: str = "leave it out, or use a formula or a file"


class References(NamedTuple):
    """What the key ``reference`` of a kind may hold for a function."""

    words: Mapping[str, Word]
    right: str  #: what it must be
    names: tuple[str, ...] = ()  #: t, where a formula may name it

    def is_formula(self, reference: Any) -> bool:
        """Whether a reference is neither a word nor the rows of a file."""
        return isinstance(reference, str) and reference not in self.words

    def formula(self, case: Any, text: str) -> Any:
        """Tree of a formula in parameters of the model, T and perhaps t; NumberError if it is none."""
        if re.search(r"\by1\b", text):  # as which t stands in the tree
            raise NumberError("unknown name 'y1'")
        return parse_expression(text, len(self.names), self.names, numbers_of(case))

    def check(self, case: Any, name: str, reference: str | TimeCurve) -> None:
        """Raise the error about the reference of the function `name`, if it is not valid."""
        at = "reference", name
        if name not in case.functions:
            raise wrong("is not the name of a function", f"known: {', '.join(case.functions)}", *at)
        if isinstance(reference, tuple):
            if not np.isfinite(_in_curve(reference, case.t, case.step)[0]).any():
                first, last = reference[0][0], reference[-1][0]
                mistake = f"has a file with t = {first:g} to {last:g}, none of the times of the statistics"
                raise wrong(mistake, "give values at some of these times", *at)
        elif word := self.words.get(reference):
            if reason := word.obstacle(case, name):
                raise wrong(f"is '{reference}', but {reason}", word.remedy, *at)
        else:
            try:
                self.formula(case, reference)
            except NumberError as error:
                raise wrong(f"is {shown(reference)} ({error})", self.right, *at) from None

    def means(self, case: Any, times: Array) -> tuple[Array, Array]:
        """Reference means (F, times) of the functions of a case, NaN where there is none, and their errors.

        These are standard errors or numerical ones; `times` (times,) may be a single one, which has no meaning.
        """
        value, error = np.full((2, len(case.functions), len(times)), np.nan)
        for f, name in enumerate(case.functions):
            reference: Any = case.reference.get(name)
            if isinstance(reference, tuple):
                value[f], error[f] = _in_curve(reference, times, case.step)
            elif reference in self.words:
                value[f], error[f] = self.words[reference].mean(case, name)
            elif reference is not None:
                value[f], error[f] = as_numpy(self.formula(case, reference))(times[np.newaxis]), 0.0
        return value, error


def curve(text: str, path: str) -> TimeCurve:
    """Rows of a file, by t; raises the error about the key ``file``."""
    right = "must have t and value, and may have stderr"
    try:
        table = np.genfromtxt(io.StringIO(text.strip() or "nothing"), delimiter=",", names=True, ndmin=1)
    except ValueError as error:
        raise wrong(f"is {shown(path)}, no table: {str(error).split('    ')[-1].strip()}", right, "file") from None
    names: Any = table.dtype.names
    if not {"t", "value"} <= set(names) <= {"t", "value", "stderr"}:
        raise wrong(f"is {shown(path)}, with the columns {', '.join(names)}", right, "file")
    stderr = np.abs(table["stderr"]) if "stderr" in names else np.zeros(len(table))
    rows = sorted(zip(table["t"].tolist(), table["value"].tolist(), stderr.tolist(), strict=True))
    if not rows or not np.isfinite(rows).all():
        right = f"must have rows with a finite number for each of {', '.join(names)}"
        raise wrong(f"is {shown(path)}, with rows that are no such numbers, or without rows", right, "file")
    if len({t for t, _, _ in rows}) < len(rows):
        raise wrong(f"is {shown(path)}, which has a time twice", "give one line for each time", "file")
    return tuple(rows)


def _in_curve(curve: TimeCurve, t: Array, step: float) -> tuple[Array, Array]:
    """Values and standard errors of a curve at times, NaN where it has none."""
    times, *columns = np.array(curve).T
    nearest = np.abs(np.subtract.outer(t, times)).argmin(axis=1)
    met = np.abs(times[nearest] - t) <= ROUNDING * np.maximum(t, step)
    value, error = (np.where(met, column[nearest], np.nan) for column in columns)
    return value, error


@functools.lru_cache(maxsize=64, typed=True)
def gibbs_mean(model: Any, initial: Any, temperature: float, function: PathFunction) -> tuple[float, float]:
    """Mean of a function under the Gibbs law and its numerical error; ValueError, with a reason, where it is not known.

    Cached, as all schemes have the same; typed, because models of two classes may be equal tuples.
    """
    expectation: tuple[float, float] = gibbs.law_of(model, initial, temperature).expectation(function.values)
    return expectation


def reason_of(mean: Callable[[Any, str], Any]) -> Callable[[Any, str], str | None]:
    """Reason, in a phrase, with which a mean raises ValueError; None where it is known."""

    def obstacle(case: Any, name: str) -> str | None:
        try:
            mean(case, name)
        except ValueError as error:
            return str(error)
        return None

    return obstacle
