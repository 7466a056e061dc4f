"""States along paths, and expectations of functions of the last, as arrays."""

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from ..ensemble.loop import TimeGrid, paths_of
from ..ensemble.observer import invariants_of, state_recorder
from ..ensemble.protocol import named_numbers
from ..ensemble.random_states import block_states
from ..expressions import as_numpy, parse_expression
from ..expressions.arithmetic import NumberError
from ..kinds.blocks import SampledPlan, integrated_batch
from ..kinds.plans import State, path_grid
from ..kinds.trajectory import study
from ..kinds.trajectory.study import TrajectoryPlan
from ..models.delegation import undamped
from ..numerics.rng import LANES
from ..running import workers
from ..running.compiling import compile_missing, physical_memory
from ..running.run import kernel_calls
from ..specs import SpecError
from ..statistics.accumulators import Array, Batch, Sums, counted, moments
from ..statistics.estimators import group_counts, mean_over_paths, standard_deviation
from ..storage.records import Part
from .progress import ProgressDisplay
from .results import component_names, dataset_of, netcdf_attributes
from .specs import of_mapping, whole

_BATCH_BYTES = 64e6  # of the states of some blocks, which are handed to an observer together

_MUCH_BYTES = 1e9  # of states, of which a person is told

#: Keys of specs that decide nothing of a path, and why.
_OF_SPECS = {
    "times": "chooses fields of a figure; every=k stores each k-th state, and .sel(t=...) takes some of them",
    **dict.fromkeys(("panels", "title", "asks", "figure"), "is for figures and tables; leave it out"),
    **dict.fromkeys(("cases", "profiles", "sweep", "expect"), "is for spi.run; leave it out"),
    **dict.fromkeys(("kind", "schemes"), "cannot be chosen; give the scheme as second argument"),
}

_OF_EXPERIMENTS = ("case_title", "panels")  # attributes that say nothing of a path

ObserverFunction = Callable[[np.ndarray, np.ndarray], Any]


def trajectory(
    model: Any,
    scheme: str,
    *,
    initial: Sequence[Any],
    final_time: Any,
    step: Any,
    seed: int = 1,
    path: int = 0,
    samples: int | None = None,
    every: int = 1,
    observe: ObserverFunction | None = None,
    progress: bool | None = None,
    **options: Any,
) -> xr.Dataset:
    """Paths of a scheme: states, Hamiltonian and Casimirs at the times 0, k h, 2 k h, ..., T with k = `every`.

    `model` is what stands under ``model:`` in a spec: a name or a mapping; or a model's class, or a record of it.
    `initial`, `final_time` T, `step` h and `seed` are as in a spec, and so are further `options`: damping, eps,
    truncate_noise, compositions.

    Without `samples` it is the one path of number `path`: ``y`` (t, component), ``hamiltonian`` (t) and ``casimirs``
    (t, casimir).  With `samples` there are those of the numbers 0, ..., samples - 1, and a first axis ``path``.  The
    same seed, number and step give the same Brownian path with every scheme, and the same numbers as ``spi.run``.

    `observe` stores something else instead of the states, so that memory does not bound the number of samples: it is
    called with the times (times,) and the states (paths, times, components) of some paths at a time, and returns an
    array whose first axis is that of the paths, or a mapping of names and such arrays; the variables of the result are
    these, or ``observed``.  A second axis as long as the times is the axis ``t``, unless there are as many components.
    It is given 64 paths at least, so that these at all times must find room in memory.

    Raises SpecError with a line for each mistake in the arguments.
    """
    count = None if samples is None else whole("samples", samples, 1)
    if observe is not None and count is None:
        raise SpecError("samples: missing; add samples, how many paths are observed")
    keys = {"initial": initial, "final_time": final_time, "step": step, "seed": seed, "path": path, "every": every}
    plan = plan_of(model, scheme, keys | options)
    with ProgressDisplay("trajectory", progress) as line:
        if count is None:
            return _one_path(plan, line)
        if observe is None:
            return _all_states(plan, count, line)
        return _observed(plan, count, observe, line)


