"""Question of an answer: functions of the state at the end, and whether their expectations can be solved for."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spi.ensemble.protocol import has_friction
from spi.ensemble.random_states import RandomState
from spi.exact.expectations import can_solve, demands
from spi.exact.linear import MomentEquations
from spi.expressions import as_numpy, canonical, range_of
from spi.expressions.summands import hidden_summands, is_plain, unbounded_rest
from spi.kinds.blocks import LevelPlan
from spi.kinds.linear import linear_moments


@dataclass(frozen=True, kw_only=True)
class QuestionPlan(LevelPlan):
    """Functions of a case with their ranges, and their moments where these are all that it takes."""

    python: tuple[tuple[str, Callable], ...] = ()  #: Python functions by name, in place of formulas of the case

    @cached_property
    def asked(self) -> list[Callable]:
        """F test functions of arrays of states."""
        given = dict(self.python)
        return [given.get(name, phi) for name, phi in zip(self.case.functions, super().phis, strict=True)]

    @property
    def phis(self) -> list[Callable]:
        """Functions of which there are sums: the F asked ones, and behind them summands that these may hide."""
        return [*self.asked, *(as_numpy(tree) for _, tree in self.hidden)]

    @cached_property
    def hidden(self) -> list[tuple[int, Any]]:
        """Summands in which rare values may hide, each with the number of the function that it belongs to.

        Behind them stand the rests of functions, see :func:`spi.expressions.summands.unbounded_rest`.
        """
        return [(f, part) for f, tree in self._trees for part in hidden_summands(tree)] + self.rests

    @cached_property
    def rests(self) -> list[tuple[int, Any]]:
        """Rests of functions without the summands whose range is known, each with the number of the function."""
        each = ((f, unbounded_rest(tree)) for f, tree in self._trees)
        return [(f, rest) for f, rest in each if rest is not None]

    @property
    def _trees(self) -> list[tuple[int, Any]]:
        """Formulas, each with its number, but for those that have a Python function in their place."""
        python, named = dict(self.python), zip(self.case.functions, self.case.expressions, strict=True)
        return [(f, tree) for f, (name, tree) in enumerate(named) if name not in python]

    @cached_property
    def owners(self) -> np.ndarray:
        """Numbers of the functions that the hidden summands belong to."""
        return np.array([f for f, _ in self.hidden], np.int64)

    @property
    def formulas(self) -> tuple[str, ...]:
        """Texts of the functions, of those in Python their names."""
        texts = zip(self.case.functions, map(canonical, self.case.expressions), strict=True)
        return tuple(name if name in dict(self.python) else text for name, text in texts)

    @cached_property
    def ranges(self) -> np.ndarray:
        """(F + summands, 2) bounds of the functions and of the hidden summands, whatever the state is."""
        bounds = zip(self.case.functions, map(range_of, self.case.expressions), strict=True)
        own = [(-np.inf, np.inf) if name in dict(self.python) else ends for name, ends in bounds]
        return np.array([*own, *(range_of(tree) for _, tree in self.hidden)])

    @cached_property
    def steep(self) -> np.ndarray:
        """(F + summands,) whether a formula may be nearly an indicator: polynomials, sines and cosines are not."""
        return ~np.array([is_plain(tree) for tree in (*self.case.expressions, *(tree for _, tree in self.hidden))])

    @cached_property
    def spans(self) -> np.ndarray:
        """(F + summands,) the largest distance of two values: 0 where all paths are the same, or infinity."""
        if not self.is_random:
            return np.zeros(len(self.ranges))
        return np.asarray(self.ranges[:, 1] - self.ranges[:, 0])

    @cached_property
    def moments(self) -> MomentEquations | None:
        """Moments that the functions need, where the equation is linear and they are polynomials; else None."""
        case = self.case
        if case.sampling or self.python or isinstance(case.initial, RandomState):
            return None
        return linear_moments(case.model, case.expressions, (case.final_time,))

    @cached_property
    def solvable(self) -> bool:
        """Whether the expectation can be computed without sampling."""
        if self.moments is not None:
            return True
        case = self.case
        open_ended = case.damping or has_friction(case.model) or isinstance(case.initial, RandomState)
        if case.sampling or open_ended or not can_solve(case.model):
            return False
        end = case.final_time
        return not demands(case.model, ((1.0, ()),), case.initial, end, (end,), self.asked).obstacle
