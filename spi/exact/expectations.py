"""Expectations without sampling, of schemes and of the equation itself, by solvers that plug-ins have.

The solver is chosen by a method that the model answers, see ``spi.ensemble.protocol``, such as ``axis_inertias``.
Without one nothing is known without sampling.
"""

from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ..compiler.dispatch import answers
from ..compiler.records import class_of
from ..ensemble import protocol
from ..plugins import Registry
from .surfaces import by_place
from .work import work

SOLVING = "solving"  #: the name of the work


class Expectations(NamedTuple):
    """E phi(y) at the final time for F test functions: of a scheme at S step sizes, and of the equation itself.

    Each bound is an estimate of the numerical error, from refining the discretisation; `weak_error` is value - limit,
    where errors common to both cancel.
    """

    h: np.ndarray  #: (S,) step sizes
    value: np.ndarray  #: (F, S) E phi(y_N)
    limit: np.ndarray  #: (F,) E phi(y(T))
    weak_error: np.ndarray  #: (F, S)
    value_bound: np.ndarray  #: (F, S)
    limit_bound: np.ndarray  #: (F,)
    weak_error_bound: np.ndarray  #: (F, S)
    notes: dict[str, Any]  #: the resolution


class Demands(NamedTuple):
    """Rough cost of a computation by a solver."""

    seconds: float  #: on all threads
    bytes: float  #: of memory, at most
    obstacle: str = ""  #: the reason why the solver cannot do it, as a predicate of "the solver"
    remedy: str = ""  #: advice for that case
    least: float = 0.0  #: numerical error below which rounding lets no accuracy be reached


#: The name of a method that a model must answer -> the module with its solver.  That has ``demands``, ``expectations``
#: and ``Refining``, with the arguments of the functions here, and perhaps ``seconds_of_equation`` and
#: ``exact_expectations`` where it solves the equation itself, without a scheme.
SOLVERS = Registry("solvers", made=import_module)


def can_solve(model):
    """Whether :func:`expectations` works for a model, or a class of models."""
    return any(answers(getattr(protocol, method), model) for method in SOLVERS)


def can_solve_equation(model):
    """Whether :func:`exact_expectations` works for a model, or a class of models."""
    return _solver(model, _OF_EQUATION) is not None


_OF_EQUATION = "exact_expectations"


def _solver(model, function):
    """The first module for a model that has a function; None if there is none."""
    able = (method for method in SOLVERS if answers(getattr(protocol, method), model))
    return next((SOLVERS[method] for method in able if hasattr(SOLVERS[method], function)), None)


def solver_of(model, function="expectations"):
    """Module for a model that has a function; ValueError if there is none."""
    if solver := _solver(model, function):
        return solver
    methods = [method for method in SOLVERS if hasattr(SOLVERS[method], function)]
    why = f"which does not answer {' or '.join(methods)}" if methods else "as no solver is installed"
    raise ValueError(f"no solver without sampling for {class_of(model).__qualname__}, {why}")


def demands(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """:class:`Demands` of :func:`expectations` with these arguments, and whether it can compute them at all.

    Takes milliseconds, by the grids that the solver would choose.
    """
    compositions = by_place(model, compositions)
    return solver_of(model).demands(model, compositions, initial, final_time, steps, functions, accuracy)


def expectations(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """E phi(y_N) of a splitting scheme at each step size, and E phi(y(T)) of the equation; an :class:`Expectations`.

    `compositions` is a step as ``schemes.stages.compositions`` gives it: ((probability, flows), ...) with the flows
    ("drift" or "noise", k, share of the step) in the order in which they act, each noise flow with an increment of its
    own; `functions` take an array y of shape (3, n) and return n values.  `accuracy` asks for an absolute numerical
    error.  ValueError for a model without a solver (:func:`can_solve`).
    """
    solver = solver_of(model)
    asked = model, by_place(model, compositions), initial, final_time, steps, functions, accuracy
    with work(SOLVING, solver.demands(*asked).seconds):
        return solver.expectations(*asked)


def exact_expectations(model, initial, final_time, functions, accuracy, **limits):
    """E phi(y(T)) of the equation for F functions, and a bound of its numerical error, two arrays (F,).

    At several times, which increase, in place of the final one: (F, times).  NaN and infinite where it would take too
    long, with ``most_seconds=`` longer than that.

    No scheme is involved.  ValueError for a model for which that is not possible (:func:`can_solve_equation`).
    """
    solver = solver_of(model, _OF_EQUATION)
    with work(SOLVING, solver.seconds_of_equation(model, initial, final_time, functions, **limits)):
        return solver.exact_expectations(model, initial, final_time, functions, accuracy, **limits)


def seconds_of_equation(model, initial, final_time, functions, **limits):
    """Seconds of :func:`exact_expectations`, roughly; takes milliseconds, as :func:`demands`."""
    return solver_of(model, _OF_EQUATION).seconds_of_equation(model, initial, final_time, functions, **limits)


def refiner(model, initial, final_time, functions, accuracy):
    """An object that refines E phi(y(T)) of the equation for F functions step by step.

    It has ``refine(number)``, the values, their uncertainties, and the effort, a number that says how much work it was;
    ``costs(effort)``, the seconds of typical speed of each refinement there can be; ``effort``, that which is usual;
    ``rough`` (F,), which functions have kinks; and ``known`` (F,), the expectations where nothing moves, else None, and
    ``known_bound``, of their errors.
    """
    return solver_of(model).Refining(model, initial, final_time, functions, accuracy)
