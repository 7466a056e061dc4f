"""Statistics of functions of paths at many times: sums over paths, and what follows from them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise
from types import MappingProxyType
from typing import Any

import numpy as np

from spi.ensemble.loop import one_step, thread_count
from spi.ensemble.random_states import RandomState
from spi.ensemble.scheme_protocol import REPORT, SUMMED
from spi.kinds.blocks import SampledPlan, reported, stderr_of_means
from spi.kinds.functions import ns_to_evaluate
from spi.kinds.plans import KernelCall, PartCost, State, Task, each_scheme
from spi.numerics.rng import LANES
from spi.plugins.dynamics.ensemble.counting import add_moments, count_values, rank_values
from spi.plugins.dynamics.kinds.maps import Cells, DensityMap
from spi.plugins.dynamics.kinds.references import EXACT, STATIONARY
from spi.plugins.dynamics.statistics.cells import cells_around, count_places
from spi.plugins.dynamics.statistics.quantiles import edges_around
from spi.schemes import typical_ns
from spi.statistics.accumulators import Array, Batch, Sums, added, by_group, counted, moments
from spi.statistics.estimators import GROUPS, mean_over_paths
from spi.statistics.intervals import clopper_pearson, student_of_paths
from spi.statistics.rounding import with_rounding

from . import stationary
from .estimates import (
    SPHERE,
    Bins,
    Columns,
    Map,
    PathMoments,
    Unchanged,
    histogram,
    in_threads,
    quantiles,
    simultaneous,
)
from .keys import OF_FITS
from .passages import Distances, InTime, LookTimes, corrected, noise_depends_on_time
from .references import REFERENCES, reference_formulas, seconds_of_means
from .results import LEAST_GROUPS, PANELS, Statistics

_MEANS, _WAVES = "reference means", "linear waves"  # the names of tasks
_BATCH_BYTES = 24e6
_PILOT = 16  # blocks, whatever the number of samples, so that more samples have the same bins
_SHORT = 2.0**-20  # of a step, in which noise alone moves a state
_CACHED = 2**15  # floats of an array that fits the cache several times
# Nanoseconds of one thread for a time of a path: of functionals and conditions, of columns and their pairs, of a value
# that is counted for quantiles or a histogram, and of a series that is correlated in time.
_ALONG_NS, _PASSAGE_NS, _COLUMN_NS, _PAIR_NS, _RANK_NS, _COUNT_NS, _SERIES_NS = 5.0, 80.0, 2.0, 1.0, 11.0, 2.0, 50.0


class StatisticsSums(Sums):
    """Sums over some paths, of F functions and further columns at T times."""

    values: Array = moments("time column")
    products: Array = moments("time pair", 1)  #: of pairs of columns
    counts: Array = added("time counted bin", int)  #: below all bins, in each, and above all or NaN
    ranks: Array = added("time ranked place", int)  #: below all edges, between them, and above all or NaN
    coarse: Array = moments("time passage", 1)  #: who has passed, by looks twice as far apart
    first_times: Array = moments("look passage", 1)  #: mean first times, by looks and by such
    lost: Array = added("time function end", int)  #: of minus infinity, and of infinity or NaN
    cells: Array = added("map one cell", int)  #: outside of all cells, in each, and NaN
    means: Array = by_group("stationary")  #: of each function over the times of a path
    lagged: Array = by_group("stationary lag")  #: of products of values at two times
    waves: Array = by_group("wave lag complex")  #: the same of modes of a lattice
    nonfinite: Array = counted()
    report: Array = added("report")  #: of what steps report that which is summed up


def _lost(values: np.ndarray, batch: Batch) -> np.ndarray:
    """(T, F, 2): the number of values (blocks, T, F, LANES) that are minus infinity, and of those infinity or NaN."""
    finite = np.isfinite(values)
    if finite.all():
        return np.zeros((*values.shape[1:3], 2), np.int64)
    counted = batch.counted[:, np.newaxis, np.newaxis]
    below, others = (values == -np.inf) & counted, ~finite & (values != -np.inf) & counted
    return np.stack([below.sum(axis=(0, 3)), others.sum(axis=(0, 3))], axis=-1)


def _shares(times: int) -> list[tuple[int, int]]:
    """The first time, and that behind the last one, of each thread."""
    return list(pairwise(np.linspace(0, times, min(thread_count(), times) + 1).astype(int).tolist()))


parts = each_scheme


@dataclass(frozen=True, kw_only=True)
class StatisticsPlan(SampledPlan):
    """Statistics of one scheme."""

    record = Statistics
    sums = StatisticsSums

    def cost(self) -> PartCost:
        """Also of the functions along paths, and of the reference means, which all schemes share."""
        cost = super().cost()
        passages, counted = bool(self.columns.passages) and self.is_bridged, self.case.counters or self.case.density
        first = LANES * _PILOT * (passages + bool(counted)) * int(self.steps.sum()) * typical_ns(self.row, self.model)
        observing = self.blocks * LANES * self._ns_to_observe()
        cost = cost._replace(seconds=cost.seconds + 1e-9 * (first + observing))
        if self.part != parts(self.case)[0]:
            return cost
        return cost._replace(seconds=cost.seconds + seconds_of_means(self.case) * thread_count())

    def _ns_to_observe(self) -> float:
        """Nanoseconds that one thread takes to evaluate the functions of a path and to add up what follows."""
        case, columns, step = self.case, self.columns, typical_ns(self.row, self.model)
        times, stored, ns = len(columns.places), columns.stored, 0.0
        for function in columns.functions:
            at = stored if function.functional else times
            ns += at * ns_to_evaluate(function, step)
            ns += at * (_PASSAGE_NS * len(function.conditions) or _ALONG_NS * bool(function.functional))
        counted = _RANK_NS * bool(case.ranked_places) + _COUNT_NS * bool(case.counted_bins)
        ns += times * (_COLUMN_NS * columns.number + _PAIR_NS * len(self.pairs[0]) + counted * len(columns.functions))
        if (given := case.time_correlations) is not None:
            lengths = stationary.lengths(case)
            ns += times * _SERIES_NS * (lengths["stationary"] + lengths["wave"] * len(given.spins or ()))
        return ns

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block, and nothing summed up or counted."""
        values, none = np.zeros((1, 1, 1, LANES)), (0, 0)
        nowhere = np.zeros((2, 1, 1, GROUPS)), np.zeros(0, int), np.zeros(0, int), np.zeros((1, 1, 0, GROUPS))
        calls = [*super().kernel_calls(), KernelCall(add_moments, (values, 0, 0, *nowhere, none))]
        if self.case.counted_bins or self.case.density:
            bins = np.zeros((1, 1)), np.ones((1, 1)), np.zeros((1, 1, 3), np.int64)
            calls.append(KernelCall(count_values, (values, 0, 0, *bins, none)))
        if self.case.ranked_places:
            edges = np.zeros((1, 1, 1)), np.zeros((1, 1, 2), np.int64)
            calls.append(KernelCall(rank_values, (values, 0, 0, *edges, none)))
        return calls

    @cached_property
    def columns(self) -> Columns:
        """Columns that are summed up."""
        return Columns.of(self.case)

    @cached_property
    def looks(self) -> list[LookTimes]:
        """How paths are looked at for each passage: with the noise on its conditions, as the first paths show it."""
        each = [self.columns.functions[f].conditions for f in self.columns.passages]
        if not self.is_bridged:
            return [LookTimes(self.columns.between, (None,) * len(conditions), self.is_noisy) for conditions in each]
        h = _SHORT * self.case.step
        step = partial(one_step, self.scheme, self.model, h)
        y = self._pilot_states if each else np.zeros((0, 0))

        in_time = bool(each) and noise_depends_on_time(self.case.model)

        def measured(condition: Callable[[np.ndarray], np.ndarray]) -> Distances | InTime | None:
            states = self.columns.states(y)
            if in_time:
                return InTime.measured(condition, states, step, h, self.columns.between)
            return Distances.measured(condition, states, step, h)

        return [LookTimes(self.columns.between, tuple(map(measured, conditions)), True) for conditions in each]

    @property
    def is_bridged(self) -> bool:
        """Whether paths between two looks are like Brownian bridges: with noise that is white."""
        return self.case.noise is None and self.is_noisy

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of columns whose products are summed up: those of covariances, then those of autocorrelations."""
        left, right = np.triu_indices(len(self.case.functions) if "covariance" in self.case.statistics else 0)
        first = len(self.columns.functions)
        remembered = np.array([f for f, _ in self.columns.since], int)
        return np.append(left, remembered), np.append(right, first + np.arange(len(remembered)))

    @property
    def _pilot_states(self) -> np.ndarray:
        """States of the first paths."""
        return self.recorded(Batch.of_first(_PILOT), self.case.stride)[0]

    @cached_property
    def _pilot(self) -> np.ndarray:
        """(T, F, paths) values of the functions, whose origins are not subtracted, on the first paths."""
        y = self._pilot_states
        values = np.empty((_PILOT, len(self.case.places), self.columns.number, LANES))
        with in_threads() as each:
            self.columns.evaluate(each, self.looks, y, values)
        values = values[:, :, : len(self.columns.functions)]
        return np.moveaxis(values, 0, -2).reshape(*values.shape[1:3], -1)

    @cached_property
    def _centred(self) -> np.ndarray:
        """(T, F, paths) the same less their origins."""
        return self._pilot - self.columns.origins

    @cached_property
    def bins(self) -> Bins:
        """Bins that hold the values on the first paths, and half of their range on each side."""
        return Bins(*cells_around(self._centred, self.case.bins, 0.5), self.case.bins)

    @cached_property
    def edges(self) -> np.ndarray:
        """(T, F, EDGES) between which values are counted for quantiles."""
        return edges_around(self._pilot)

    @cached_property
    def map_times(self) -> list[int]:
        """Times of the maps, by their numbers."""
        return [self.case.place(t) for t in self.case.density.times] if self.case.density else []

    @cached_property
    def cells(self) -> Cells | None:
        """Cells of the maps, those of two functions around the values on the first paths; None without maps."""
        density = self.case.density
        if density is None or density.of == (SPHERE,):
            return density and Cells.of_sphere(len(self.map_times), density.number)
        pair = tuple(list(self.case.functions).index(name) for name in density.of)
        return Cells.around(self._centred[self.map_times][:, list(pair)], pair, density.number)

    def lengths(self, number: int) -> dict[str, int]:
        case, columns = self.case, self.columns
        return {
            "time": len(case.places),
            "column": columns.number,
            "pair": len(self.pairs[0]),
            "function": len(columns.functions),
            "passage": len(columns.passages),
            "look": 2,
            "end": 2,
            "counted": len(columns.functions) if case.counted_bins else 0,
            "bin": 2 + case.counted_bins,
            "ranked": len(columns.functions) if case.ranked_places else 0,
            "place": case.ranked_places,
            "map": len(self.map_times),
            "one": 1,
            "cell": 2 + (case.density.count if case.density else 0),
            **stationary.lengths(case),
            "report": SUMMED,
        }

    def most_blocks(self, number: int) -> int:
        """Largest number of blocks in a batch, because of the memory of their states."""
        columns = self.columns
        return max(1, int(_BATCH_BYTES / (8 * LANES * columns.stored * len(self.initial))))

    def stderr(self, sums: Sums) -> float:
        """The standard error of the first mean at the last time."""
        return stderr_of_means(sums)

    def observe(self, batch: Batch) -> dict[str, np.ndarray]:
        """States of a batch, (blocks, stored, d * LANES), and reports."""
        y, report = self.recorded(batch, self.case.stride)
        return {"states": y, "report": report[:, 0, :SUMMED]}

    def added(self, sums: Any, contributions: dict[str, np.ndarray], batch: Batch) -> Any:
        """Sums with the states of a batch, as many blocks at once as caches hold, if memory does."""
        states = contributions["states"]
        case, times, columns = self.case, len(self.case.places), self.columns
        copied = ("values", "products", "counts", "ranks", "lost", "cells")
        added = sums._replace(**{name: getattr(sums, name).copy() for name in copied})
        few = max(1, _CACHED // (columns.stored * LANES)) * thread_count()
        few = max(1, min(few, int(_BATCH_BYTES / (8 * LANES * times * columns.number))))
        values = np.empty((min(few, len(states)), times, columns.number, LANES))
        with in_threads() as each:
            for begin in range(0, len(states), few):
                some = states[begin : begin + few]
                of_some, part = values[: len(some)], batch.part(batch.first + begin, len(some))
                of_passages = columns.evaluate(each, self.looks, some, of_some)
                if columns.passages:
                    added = added.with_batch(of_passages, part)
                self._rank(each, added, of_some, part)
                columns.centre(of_some)
                self._add(each, added, some, of_some, part)
                if case.time_correlations is not None:
                    added = stationary.added(case, added, some, of_some, part)
        ends = states[:, -1].reshape(len(states), -1, LANES)
        lost = np.logical_not(np.isfinite(ends).all(axis=1))
        return added.with_batch({"nonfinite": lost, "report": contributions["report"]}, batch)

    def _rank(self, each: Map, sums: StatisticsSums, values: np.ndarray, batch: Batch) -> None:
        """Count values of a batch, whose origins are not subtracted, for quantiles, in each thread other times."""
        if sums.ranks.size:
            edges = self.edges  # here, since the first paths are a run

            def rank(times: tuple[int, int]) -> None:
                rank_values(values, batch.first, batch.end, edges, sums.ranks, times)

            list(each(rank, _shares(values.shape[1])))

    def _add(self, each: Map, sums: StatisticsSums, y: np.ndarray, values: np.ndarray, batch: Batch) -> None:
        """Add the values of a batch with states y to sums, in each thread at other times."""
        pairs, bins = self.pairs, self.bins if sums.counts.size else None  # here, since the first paths are a run

        def add(times: tuple[int, int]) -> None:
            add_moments(values, batch.first, batch.end, sums.values, *pairs, sums.products, times)
            sums.lost[slice(*times)] += _lost(values[:, slice(*times), : sums.lost.shape[1]], batch)
            if bins is not None:
                count_values(values, batch.first, batch.end, bins.low, 1 / bins.width, sums.counts, times)

        list(each(add, _shares(values.shape[1])))
        if self.cells is not None:
            pair = np.moveaxis(values[:, self.map_times][:, :, list(self.cells.pair)], 2, 0)
            states = self.columns.states(y)[:, :, self.case.places[self.map_times]]
            maps = np.ascontiguousarray(self.cells.places(states, pair))
            count_places(maps, batch, sums.cells)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; the references are among the answers of the tasks.  Fits are made of sums."""
        entries = super().deciding(number)
        if self.case.time_correlations is not None:
            correlated = entries["time_correlations"]
            entries["time_correlations"] = {key: value for key, value in correlated.items() if key not in OF_FITS}
        return entries | self.case.model_dump(include={"reference"}) if number is None else entries

    def tasks(self, state: State) -> list[Task]:
        """References that take a computation, and the frequencies of linear waves."""
        tasks, case = [], self.case
        if {EXACT, STATIONARY}.intersection(name for name in case.reference.values() if isinstance(name, str)):
            tasks.append(
                Task(_MEANS, lambda: dict(zip(("value", "error"), REFERENCES.means(case, case.t), strict=True)))
            )
        given = case.time_correlations
        if given is not None and given.spins and given.about is not None:
            tasks.append(Task(_WAVES, lambda: stationary.waves_about(case)))
        return tasks

    def results(self, state: State) -> Statistics:
        return Statistics(**(self.whole(state) | self.estimates(state.total(), state.answers)))

    def estimates(self, sums: StatisticsSums, answers: Mapping[str, Any] = MappingProxyType({})) -> dict[str, Any]:
        """Fields of :class:`Statistics` that follow from the sums and the answers of the tasks."""
        case, functions = self.case, self.columns.functions
        names, count = tuple(case.functions), len(case.functions)
        estimated = PathMoments.of(sums.values, sums.products, self.samples)
        bins = self.bins._replace(low=self.bins.low + self.columns.origins.T) if sums.counts.size else None
        of_values = np.array([f not in self.columns.passages for f in range(count)])
        passages = self.columns.passages
        seen, left = estimated, np.zeros((count, len(case.t)))
        if passages:
            estimated, left[passages] = self._with_passages(estimated, sums, passages)
        mean = estimated.mean[:count] + self.columns.origins
        constant = Unchanged.of(case, self.columns, seen, self._not_random())
        varies = of_values[:, np.newaxis] & ~constant.exact & ~constant.alike
        stderr = self._stderr(estimated, of_values, constant)
        low, high = self._ends(mean, stderr, seen.mean, left, passages)
        of_passages = None
        if passages:
            intervals = case.bins if "histogram" in case.statistics else 0
            random = self.is_random
            first_times = sums.first_times[0], self.is_bridged or not random, random, intervals
            of_passages = replace(
                estimated.passages(passages, count, case.t, *first_times),
                between=self.columns.between,
                left=np.where(of_values, np.nan, left.T).T,
            )
        return {
            "functions": names,
            "texts": tuple(function.label for function in functions),
            "t": case.t,
            "mean": mean,
            "mean_stderr": stderr,
            "mean_low": low,
            "mean_high": high,
            "finite": (self.samples - sums.lost.sum(axis=-1).T) / self.samples,
            "band": simultaneous(estimated.mean_without[:, :count]),
            "passages": of_passages,
            "rounding": np.where(constant.exact, constant.change, np.nan) if constant.exact.any() else None,
            "kurtosis": np.where(varies, seen.kurtosis(count), np.nan),
            **self._second_moments(seen, constant),
            **self._counted(sums, bins, of_values, constant, mean),
            "density_map": self._map(sums.cells, names),
            "time": stationary.estimates(case, sums, constant.size, answers.get(_WAVES, {}))
            if case.time_correlations is not None
            else None,
            **self._differences(mean, stderr, constant, answers.get(_MEANS)),
            "acceptance": reported(np.append(sums.report, np.zeros(len(REPORT) - SUMMED)))["acceptance"],
            "panels": case.panels or PANELS,
            "nonfinite": int(sums.nonfinite),
            "ns_per_step": self.ns_per_step(sums),
        }

    def _counted(
        self, sums: StatisticsSums, bins: Bins | None, of_values: np.ndarray, constant: Unchanged, mean: np.ndarray
    ) -> dict[str, Any]:
        """Quantiles and histograms from the counts in bins, those that the case names."""
        fields: dict[str, Any] = {}
        if sums.ranks.size:
            found = quantiles(sums.ranks, sums.lost, self.edges, of_values, self.case.quantiles)
            fields["quantiles"] = constant.quantiles(found, mean)
        if bins is not None:
            fields["histogram"] = histogram(sums.counts, self.samples, bins, of_values, constant.exact)
        return fields

    def _with_passages(
        self, estimated: PathMoments, sums: StatisticsSums, passages: list[int]
    ) -> tuple[PathMoments, np.ndarray]:
        """The means of passages with what looks twice as far apart show, and what may be left (passages, T)."""
        coarse, coarse_without = mean_over_paths(np.swapaxes(sums.coarse[0], 0, 1), estimated.groups)
        mean, without = estimated.mean.copy(), estimated.mean_without.copy()
        bridged = self.is_bridged or not self.is_noisy
        found = corrected(mean[passages], coarse, without[:, passages], coarse_without, bridged)
        mean[passages], without[:, passages] = np.clip(found.value, 0.0, 1.0), found.without
        return estimated._replace(mean=mean, mean_without=without), found.left

    def _stderr(self, estimated: PathMoments, of_values: np.ndarray, constant: Unchanged) -> np.ndarray:
        """(F, T) of the means.

        Where all paths are alike though they need not be, the error of a share follows from the rule of three; that of
        other values is NaN.
        """
        count = len(of_values)
        mean, sure = estimated.mean[:count], self._not_random()
        unseen = np.where(of_values, np.nan, estimated.unseen)[:, np.newaxis]
        stderr = constant.stderr(estimated.stderr(estimated.mean, estimated.mean_without)[:count])
        return np.where(sure & np.isfinite(mean), 0.0, np.where(constant.alike, unseen, stderr))

    def _not_random(self) -> np.ndarray:
        """(F, T) where all paths have the same value by what the function is, or because nothing is random."""
        case, functions = self.case, self.columns.functions
        random = isinstance(self.initial, RandomState)
        always = np.array(
            [[function.is_constant or function.is_of_time or not self.is_random] for function in functions]
        )
        at_start = np.array([[function.functional == "start"] for function in functions]) | (case.t == 0)
        return always | (at_start & (not random))

    def _ends(
        self, mean: np.ndarray, stderr: np.ndarray, seen: np.ndarray, left: np.ndarray, passages: list[int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The ends of the 95 % intervals of means (F, T): Student's, and of shares those of Clopper and Pearson.

        The latter are about what was `seen`, moved to the mean, and wider by what may be `left`.
        """
        half = student_of_paths(self.samples, LEAST_GROUPS) * stderr
        with np.errstate(invalid="ignore"):
            low, high = mean - half, mean + half
            for f in passages:
                away = mean[f] - seen[f]
                ends = clopper_pearson(seen[f] * self.samples, self.samples)
                down, up = np.clip(ends[0] + away - left[f], 0.0, 1.0), np.clip(ends[1] + away + left[f], 0.0, 1.0)
                low[f], high[f] = (np.where(stderr[f] == 0, mean[f], end) for end in (down, up))  # at t = 0 it is exact
        return low, high

    def _second_moments(self, estimated: PathMoments, constant: Unchanged) -> dict[str, Any]:
        """Variances (F, T), covariances (F, F, T) and autocorrelations (F, T), those that the case names.

        Standard errors are NaN where values are alike on all paths, and autocorrelations from where they are constant.
        """
        case, count = self.case, len(self.case.functions)
        fields: dict[str, Any] = {}
        alike, least = constant.alike, constant.of_products()
        if "variance" in case.statistics:
            value, error = estimated.variances(count)
            fields["variance"] = np.where(constant.exact, np.maximum(value, 0.0), value)
            error = np.maximum(error, least[np.arange(count), np.arange(count)])
            fields["variance_stderr"] = np.where(alike, np.nan, error)
        left, right = self.pairs
        own = len(left) - len(self.columns.since)
        if "covariance" in case.statistics:
            fields["others"] = tuple(case.functions)
            fields["covariance"], error = estimated.covariances(left[:own], right[:own], count)
            fields["covariance_stderr"] = np.where(alike | alike[:, np.newaxis], np.nan, np.maximum(error, least))
        if self.columns.since:
            value, error = np.full((2, count, len(case.t)), np.nan)
            since = np.full(count, np.nan)
            chosen, begin = np.array(self.columns.since).T
            known = np.where(constant.exact[chosen, begin], np.nan, 1.0)[:, np.newaxis]
            value[chosen], error[chosen] = known * estimated.autocorrelations(left[own:], right[own:], begin)
            since[chosen] = case.t[begin]
            fields |= {"autocorrelation": value, "autocorrelation_stderr": error, "since": since}
        return fields

    def _differences(
        self, mean: np.ndarray, stderr: np.ndarray, constant: Unchanged, known: Mapping[str, Any] | None
    ) -> dict[str, Any]:
        """Reference means, the distances of the means (F, T) from them, and the standard errors of these."""
        if not self.case.reference:
            return {}
        reference, error = (known["value"], known["error"]) if known else REFERENCES.means(self.case, self.case.t)
        difference = mean - reference
        return {
            "reference": reference,
            "reference_formulas": reference_formulas(self.case),
            "difference": difference,
            "difference_stderr": with_rounding(np.hypot(stderr, error), difference, constant.size, constant.steps),
        }

    def _map(self, counts: np.ndarray, names: tuple[str, ...]) -> DensityMap | None:
        """Maps; None if the case has none."""
        if self.cells is None:
            return None
        pair = list(self.cells.pair)
        origins = self.columns.origins[pair, 0] if pair else np.zeros(2)
        found = self.cells.densities(counts, self.case.t[self.map_times], tuple(names[f] for f in pair), origins)
        return DensityMap(**found, law=self.cells.gibbs(self.model, self.initial, self.case.temperature))


plan = StatisticsPlan.of
