"""Work and precision: the errors of schemes against the processor time that one path takes.

Errors are those of an experiment of kind strong or, where there is a test function, weak.  The time is measured for
each step size alone, on one thread, after everything is compiled; with extrapolation for the step sizes that are
combined, on common paths.  It is the median of several repeats, in each of which all step sizes take their turn, so
that a machine that is slow for a while is so for all of them.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import brownian
from spi.ensemble.loop import arguments_of, grid, integrate, limited_threads, thread_count
from spi.ensemble.observer import path_observer
from spi.kinds.plans import Done, KernelCall, PartCost, Plan, State, Task
from spi.kinds.strong import study as strong
from spi.kinds.strong.results import StrongErrors
from spi.kinds.weak import study as weak
from spi.kinds.weak.results import WeakErrors, cannot_do, not_reached
from spi.numerics.rng import LANES
from spi.printing.text import joined
from spi.schemes import typical_ns
from spi.statistics.tallies import Chunk, PathSet
from spi.storage.records import Part

from .results import WorkPrecision

#: Steps of paths that a step size takes in one repeat: some milliseconds.
_PATH_STEPS = 2**20

_REPEAT = "repeat "  # with which the names of the tasks begin that measure times


def parts(case: Any) -> list[Part]:
    """Parts of a case in their order: each scheme, weak errors with the first estimator that can do it."""
    chosen: dict[str, Part] = {}
    for part in (weak if case.functions else strong).parts(case):
        chosen.setdefault(part.variant, part)
    return [*chosen.values()]


def left_out(case: Any) -> tuple[str, ...]:
    """Schemes that no estimator of weak errors can do."""
    done = {part.scheme for part in parts(case)}
    return tuple(scheme for scheme in case.schemes if scheme not in done)


def remarks(case: Any) -> Iterator[str]:
    """Warnings: parts of a case that are left out or changed."""
    if schemes := left_out(case):
        yield cannot_do(joined(case.estimators), schemes)
    used = dict.fromkeys(part.estimator for part in parts(case))
    yield from (line for name in used if name for line in weak.ESTIMATORS[name].remarks(case))


def plan(case: Any, part: Part) -> "WorkPlan":
    """Plan for one scheme of a case."""
    return WorkPlan(case=case, part=part, errors=(weak if case.functions else strong).plan(case, part))


class _Job(NamedTuple):
    """Work that is timed at one step size."""

    paths: int
    run: Callable[[], Any]  #: integrates these paths from 0 to T


@dataclass(frozen=True, kw_only=True)
class WorkPlan(Plan):
    """Errors of one scheme, and then the time of a path at each step size."""

    record = WorkPrecision

    errors: Any  #: the plan of the strong or weak errors

    @property
    def of_paths(self) -> Plan:
        """That of the errors."""
        return self.errors

    @property
    def h(self) -> np.ndarray:
        """(S,) the steps of the results, from large to small."""
        return self.errors.h if self.case.functions else np.array(self.case.steps)

    def cost(self) -> PartCost:
        """Cost of the errors and of the times, which one thread measures."""
        errors, finest = self.errors.cost(), np.maximum(self.path_steps, LANES * self.case.final_time / self.h)
        of_all = float(finest.sum()) * sum(0.5**i for i in range(self.part.extrapolate + 1))
        times = 1e-9 * typical_ns(self.row, self.model) * of_all * (self.case.repeats + 1)
        return errors._replace(seconds=errors.seconds + times * thread_count())

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; a path set belongs to the errors."""
        entries = super().deciding(None) if number is None else self.errors.deciding(number)
        return {key: value for key, value in entries.items() if key != "repeats"}

    def initial_extra(self) -> Any:
        """That of the errors."""
        return self.errors.initial_extra()

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """Paths of the errors."""
        return self.errors.path_sets(extra)

    def empty(self, number: int) -> Any:
        """Sums over no paths."""
        return self.errors.empty(number)

    def advance(self, chunks: Sequence[Chunk], started: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of the errors, see :class:`~spi.kinds.plans.Plan`."""
        return self.errors.advance(chunks, started)

    def next_allocation(self, state: State) -> Any | None:
        """The next allocation of the errors."""
        return self.errors.next_allocation(self._of_errors(state))

    def _of_errors(self, state: State) -> State:
        """State of the errors."""
        own = State(self.errors)
        own.extra, own.tallies = state.extra, state.tallies
        own.answers = {name: answer for name, answer in state.answers.items() if not name.startswith(_REPEAT)}
        return own

    def kernel_calls(self) -> list[KernelCall]:
        """Kernels of the errors, and the fewest steps of one block that can be timed."""
        timed = self._arguments(float(self.h[0]), 2**self.part.extrapolate, 1)
        return [*self.errors.kernel_calls(), KernelCall(integrate, timed)]

    def tasks(self, state: State) -> list[Task]:
        """Those of the errors, and the repeats of the measurement."""
        jobs: list[_Job] = []

        def measure() -> dict[str, Any]:
            """Processor seconds of one path (S,)."""
            if not jobs:
                jobs.extend(self.job(h) for h in self.h.tolist())
                _seconds_per_path(jobs)  # compiles and touches the memory, so it does not count
            return {"times": np.array(_seconds_per_path(jobs))}

        return [*self.errors.tasks(self._of_errors(state)), *(Task(repeat, measure) for repeat in self._repeats)]

    @property
    def _repeats(self) -> list[str]:
        """Names of the tasks that measure."""
        return [f"{_REPEAT}{number}" for number in range(1, self.case.repeats + 1)]

    @property
    def path_steps(self) -> int:
        """Steps of paths that are timed at once: fewer where they would take more than about 0.1 s."""
        return min(_PATH_STEPS, int(1e8 / typical_ns(self.row, self.model)))

    def job(self, h: float) -> _Job:
        """Whole paths at step size h; weak errors need their ends only, strong ones an observer."""
        steps = round(self.case.final_time / h)
        blocks = max(1, self.path_steps // (LANES * steps))
        scheme, model, start, *others = self._arguments(h, steps, blocks)
        return _Job(blocks * LANES, lambda: integrate(scheme, model, start.copy(), *others))

    def _arguments(self, h: float, steps: int, blocks: int) -> tuple[Any, ...]:
        """Arguments of the loop for steps of size h of some blocks.

        With extrapolation there are also half as many steps of size 2h, and so on, of the same Brownian paths.
        """
        case, sizes = self.case, self.part.extrapolate + 1
        paths: dict[str, Any] = {"doublings": range(sizes - 1, -1, -1), "by_reference": (0,) * sizes}
        paths["area_terms"] = fourier_terms(self.model, [self.scheme], h, areas=case.areas)
        reference = case.reference_record(self.part.eps)
        times = grid(h, steps, truncate=case.clipping, reference_scheme=reference, **paths)
        observer = None if case.functions else path_observer(self.model, self.initial, times, blocks)
        run = self.scheme, self.model, self.initial, times, brownian(case.seed), 0, blocks, blocks * LANES
        return arguments_of(*run, observer)

    def progress(self, state: State) -> Done:
        """Progress of the errors and, from the first repeat on, of the times, in seconds of typical speed."""
        of_errors = self.errors.progress(self._of_errors(state))
        measured = sum(repeat in state.answers for repeat in self._repeats)
        if not measured:
            return of_errors
        seconds = 1e-9 * typical_ns(self.row, self.model) * self.path_steps * len(self.h)
        return Done(measured * seconds, self.case.repeats * seconds, of_errors.stderr)

    def results(self, state: State) -> WorkPrecision:
        """Results of one scheme of a case: errors, and the quartiles of the times."""
        case, errors = self.case, self.errors.results(self._of_errors(state))
        of_errors = _of_strong(errors) if isinstance(errors, StrongErrors) else _of_weak(errors)
        times = np.array([state.answers[repeat]["times"] for repeat in self._repeats])
        low, median, high = np.quantile(times, (0.25, 0.5, 0.75), axis=0)
        steps = case.final_time / self.h * sum(0.5**i for i in range(self.part.extrapolate + 1))
        same = ("h", "expected_order", "reference_step", "reference_scheme", "reference_nonfinite", "threads")
        return WorkPrecision(
            about=replace(errors.about, estimator=""),
            **{name: getattr(errors, name) for name in (*same, "wall_seconds")},
            **of_errors,
            ns_per_step=1e9 * median / steps,
            seconds_per_path=median,
            seconds_per_path_low=low,
            seconds_per_path_high=high,
            repeats=case.repeats,
            left_out=left_out(case),
            targets=case.targets or _targets(of_errors["error"][of_errors["resolved"]]),
        )


def _seconds_per_path(jobs: Iterable[_Job]) -> list[float]:
    """Processor seconds of one path of each job, on one thread, one job after the other."""
    seconds = []
    with limited_threads(1):
        for job in jobs:
            began = time.process_time()
            job.run()
            seconds.append((time.process_time() - began) / job.paths)
    return seconds


def _of_strong(errors: StrongErrors) -> dict[str, Any]:
    """Fields that strong errors have under the same names."""
    names = ("error", "error_stderr", "resolved", "nonfinite", "casimir_drift", "order", "samples", "note")
    return {"measure": "strong"} | {name: getattr(errors, name) for name in names}


def _of_weak(errors: WeakErrors) -> dict[str, Any]:
    """Fields that weak errors have of their only test function."""
    fields: dict[str, Any] = {
        "measure": "weak",
        "estimator": errors.about.estimator,
        "functions": errors.formulas,
        "error": np.abs(errors.error[0]),
        "resolved": errors.resolved[0],
        "nonfinite": errors.nonfinite,
        "order": errors.orders[0],
        "note": "; ".join(filter(None, (not_reached(errors), errors.note))),
    }
    if errors.unsampled:
        return fields | {"error_bound": errors.unsampled.error_bound[0]}
    sampled: Any = errors.sampled
    return fields | {"error_stderr": sampled.error_stderr[0], "samples": sampled.samples}


def _targets(error: np.ndarray) -> tuple[float, ...]:
    """Powers of ten within the errors that are resolved, or the next below if there is none."""
    error = error[error > 0.0]
    if not len(error):
        return (0.1,)
    low, high = np.ceil(np.log10(error.min())), np.floor(np.log10(error.max()))
    return tuple(10.0**e for e in np.arange(high, min(low, high) - 1, -1))
