"""Path sets of an answer, and the estimates from their sums: those of each level, and of all together.

The value of the chosen levels has an interval, with the bound of its bias.  Two checks stand beside it: one step finer,
and the difference from a reference scheme on the same noise.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import RandomStream, points_of
from spi.ensemble.loop import grid
from spi.exact.work import work as working
from spi.kinds.blocks import DIFFERENCE, POWERS, VALUE, Sample, two_steps, values_at_end
from spi.kinds.plans import KernelCall, State
from spi.schemes import typical_ns, weak_exponents
from spi.schemes.splitting import has_antithetic_path
from spi.statistics.accumulators import Array, Sums, moments
from spi.statistics.estimators import weights
from spi.statistics.tallies import Batch, Chunk
from spi.storage.records import Part

from . import planner
from .decisions import Decisions, Outcome
from .keys import ROUNDING
from .results import Compared
from .sets import LEVELS, Role, SetOf, all_sets
from .solving import SolvingPlan

OF_VALUES = -1  #: the quantity of the values themselves, the last one or the only one of a path set

#: The costs of a path besides its steps, its beginning and phi at its end, and of the sums over a quantity of a
#: function; measured, of typical speed.
PATH_NS, SUM_NS = 25.0, 15.0

_ORDERS = 4  # powers of h that extrapolation removes, and the next
_CHECK_WIDTH = 2.0  # standard errors by which the check may be off


class Totals(Sums):
    """Sums over some samples of one path set, for F functions."""

    sums: Array = moments("quantity function", POWERS)


def _first_sampled(ways: Sequence[planner.Spread], samples: Sequence[int]) -> tuple[planner.Spread, int]:
    """The first of some spreads that has samples, and their number; else the last one."""
    pairs = list(zip(ways, samples, strict=True))
    return next((pair for pair in pairs if not np.isnan(pair[0].mean).all()), pairs[-1])


@dataclass(frozen=True, kw_only=True)
class EstimatingPlan(SolvingPlan):
    """Path sets of each scheme, the cost of their samples, and the estimates from their sums."""

    sums = Totals

    # -----------------------------------------------------------------------------------------------------------------
    # The paths: the path sets of each scheme, and the cost of their samples.
    # -----------------------------------------------------------------------------------------------------------------

    @cached_property
    def of_schemes(self) -> tuple[Self, ...]:
        """Plan as that of each scheme."""
        return tuple(replace(self, part=Part(name)) for name in self.case.schemes)

    @cached_property
    def reference(self) -> Self | None:
        """Plan as that of the scheme that checks the bias."""
        name = self.case.reference_scheme
        return replace(self, part=Part(name)) if name else None

    def exponents(self, scheme: int) -> tuple[float, ...]:
        """Powers of h in the weak error of a scheme; () where theory states none."""
        return weak_exponents(self.of_schemes[scheme].row, self.model, _ORDERS) or ()

    @cached_property
    def sets(self) -> tuple[Sample, ...]:
        """Paths of a sample of all path sets, in the order of their numbers."""
        return tuple(map(self._sample, all_sets(len(self.case.schemes))))

    def _sample(self, path_set: SetOf) -> Sample:
        """Paths of a sample of a path set.

        VALUE is that of one path, of a level alone the only quantity.  Against a reference scheme DIFFERENCE is that at
        the fine step, VALUE that at the fine step less that at the coarse one.
        """
        case, records = self.case, [plan.row.record for plan in self.schemes_of(path_set)]
        level, paths, weights = path_set.level, {"doublings": (0,)}, [[1.0]]
        if path_set.role == Role.REFERENCE:
            paths, weights = two_steps(False)[0], [[0.0, 1.0, 0.0, -1.0], [-1.0, 1.0, 1.0, -1.0]]
        elif path_set.role == Role.DIFFERENCES:
            paths, difference = two_steps(has_antithetic_path(records[0]))
            weights = [difference, [1.0 * (i == len(difference) // 2) for i in range(len(difference))]]
        h = case.final_time / 2.0**level
        terms = fourier_terms(case.model, records, h, areas=case.areas)
        times = grid(h, 2**level, by_reference=(0,) * len(paths["doublings"]), area_terms=terms, **paths)
        return Sample.of(times, RandomStream(np.uint64(case.seed), np.uint64(path_set.stream)), weights)

    def schemes_of(self, path_set: SetOf) -> tuple[Self, ...]:
        """Plans of the schemes that a path set has paths of."""
        own = (self.of_schemes[path_set.scheme],)
        return (*own, self.reference) if self.reference and path_set.role == Role.REFERENCE else own

    def noise(self, number: int) -> Any:
        """Random numbers of a path set, or its points."""
        sample, path_set = self.sets[number], SetOf.of(number)
        if path_set.role != Role.POINTS:
            return sample.stream
        scheme = self.of_schemes[path_set.scheme].scheme
        return points_of(self.case.seed, int(sample.stream.stream), scheme, self.model, sample.grid)

    def cost_of(self, path_set: SetOf) -> float:
        """Seconds of typical speed of a sample of a path set."""
        sample = self.sets[path_set.number]
        quantities, paths = sample.weights.shape
        besides = PATH_NS * paths + SUM_NS * quantities * len(self.phis)
        rates = (typical_ns(plan.row, self.case.model) for plan in self.schemes_of(path_set))
        return sum(1e-9 * (rate * sample.steps + besides) for rate in rates)

    @cached_property
    def costs(self) -> np.ndarray:
        """(schemes, roles, levels) :meth:`cost_of` all path sets."""
        schemes = len(self.case.schemes)
        return np.reshape([self.cost_of(path_set) for path_set in all_sets(schemes)], (schemes, len(Role), LEVELS))

    def seconds_of(self, samples: np.ndarray) -> float:
        """Seconds of typical speed of samples (schemes, roles, levels)."""
        return float(self.costs.ravel() @ samples.ravel())

    def lengths(self, number: int) -> dict[str, int]:
        return {"quantity": len(self.sets[number].weights), "function": len(self.ranges)}

    def deciding(self, number: int | None) -> dict[str, Any]:
        """For a path set the model, the functions and the scheme; for the decisions the whole case."""
        rows = self.case.model_dump(include={"compositions"}).get("compositions", {})
        keys = super().deciding(number) | {"compositions": [[name, rows[name]] for name in sorted(rows)]}
        if number is None:
            return keys | {"schemes": self.case.schemes, "samples": self.case.samples}
        for key in ("accuracy", "seconds", "sampling", "extrapolate", "steps"):
            keys.pop(key, None)
        path_set = SetOf.of(number)
        if path_set.role != Role.REFERENCE:
            keys.pop("reference_scheme", None)
        return keys | {"part": None, "scheme": self.case.schemes[path_set.scheme]}

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block of the scheme; the others are rarely needed."""
        first = self.sets[SetOf(0, Role.DIFFERENCES, 1).number]
        return [] if self.solvable else self.calls_of_a_step(first.grid, first.stream)

    def advance(self, chunks: Sequence[Chunk], started: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, once the kernel of its scheme is there, see :class:`Plan`."""
        number = chunks[0].path_set
        for plan in self.schemes_of(SetOf.of(number)):
            for call in plan.calls_of_a_step(self.sets[number].grid, self.noise(number)):
                if not is_loaded(call.kernel, call.arguments):
                    with working(f"compiling {plan.part.scheme}", 0.0):
                        call.kernel(*call.arguments)
        yield from super().advance(chunks, started)

    def values(self, batch: Batch) -> np.ndarray:
        """Values of the test functions at the end of a batch."""
        times, noise = self.sets[batch.path_set].grid, self.noise(batch.path_set)
        plans = self.schemes_of(SetOf.of(batch.path_set))
        return np.concatenate([values_at_end(plan, times, noise, batch)[0] for plan in plans], axis=1)

    # -----------------------------------------------------------------------------------------------------------------
    # Estimates from the sums over path sets.
    # -----------------------------------------------------------------------------------------------------------------

    def totals(self, state: State, scheme: int, role: Role) -> list[Totals]:
        """(levels,) the sums over the path sets of a scheme in a role."""
        return [state.so_far(SetOf(scheme, role, level).number) for level in range(LEVELS)]

    def spread(self, totals: Totals, quantity: int = DIFFERENCE, along: bool = False) -> planner.Spread:
        """Moments (F,) of a quantity of a path set, with the rare values of hidden summands."""
        return self._spread_of_all(totals, quantity, along).with_hidden(self.owners)

    def _spread_of_all(self, totals: Totals, quantity: int = DIFFERENCE, along: bool = False) -> planner.Spread:
        """Moments (F + summands,) of a quantity of a path set.

        Differences are no larger than the range of values, or, where that is infinite, are taken to be no larger than
        the range of the values so far.
        """
        sums, span, paths = totals.sums[:, quantity], self.spans, totals.paths
        with np.errstate(all="ignore"):  # there may be no paths yet
            mean = sums[0].sum(axis=-1) / paths
        if quantity == DIFFERENCE:
            seen = planner.Spread.of(totals.sums[:, OF_VALUES], paths, span).range_seen(paths)
            with np.errstate(all="ignore"):
                span = np.minimum(span, seen) + np.where(span > 0.0, np.abs(mean), 0.0)
            return planner.Spread.of(sums, paths, span, along, bounded=np.isfinite(self.spans))
        bounds = self.ranges if self.is_random else np.repeat(mean[:, np.newaxis], 2, axis=1)
        steep = self.steep & ~np.bool_(along)  # along points variances of smooth functions fall faster
        return planner.Spread.of(sums, paths, span, along, bounds, steep, np.isfinite(self.spans))

    def measured(self, state: State, scheme: int) -> planner.Measured:
        """Estimates of the levels of a scheme; values along points come first, then those of levels alone."""
        roles = Role.POINTS, Role.VALUES, Role.DIFFERENCES
        along, alone, coupled = (self.totals(state, scheme, role) for role in roles)
        ways = zip(
            [self.spread(each, OF_VALUES, True) for each in along],
            [self.spread(each, OF_VALUES) for each in alone],
            [self.spread(each, OF_VALUES) for each in coupled],
            strict=True,
        )
        there = zip(*([each.paths for each in totals] for totals in (along, alone, coupled)), strict=True)
        values, samples = zip(*map(_first_sampled, ways, there), strict=True)
        return planner.Measured.of(
            planner.Spread.together([self.spread(each) for each in coupled]),
            np.array([each.paths for each in coupled], float),
            planner.Spread.together(values),
            self.costs[scheme, [Role.DIFFERENCES, Role.VALUES]].ravel(),
            [each.paths for each in along],
            samples,
        )

    # -----------------------------------------------------------------------------------------------------------------
    # The value, its interval, and the checks.
    # -----------------------------------------------------------------------------------------------------------------

    @np.errstate(all="ignore")  # paths may diverge
    def outcome(self, state: State) -> Outcome:
        """Value with its interval, and the check."""
        extra: Decisions = state.extra
        measured, exponents = self.measured(state, extra.scheme), self.exponents(extra.scheme)
        if not math.isnan(extra.order):
            exponents = (extra.order,)
        w, finest = weights(exponents[: extra.levels]), extra.finest
        share = planner.shares(w, extra.base, finest, LEVELS)
        used, coupled = np.flatnonzero(share), self.totals(state, extra.scheme, Role.DIFFERENCES)
        base, along = state.so_far(extra.base_set.number), bool(extra.follows_points)
        of_all = [planner.MeanTerm(1.0, self._spread_of_all(base, OF_VALUES, along), base.paths, along)]
        for level in used:
            own = coupled[level]
            of_all.append(planner.MeanTerm(float(share[level]), self._spread_of_all(own), own.paths))
        terms = [term._replace(spread=term.spread.with_hidden(self.owners)) for term in of_all]
        value = terms[0].spread.mean + (share[used, np.newaxis] * measured.mean[used]).sum(axis=0)
        (stderr, sampling, _), q = planner.sampling_error(terms), planner.order_of(exponents, extra.levels)
        constant = np.equal(*self.ranges[: len(value)].T)  # by the formula
        rounding = np.where(constant, 0.0, ROUNDING * np.abs(value))
        bias = np.maximum(planner.bound(measured, exponents, extra.levels, finest, extra.base), rounding)
        few = self._few(of_all)
        unresolved = few | np.any([term.spread.unknown for term in terms], axis=0)
        half = np.where(unresolved, np.inf, bias + sampling)
        check, check_stderr = planner.changed(measured, w, finest + 1)
        passed = bool((np.abs(check) <= (1.0 + 2.0**-q) * bias + _CHECK_WIDTH * check_stderr).all())
        return Outcome(value, half, bias, stderr, q, check, check_stderr, passed, share, unresolved, few)

    def _few(self, terms: Sequence[planner.MeanTerm]) -> np.ndarray:
        """(F,) whether a few samples have the variance of an estimate whose function has no known range, or a summand.

        With fewer than planner.ENOUGH the largest values of heavy tails have not been seen, and no interval holds.
        """
        seen = [term.spread._replace(variance=term.spread.variance - term.spread.unseen) for term in terms]
        _, _, degrees = planner.sampling_error(
            [term._replace(spread=spread) for term, spread in zip(terms, seen, strict=True)]
        )
        some = np.any(
            [np.asarray(term.spread.few) for term in terms], axis=0
        )  # else it is the variance of rounding errors
        few = some & np.isinf(self.spans) & (degrees < 2.0 * planner.ENOUGH)
        own = few[: len(few) - len(self.owners)]
        own[[f for f, _ in self.rests]] = False  # of these the rest is judged
        return own | (np.bincount(self.owners, few[len(own) :], len(own)) > 0.0)

    @np.errstate(all="ignore")
    def compared(self, state: State) -> Compared:
        """Difference from the reference scheme at a step h, and its limit as h tends to 0.

        With D(h) = a h^r + ..., r the lower order of the two, that is D(h) - (D(2h) - D(h)) / (2^r - 1).
        """
        extra, scheme = state.extra, self.reference
        totals = state.so_far(SetOf(extra.scheme, Role.REFERENCE, extra.compared_level).number)
        of_reference = weak_exponents(scheme.row, self.model, 1) if scheme else None
        r = min((self.exponents(extra.scheme) or (1.0,))[0], (of_reference or (1.0,))[0])
        of_difference, of_change = self.spread(totals), self.spread(totals, VALUE)
        left = of_difference.mean + of_change.mean / (2.0**r - 1.0)
        spread = np.sqrt(of_difference.variance), np.sqrt(of_change.variance) / (2.0**r - 1.0)
        stderr = (spread[0] + spread[1]) / math.sqrt(totals.paths)
        allowed = 0.5 * np.abs(of_change.mean) / (2.0**r - 1.0) + self.outcome(state).bias + _CHECK_WIDTH * stderr
        return Compared(
            reference=self.case.reference_scheme or "",
            step=self.case.final_time / 2.0**extra.compared_level,
            difference=of_difference.mean,
            left=left,
            stderr=stderr,
            agrees=bool((np.abs(left) <= allowed).all()),
        )
