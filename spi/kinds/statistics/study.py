"""Statistics of functions of paths at many times: sums over paths, and what follows from them."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.loop import grid, integrated, thread_count
from spi.ensemble.moments import add_moments, count_values
from spi.ensemble.observer import state_recorder
from spi.ensemble.random_states import first_states, in_blocks
from spi.kinds.blocks import BlocksPlan
from spi.kinds.plans import Cost, Done, State
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.statistics.estimators import GROUPS, group_counts, jackknife_stderr
from spi.statistics.powers import mean_over_paths
from spi.storage.records import Part

from .functions import COARSER, origin_of
from .quantiles import Bins, histogram, quantiles
from .results import Corrected, Statistics

_BATCH_BYTES = 64e6
_PILOT = 16  # blocks, whatever the number of samples, so that more samples have the same bins
_CACHED = 2**15  # floats of an array that fits the cache several times
_DRAWS = 4000  # for the factor of simultaneous bands


class Sums(NamedTuple):
    """Of F functions at T times, over some paths."""

    paths: int
    seconds: float
    cpu_seconds: float
    values: np.ndarray  #: (2, T, F, GROUPS) sums of phi and of its square
    products: np.ndarray  #: (1, T, P, GROUPS) sums of products of pairs of functions
    counts: np.ndarray  #: (T, F, 2 + bins) int64: below all bins, in each, and above all or NaN
    nonfinite: int

    def plus(self, later: "Sums") -> "Sums":
        """These paths and some later ones."""
        mine, others = self._asdict(), later._asdict()
        return Sums(**{name: mine[name] + others[name] for name in self._fields})


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case: Any, part: Part) -> "StatisticsPlan":
    """The plan for one scheme of a case."""
    terms = fourier_terms(case.model, [case.row(part.scheme, part.eps).record], case.step)
    times = grid(case.step, round(case.final_time / case.step), truncate=case.truncate_noise, area_terms=terms)
    return StatisticsPlan(case=case, part=part, grid=times, samples=case.samples)


@dataclass(frozen=True, kw_only=True)
class StatisticsPlan(BlocksPlan):
    """Statistics of one scheme."""

    def cost(self) -> Cost:
        """Steps of all paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = self.grid.reference_steps * self.blocks * LANES
        return Cost(steps, steps * 1e-9 * typical_ns(self.row, self.model), int(_BATCH_BYTES))

    @cached_property
    def functions(self) -> tuple[Any, ...]:
        """The functions of the case, and behind them for each passage the one that looks at every second time."""
        found = self.case.path_functions
        return *found, *(one._replace(functional=COARSER) for one in found if one.functional == "passage")

    @cached_property
    def origins(self) -> np.ndarray:
        """(F, 1) what functions are at t = 0, which is taken from all values, so that variances do not cancel."""
        return np.array([[origin_of(function, self.initial)] for function in self.functions])

    @cached_property
    def places(self) -> np.ndarray:
        """Which of the stored states have statistics."""
        return self.case.places

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """The pairs of functions whose products are summed up."""
        return np.triu_indices(len(self.case.functions) if "covariance" in self.case.statistics else 0)

    @cached_property
    def bins(self) -> Bins:
        """Bins that hold what the first paths do, with half of their range beside it."""
        values, _ = self.rows(0, 0, _PILOT, _PILOT * LANES)
        return Bins.around(np.moveaxis(values, 0, -2).reshape(*values.shape[1:3], -1), self.case.fine_bins)

    def empty(self, number: int) -> Sums:
        """The sums over no paths."""
        times, functions = len(self.case.places), len(self.functions)
        fine = self.case.fine_bins
        return Sums(
            paths=0,
            seconds=0.0,
            cpu_seconds=0.0,
            values=np.zeros((2, times, functions, GROUPS)),
            products=np.zeros((1, times, len(self.pairs[0]), GROUPS)),
            counts=np.zeros((times, functions if fine else 0, 2 + fine), np.int64),
            nonfinite=0,
        )

    def most_blocks(self, number: int) -> int:
        """How many blocks a batch may have, because of memory."""
        times = self.grid.reference_steps // self.case.stride + 1
        return max(1, int(_BATCH_BYTES / (8 * LANES * times * (len(self.initial) + 4 * len(self.functions)))))

    def rows(self, number: int, first: int, blocks: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Values of functions less their origins (blocks, T, F, LANES), and which paths diverged (blocks, LANES)."""
        d, stride = len(self.initial), self.case.stride
        y = np.empty((blocks, self.grid.reference_steps // stride + 1, d * LANES))
        y[:, 0] = in_blocks(first_states(self.initial, self.stream, first, blocks), blocks)
        recorder = state_recorder(self.grid, y, stride)
        integrated(self.scheme, self.model, self.initial, self.grid, self.stream, first, blocks, end, recorder)
        states = np.moveaxis(y.reshape(blocks, -1, d, LANES), 2, 0)
        values = np.empty((blocks, len(self.places), len(self.functions), LANES))
        few = max(1, _CACHED // (states.shape[2] * LANES))
        pieces = [slice(begin, begin + few) for begin in range(0, blocks, few)]
        with ThreadPoolExecutor(min(thread_count(), len(pieces))) as threads:
            list(threads.map(lambda piece: self._evaluate(states[:, piece], values[piece]), pieces))
        return values, np.logical_not(np.isfinite(states[:, :, -1]).all(axis=0))

    def _evaluate(self, states: np.ndarray, values: np.ndarray) -> None:
        """Put the functions of states (d, blocks, stored, LANES) into values (blocks, T, F, LANES)."""
        places, between = self.places, self.case.stride * self.case.step
        chosen = states if len(places) == states.shape[2] else states[:, :, places]
        with np.errstate(all="ignore"):
            for f, function in enumerate(self.functions):
                if function.functional:
                    found = np.broadcast_to(function.values(states), states.shape[1:])
                    along = function.along(found, between)[:, places]
                else:
                    along = function.values(chosen)
                np.subtract(along, self.origins[f], out=values[:, :, f])

    def added(self, sums: Sums, rows: tuple[np.ndarray, np.ndarray], at: slice, first: int, end: int) -> Sums:
        """The sums with the rows `at`, of which the first is that of block `first`."""
        values, lost = (of_all[at] for of_all in rows)
        added = sums._replace(values=sums.values.copy(), products=sums.products.copy(), counts=sums.counts.copy())
        add_moments(values, first, end, added.values, *self.pairs, added.products)
        if sums.counts.size:
            count_values(values, first, end, self.bins.low, 1 / self.bins.width, added.counts)
        counted = first * LANES + np.arange(lost.size).reshape(lost.shape) < end
        return added._replace(nonfinite=sums.nonfinite + int((lost & counted).sum()))

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error of the first mean at the last time."""
        known = state.so_far()
        if not known.paths:
            return Done(0, self.samples, float("nan"))
        counts = group_counts(known.paths)
        mean, without = mean_over_paths(known.values[0], counts)
        return Done(known.paths, self.samples, float(jackknife_stderr(mean, without, counts)[-1, 0]))

    def results(self, state: State) -> Statistics:
        """The results of one scheme of a case, from its final state."""
        sums, case, groups = state.total(), self.case, group_counts(self.samples)
        mean, without = (np.moveaxis(each, -1, -2) for each in mean_over_paths(sums.values[0], groups))
        names = tuple(case.functions)
        stderr, count = jackknife_stderr(mean, without, groups), len(names)
        bins = self.bins._replace(low=self.bins.low + self.origins.T) if sums.counts.size else None
        counted: tuple[Any, Any, Any] = (
            sums.counts,
            bins,
            [function.functional != "passage" for function in self.functions[:count]],
        )
        return Statistics(
            **self.whole(state),
            functions=names,
            texts=tuple(function.told for function in self.functions[:count]),
            t=case.t,
            mean=(mean + self.origins)[:count],
            mean_stderr=stderr[:count],
            band=simultaneous(mean, without, stderr)[:count],
            corrected=self._corrected(mean, without, groups) if count < len(mean) else None,
            **(self._variance(sums, groups) if "variance" in case.statistics else {}),
            **({"others": names} | self._covariance(sums, groups) if "covariance" in case.statistics else {}),
            quantiles=quantiles(*counted, case.quantiles) if "quantiles" in case.statistics else None,
            histogram=histogram(*counted, case.bins) if "histogram" in case.statistics else None,
            reference=case.reference_means if case.reference else None,
            nonfinite=sums.nonfinite,
            step=case.step,
            samples=self.samples,
            ns_per_step=1e9 * sums.cpu_seconds / (self.grid.reference_steps * self.samples),
        )

    def _corrected(self, mean: np.ndarray, without: np.ndarray, groups: np.ndarray) -> Corrected:
        """Shares of passages (F, T) without the bias of looking at some times only, which is of order 1/2 in them."""
        count = len(self.case.functions)
        value, error = np.full((2, count, mean.shape[1]), np.nan)
        passages = [f for f in range(count) if self.functions[f].functional == "passage"]
        for coarser, f in enumerate(passages, count):
            fine, rough = (each[..., [f, coarser], :] for each in (mean, without))
            factor = 1 + math.sqrt(2)
            value[f] = fine[0] + factor * (fine[0] - fine[1])
            left_out = rough[:, 0] + factor * (rough[:, 0] - rough[:, 1])
            error[f] = jackknife_stderr(value[f], left_out, groups)
            value[f, 1::2] = error[f, 1::2] = np.nan  # where every second time is the one before
        return Corrected(share=value, share_stderr=error)

    def _variance(self, sums: Sums, groups: np.ndarray) -> dict[str, Any]:
        """Variances (F, T) and their standard errors."""
        (mean, square), without = mean_over_paths(sums.values[:, :, : len(self.case.functions)], groups)
        return _named("variance", square - mean**2, without[:, 1] - without[:, 0] ** 2, groups, self.samples)

    def _covariance(self, sums: Sums, groups: np.ndarray) -> dict[str, Any]:
        """Covariances (F, F, T) and their standard errors."""
        i, j = self.pairs
        mean, without = mean_over_paths(sums.values[0], groups)
        product, without_product = mean_over_paths(sums.products[0], groups)
        value = product - mean[..., i] * mean[..., j]
        leave_one_out = without_product - without[..., i] * without[..., j]
        found = _named("covariance", value, leave_one_out, groups, self.samples)
        count = len(self.case.functions)
        whole = np.empty((count, count), int)
        whole[i, j] = whole[j, i] = np.arange(len(i))
        return {name: values[whole] for name, values in found.items()}


def _named(
    name: str, value: np.ndarray, without: np.ndarray, groups: np.ndarray, samples: int
) -> dict[str, np.ndarray]:
    """Values (T, F) and their standard errors as (F, T), of a second moment about the mean without its bias."""
    unbiased = samples / max(samples - 1, 1)
    return {name: unbiased * value.T, f"{name}_stderr": unbiased * jackknife_stderr(value, without, groups).T}


def simultaneous(mean: np.ndarray, without: np.ndarray, stderr: np.ndarray) -> np.ndarray:
    """(F,) the factor c by which mean -+ c stderr holds all true means (F, T) at once in 95 % of cases.

    The largest of correlated normal variables, of which the correlations are those of the leave-one-out values; with
    normal weights for these, drawn from a fixed seed.
    """
    spread = without - without.mean(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        units = spread / np.sqrt((spread**2).sum(axis=0))
    units[~np.isfinite(units)] = 0.0
    weights = np.random.default_rng(1).standard_normal((_DRAWS, len(units)))
    found = [np.abs(weights @ units[:, f]).max(axis=1) for f in range(len(mean))]
    return np.maximum(np.quantile(found, 0.95, axis=1), 1.96)
