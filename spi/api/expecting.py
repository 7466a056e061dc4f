"""Expectations E phi(y_h(T)) of functions of the final state, the functions expressions or Python."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..ensemble.areas import fourier_terms
from ..ensemble.loop import FinalStates, Grid, empty_report, grid, integrate, shortest, steps_of
from ..expressions import as_numpy, parse_expression
from ..expressions.arithmetic import NumberError
from ..kinds.plans import KernelCall
from ..kinds.trajectory.study import TrajectoryPlan
from ..numerics.rng import LANES
from ..running.compiling import compile_missing
from ..specs import SpecError
from .paths import plan_of
from .progress import Line
from .specs import whole

_BATCH_BYTES = 16e6  # of final states; the division into batches decides the last bits of means

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

    Raises SpecError if anything is wrong with what is asked for.
    """
    count = whole("samples", samples, 2)
    keys = {"initial": initial, "final_time": final_time, "seed": seed} | options
    each = _plans(model, scheme, keys, np.atleast_1d(np.asarray(steps, dtype=object)).tolist())
    finest = each[0]
    phis = _callables(functions, finest)
    doublings = [_doublings(one.case.step, finest.case.step) for one in each]
    sums = _Sums.none((len(phis), len(each)))
    with Line("expectations", progress) as line:
        for states, done in _final_states(finest, doublings, count, line):
            sums = sums.plus(_values(phis, states))
            line.share("paths", done, count)
    h = [one.case.step for one in each][::-1]
    return _dataset(sums, list(phis), h, {"samples": count, "scheme": scheme, "model": finest.case.model_name})


def _plans(model: Any, scheme: str, keys: dict[str, Any], steps: list[Any]) -> list[TrajectoryPlan]:
    """The plans of paths with each step size, from small to large."""
    if not steps:
        raise SpecError("steps: is an empty list; give a step size, or several")
    return sorted((plan_of(model, scheme, keys | {"step": h}) for h in steps), key=lambda one: one.case.step)


def _callables(functions: Any, ready: TrajectoryPlan) -> dict[str, Phi]:
    """The functions by their names."""
    named = functions if isinstance(functions, Mapping) else {"phi": functions}
    return {str(name): one if callable(one) else _parsed(str(name), one, ready) for name, one in named.items()}


def _parsed(name: str, text: Any, ready: TrajectoryPlan) -> Phi:
    d = len(ready.initial)
    try:
        phi: Phi = as_numpy(parse_expression(str(text), d, ready.case.variables))
        return phi
    except NumberError as error:
        right = f"must be an expression in y1 .. y{d} such as sin(2*pi*y1) + y2^2, or a Python function"
        raise SpecError(f"functions.{name}: is '{text}' ({error}); {right}") from None


def _doublings(h: float, finest: float) -> int:
    """How often the smallest step is doubled."""
    doublings = round(math.log2(h / finest))
    if abs(finest * 2.0**doublings - h) > 1e-12 * h:
        raise SpecError(f"steps: has {h:g}, which is not 1, 2, 4, 8, ... times the smallest, {finest:g}; take others")
    return doublings


def _final_states(
    ready: TrajectoryPlan, doublings: list[int], samples: int, line: Line
) -> Iterator[tuple[np.ndarray, int]]:
    """Final states (steps from small to large, d, paths) of some paths at a time, and how many paths are done."""
    h, d, levels = ready.case.step, len(ready.initial), len(doublings)
    terms = fourier_terms(ready.case.model, [ready.scheme], h)
    count = round(ready.case.final_time / h)
    times = grid(h, count, doublings, ready.case.truncate_noise, area_terms=terms)
    most, total = max(1, int(_BATCH_BYTES / (8 * LANES * levels * d))), math.ceil(samples / LANES)

    def call(times: Grid, first: int, blocks: int, end: int) -> KernelCall:
        last = FinalStates(np.zeros((blocks, levels, d * LANES)), steps_of(times))
        what = ready.scheme, ready.model, ready.initial, times, ready.stream
        return KernelCall(integrate, (*what, last, empty_report(blocks, levels), first, blocks, end))

    compile_missing([(ready.part.scheme, call(shortest(times), 0, 1, LANES))], line.watch.report_compiling)
    for first in range(0, total, most):
        blocks = min(most, total - first)
        one = call(times, first, blocks, samples)
        one.kernel(*one.arguments)
        last = one.arguments[5]
        y = last.y.reshape(blocks, levels, d, LANES).transpose(1, 2, 0, 3).reshape(levels, d, -1)
        done = min((first + blocks) * LANES, samples)
        yield y[..., : done - first * LANES], done


def _values(phis: dict[str, Phi], states: np.ndarray) -> np.ndarray:
    """The values (functions, steps, paths) of all functions."""
    values = np.empty((len(phis), len(states), states.shape[-1]))
    for f, (name, phi) in enumerate(phis.items()):
        for level, y in enumerate(states):
            with np.errstate(all="ignore"):
                found = np.asarray(phi(y))
            if found.shape != y.shape[-1:]:
                raise ValueError(f"the function {name} returned shape {found.shape} for {y.shape[-1]} paths; one each")
            values[f, level] = found
    return values


class _Sums:
    """The number of paths, the means of the functions, sums of squares about them, and how many were not finite."""

    def __init__(self, paths: int, mean: np.ndarray, squares: np.ndarray, nonfinite: np.ndarray) -> None:
        self.paths, self.mean, self.squares, self.nonfinite = paths, mean, squares, nonfinite

    @classmethod
    def none(cls, shape: tuple[int, int]) -> "_Sums":
        return cls(0, np.zeros(shape), np.zeros(shape), np.zeros(shape[1], int))

    def plus(self, values: np.ndarray) -> "_Sums":
        """With values (functions, steps, paths) added as Chan, Golub and LeVeque do, without cancellation."""
        n = values.shape[-1]
        with np.errstate(all="ignore"):
            mean = values.mean(axis=-1)
            squares = ((values - mean[..., np.newaxis]) ** 2).sum(axis=-1)
            apart, paths = mean - self.mean, self.paths + n
            together = self.squares + squares + apart**2 * (self.paths * n / paths)
            lost = (~np.isfinite(values).all(axis=0)).sum(axis=-1)
            return _Sums(paths, self.mean + apart * (n / paths), together, self.nonfinite + lost)


def _dataset(sums: _Sums, names: list[str], h: list[float], attributes: dict[str, Any]) -> xr.Dataset:
    """The result, from the largest step to the smallest."""
    stderr = np.sqrt(sums.squares / (sums.paths - 1) / sums.paths)
    axes = ("function", "h")
    return xr.Dataset(
        {
            "expectation": (axes, sums.mean[:, ::-1], {"long_name": "E phi(y_h(T))"}),
            "expectation_stderr": (axes, stderr[:, ::-1], {"long_name": "standard error of the expectation"}),
            "nonfinite": (("h",), sums.nonfinite[::-1], {"long_name": "diverged paths (NaN or infinity)"}),
        },
        {"function": names, "h": ("h", h, {"long_name": "step size"})},
        attributes,
    )