def plan_of(model: Any, scheme: str, keys: dict[str, Any]) -> TrajectoryPlan:
    """Plan of a path; SpecError if anything is wrong with the keys of the spec that it would have."""
    if needless := [f"{key}: {reason}" for key, reason in _OF_SPECS.items() if key in keys]:
        raise SpecError(*needless)
    fixed = {"kind": "trajectory", "model": model, "schemes": [scheme], "panels": ["components"]}
    (case,) = of_mapping(fixed | keys, "trajectory", place="").cases
    if len(case.runs) > 1:
        raise SpecError(f"eps: has {len(case.runs)} values; must be one number here")
    ((name, eps),) = case.runs
    return study.plan(case, Part(name, eps=eps))


def computed(plan: Any, line: ProgressDisplay, show: Callable[[State], None]) -> State:
    """Final state of a plan; until then `show` is called with the state now and then."""
    state = State(plan)
    compile_missing(kernel_calls([plan]), line.watch.report_compiling)
    workers.advance_here([state], lambda number: show(state))
    return state


def _one_path(plan: Any, line: ProgressDisplay) -> xr.Dataset:
    """One path with its invariants."""
    state = computed(plan, line, lambda state: line.share("path", plan.progress(state).done, 1))
    record = plan.results(state)
    dataset = dataset_of(record.group(), record)
    dataset.attrs = _of_paths(dataset.attrs)
    return dataset


def times_of(plan: TrajectoryPlan) -> np.ndarray:
    """Times of the stored states."""
    return np.arange(plan.case.recorded + 1) * plan.case.spacing * plan.case.step


def _batches(plan: Any, samples: int, line: ProgressDisplay, at_once: bool) -> Iterator[np.ndarray]:
    """States (paths, times, d) of the first so many paths, block after block; all or one batch stored `at_once`.

    Warns where they take much memory; SpecError if this machine has less.
    """
    times, d, every = plan.case.recorded + 1, len(plan.initial), plan.case.every
    most, total = max(1, int(_BATCH_BYTES / (8 * LANES * times * d))), math.ceil(samples / LANES)
    paths = LANES * (total if at_once else min(most, total))
    size, memory = 8.0 * paths * times * d, physical_memory()
    states = f"the states of {paths} paths at {times} times take {size / 1e9:.3g} GB at once"
    if memory is not None and size > memory:
        right = f"store fewer, e.g. every={every * math.ceil(2 * size / memory)}"
        raise SpecError(f"every: is {every}: {states}, and this machine has {memory / 1e9:.3g} GB; {right}")
    if size > _MUCH_BYTES:
        warnings.warn(f"{states}; a larger every= stores fewer", stacklevel=2)
    compile_missing(kernel_calls([plan]), line.watch.report_compiling)
    for first in range(0, total, most):
        line.share("paths", first, total)
        batch = Batch(0, first, min(most, total - first), samples)
        y = np.empty((batch.blocks, times, d * LANES))
        y[:, 0] = block_states(plan.initial, plan.stream, first, batch.blocks)
        integrated_batch(plan, plan.grid, plan.stream, batch, state_recorder(plan.grid, y, every))
        lanes = y.reshape(batch.blocks, times, d, LANES).transpose(0, 3, 1, 2)
        yield lanes.reshape(-1, times, d)[: samples - batch.first_path]


def _all_states(plan: TrajectoryPlan, samples: int, line: ProgressDisplay) -> xr.Dataset:
    """States of all paths with their invariants."""
    y, times = np.concatenate(list(_batches(plan, samples, line, at_once=True))), times_of(plan)
    energy, conserved = invariants_of(plan.model, y.reshape(-1, y.shape[2]), np.tile(times, len(y)))
    return xr.Dataset(
        {
            "y": (("path", "t", "component"), y, {"long_name": "state"}),
            "hamiltonian": (("path", "t"), energy.reshape(y.shape[:2]), {"long_name": "Hamiltonian"}),
            "casimirs": (("path", "t", "casimir"), conserved.reshape(*y.shape[:2], -1), {"long_name": "Casimirs"}),
        },
        {
            "path": np.arange(samples),
            "t": ("t", times, {"long_name": "time"}),
            "component": component_names(plan.case.variables, y.shape[2]),
            "casimir": np.arange(conserved.shape[1]),
        },
        _attributes(plan),
    )


