"""Expectations of functions of the final state: E phi(y_h(T)), and E phi(y(T)) to a wanted accuracy."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from ..ensemble.loop import Grid, paths_of
from ..expressions import as_numpy, parse_expression
from ..expressions.arithmetic import NumberError
from ..kinds.answer import study
from ..kinds.answer.results import Answer
from ..kinds.blocks import BlocksPlan
from ..kinds.plans import State, path_grid
from ..kinds.trajectory.study import TrajectoryPlan
from ..numerics.rng import LANES
from ..printing.text import human_time
from ..specs import SpecError
from ..statistics.accumulators import Array, Sums, counted, moments
from ..statistics.estimators import group_counts, mean_over_paths, standard_deviation
from .paths import computed, plan_of
from .progress import Line
from .specs import of_mapping, whole

Phi = Callable[[np.ndarray], Any]  #: values (paths,) of states (d, paths)


def expectations(
    model: Any,
    scheme: str,
    functions: str | Phi | Mapping[str, str | Phi],
    *,
    initial: Sequence[Any],
    final_time: Any,
    steps: Any,
    samples: int,
    seed: int = 1,
    progress: bool | None = None,
    **options: Any,
) -> xr.Dataset:
    """Means of functions phi of the final state over paths, E phi(y_h(T)), with their standard errors.

    `functions` is phi, or a mapping of names: an expression such as "sin(y1) + y2^2", or a Python function that takes
    states as an array (d, paths) and returns (paths,); NumPy evaluates both, and nothing is compiled for them.
    `steps` is a step size h or several, each 2, 4, 8, ... times the smallest; all of them use the same Brownian paths.
    `samples` is the number of paths.  `model`, `initial`, `final_time`, `seed` and `options` are as for
    :func:`spi.trajectory`.

    The result has ``expectation`` and ``expectation_stderr`` (function, h) and ``nonfinite`` (h), the number of
    diverged paths (NaN or infinity), with which the means are not finite.  For weak errors with their orders, for
    multilevel estimates and for expectations without sampling see experiments of kind weak.

    Raises SpecError with a line for each mistake in the arguments.
    """
    count = whole("samples", samples, 2)
    keys = {"initial": initial, "final_time": final_time, "seed": seed} | options
    sizes = np.atleast_1d(np.asarray(steps, dtype=object)).tolist()
    if not sizes:
        raise SpecError("steps: is an empty list; give a step size, or several")
    each = sorted((plan_of(model, scheme, keys | {"step": h}) for h in sizes), key=lambda plan: -plan.case.step)
    h, finest = [plan.case.step for plan in each], each[-1]
    of_case: Any = {"case": finest.case, "part": finest.part, "functions": _callables(functions, finest)}
    plan = MeansPlan(**of_case, h=tuple(h), count=count)
    with Line("expectations", progress) as line:
        state = computed(plan, line, lambda state: line.share("paths", state.tally().paths, count))
    about = {"samples": count, "scheme": scheme, "model": finest.case.model_name}
    return _dataset(state.total(), list(plan.functions), h, about)


def _by_name(functions: Any) -> Mapping[str, Any]:
    """The functions by their names, one alone as phi."""
    return functions if isinstance(functions, Mapping) else {"phi": functions}


def _callables(functions: Any, finest: TrajectoryPlan) -> dict[str, Phi]:
    """The functions by their names, of expressions by NumPy; SpecError if one is none."""
    d, phis = len(finest.initial), {}
    for name, phi in _by_name(functions).items():
        try:
            phis[str(name)] = phi if callable(phi) else as_numpy(parse_expression(str(phi), d, finest.case.variables))
        except NumberError as error:
            right = f"must be an expression in y1 .. y{d} such as sin(2*pi*y1) + y2^2, or a Python function"
            raise SpecError(f"functions.{name}: is '{phi}' ({error}); {right}") from None
    return phis


class EndSums(Sums):
    """Sums over some paths, for F functions at L step sizes."""

    values: Array = moments("level function", 1)  #: of phi
    apart: Array = moments("level function")  #: of phi(y) - phi(y_0), which loses fewer digits
    nonfinite: Array = counted("level")


@dataclass(frozen=True, kw_only=True)
class MeansPlan(BlocksPlan):
    """Means of functions at the end of paths, summed up as the weak study does, whose bits they have."""

    sums = EndSums

    functions: dict[str, Phi]
    h: tuple[float, ...]  #: step sizes, from large to small
    count: int  #: of paths

    @property
    def samples(self) -> int:
        """The number of paths."""
        return self.count

    @cached_property
    def grid(self) -> Grid:
        """The times of the paths and their step sizes; SpecError for other than doublings of the smallest."""
        doublings = [round(math.log2(step / self.h[-1])) for step in self.h]
        for step, times in zip(self.h, doublings, strict=True):
            if abs(self.h[-1] * 2.0**times - step) > 1e-12 * step:
                right = f"not 1, 2, 4, 8, ... times the smallest, {self.h[-1]:g}; take others"
                raise SpecError(f"steps: has {step:g}, which is {right}")
        return path_grid(self.case, self.part, self.h[-1], doublings)

    @property
    def at_start(self) -> np.ndarray:
        """(F,) phi(y_0), from which values are counted for their spread; 0 where it is not finite."""
        y = np.repeat(np.reshape(self.initial, (-1, 1)), LANES, axis=1)
        values = np.array([_values_of(name, phi, y)[0] for name, phi in self.functions.items()])
        return np.where(np.isfinite(values), values, 0.0)

    def lengths(self, number: int) -> dict[str, int]:
        """The lengths of the axes of the sums."""
        return {"level": len(self.steps), "function": len(self.functions)}

    def observe(self, number: int, first: int, blocks: int, end: int) -> dict[str, Array]:
        """The values (blocks, L, F, LANES) at the end of some blocks, NaN of idle paths."""
        states, _ = self.integrated(first, blocks, end)
        y = paths_of(states, len(self.initial))[..., : end - first * LANES]
        values: Array = np.full((len(self.steps), len(self.functions), blocks * LANES), np.nan)
        for level, of_level in enumerate(y):
            for f, (name, phi) in enumerate(self.functions.items()):
                values[level, f, : y.shape[-1]] = _values_of(name, phi, of_level)
        values = np.moveaxis(values.reshape(*values.shape[:2], blocks, LANES), 2, 0)
        with np.errstate(all="ignore"):
            apart = values - self.at_start[:, np.newaxis]
        return {"values": values, "apart": apart, "nonfinite": np.logical_not(np.isfinite(values).all(axis=2))}


def _values_of(name: str, phi: Phi, y: np.ndarray) -> np.ndarray:
    """The values (paths,) of a function of states (d, paths); ValueError if it returns anything else."""
    y = y.view()
    y.flags.writeable = False  # so that no function changes what the next one is given
    with np.errstate(all="ignore"):
        values = np.asarray(phi(y))
    if values.shape != y.shape[-1:]:
        raise ValueError(f"the function {name} returned shape {values.shape} for {y.shape[-1]} paths; one each")
    if values.dtype.kind == "c":
        raise ValueError(f"the function {name} returned complex numbers; return real ones")
    return values


def _dataset(sums: EndSums, names: list[str], h: list[float], attributes: dict[str, Any]) -> xr.Dataset:
    """The means and their errors at each step size."""
    counts = group_counts(sums.paths)
    mean, _ = mean_over_paths(sums.values[0], counts)
    (apart, square), _ = mean_over_paths(sums.apart, counts)
    stderr = standard_deviation(apart, square) / math.sqrt(sums.paths - 1)
    axes = ("function", "h")
    return xr.Dataset(
        {
            "expectation": (axes, mean.T, {"long_name": "E phi(y_h(T))"}),
            "expectation_stderr": (axes, stderr.T, {"long_name": "standard error of the expectation"}),
            "nonfinite": (("h",), sums.nonfinite, {"long_name": "diverged paths (NaN or infinity)"}),
        },
        {"function": names, "h": ("h", h, {"long_name": "step size"})},
        attributes,
    )


def answer(
    model: Any,
    functions: str | Phi | Mapping[str, str | Phi],
    *,
    initial: Sequence[Any],
    final_time: Any,
    accuracy: Any,
    seed: int = 1,
    progress: bool | None = None,
    **options: Any,
) -> Answer:
    """E phi(y(T)) to a wanted accuracy, half the width of a 95 % interval with what is left of the bias.

    `functions` is phi, or a mapping of names: expressions or Python functions, as for :func:`spi.expectations`.  With
    a Python function among them, whose range is not known, all are sampled.  The program chooses:
    no sampling where a solution is known, else scheme, steps, extrapolation and samples, from a pilot; it checks
    the bias by one step finer, and continues if the check fails.  `options` are further keys of an experiment of kind
    answer: schemes, extrapolate, sampling, seconds, damping.  `model`, `initial`, `final_time` and `seed` are as for
    :func:`spi.trajectory`.

    The result has ``value``, ``half``, ``bias`` and ``stderr`` (function), whether the accuracy was ``reached``,
    ``warnings``, and ``chosen``; printing it shows all of them in words.  An accuracy that cannot be reached is no
    error: ``reached`` and ``warnings`` report it.

    Raises SpecError with a line for each mistake in the arguments.
    """
    keys = {"initial": initial, "final_time": final_time, "accuracy": accuracy, "seed": seed}
    named = _by_name(functions)
    python = {str(name): phi for name, phi in named.items() if callable(phi)}
    if python:  # formulas that every system has stand for them
        named = {name: f"y1^{n}" if callable(phi) else phi for n, (name, phi) in enumerate(named.items(), 2)}
        functions, options = named, options | {"sampling": True}

    def of_blocks(name: str, phi: Phi) -> Phi:
        """A function of states (d, paths) as one of states (d, ...)."""
        return lambda y: _values_of(name, phi, y.reshape(len(y), -1)).reshape(y.shape[1:])

    data = {"kind": "answer", "model": model, "functions": functions, **keys, **options}
    (case,) = of_mapping(data, "answer", place="").cases
    own = tuple((name, of_blocks(name, phi)) for name, phi in python.items())
    plan: Any = replace(study.plan(case, study.parts(case)[0]), python=own)

    def show(state: State) -> None:
        """Show the share of the predicted work, which no clock decides."""
        done, total, _ = plan.progress(state)
        line.share(f"of about {human_time(total)} of work at typical speed", done, total or 1.0, state.work)

    with Line("answer", progress) as line:
        result: Answer = plan.results(computed(plan, line, show))
    return result