def _observed(plan: TrajectoryPlan, samples: int, observe: ObserverFunction, line: ProgressDisplay) -> xr.Dataset:
    """Values that an observer makes of all paths."""
    parts: dict[str, list[np.ndarray]] = {}
    times = times_of(plan)
    for y in _batches(plan, samples, line, at_once=False):
        observed = observe(times, y)
        for name, returned in observed.items() if isinstance(observed, dict) else [("observed", observed)]:
            values = np.asarray(returned)
            if name in ("path", "t"):
                raise ValueError(f"observe returned {name}, which is the name of an axis; take another")
            if values.shape[:1] != y.shape[:1]:
                problem = f"returned {name} of shape {values.shape} for {len(y)} paths"
                raise ValueError(f"observe {problem}; the first axis must be that of the paths")
            parts.setdefault(name, []).append(values)
    variables = {}
    for name, arrays in parts.items():
        values = np.concatenate(arrays)
        along = values.shape[1:2] == times.shape and len(times) != len(plan.initial)
        axes = "path", *("t" if along and i == 1 else f"{name}_{i}" for i in range(1, values.ndim))
        variables[name] = axes, values
    coordinates = {"path": np.arange(samples), "t": ("t", times, {"long_name": "time"})}
    return xr.Dataset(variables, coordinates, _attributes(plan))


def _attributes(plan: TrajectoryPlan) -> dict[str, Any]:
    """Attributes of many paths."""
    return _of_paths({"step": plan.case.step, "every": plan.case.every, **plan.description().attributes()})


def _of_paths(attributes: dict[str, Any]) -> dict[str, Any]:
    """Attributes that say something of paths, as far as they have values."""
    return netcdf_attributes({name: value for name, value in attributes.items() if name not in _OF_EXPERIMENTS})


# ---------------------------------------------------------------------------------------------------------------------
# Expectations of functions of the final state: E phi(y_h(T)).
# ---------------------------------------------------------------------------------------------------------------------


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
    with ProgressDisplay("expectations", progress) as line:
        state = computed(plan, line, lambda state: line.share("paths", state.tally().paths, count))
    about = {"samples": count, "scheme": scheme, "model": finest.case.model_name}
    return _dataset(state.total(), list(plan.functions), h, about)


def functions_by_name(functions: Any) -> Mapping[str, Any]:
    """Functions by their names, one alone as phi."""
    return functions if isinstance(functions, Mapping) else {"phi": functions}


def _callables(functions: Any, finest: TrajectoryPlan) -> dict[str, Phi]:
    """Functions by their names, of expressions by NumPy; SpecError if one is none."""
    d, phis = len(finest.initial), {}
    own = finest.case.variables, named_numbers(undamped(finest.case.model))
    for name, phi in functions_by_name(functions).items():
        try:
            phis[str(name)] = phi if callable(phi) else as_numpy(parse_expression(str(phi), d, *own))
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
class MeansPlan(SampledPlan):
    """Means of functions at the end of paths, summed up as the weak study does, whose bits they have."""

    sums = EndSums

    functions: dict[str, Phi]
    h: tuple[float, ...]  #: step sizes, from large to small
    count: int  #: of paths

    @property
    def samples(self) -> int:
        """Number of paths."""
        return self.count

    @cached_property
    def grid(self) -> TimeGrid:
        """Times of the paths and their step sizes; SpecError for other than doublings of the smallest."""
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
        values = np.array([values_of(name, phi, y)[0] for name, phi in self.functions.items()])
        return np.where(np.isfinite(values), values, 0.0)

    def lengths(self, number: int) -> dict[str, int]:
        return {"level": len(self.steps), "function": len(self.functions)}

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Values (blocks, L, F, LANES) at the end of a batch, NaN of idle paths."""
        states, _ = self.integrated(batch)
        y = paths_of(states, len(self.initial))[..., : batch.end - batch.first_path]
        values: Array = np.full((len(self.steps), len(self.functions), batch.blocks * LANES), np.nan)
        for level, of_level in enumerate(y):
            for f, (name, phi) in enumerate(self.functions.items()):
                values[level, f, : y.shape[-1]] = values_of(name, phi, of_level)
        values = np.moveaxis(values.reshape(*values.shape[:2], batch.blocks, LANES), 2, 0)
        with np.errstate(all="ignore"):
            apart = values - self.at_start[:, np.newaxis]
        return {"values": values, "apart": apart, "nonfinite": np.logical_not(np.isfinite(values).all(axis=2))}


def values_of(name: str, phi: Phi, y: np.ndarray) -> np.ndarray:
    """Values (paths,) of a function of states (d, paths); ValueError if it returns anything else."""
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
